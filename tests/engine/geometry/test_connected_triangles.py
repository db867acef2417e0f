"""Which triangles hang together."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import trimesh
from esh.engine.problem.surface import Surface, SurfaceMesh

BOX = trimesh.creation.box((1.0, 1.0, 1.0))
TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def parts(vertices, triangles):
    return Surface(SurfaceMesh(np.asarray(vertices), np.asarray(triangles))).part.tolist()


def test_both_sides_of_faces_are_two_parts():
    both = np.concatenate([BOX.faces, BOX.faces[:, ::-1]])
    assert parts(BOX.vertices, both) == 12 * [0] + 12 * [1]
    square = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert parts(square, [[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]]) == [0, 0, 1, 1]


def test_a_vertex_joins_where_both_end_at_it():
    """As where faces are chosen like the black squares of a board; closed meshes that touch in one are two."""
    board = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]]
    assert parts(board, [[0, 1, 2], [0, 2, 3], [2, 4, 5], [2, 5, 6]]) == [0, 0, 0, 0]
    assert parts(np.concatenate([TETRAHEDRON, -TETRAHEDRON]), np.concatenate([FACES, FACES[:, ::-1] + 4])) == [
        *4 * [0],
        *4 * [1],
    ]


@pytest.mark.parametrize("flipped", list(product((False, True), repeat=3)))
def test_a_side_of_three_triangles_joins_all_whichever_way_they_look(flipped):
    fan = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 1], [0, -1, -1]]
    triangles = [[0, 1, k][:: -1 if back else 1] for k, back in zip((2, 3, 4), flipped, strict=True)]
    assert parts(fan, triangles) == [0, 0, 0]


def test_a_side_of_very_many_triangles_and_one_of_a_strip_with_one_side_join():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    pages = np.concatenate([[[0.0, 0, 0], [0, 0, 1]], np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)])
    assert parts(pages, [[0, 1, k] for k in range(2, 14)]) == 12 * [0]
    turn = np.arange(16) * np.pi / 8.0
    way = np.stack([np.cos(turn) * np.cos(turn / 2), np.sin(turn) * np.cos(turn / 2), np.sin(turn / 2)], axis=1)
    ring = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    strip = np.concatenate([ring + 0.3 * way, ring - 0.3 * way])
    triangles = []
    for k in range(16):
        # The Möbius strip's end is its beginning turned over.
        a, b, c, d = (k, k + 16, k + 1, k + 17) if k < 15 else (15, 31, 16, 0)
        triangles += [[a, b, c], [b, d, c]]
    assert parts(strip, triangles) == 32 * [0]
