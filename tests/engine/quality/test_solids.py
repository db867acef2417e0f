"""Which convex bodies meet in space, against linear programs, and how deep, against very many directions."""

import time

import numpy as np
import pytest
from esh.engine.geometry.unit_vectors import spread_directions
from esh.engine.quality.close_boxes import close_boxes
from esh.engine.quality.nearest_to_origin import nearest_to_origin
from esh.engine.quality.solids import TOLERANCE, Solids, depths, meeting, meeting_pairs

optimize = pytest.importorskip("scipy.optimize")
Rotation = pytest.importorskip("scipy.spatial.transform").Rotation

CUBE = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T


def soup(seed, count=90):
    """Boxes, plates without thickness and hulls of points, of three sizes, turned at random."""
    rng = np.random.default_rng(seed)
    shapes = [CUBE * [1.0, 0.5, 0.3] + 0.2, CUBE * [1.0, 0.8, 0.0], 0.4 * rng.normal(size=(30, 3))]
    axes = Rotation.random(count, random_state=seed).as_matrix() * rng.choice([0.2, 0.8, 1.5], count)[:, None, None]
    return Solids(shapes, rng.integers(0, 3, count), rng.random((count, 3)) * [5.0, 5.0, 1.5], axes)


def corners(solids, body):
    return solids.position[body] + solids.shapes[solids.shape[body]] @ solids.axes[body].T


def have_a_point_in_common(one, two):
    """Whether some mean of the corners of one is a mean of those of the other."""
    equal = np.vstack(
        [
            np.hstack([one.T, -two.T]),
            np.repeat([1.0, 0.0], [len(one), len(two)]),
            np.repeat([0.0, 1.0], [len(one), len(two)]),
        ]
    )
    found = optimize.linprog(np.zeros(equal.shape[1]), A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0, 1.0], method="highs")
    return found.status == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_just_those_pairs_meet_that_have_a_point_in_common(seed):
    solids = soup(seed)
    smaller = solids.smaller(TOLERANCE)
    wanted = np.random.default_rng(seed).random(90) < 0.6
    pairs = list(zip(*meeting_pairs(solids, wanted), strict=True))
    expected = [
        (i, j)
        for i in range(90)
        for j in range(i + 1, 90)
        if (wanted[i] or wanted[j]) and have_a_point_in_common(corners(smaller, i), corners(smaller, j))
    ]
    assert pairs == expected and len(pairs) > 60


def test_kinds_that_may_meet_are_not_looked_at():
    solids, kind = soup(3), np.arange(90) % 3
    apart = np.array([[True, True, False], [True, True, True], [False, True, False]])
    first, second = meeting_pairs(solids, np.ones(90, bool))
    told = apart[kind[first], kind[second]]
    found = meeting_pairs(solids, np.ones(90, bool), apart, kind)
    np.testing.assert_array_equal(found, (first[told], second[told]))
    assert 0 < told.sum() < len(told)


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0)])
def test_what_touches_does_not_meet(way):
    """By faces, edges and corners: neither exactly, nor by less than is seen."""
    for more, meets in ((0.0, False), (-0.5 * TOLERANCE, False), (-2.0 * TOLERANCE, True), (0.01, False)):
        place = np.array([np.zeros(3), (1.0 + more) * np.array(way)])
        solids = Solids([CUBE], np.zeros(2, int), place, np.tile(np.eye(3), (2, 1, 1)))
        assert len(meeting_pairs(solids, np.ones(2, bool))[0]) == meets, more


def test_flat_bodies_of_one_plane_meet_where_they_overlap():
    rng = np.random.default_rng(4)
    turn = rng.random(60) * 6.0
    axes = Rotation.from_rotvec(np.outer(turn, [0.0, 0.0, 1.0])).as_matrix()
    axes = Rotation.from_rotvec([0.3, 0.5, 0.0]).as_matrix() @ axes
    place = rng.random((60, 2)) * 4.0 @ Rotation.from_rotvec([0.3, 0.5, 0.0]).as_matrix()[:, :2].T
    solids = Solids([CUBE * [1.0, 0.4, 0.0]], np.zeros(60, int), place, axes)
    first, second = np.triu_indices(60, 1)
    expected = [
        have_a_point_in_common(corners(solids, i), corners(solids, j)) for i, j in zip(first, second, strict=True)
    ]
    np.testing.assert_array_equal(meeting(solids, first, second), expected)


def test_depths_are_the_shortest_ways_that_part_bodies():
    solids = soup(5)
    first, second = meeting_pairs(solids, np.ones(90, bool))
    depth = depths(solids, first, second)
    direction = spread_directions(20_000)
    for one, two, found in zip(first, second, depth, strict=True):
        ahead = (corners(solids, one) @ direction.T).max(axis=0) - (corners(solids, two) @ direction.T).min(axis=0)
        # Of many directions one is nearly that way; what lies in a plane is parted along a single one.
        assert found > 0.97 * ahead.min() - 0.01
    deepest = int(depth.argmax())
    ahead = (corners(solids, first[deepest]) @ direction.T).max(axis=0)
    ahead -= (corners(solids, second[deepest]) @ direction.T).min(axis=0)
    assert depth[deepest] == pytest.approx(ahead.min(), rel=0.02)


def test_of_two_cubes_the_depth_is_known():
    place = np.array([[0.0, 0.0, 0.0], [0.9, 0.3, 0.2], [5.0, 0.0, 0.0], [5.0, 0.2, 0.75]])
    solids = Solids([CUBE], np.zeros(4, int), place, np.tile(np.eye(3), (4, 1, 1)))
    first, second = meeting_pairs(solids, np.ones(4, bool))
    assert (first.tolist(), second.tolist()) == ([0, 2], [1, 3])
    np.testing.assert_allclose(depths(solids, first, second), [0.1, 0.25], atol=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_close_boxes_are_all_found_once(seed):
    """Of all sizes, in space, in a plane, on a line and in one place."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 400))
    center = rng.random((count, 3)) * [[5.0, 5.0, 5.0], [20.0, 20.0, 0.0], [30.0, 0.0, 0.0], [0.0, 0.0, 0.0]][seed % 4]
    half = 10.0 ** rng.uniform(-3.0, 0.0, (count, 1)) * rng.uniform(0.1, 1.0, (count, 3))
    wanted = rng.random(count) < [0.05, 1.0][seed % 2]
    parts = [np.sort(np.stack(part, axis=1), axis=1) for part in close_boxes(center, half, wanted)]
    found = np.concatenate([np.empty((0, 2), int), *parts])
    first, second = np.triu_indices(count, 1)
    close = (np.abs(center[first] - center[second]) < half[first] + half[second]).all(axis=1)
    close &= wanted[first] | wanted[second]
    np.testing.assert_array_equal(found[np.lexsort(found.T[::-1])], np.stack([first[close], second[close]], axis=1))


def test_the_nearest_point_of_a_tetrahedron_is_nearer_than_all_others():
    rng = np.random.default_rng(1)
    corner = rng.normal(size=(500, 4, 3)) + rng.normal(size=(500, 1, 3))
    nearest, used = nearest_to_origin(corner)
    weight = rng.dirichlet(np.full(4, 0.5), 3000)
    others = np.linalg.norm(np.einsum("wc,nck->nwk", weight, corner), axis=2).min(axis=1)
    assert (np.linalg.norm(nearest, axis=1) <= others + 1e-12).all()
    inside = used.all(axis=1)
    assert 10 < inside.sum() < 490 and not nearest[inside].any()
    # All of a tetrahedron is beyond the plane through that point.
    ahead = np.einsum("nck,nk->nc", corner, nearest)
    assert (ahead >= (nearest**2).sum(axis=1)[:, None] - 1e-9).all()


@pytest.mark.alone
def test_a_hundred_thousand_that_lean_take_a_second(slowness):
    rng = np.random.default_rng(1)
    side = 316
    place = np.stack(np.meshgrid(np.arange(side), np.arange(side), [0.0]), axis=-1).reshape(-1, 3)
    place[:, :2] = 2.2 * place[:, :2] + rng.normal(size=(len(place), 2)) * 0.1
    turn = rng.random(32) * 2.0 * np.pi
    cone = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(32)])
    tilt = rng.normal(size=(len(place), 3)) * [0.15, 0.15, 2.0]
    solids = Solids([np.vstack([cone, [[0.0, 0.0, 5.0]]])], np.zeros(len(place), int), place, _turned(tilt))
    before = time.process_time()
    first, second = meeting_pairs(solids, np.ones(len(place), bool))
    depths(solids, first, second)
    took = time.process_time() - before
    assert took < 2.5 * slowness(), "half of it on an idle machine"
    assert len(first) > 500


def _turned(vector):
    return Rotation.from_rotvec(vector).as_matrix()
