"""Meshes that touch along a crease, as the pieces of a kit do, and those that only lie on each other."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import launcher_of_process
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality.sheets import sheets_of
from esh.engine.solve import solve
from esh.engine.surface.parts import joined_parts

BODIES = 4096


def box(x: float, y: float, z: float, middle: tuple[float, float, float] = (0.0, 0.0, 0.0), finer: int = 0):
    mesh = trimesh.creation.box((x, y, z))
    for _ in range(finer):
        mesh = mesh.subdivide()
    return mesh.apply_translation(middle)


def sheet(x: float, y: float, middle: tuple[float, float, float], standing: bool = False):
    corner = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]]) / 2
    if standing:
        corner = corner[:, [0, 2, 1]]
    return trimesh.Trimesh(corner + middle, [[0, 1, 2], [0, 2, 3]], process=False)


def rough_ball(seed: int, middle: tuple[float, float, float]):
    mesh = trimesh.creation.icosphere(5)
    mesh.vertices *= 1.0 + 0.02 * np.random.default_rng(seed).normal(size=(len(mesh.vertices), 1))
    return mesh.apply_translation(middle)


ONE = {
    "boxes shifted along their faces": [box(1, 1, 1), box(1, 1, 1, (1, 0.3, 0))],
    "walls of other triangles": [box(2, 0.2, 1, finer=2), box(1.3, 0.2, 1, (1.65, 0, 0.1), 3)],
    "a gap of a thousandth": [box(1, 1, 1), box(1, 1, 1, (1.001, 0.3, 0))],
    "bricks": [box(0.4, 0.2, 0.2, (0.4 * i + 0.2 * (j % 2), 0, 0.2 * j)) for i in range(4) for j in range(4)],
    "ground that ends at a box": [sheet(2, 2, (0, 0, 0.5)), box(1, 2, 1, (1.5, 0.3, 0))],
}
# Were these joined, what lies on or in each other there would be, too: carpets and the floor, by the wall that they end at.
SEVERAL = {
    "a box on the ground": [sheet(3, 3, (0, 0, 0)), box(1, 1, 1, (0, 0, 0.5))],
    "a smaller box on a box": [box(1, 1, 1), box(0.6, 0.6, 0.6, (0, 0, 0.8))],
    "ground that ends at a wall": [sheet(2, 2, (0, 0, 0.2)), box(1, 2, 1, (1.5, 0.3, 0))],
    "a carpet that ends at a wall": [box(3, 3, 0.1), box(0.1, 3.4, 2, (1.55, 0, 1)), sheet(2.5, 2, (0.25, 0, 0.055))],
    "a carpet as wide as the floor": [box(3, 3, 0.2), box(3, 2, 0.02, (0, 0, 0.11))],
    "sheets of one outline, one above the other": [sheet(1, 1, (0, 0, 0)), sheet(1, 1, (0, 0, 0.001))],
    "sheets farther above each other": [sheet(1, 1, (0, 0, 0)), sheet(1, 1, (0, 0, 0.005))],
    "a thin plate on the ground": [sheet(3, 3, (0, 0, 0)), box(1, 1, 0.02, (0, 0, 0.01))],
    "a ball on the ground": [sheet(3, 3, (0, 0, 0)), trimesh.creation.icosphere(3).apply_translation((0, 0, 1))],
    "a box that is sunk into the ground": [sheet(3, 3, (0, 0, 0)), box(1, 1, 1, (0, 0, 0.2))],
    "a sheet on a wall": [box(2, 0.2, 1), sheet(1.1, 1, (0, -0.1, 0), standing=True)],
    "rough balls that run into each other": [rough_ball(0, (0, 0, 0)), rough_ball(1, (1.5, 0, 0))],
    "boxes apart": [box(1, 1, 1), box(1, 1, 1, (1.02, 0.3, 0))],
}


def surface_of(meshes: list[trimesh.Trimesh], turned: bool) -> Surface:
    turn = trimesh.transformations.rotation_matrix(0.4 if turned else 0.0, (1.0, 2.0, 3.0))
    return Surface([SurfaceMesh(mesh.copy().apply_transform(turn).vertices, mesh.faces) for mesh in meshes])


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("name", "one"), [*((name, True) for name in ONE), *((name, False) for name in SEVERAL)])
def test_what_continues_across_a_crease_is_one_part(name: str, one: bool, turned: bool) -> None:
    surface = surface_of((ONE if one else SEVERAL)[name], turned)
    launcher = launcher_of_process(str(resolve_device("cpu")))
    part, *_ = joined_parts(launcher, surface, float(np.sqrt(surface.area / BODIES)))
    assert surface.part.max() >= 1
    assert part.max() == (0 if one else surface.part.max())
    sheets = np.unique(sheets_of(surface, BODIES, launcher)[0])
    assert len(sheets) == part.max() + 1


def test_where_a_sheet_continues_on_a_box_it_does_not_end() -> None:
    surface = surface_of(ONE["ground that ends at a box"], turned=False)
    launcher = launcher_of_process(str(resolve_device("cpu")))
    open_side = joined_parts(launcher, surface, float(np.sqrt(surface.area / BODIES))).open_side
    # Three of the four sides of the sheet.
    assert surface.open_side.sum() == 4
    assert open_side.sum() == 3


def test_bodies_beside_the_seam_of_shifted_boxes_keep_their_distance() -> None:
    surface = surface_of(ONE["boxes shifted along their faces"], turned=False)
    problem = Problem(surface, [BodyClass("dot", [Size("dot", 1e-6, BODIES)])])
    placement = solve(problem, device="cpu")
    spacing = float(np.sqrt(2.0 * surface.area / np.sqrt(3.0) / BODIES))
    top = placement.position[placement.normal[:, 2] > 0.9]
    beside = top[(np.abs(top[:, 0] - 0.5) < 0.5 * spacing) & (top[:, 1] > -0.2) & (top[:, 1] < 0.5)]
    away = np.linalg.norm(top[:, None] - beside, axis=2)
    nearest = np.sort(away, axis=0)[1] / spacing
    assert len(beside) > 8
    assert nearest.min() > 0.65
    assert nearest.mean() > 0.75
