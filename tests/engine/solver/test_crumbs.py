"""Parts of a surface for a few bodies each: they have whole numbers, and what stands on them leaves all others in peace."""

import esh
import numpy as np
import pytest
import trimesh
from esh.engine.descent.numbers_of_parts import first_ranks_among_crumbs
from scipy.spatial import cKDTree

TWO_SIZES = [esh.Size("large", 0.02, 100), esh.Size("small", 0.003, 1400)]
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]


def beside(count, mesh, seed=5):
    """So many copies of a mesh in a cube of 4 m, none near another."""
    rng, places, found = np.random.default_rng(seed), np.zeros((0, 3)), []
    while len(found) < count:
        place = rng.uniform(1.0, 5.0, 3)
        if not len(places) or np.linalg.norm(places - place, axis=1).min() > 0.25:
            places = np.vstack([places, place])
            found.append(esh.SurfaceMesh(mesh.vertices + place, mesh.faces))
    return found


def ball(radius, subdivisions):
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)


LARGE = esh.SurfaceMesh(ball(1.0, 3).vertices - [2.0, 0.0, 0.0], ball(1.0, 3).faces)


def spacings(placement, mesh=0):
    """Distances to the nearest neighbor on one mesh."""
    place = placement.position[placement.mesh == mesh]
    return cKDTree(place).query(place, 2)[0][:, 1]


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "crumb",
    [(40, ball(0.012, 1)), (100, ball(0.04, 1)), (100, ball(0.054, 2)), (200, trimesh.creation.box((0.08,) * 3))],
    ids=["a fifth of a body", "two bodies", "four bodies", "cubes"],
)
def test_bodies_on_crumbs_do_not_disturb_those_on_a_large_mesh(crumb, seed, device):
    """What stands on crumbs is asked to go round them for ever, and the others jumped by what was asked of it."""
    surface = esh.Surface([LARGE, *beside(*crumb)])
    placement = esh.solve(esh.Problem(surface, [esh.BodyClass("c", TWO_SIZES)], seed=seed), device=device)
    count = int((placement.mesh == 0).sum())
    sizes = [
        esh.Size(s.name, s.area, int((placement.mesh[placement.size_index == k] == 0).sum()))
        for k, s in enumerate(TWO_SIZES)
    ]
    alone = esh.solve(esh.Problem(esh.Surface([LARGE]), [esh.BodyClass("c", sizes)], seed=seed), device=device)
    assert len(alone.position) == count
    assert spacings(placement).min() > 0.93 * spacings(alone).min()
    assert np.median(spacings(placement)) > 0.97 * np.median(spacings(alone))
    assert placement.report.converged


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("classes", [1, 2])
def test_like_crumbs_have_like_numbers_and_another_seed_others(classes, device):
    surface = esh.Surface([LARGE, *beside(200, trimesh.creation.box((0.06,) * 3))])
    asked = [esh.BodyClass(f"c{k}", TWO_SIZES) for k in range(classes)]
    found = []
    for seed in range(3):
        placement = esh.solve(esh.Problem(surface, asked, seed=seed), device=device, max_steps=2)
        found.append(np.bincount(placement.mesh, minlength=201)[1:])
        expected = classes * 1500 * 0.0216 / surface.area
        assert set(found[-1].tolist()) <= {int(expected), int(expected) + 1}
        assert abs(found[-1].mean() - expected) < 0.03
    assert len({tuple(one.tolist()) for one in found}) == 3


@pytest.mark.parametrize("device", DEVICES)
def test_those_of_a_crumb_keep_apart(device):
    """On cards for seven bodies each, and nothing else: closest pairs on nine of ten are .066 m apart or more."""
    card = trimesh.Trimesh(
        [[0, 0, 0], [0.2, 0, 0], [0.2, 0.18, 0], [0, 0.18, 0]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    surface = esh.Surface(beside(100, card))
    placement = esh.solve(esh.Problem(surface, [esh.BodyClass("c", [esh.Size("s", 0.003, 700)])]), device=device)
    np.testing.assert_array_equal(np.bincount(placement.mesh), 7)
    closest = [spacings(placement, k).min() for k in range(100)]
    assert np.quantile(closest, 0.1) > 0.066
    assert np.median(closest) > 0.07
    assert placement.report.converged


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("avoid_overlap", [False, True])
@pytest.mark.parametrize("count", [100, 500])
def test_none_leaves_a_crumb_for_another_that_it_runs_into(count, avoid_overlap, device):
    """Of balls in a row each of which reaches into the next one, a tenth had none of one body each, and a tenth two."""
    balls = [ball(0.5, 2).apply_translation((0.9 * i, 0.9 * j, 0.0)) for i in range(10) for j in range(10)]
    surface = esh.Surface([esh.SurfaceMesh(one.vertices, one.faces) for one in balls])
    problem = esh.Problem(surface, [esh.BodyClass("c", [esh.Size("s", 0.02, count)])], avoid_overlap=avoid_overlap)
    placement = esh.solve(problem, device=device)
    np.testing.assert_array_equal(np.bincount(placement.mesh, minlength=100), count // 100)


def test_groups_in_the_same_places_are_dealt_out_in_turn():
    running = np.full((2, 50), 1.0).cumsum(axis=1)
    for chance in (0.0, 0.3, 0.999):
        number = np.diff(first_ranks_among_crumbs(running, np.array([90, 30]), chance))
        np.testing.assert_array_equal(number.sum(axis=1), [90, 30])
        assert set(number.sum(axis=0).tolist()) == {2, 3}
        assert number[1].max() == 1


def test_crumbs_without_density_have_none():
    running = np.array([[0.0, 2.0, 2.0, 3.0, 3.0], [1.0, 1.0, 1.0, 1.0, 1.0]])
    for chance in (0.0, 0.5, 0.999):
        number = np.diff(first_ranks_among_crumbs(running, np.array([3, 4]), chance))
        np.testing.assert_array_equal(number, [[0, 2, 0, 1, 0], [4, 0, 0, 0, 0]])
    nothing = first_ranks_among_crumbs(np.zeros((1, 3)), np.array([0]), 0.5)
    np.testing.assert_array_equal(nothing, np.zeros((1, 4)))
