"""Bodies of each of several parts of a surface: those that none can leave for another have the right number from the start on."""

import esh
import numpy as np
import pytest
import trimesh
from esh.engine.descent.numbers_of_parts import first_ranks
from esh.engine.solver.solver import Solver


def spheres(radii, apart=3.0):
    mesh = trimesh.creation.icosphere(2)
    return esh.Surface(
        [esh.SurfaceMesh(radius * mesh.vertices + [apart * k, 0, 0], mesh.faces) for k, radius in enumerate(radii)]
    )


def numbers(surface, asked, device):
    """Bodies of every mesh at the start, shape ``[size, mesh]``."""
    with Solver(asked, device=device) as solver:
        placed = solver.placement()
    sizes = int(placed.size_index.max()) + 1
    return np.stack(
        [np.bincount(placed.mesh[placed.size_index == k], minlength=len(surface.meshes)) for k in range(sizes)]
    )


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
@pytest.mark.parametrize("seed", range(6))
def test_every_part_has_its_share_but_for_rounding(seed, device):
    surface = spheres([1.0, 1.0, 0.5, 2.0])
    sizes = [esh.Size("a", 1e-4, 400), esh.Size("b", 2e-4, 91)]
    found = numbers(surface, esh.Problem(surface, [esh.BodyClass("c", sizes)], seed=seed), device)
    share = np.array([1.0, 1.0, 0.25, 4.0]) / 6.25
    np.testing.assert_array_equal(found.sum(axis=1), [400, 91])
    assert (np.abs(found - np.outer([400, 91], share)) < 1.0).all()


def test_the_first_group_is_rounded_to_the_nearest_where_sums_are():
    share = np.array([[114.13, 114.13, 3867.74]])
    np.testing.assert_array_equal(first_ranks(share.cumsum(axis=1), np.array([4096])), [[0, 114, 228, 4096]])


def test_of_many_like_parts_every_so_many_have_one_more():
    """And not the first of them, nor the same ones of both groups."""
    running = np.full((2, 100), 2.4).cumsum(axis=1)
    number = np.diff(first_ranks(running, np.array([240, 240])))
    assert set(number.ravel().tolist()) == {2, 3}
    for one in number:
        assert np.abs(one.cumsum() - running[0]).max() < 1.0
    assert set(number.sum(axis=0).tolist()) <= {4, 5}


def test_a_part_without_density_has_none():
    running = np.array([[0.0, 3.0, 3.0, 10.0, 10.0]])
    np.testing.assert_array_equal(first_ranks(running, np.array([7])), [[0, 0, 2, 2, 7, 7]])


@pytest.mark.parametrize("pinned", [[0], [0, 3]])
@pytest.mark.parametrize("include", [True, False])
def test_a_part_that_fixed_bodies_fill_gets_no_more(pinned, include):
    """By chance they leave room in some cells of it: 7 in 100 were put there, and could not leave."""
    surface = spheres([1.0, 1.0, 0.5, 2.0])
    classes = [esh.BodyClass("c", [esh.Size("s", 1e-4, 1000)])]
    before = esh.solve(esh.Problem(surface, classes, seed=1), device="cpu")
    own = np.isin(before.mesh, pinned)
    fixed = esh.FixedBodies.of_placement(before, own)
    asked = classes if include else [esh.BodyClass("c", [esh.Size("s", 1e-4, int((~own).sum()))])]
    after = esh.solve(esh.Problem(surface, asked, fixed=fixed, include_fixed=include, seed=2), device="cpu")
    count, wanted = (np.bincount(placement.mesh, minlength=4) for placement in (after, before))
    np.testing.assert_array_equal(count[pinned], wanted[pinned])
    assert np.abs(count - wanted).max() <= 1
    assert after.report.coverage_error < 0.01
    assert after.report.smallest_spacing > 0.7


def test_new_bodies_make_up_for_what_fixed_ones_leave_of_every_part():
    """One part has far more than it is asked for, another one a few, and what is left goes by what these are asked for."""
    surface = spheres([1.0] * 4)
    alone = esh.solve(esh.Problem(spheres([1.0]), [esh.BodyClass("c", [esh.Size("s", 1e-4, 400)])]), device="cpu")
    few = esh.solve(esh.Problem(spheres([1.0]), [esh.BodyClass("c", [esh.Size("s", 1e-4, 60)])]), device="cpu")
    position = np.concatenate([alone.position, few.position + [3.0, 0.0, 0.0]])
    fixed = esh.FixedBodies(position=position, area=1e-4)
    classes = [esh.BodyClass("c", [esh.Size("s", 1e-4, 1000)])]
    placed = esh.solve(esh.Problem(surface, classes, fixed=fixed, include_fixed=True), device="cpu")
    np.testing.assert_array_equal(np.bincount(placed.mesh), [400, 200, 200, 200])
