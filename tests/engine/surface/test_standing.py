"""Parts of a surface that stand on one another."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import launcher_of_process
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.surface.facets import Facets
from esh.engine.surface.kernels_relations import see_each_other
from esh.engine.surface.parts import joined_parts
from esh.engine.surface.relations import Relations

BODIES = 4096
LAUNCHER = launcher_of_process(str(resolve_device("cpu")))


def box(x: float, y: float, z: float, middle: tuple[float, float, float], turn: float = 0.0) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((x, y, z))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn), (0, 0, 1)))
    return mesh.apply_translation(middle)


def sheet(x: float, y: float, middle: tuple[float, float, float], cells: int = 1) -> trimesh.Trimesh:
    along = np.linspace(-0.5, 0.5, cells + 1)
    corner = np.stack([*np.meshgrid(x * along, y * along, indexing="ij"), np.zeros((cells + 1, cells + 1))], axis=-1)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    cell = np.stack([first, first + cells + 1, first + cells + 2, first + 1], axis=1)
    return trimesh.Trimesh(
        corner.reshape(-1, 3) + middle, cell[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3), process=False
    )


def flat_rock() -> trimesh.Trimesh:
    """A round thing with a flat foot on the ground."""
    mesh = trimesh.creation.icosphere(4)
    mesh.vertices *= (0.8, 0.6, 0.5)
    mesh.vertices[:, 2] = np.maximum(mesh.vertices[:, 2], -0.1) + 0.1
    return mesh


def tube(radius: float, height: float, bottom: float) -> trimesh.Trimesh:
    angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(48, bottom)], axis=1)
    this, after = np.arange(48), (np.arange(48) + 1) % 48
    sides = np.concatenate(
        [np.stack([this, after, after + 48], axis=1), np.stack([this, after + 48, this + 48], axis=1)]
    )
    return trimesh.Trimesh(np.concatenate([ring, ring + (0, 0, height)]), sides, process=False)


GROUND = sheet(3, 3, (0, 0, 0))
FLOOR, WALL, CARPET = box(3, 3, 0.1, (0, 0, 0)), box(0.1, 3.4, 2, (1.55, 0, 1)), sheet(2.5, 2, (0.25, 0, 0.055))
# Meshes, and the numbers of those that stand on one another.
STANDING = {
    "a box on the ground": ([GROUND, box(1, 1, 1, (0, 0, 0.5))], [(0, 1)]),
    "a turned box on the ground": ([GROUND, box(1, 1, 1, (0, 0, 0.5), turn=17)], [(0, 1)]),
    "a box on ground of small triangles": ([sheet(3, 3, (0, 0, 0), 50), box(1, 1, 1, (0, 0, 0.5), turn=17)], [(0, 1)]),
    "a box a thousandth in the ground": ([GROUND, box(1, 1, 1, (0, 0, 0.499))], [(0, 1)]),
    "a box a thousandth above the ground": ([GROUND, box(1, 1, 1, (0, 0, 0.501))], [(0, 1)]),
    "a smaller box on a box": ([box(1, 1, 1, (0, 0, 0)), box(0.6, 0.6, 0.6, (0, 0, 0.8))], [(0, 1)]),
    "a floor that ends at a wall": ([GROUND, box(0.2, 3.4, 1.2, (1.6, 0, 0.4))], [(0, 1)]),
    "a rock with a flat foot": ([GROUND, flat_rock()], [(0, 1)]),
    "a carpet and a floor that end at a wall": ([FLOOR, WALL, CARPET], [(0, 1), (1, 2)]),
    "tubes in each other on the ground": ([GROUND, tube(1.0, 1.0, 0.0), tube(0.9, 0.8, 0.0)], [(0, 1), (0, 2)]),
    "a box on a box on the ground": (
        [GROUND, box(1, 1, 1, (0, 0, 0.5)), box(0.5, 0.5, 0.5, (0, 0, 1.25))],
        [(0, 1), (1, 2)],
    ),
}
APART = {
    "a thin plate on the ground": [GROUND, box(1, 1, 0.02, (0, 0, 0.01))],
    "thin plates on each other": [box(1, 1, 0.02, (0, 0, 0)), box(0.8, 0.8, 0.02, (0, 0, 0.02))],
    "a carpet on the floor": [FLOOR, sheet(2, 2, (0, 0, 0.055))],
    "a sticker on a wall": [
        WALL,
        sheet(1, 1, (0, 0, 0)).apply_transform([[0, 0, -1, 1.5], [0, 1, 0, 0], [1, 0, 0, 1], [0, 0, 0, 1]]),
    ],
    "an eye in its socket": [tube(0.5, 0.5, -0.25), trimesh.creation.icosphere(3, radius=0.49)],
    "tubes in each other": [tube(1.0, 1.0, 0.0), tube(0.9, 0.8, 0.0)],
    "both skins of a thin wall": [tube(1.0, 1.0, 0.0), tube(0.99, 1.0, 0.0)],
    "a ball on the ground": [GROUND, trimesh.creation.icosphere(3).apply_translation((0, 0, 1))],
    "a box under the ground": [GROUND, box(1, 1, 1, (0, 0, -0.5))],
    "a box that is sunk into the ground": [GROUND, box(1, 1, 1, (0, 0, 0.2))],
    "a box in a box": [box(2, 2, 2, (0, 0, 0)), box(1, 1, 1, (0, 0, -0.5))],
    "boxes apart": [box(1, 1, 1, (0, 0, 0)), box(1, 1, 1, (1.02, 0.3, 0))],
}
CASES = [*((name, *case) for name, case in STANDING.items()), *((name, meshes, []) for name, meshes in APART.items())]


def surface_of(meshes: list[trimesh.Trimesh], turned: bool) -> Surface:
    turn = trimesh.transformations.rotation_matrix(0.4 if turned else 0.0, (1.0, 2.0, 3.0))
    return Surface([SurfaceMesh(mesh.copy().apply_transform(turn).vertices, mesh.faces) for mesh in meshes])


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("meshes", "pairs"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_who_stands_on_whom_is_told_pair_by_pair(meshes, pairs, turned):
    surface = surface_of(meshes, turned)
    parts = joined_parts(LAUNCHER, surface, float(np.sqrt(surface.area / BODIES)))
    first = np.cumsum([0, *(len(mesh.faces) for mesh in meshes[:-1])])
    assert len(np.unique(parts.label)) == len(meshes)
    assert sorted(map(sorted, parts.relations.pair.tolist())) == sorted(
        sorted(parts.label[first[list(pair)]].tolist()) for pair in pairs
    )


def test_where_a_box_stands_on_large_triangles_these_are_cut_into_small_tiles():
    surface = surface_of(STANDING["a box on the ground"][0], turned=False)
    unit = float(np.sqrt(surface.area / BODIES))
    label, open_side, relations, *_ = joined_parts(LAUNCHER, surface, unit)
    place = np.abs(relations.place * unit + 0.5 * (surface.low + surface.high))
    np.testing.assert_allclose(place[:, :2].max(axis=1), 0.5, atol=1e-9)
    facets, before = (
        Facets(LAUNCHER, surface, unit, label, open_side, relations),
        Facets(LAUNCHER, surface, unit, label, open_side),
    )
    middle = facets.corner.mean(axis=1) * unit
    foot = np.abs(np.abs(middle[:, :2]).max(axis=1) - 0.5) < 0.5 * unit
    on_ground = (facets.triangle < 2) & foot
    assert on_ground.sum() > 20
    assert (facets.cuts[on_ground] > before.cuts[on_ground]).all()
    away = np.abs(np.abs(middle[:, :2]).max(axis=1) - 0.5) > 4.0 * unit
    np.testing.assert_array_equal(facets.cuts[away], before.cuts[away])


@wp.kernel
def ask(
    count: int,
    numbers: wp.array(dtype=wp.int32),
    relations: int,
    # outputs
    found: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    found[i] = int(see_each_other(i / count, i % count, numbers, relations))


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 1.0])
def test_kernels_find_every_pair_and_no_other(share):
    count = 40
    related = np.triu(np.random.default_rng(3).random((count, count)) < share, 1)
    relations = Relations(np.argwhere(related), np.full(int(related.sum()), np.inf))
    numbers, begin = relations.behind(np.arange(5), count)
    np.testing.assert_array_equal(numbers[:5], np.arange(5))
    found = wp.zeros(count * count, dtype=wp.int32, device="cpu")
    wp.launch(
        ask, count * count, [count, wp.array(numbers, dtype=wp.int32, device="cpu"), begin], [found], device="cpu"
    )
    np.testing.assert_array_equal(found.numpy().reshape(count, count), related | related.T | np.eye(count, dtype=bool))


def test_to_bodies_far_apart_a_small_part_is_nothing():
    relations = Relations(np.array([[0, 1], [0, 2]]), np.array([100.0, 1000.0]))
    assert relations.behind(np.zeros(1), 3, 3.0)[0].tolist() == [0, 5, 7, 8, 9, 1, 2, 0, 0]
    assert relations.behind(np.zeros(1), 3, 4.0)[0].tolist() == [0, 5, 6, 6, 7, 2, 0]
    assert relations.behind(np.zeros(1), 3, 12.0) == (np.zeros(1), 0)
