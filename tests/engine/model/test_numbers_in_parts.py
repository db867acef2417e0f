"""Bodies of each of several parts of the ground, between which nothing is asked for: as many as asked for but for rounding."""

import esh
import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.model.model import Model
from esh.engine.model.numbers_in_parts import WORTH_AN_EDIT, _changes, move_between_parts
from esh.engine.quality.coverage import coverage_error
from esh.engine.space.parts_of_ground import parts_of_ground
from esh.engine.space.space import Space

DOMAIN = esh.Domain((30.0, 22.5))
COLUMN, ROW = np.meshgrid((np.arange(240) + 0.5) / 240, (np.arange(180) + 0.5) / 180)
BELOW = (0.15 * np.sin(6.0 * COLUMN) < ROW - 0.5).astype(np.int64)
RIVER = np.abs(ROW - 0.5 - 0.15 * np.sin(6.0 * COLUMN)) < 0.04
ISLANDS = sum(
    ((COLUMN - x) * 4 / 3) ** 2 + (ROW - y) ** 2 < r**2
    for x, y, r in [(0.2, 0.3, 0.2), (0.6, 0.25, 0.15), (0.8, 0.7, 0.22), (0.4, 0.75, 0.18), (0.12, 0.85, 0.1)]
).astype(np.float32)
DEVICES = pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])


def problem_of(density, sizes, domain=DOMAIN, **more):
    return esh.Problem(domain, [esh.BodyClass("c", sizes, density)], **more)


def parts_of(density, domain=DOMAIN):
    launcher = Launcher(resolve_device("cpu"))
    try:
        return parts_of_ground(launcher, np.asarray(density, np.float32), Space.of(domain), 1000)
    finally:
        launcher.close()


def labels_at(label, placed):
    column = (placed.position[:, 0] / DOMAIN.size[0] * 240).astype(int).clip(0, 239)
    row = ((1.0 - placed.position[:, 1] / DOMAIN.size[1]) * 180).astype(int).clip(0, 179)
    return label[row, column]


def numbers(density, label, placed):
    """Of every size and part how many there are, and how many are asked for."""
    size = placed.size_index
    found = np.zeros((size.max() + 1, label.max() + 1), int)
    np.add.at(found, (size, labels_at(label, placed)), 1)
    share = np.bincount(label.ravel(), np.asarray(density, float).ravel())
    return found, np.outer(found.sum(axis=1), share / share.sum())


@DEVICES
@pytest.mark.parametrize("boundary", ["open", "mirror", "periodic"])
@pytest.mark.parametrize("seed", range(3))
def test_both_banks_of_a_river_have_their_numbers(seed, boundary, device):
    density = np.where(RIVER, 0.0, 1.0 + COLUMN)
    domain = esh.Domain(DOMAIN.size, boundary)
    label = BELOW
    if boundary == "periodic":
        # Above and below meet at the edges: another river is to part them there.
        density[:4], density[-4:] = 0.0, 0.0
    sizes = [esh.Size("a", 1e-4, 1400), esh.Size("b", 2e-4, 333)]
    with esh.Solver(problem_of(density, sizes, domain, seed=seed), device=device) as solver:
        found, asked = numbers(density, label, solver.placement())
        solver.run(20)
        later, _ = numbers(density, label, solver.placement())
    assert (np.abs(found - asked) < 1.0).all()
    assert (np.abs(found - asked).sum(axis=0) < 1.5).all()
    np.testing.assert_array_equal(later, found)


def test_islands_are_even_at_large():
    """Without whole numbers errors are .0031, .0018 and .0010 on average."""
    errors = []
    for seed in range(4):
        placed = esh.solve(problem_of(ISLANDS, [esh.Size("a", 1e-4, 2000)], seed=seed), device="cpu", max_steps=100)
        errors.append([coverage_error(placed.position, placed.area, ISLANDS, DOMAIN, k) for k in (1.0, 2.0, 4.0)])
    assert (np.mean(errors, axis=0) < [0.0025, 0.0014, 0.0008]).all()


@DEVICES
@pytest.mark.parametrize("follows", [True, False])
def test_a_river_that_is_painted_parts_the_ground_in_whole_numbers(follows, device):
    """Who was left on either bank by chance was four too few there, and remained so."""
    before, after = np.ones((180, 240), np.float32), np.where(RIVER, 0.0, 1.0).astype(np.float32)
    errors = []
    for seed in range(4):
        count = round(3000 * after.mean()) if follows else 3000
        with esh.Solver(problem_of(before, [esh.Size("a", 1e-4, 3000)], seed=seed), device=device) as solver:
            solver.run(100)
            there = solver.placement()
            edit = solver.edit(problem_of(after, [esh.Size("a", 1e-4, count)], seed=seed))
            edited = solver.placement()
            solver.run(100)
            placed = solver.placement()
        found, asked = numbers(after, BELOW, edited)
        # Of two parts each is off by half of what an edit does nothing about, at most.
        assert np.abs(found - asked).max() <= 0.5 * WORTH_AN_EDIT
        assert set(edited.id) == set(there.id) - set(edit.removed) | set(edit.added)
        errors.append(coverage_error(placed.position, placed.area, after, DOMAIN, 2.0))
    # That of one without a river is .0004.
    assert np.mean(errors) < 0.0006


def test_who_is_fixed_counts_where_he_is():
    fixed = esh.FixedBodies(np.random.default_rng(1).uniform([1.0, 1.0], [29.0, 5.0], (40, 2)))
    density = np.where(RIVER, 0.0, 1.0)
    problem = problem_of(density, [esh.Size("a", 1e-4, 500)], fixed=fixed, include_fixed=True)
    with esh.Solver(problem, device="cpu") as solver:
        placed = solver.placement()
    found, asked = numbers(density, BELOW, placed)
    assert np.abs(found - asked).max() < 1.0
    np.testing.assert_array_equal(placed.position[placed.fixed], fixed.position)


def test_a_ground_of_one_part_has_no_parts():
    assert parts_of(np.ones((8, 8))) is None
    assert parts_of(1.0 - RIVER * (COLUMN > 0.2)) is None
    ends = np.ones((20, 20))
    ends[8:12] = 0.0
    assert parts_of(ends).count == 2
    # Where edges are joined what is above and what is below are one.
    assert parts_of(ends, esh.Domain(DOMAIN.size, "periodic")) is None


def test_crumbs_and_what_is_nearly_empty_belong_to_the_nearest_part():
    density = np.zeros((30, 60))
    density[:, :20], density[:, 40:], density[15, 25], density[10:20, 30:38] = 1.0, 1.0, 1.0, 0.001
    ground = parts_of(density)
    assert ground.count == 2
    assert (ground.part[:, :29] == ground.part[0, 0]).all()
    assert (ground.part[:, 31:] == ground.part[0, -1]).all()
    assert ground.share.sum() == pytest.approx(1.0)


def test_a_fine_image_is_looked_at_coarsely():
    density = np.ones((1200, 1500), np.float32)
    density[:, 700:760] = 0.0
    ground = parts_of(density)
    assert max(ground.part.shape) <= 512
    np.testing.assert_allclose(ground.share, [700 / 1440, 740 / 1440], rtol=1e-6)


@pytest.mark.parametrize(
    ("there", "asked", "expected"),
    [
        ([10, 10], [10.4, 9.6], [0, 0]),
        ([12, 8], [10.6, 9.4], [-1, 1]),
        ([4, 6, 5, 5], [5.0, 5.0, 5.0, 5.0], [1, -1, 0, 0]),
        ([0, 0], [0.9, -0.9], [0, 0]),
    ],
)
def test_as_few_as_possible_change_parts(there, asked, expected):
    assert _changes(np.array(there), np.array(asked)).tolist() == expected


def test_an_edit_does_nothing_about_what_is_hardly_off():
    there, asked = np.array([11, 9]), np.array([10.2, 9.8])
    assert _changes(there, asked, WORTH_AN_EDIT).tolist() == [0, 0]
    assert _changes(there + [1, -1], asked, WORTH_AN_EDIT).tolist() == [-2, 2]


def test_newcomers_keep_off_others_and_pinned_bodies_stay():
    """All bodies begin on one bank; those that are new go first."""
    problem = problem_of(np.where(RIVER, 0.0, 1.0), [esh.Size("a", 1e-4, 300)], seed=2)
    position = np.random.default_rng(0).uniform([0.5, 0.5], [29.5, 5.0], (300, 2))
    flags = np.zeros(300, np.int32)
    flags[:50] = 1
    launcher = Launcher(resolve_device("cpu"))
    try:
        moved = move_between_parts(launcher, Model(problem, flags), position, 1, np.arange(300) >= 180)
    finally:
        launcher.close()
    above = labels_at(1 - BELOW, esh_positions(position)) == 1
    assert 120 < len(moved) < 180
    np.testing.assert_array_equal(np.flatnonzero(above), np.sort(moved))
    assert set(range(180, 300)) <= set(moved.tolist())
    assert not set(moved.tolist()) & set(range(50))
    away = np.linalg.norm(position[moved][:, None] - position[moved], axis=2)
    np.fill_diagonal(away, np.inf)
    assert away.min() > 0.3


def esh_positions(position):
    """Something with positions."""
    return type("Placed", (), {"position": position})
