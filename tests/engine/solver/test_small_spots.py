"""Bodies on a small part of their domain: as even there, and as quickly, as where the domain is no larger than that."""

import math

import esh
import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.edits.spread import Spreading
from esh.engine.field.field import Field
from esh.engine.field.field_targets import FieldTarget
from esh.engine.model.memory import required_memory
from esh.engine.problem.domain import Domain
from esh.engine.quality.spacing import smallest_spacing
from esh.engine.solver.solver import Solver
from esh.engine.space.part import Part, part_of
from esh.engine.space.space import Space
from scipy.spatial import cKDTree

SIDE, MIDDLE = 10.0, (3.0, 6.0)


def disc(radius, pixels=1024, less=None):
    """A disc about the middle; ``less`` says how much of it another one, half as large, beside its middle has."""
    x = (np.arange(pixels) + 0.5) * SIDE / pixels
    image = (np.hypot(x[None] - MIDDLE[0], SIDE - x[:, None] - MIDDLE[1]) < radius).astype(np.float32)
    if less is not None:
        image[np.hypot(x[None] - MIDDLE[0] - 0.4 * radius, SIDE - x[:, None] - MIDDLE[1]) < 0.3 * radius] *= less
    return image


def problem_of(image, count, boundary="open", seed=1, **more):
    size = esh.Size("s", area=1e-8, count=count)
    return esh.Problem(
        esh.Domain((SIDE, SIDE), boundary), [esh.BodyClass("a", [size], density=image)], seed=seed, **more
    )


def distances(position, area):
    """Of the nearest neighbors, over those of a hexagonal lattice."""
    return cKDTree(position).query(position, k=2)[0][:, 1] / math.sqrt(2.0 / math.sqrt(3.0) * area / len(position))


@pytest.mark.parametrize("boundary", ["open", "mirror", "periodic"])
@pytest.mark.parametrize(("radius", "count"), [(0.5, 3000), (0.06, 500)])
def test_a_spot_is_as_even_as_a_domain_of_its_own(boundary, radius, count):
    placement = esh.solve(problem_of(disc(radius), count, boundary), device="cpu")
    away = np.hypot(*(placement.position - MIDDLE).T)
    assert away.max() < radius + 1.5 * SIDE / 1024
    nearest = distances(placement.position, math.pi * radius**2)
    assert nearest.min() > 0.8 and nearest.mean() > 0.9
    # As many in the inner half as it is large.
    assert np.mean(away < radius * math.sqrt(0.5)) == pytest.approx(0.5, abs=0.03)


def test_a_natural_border_around_a_spot_leaves_no_close_pairs():
    smallest = []
    for seed in range(4):
        placement = esh.solve(problem_of(disc(0.5), 1000, "natural", seed), device="cpu")
        smallest.append(distances(placement.position, math.pi * 0.25).min())
    assert min(smallest) > 0.5


def test_classes_in_a_spot_follow_their_own_parts_of_it():
    whole = disc(0.3)
    left = whole * (np.arange(1024) < 1024 * MIDDLE[0] / SIDE)
    classes = [
        esh.BodyClass("all", [esh.Size("s", area=1e-8, count=400)], density=whole),
        esh.BodyClass("left", [esh.Size("s", area=1e-8, count=100)], density=left),
    ]
    placement = esh.solve(esh.Problem(esh.Domain((SIDE, SIDE)), classes, seed=1), device="cpu")
    own = placement.position[placement.class_index == 1]
    assert own[:, 0].max() < MIDDLE[0] + SIDE / 1024
    assert distances(own, 0.5 * math.pi * 0.09).min() > 0.6


def test_lines_and_outlines_in_a_spot_keep_apart():
    sticks = esh.Size("sticks", footprint=esh.Footprint.rectangle(0.05, 0.01), count=150)
    dots = esh.Size("dots", footprint=esh.Footprint.disc(0.01), count=150)
    lines = esh.Size("lines", area=5e-4, count=50, line=esh.Line(0.06))
    classes = [esh.BodyClass(s.name, [s], density=disc(0.5)) for s in (sticks, dots, lines)]
    placement = esh.solve(esh.Problem(esh.Domain((SIDE, SIDE)), classes, avoid_overlap=True, seed=1), device="cpu")
    assert placement.report.overlaps == 0
    assert np.hypot(*(placement.position - MIDDLE).T).max() < 0.52


@pytest.mark.parametrize("radius", [0.5, 0.12])
def test_an_edit_of_a_spot_moves_only_what_it_changes(radius):
    unmoved = []
    # Few are far enough from the change: one count says little.
    for count in (1800, 2000, 2200):
        with Solver(problem_of(disc(radius), count), device="cpu") as solver:
            solver.step(100)
            before = solver.placement().position
            changed = disc(radius, less=0.3)
            solver.edit(problem_of(changed, round(count * float(changed.sum() / disc(radius).sum()))))
            solver.step(5)
            position = solver.placement().position
        spacing = math.sqrt(math.pi * radius**2 / count)
        nearest = cKDTree(position).query(position, k=2)[0][:, 1]
        assert nearest.min() > 0.7 * spacing
        from_change = np.hypot(position[:, 0] - MIDDLE[0] - 0.4 * radius, position[:, 1] - MIDDLE[1])
        far = from_change > 0.3 * radius + 2.0 * spacing
        unmoved.append(np.mean(cKDTree(before).query(position[far])[0] < 0.1 * spacing))
    assert np.mean(unmoved) > 0.8


def test_the_field_of_a_part_is_that_of_all():
    """On a spot that a mesh over all of the space shows finely enough, too."""
    rng = np.random.default_rng(2)
    size, n = (100.0, 80.0), 400
    image = np.zeros((160, 200), np.float32)
    image[40:80, 120:170] = np.linspace(1.0, 2.0, 50)
    low, high = np.array([60.0, 40.0]), np.array([85.0, 60.0])
    position = (low + (high - low) * rng.random((n, 2))).astype(np.float32)
    part = part_of([image]).with_margin(5.0, size)
    assert 0.05 < part.share < 0.25
    launcher = Launcher(resolve_device("cpu"))
    found = []
    for own in (None, part):
        field = Field(
            launcher,
            space=Space(size),
            interaction=np.ones((1, 1)),
            targets=[FieldTarget(image, float(n))],
            spacing=1.1,
            charge=np.ones(n),
            charge_group=np.zeros(n, np.int32),
            part=own,
        )
        force = launcher.zeros(n, wp.vec2)
        field.evaluate(launcher.array(position, wp.vec2), force)
        found.append(force.numpy())
    launcher.close()
    away = np.linalg.norm(found[1] - found[0], axis=1)
    assert np.median(away) < 3e-3 * np.linalg.norm(found[0], axis=1).mean()
    assert away.max() < 0.02 * np.linalg.norm(found[0], axis=1).max()


def test_a_part_is_the_rectangle_around_all_densities():
    one, other = np.zeros((10, 20), np.float32), np.zeros((5, 5), np.float32)
    one[2, 3:5], other[1, 1] = 1.0, 2.0
    assert part_of([one, other]) == Part((0.15, 0.6), (0.4, 0.8))
    assert part_of([one, np.ones((1, 1), np.float32)]) is None
    assert part_of([np.zeros((3, 3), np.float32)]) is None
    # A frame along the edges is no small part.
    frame = np.ones((9, 9), np.float32)
    frame[1:-1, 1:-1] = 0.0
    assert part_of([frame]) is None
    wider = Part((0.15, 0.6), (0.4, 0.8)).with_margin(1.0, (10.0, 20.0))
    assert (*wider.low, *wider.high) == pytest.approx((0.05, 0.55, 0.5, 0.85))
    assert Part().touches_border and not Part((0.1, 0.1), (0.9, 0.9)).touches_border


def test_spacings_in_a_crowd_are_those_of_a_tree():
    rng = np.random.default_rng(1)
    lattice = np.stack(np.meshgrid(np.arange(150.0), np.arange(150.0)), axis=-1).reshape(-1, 2)
    position = MIDDLE + (lattice + 0.4 * rng.random(lattice.shape)) / 1500.0
    number = np.full(len(position), len(position) / 0.01)
    launcher = Launcher(resolve_device("cpu"))
    found = smallest_spacing(position, number, Domain((SIDE, SIDE)), launcher)
    launcher.close()
    assert found == pytest.approx(distances(position, 0.01).min(), rel=0.01)


def test_a_spot_takes_no_more_memory_than_a_ground_of_its_own():
    spot = required_memory(problem_of(disc(0.01, pixels=4096), 200_000))
    own = required_memory(esh.Problem(esh.Domain((0.02, 0.02)), [esh.BodyClass("a", [esh.Size("s", 1e-10, 200_000)])]))
    # But for the image of 4096 x 4096 pixels.
    assert spot < 2.0 * own + 40 * 4096**2


def test_points_are_spread_where_nothing_is_left_of_a_density():
    launcher = Launcher(resolve_device("cpu"))
    faint = np.full((8, 8), 1e-44, np.float32)
    for nothing in (np.zeros((8, 8), np.float32), faint):
        points = Spreading(launcher, Domain((4.0, 3.0)), [nothing], [5], 1).points()[0].numpy()
        assert points.shape == (5, 2) and np.isfinite(points).all()
        assert (points >= 0.0).all() and (points <= [4.0, 3.0]).all()
    launcher.close()


def test_spots_that_are_far_apart_are_even_too():
    x = (np.arange(1024) + 0.5) * SIDE / 1024
    image = np.zeros((1024, 1024), np.float32)
    for at in ((1.0, 1.0), (9.0, 9.0), (1.0, 9.0)):
        image[np.hypot(x[None] - at[0], x[:, None] - at[1]) < 0.25] = 1.0
    placement = esh.solve(problem_of(image, 6000), device="cpu")
    nearest = distances(placement.position, 3.0 * math.pi * 0.25**2)
    assert nearest.min() > 0.75 and nearest.mean() > 0.9
