"""Points that values of a surface are read at: even, no more than it takes, and right in between."""

import numpy as np
import pytest
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.surface.lattices import MOST_CUTS, Lattices

SHAPES = {
    "even": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.4, 0.9, 0.3]],
    "needle from the first corner": [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.2, 0.1]],
    "needle from the second": [[5.0, 0.2, 0.1], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0]],
    "needle from the third": [[5.0, 0.0, 0.0], [5.0, 0.2, 0.1], [0.0, 0.0, 0.0]],
    "flat": [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 0.05, 0.0]],
    "thread": [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1e-6, 0.0]],
}


def lattices_of(corner, step=0.05):
    """Lattices of triangles, their points in space, and a surface to ask on."""
    corner = np.asarray(corner, float).reshape(-1, 3, 3)
    lattices = Lattices(corner, step)
    triangle, weight = lattices.points()
    surface = Surface(SurfaceMesh(corner.reshape(-1, 3), np.arange(3 * len(corner)).reshape(-1, 3)))
    return lattices, np.einsum("nk,nkd->nd", weight, corner[triangle]), surface


@pytest.mark.parametrize("name", SHAPES)
def test_what_is_linear_is_linear_in_between(name):
    lattices, place, surface = lattices_of([np.add(SHAPES["even"], [0.0, 0.0, 2.0]), SHAPES[name]])
    values = (3.0 + place @ [0.5, -2.0, 1.0]).astype(np.float32)
    rng = np.random.default_rng(1)
    weight = rng.dirichlet(np.ones(3), 500)
    weight[:6] = np.concatenate([np.eye(3), 0.5 * (1.0 - np.eye(3))])
    points = surface.points(rng.integers(0, 2, 500), weight)
    np.testing.assert_allclose(lattices.between(values, points), 3.0 + points.position @ [0.5, -2.0, 1.0], atol=1e-5)


@pytest.mark.parametrize("name", SHAPES)
def test_pieces_cover_a_triangle_and_no_neighbors_are_farther_apart_than_asked(name):
    lattices, place, surface = lattices_of(SHAPES[name])
    pieces = place[lattices.pieces()]
    area = 0.5 * np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1)
    assert area.sum() == pytest.approx(surface.area, rel=1e-4)
    # All look to the same side.
    normal = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    assert (normal @ surface.normal[0] >= 0.0).all()
    assert np.sort(np.unique(lattices.pieces())).tolist()[-1] == len(place) - 1
    side = np.linalg.norm(pieces - np.roll(pieces, 1, axis=1), axis=2)
    assert lattices.step <= 0.05 + 1e-12
    assert side.max() <= np.sqrt(2.0) * lattices.step + 1e-9


def test_a_cylinder_takes_about_as_many_points_as_a_mesh_of_even_triangles():
    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    low, high = (np.stack([2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.0 * angle + z], axis=1) for z in (0.0, 8.0))
    corner = np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    )
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    step = np.sqrt(2.0 * area / 400_000)
    triangle, _ = Lattices(corner, step).points()
    # A lattice as fine across as along would have 20 times as many.
    assert 350_000 < len(triangle) < 1_000_000


def test_sides_have_no_more_than_so_many_steps():
    lattices, place, _ = lattices_of(SHAPES["needle from the first corner"], 1e-5)
    assert lattices.step == pytest.approx(5.0 / MOST_CUTS, rel=0.01)
    assert len(place) < (MOST_CUTS + 1) * (MOST_CUTS + 2) // 2 + 1
