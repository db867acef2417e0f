"""Tiles around bodies that are fixed."""

from __future__ import annotations

import math
from pathlib import Path

import esh
import numpy as np
from esh.engine.tiles.coarse import CoarseGrid
from esh.engine.tiles.demand import integrals_of_tiles
from esh.engine.tiles.groups import group_tiles
from esh.engine.tiles.layout import Layout
from scipy import spatial


def solved(problem: esh.Problem, folder: Path, **options) -> dict[str, np.ndarray]:
    """The bodies of all tiles, by their numbers."""
    options = {"device": "cpu", "ending": ".npz", "tile": 30.0, "steps": (20, 14, 14), "workers": 0} | options
    esh.solve_tiles(problem, folder, **options)
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    assert len(parts) > 1
    keys = [key for key in parts[0].files if key not in ("class_name", "size_name")]
    whole = {key: np.concatenate([part[key] for part in parts]) for key in keys}
    order = np.argsort(whole["id"])
    assert np.array_equal(whole["id"][order], np.arange(len(order)))
    return {key: values[order] for key, values in whole.items()}


def row_of(count: int, begin: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    return np.linspace(begin, end, count)


def test_fixed_bodies_stay_and_others_make_room_for_them(tmp_path):
    # A wall of discs across all cuts, and one of them larger than its size says.
    wall = row_of(50, (8.0, 20.3), (112.0, 21.7))
    area = np.full(50, np.nan)
    area[25] = 3.0
    size = esh.Size("disc", area=0.5, count=4700)
    problem = esh.Problem(
        esh.Domain((125.0, 40.0)),
        [esh.BodyClass("a", [size])],
        seed=3,
        avoid_overlap=True,
        fixed=[esh.FixedBodies(wall, area=area)],
    )
    bodies = solved(problem, tmp_path / "out", tile=62.5)
    fixed = bodies["fixed"]
    assert len(fixed) == 4750 and fixed.sum() == 50 and fixed[-50:].all()
    assert np.array_equal(bodies["position"][fixed], wall)
    assert bodies["area"][fixed][25] == 3.0 and (bodies["area"][~fixed] == 0.5).all()
    radius = np.sqrt(bodies["area"] / math.pi)
    pairs = spatial.cKDTree(bodies["position"]).query_pairs(2.0 * radius.max(), output_type="ndarray")
    apart = np.hypot(*(bodies["position"][pairs[:, 0]] - bodies["position"][pairs[:, 1]]).T)
    assert (radius[pairs].sum(axis=1) - apart < 2e-3 * radius[pairs].min(axis=1)).all()
    # The wall is part of what the density asks for.
    near = np.abs(bodies["position"][:, 1] - 21.0) < 4.0
    assert abs(near.sum() / (4750 * 8.0 / 40.0) - 1.0) < 0.03


def crowd_problem() -> esh.Problem:
    # Where only a third of them would be wanted.
    rng = np.random.default_rng(2)
    crowd = np.array([20.0, 45.0]) + rng.uniform(-7.0, 7.0, (600, 2))
    slope = np.linspace(0.25, 1.0, 64, dtype=np.float32)[None, :]
    return esh.Problem(
        esh.Domain((66.0, 66.0)),
        [esh.BodyClass("a", [esh.Size("dot", area=1.0, count=3600)], slope)],
        seed=5,
        fixed=[esh.FixedBodies(crowd)],
    )


def test_a_crowd_of_fixed_bodies_keeps_others_off_no_farther_than_in_one_solve(tmp_path):
    problem = crowd_problem()
    bodies = solved(problem, tmp_path / "out", tile=33.0, steps=(40, 30, 30))
    whole = esh.solve(problem, device="cpu")
    free, free_whole = ~bodies["fixed"], ~whole.fixed
    counts = [
        np.histogram2d(*p.T, bins=6, range=[(0.0, 66.0)] * 2)[0]
        for p in (bodies["position"][free], whole.position[free_whole])
    ]
    assert counts[0].sum() == counts[1].sum() == 3600
    # Blocks of a hundred and more, some of which hold the crowd: as many in each, up to what stands about at their borders; and as
    # many in each row and column of blocks.
    assert np.abs(counts[0] - counts[1]).max() <= 7
    assert max(np.abs((counts[0] - counts[1]).sum(axis=axis)).max() for axis in (0, 1)) <= 14
    inside = (np.abs(bodies["position"][free] - [20.0, 45.0]) < 6.0).all(axis=1)
    assert inside.sum() <= (np.abs(whole.position[free_whole] - [20.0, 45.0]) < 6.0).all(axis=1).sum() + 3


def test_numbers_of_fixed_bodies_are_the_last_of_their_sizes():
    sizes = [esh.Size("range", area=(0.2, 0.9), count=300), esh.Size("line", area=0.5, count=50, line=esh.Line(1.5))]
    problem = esh.Problem(
        esh.Domain((40.0, 40.0)),
        [esh.BodyClass("a", sizes)],
        seed=1,
        fixed=[
            esh.FixedBodies(row_of(3, (1.0, 1.0), (5.0, 1.0)), size="range", area=np.array([0.3, 1.5, np.nan])),
            esh.FixedBodies(row_of(2, (9.0, 9.0), (12.0, 9.0)), size="line", angle=0.7, length=np.array([2.5, np.nan])),
        ],
    )
    groups = group_tiles(problem)
    assert groups.body_count == 355
    assert groups.fixed_identity.tolist() == [300, 301, 302, 353, 354]
    assert groups.areas(groups.fixed_identity)[:3].tolist() == [0.3, 1.5, problem.classes[0].sizes[0].mean_area]
    # The others have the areas that they would have without.
    assert np.allclose(groups.areas(np.arange(300)), np.linspace(0.2, 0.9, 300))
    free = np.concatenate([groups.identities(g, 0, int(groups.free_count[g])) for g in range(groups.number)])
    assert np.array_equal(np.sort(np.concatenate([free, groups.fixed_identity])), np.arange(355))


def test_fixed_lines_lie_as_they_are_said_to(tmp_path):
    line = esh.Line(length=1.2, direction=0.2)
    fixed = esh.FixedBodies(row_of(9, (4.0, 20.0), (60.0, 22.0)), angle=1.1, length=3.0)
    size = esh.Size("line", area=0.3, count=3000, line=line)
    problem = esh.Problem(esh.Domain((64.0, 40.0)), [esh.BodyClass("a", [size])], seed=1, fixed=[fixed])
    bodies = solved(problem, tmp_path / "out", tile=32.0, steps=(30, 20, 20))
    assert np.array_equal(bodies["position"][-9:], fixed.position)
    assert np.allclose(bodies["angle"][-9:], 1.1) and np.allclose(bodies["length"][-9:], 3.0)
    assert np.median(np.abs(bodies["angle"][:-9] - 0.2)) < 0.1
    assert abs(bodies["length"][:-9].mean() / 1.2 - 1.0) < 0.05


def test_sums_of_tiles_add_up():
    layout = Layout((30.0, 20.0), (3, 2), (48, 32))
    grid = CoarseGrid((30.0, 20.0), (7, 11))
    cells = np.random.default_rng(4).random(grid.shape)
    tiles = integrals_of_tiles(cells, grid, layout)
    assert tiles.shape == (6,) and math.isclose(tiles.sum(), cells.sum())
    even = integrals_of_tiles(np.ones(grid.shape), grid, layout)
    assert np.allclose(even, 77.0 / 6.0)
    # Of the first tile, by cells and parts of cells.
    weight_x = np.clip(11.0 / 3.0 - np.arange(11), 0.0, 1.0)
    weight_y = np.clip(3.5 - np.arange(7), 0.0, 1.0)
    assert math.isclose(tiles[0], weight_y @ cells @ weight_x)
