"""Tiles of all kinds of problems: lines, obstacles, contact, ranges, mirrors, several classes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.device.launcher import launcher_of_process
from esh.engine.problem.balance import SHARED_POWER
from esh.engine.problem.interaction import group_bodies
from esh.engine.quality.overlaps import overlaps_of
from esh.engine.tiles.bodies import PartBodies, read_bodies
from esh.engine.tiles.coarse import SCALE, CoarseGrid, cell_sums, displacement, solve_flow
from esh.engine.tiles.groups import group_tiles
from esh.engine.tiles.plan import TileRun, make_plan
from scipy import spatial


def solved(problem: esh.Problem | Path, folder: Path, **options) -> dict[str, np.ndarray]:
    options = {"device": "cpu", "ending": ".npz", "tile": 30.0, "steps": (12, 8, 8), "workers": 0} | options
    esh.solve_tiles(problem, folder, **options)
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    assert len(parts) > 1
    keys = ("id", "position", "area", "class_index", "size_index", "angle", "length", "width")
    whole = {key: np.concatenate([part[key] for part in parts]) for key in keys}
    order = np.argsort(whole["id"])
    assert np.array_equal(whole["id"][order], np.arange(len(order)))
    return {key: values[order] for key, values in whole.items()}


def problem_of(size: esh.Size, extent: tuple[float, float] = (60.0, 45.0), **more) -> esh.Problem:
    domain = more.pop("domain", esh.Domain(extent))
    return esh.Problem(domain, [esh.BodyClass("one", [size], more.pop("density", 1.0))], seed=4, **more)


def test_footprints_that_keep_apart_do_so_across_all_cuts(tmp_path):
    # Discs that cover 60 % of the ground.
    problem = problem_of(esh.Size("disc", area=0.6, count=7200), (120.0, 60.0), avoid_overlap=True)
    bodies = solved(problem, tmp_path / "out", tile=60.0, steps=(20, 12, 12))
    radius = math.sqrt(0.6 / math.pi)
    nearest = spatial.cKDTree(bodies["position"]).query(bodies["position"], 2)[0][:, 1]
    assert (nearest > 2.0 * radius * (1.0 - 1e-3)).all()


def test_two_sizes_that_keep_apart(tmp_path):
    sizes = [esh.Size("large", area=1.5, count=1500), esh.Size("small", area=0.4, count=4500)]
    problem = esh.Problem(esh.Domain((150.0, 56.0)), [esh.BodyClass("disc", sizes)], seed=2, avoid_overlap=True)
    bodies = solved(problem, tmp_path / "out", tile=75.0, steps=(20, 12, 12))
    assert 1500 * 1.5 + 4500 * 0.4 > 0.47 * 150.0 * 56.0
    radius = np.sqrt(bodies["area"] / math.pi)
    pairs = spatial.cKDTree(bodies["position"]).query_pairs(2.0 * radius.max(), output_type="ndarray")
    apart = np.hypot(*(bodies["position"][pairs[:, 0]] - bodies["position"][pairs[:, 1]]).T)
    assert (radius[pairs].sum(axis=1) - apart < 2e-3 * radius[pairs].min(axis=1)).all()


def test_lines_follow_a_flow_over_the_whole_domain(tmp_path):
    # Circles round the middle, which every tile sees a part of.
    v, u = np.mgrid[0:64, 0:64] / 63.0 - 0.5
    flow = np.stack([v, u], axis=-1) / np.maximum(np.hypot(u, v), 1e-6)[..., None]
    line = esh.Line(length=1.0, direction=flow.astype(np.float32))
    problem = problem_of(esh.Size("line", area=0.25, count=3600, line=line), (60.0, 60.0))
    bodies = solved(problem, tmp_path / "out", steps=(40, 30, 30))
    x, y = (bodies["position"] - 30.0).T
    far = np.hypot(x, y) > 8.0
    wrong = bodies["angle"] - (np.arctan2(y, x) + 0.5 * math.pi)
    wrong = np.abs((wrong + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
    assert np.median(wrong[far]) < math.radians(6.0)
    assert bodies["length"].mean() == pytest.approx(1.0, rel=0.05)
    # Capsules of the area that was asked for.
    thick = bodies["width"][0]
    assert (bodies["width"] == thick).all()
    assert 1.0 * thick + 0.25 * math.pi * thick**2 == pytest.approx(0.25)
    # No more uneven near cuts than elsewhere: lines along cuts are as long as others.
    near = (np.abs(bodies["position"] - 30.0) < 2.0).any(axis=1)
    assert bodies["length"][near].mean() == pytest.approx(bodies["length"][~near].mean(), rel=0.05)


def test_lines_along_the_edges_of_a_density(tmp_path):
    # Stripes that rise to the right: lines lie along them.
    v, u = np.mgrid[0:96, 0:128] * 0.5
    density = (0.3 + 0.25 * (1.0 + np.cos(2.0 * np.pi * (u + v) / 14.0))).astype(np.float32)
    problem = problem_of(
        esh.Size("line", area=0.3, count=3600, line=esh.Line(length=0.8)), (64.0, 48.0), density=density
    )
    bodies = solved(problem, tmp_path / "out", steps=(40, 30, 30))
    # Rows of an image go down, so stripes of u + v go up with x.
    wrong = np.abs((bodies["angle"] - 0.25 * math.pi + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
    assert np.median(wrong) < math.radians(12.0)


@pytest.mark.parametrize("apart", [False, True])
def test_nothing_stands_on_obstacles(tmp_path, apart):
    mask = np.zeros((30, 40), bool)
    mask[4:9, 25:36] = True
    obstacles = [
        esh.Obstacle(disc=(30.0, 22.0, 6.0)),
        esh.Obstacle(polygon=[(5.0, 5.0), (20.0, 8.0), (12.0, 16.0)], margin=0.5),
        esh.Obstacle(image=mask),
    ]
    problem = problem_of(esh.Size("dot", area=0.2, count=9000), (100.0, 45.0), obstacles=obstacles, avoid_overlap=apart)
    bodies = solved(problem, tmp_path / "out", tile=45.0 if apart else 22.5)
    x, y = bodies["position"].T
    reach = math.sqrt(0.2 / math.pi) if apart else 0.0
    assert np.hypot(x - 30.0, y - 22.0).min() >= 6.0 + reach - 1e-3
    assert not mask[((1.0 - y / 45.0) * 30).astype(int).clip(0, 29), (x / 2.5).astype(int).clip(0, 39)].any()
    # Of the triangle: outside of it, by the margin.
    corners = np.array([(5.0, 5.0), (20.0, 8.0), (12.0, 16.0)])
    edge = np.roll(corners, -1, axis=0) - corners
    offset = bodies["position"][:, None] - corners
    inside = (edge[:, 0] * offset[..., 1] - edge[:, 1] * offset[..., 0] > 0.0).all(axis=1)
    along = np.clip((offset * edge).sum(axis=2) / (edge**2).sum(axis=1), 0.0, 1.0)
    away = np.linalg.norm(offset - along[..., None] * edge, axis=2).min(axis=1)
    assert not inside.any() and away.min() >= 0.5 + reach - 1e-3
    # What is left is covered evenly.
    free = 100.0 * 45.0 - math.pi * 36.0 - mask.sum() * 2.5 * 1.5
    assert ((x > 45.0) & (y < 20.0)).sum() == pytest.approx(55.0 * 20.0 * 9000 / (free - 92.0), rel=0.03)


@pytest.mark.parametrize("distribution", ["linear", "uniform", "list"])
def test_a_range_of_areas_is_mixed_everywhere(tmp_path, distribution):
    listed = np.random.default_rng(1).uniform(0.3, 1.8, 1800) if distribution == "list" else distribution
    problem = problem_of(esh.Size("any", area=(0.3, 1.8), count=1800, distribution=listed), (60.0, 30.0))
    bodies = solved(problem, tmp_path / "out")
    area = bodies["area"]
    assert (area >= 0.3).all() and (area <= 1.8).all()
    if distribution == "list":
        assert np.allclose(area, np.sort(listed))
    elif distribution == "linear":
        assert np.allclose(area, np.linspace(0.3, 1.8, 1800))
    else:
        assert area.mean() == pytest.approx(1.05, abs=0.01)
        assert len(np.unique(np.round(np.diff(area), 9))) > 1000
    for left in (0.0, 20.0, 40.0):
        part = area[(bodies["position"][:, 0] >= left) & (bodies["position"][:, 0] < left + 20.0)]
        assert part.mean() == pytest.approx(area.mean(), rel=0.06)
        assert np.percentile(part, [10, 90]) == pytest.approx(np.percentile(area, [10, 90]), rel=0.15)


def test_mirrors_keep_the_spacing_at_the_edges(tmp_path):
    domain = esh.Domain((60.0, 45.0), "mirror")
    bodies = solved(problem_of(esh.Size("dot", area=1.0, count=2700), domain=domain), tmp_path / "out")
    x, y = bodies["position"].T
    edge = np.minimum(np.minimum(x, 60.0 - x), np.minimum(y, 45.0 - y))
    # Of an open domain a row stands on the edge itself.
    assert (edge < 0.1).sum() < 10
    rim = ((edge < 2.0).sum()) / (60.0 * 45.0 - 56.0 * 41.0)
    assert rim == pytest.approx(1.0, abs=0.08)


def test_groups_are_those_of_a_whole_problem():
    sizes = [esh.Size("large", area=3.0, count=30), esh.Size("range", area=(0.2, 0.9), count=400)]
    problem = esh.Problem(
        esh.Domain((40.0, 40.0)),
        [esh.BodyClass("a", sizes), esh.BodyClass("b", [esh.Size("one", area=1.0, count=77)])],
        seed=6,
    )
    tiles, whole = group_tiles(problem), group_bodies(problem)
    assert tiles.body_count == 507
    assert np.array_equal(tiles.class_index, whole.class_index)
    assert np.allclose(tiles.matrix, whole.matrix)
    assert np.array_equal(tiles.group_of(np.arange(507)), whole.body_group)
    assert np.allclose(tiles.areas(np.arange(507)), problem.body_areas())
    # In parts, every number comes once.
    for g in range(tiles.number):
        count = int(tiles.count[g])
        parts = [tiles.identities(g, a, min(a + 7, count)) for a in range(0, count, 7)]
        assert np.array_equal(np.sort(np.concatenate(parts)), np.arange(tiles.first[g], tiles.first[g + 1]))


def test_a_class_is_as_rare_as_in_the_whole_problem():
    """Of a size there are 4,096 samples at most; its rarity is that of all bodies."""
    classes = [esh.BodyClass(name, [esh.Size("s", area=0.01, count=n)]) for name, n in (("a", 81_920), ("b", 8_192))]
    matrix = group_tiles(esh.Problem(esh.Domain((40.0, 40.0)), classes)).matrix
    assert np.allclose(matrix, [[1.0, 0.5], [0.5, 0.5 + 5.0 + 0.25 * (10.0**SHARED_POWER - 1.0)]])


def test_large_bodies_push_small_ones_of_their_class_as_in_the_whole_problem():
    """Of 16,000 pieces of gravel there are 4,096 samples, and of 48 boulders all."""
    sizes = [esh.Size(*one) for one in (("boulder", 40.0, 48), ("stone", 3.0, 480), ("gravel", 0.09, 16_000))]
    rocks = esh.BodyClass("rock", sizes, room=1.2, gap=0.1)
    problem = esh.Problem(esh.Domain((120.0, 80.0)), [rocks], avoid_overlap=True)
    found = group_tiles(problem).matrix
    assert found[2, 2] > 1.5 * found[2, 0]
    assert np.allclose(found, group_bodies(problem).matrix)


def test_tiles_are_as_regular_as_asked(tmp_path):
    orders = []
    for regularity in (1.0, 0.0):
        folder = tmp_path / f"{regularity:g}"
        folder.mkdir()
        (folder / "even.toml").write_text(
            f"version = 1\nregularity = {regularity}\n[domain]\nsize = [64.0, 64.0]\n"
            '[[class]]\nname = "a"\ndensity = 1.0\n[[class.size]]\nname = "s"\narea = 0.2\ncount = 4096\n'
        )
        esh.solve_tiles(folder / "even.toml", folder / "out", device="cpu", ending=".npz", tile=32.0, workers=0)
        position = np.concatenate([np.load(path)["position"] for path in sorted((folder / "out").glob("tile-*.npz"))])
        way = position[spatial.cKDTree(position).query(position, 7)[1][:, 1:]] - position[:, None]
        orders.append(np.abs(np.exp(6j * np.arctan2(way[..., 1], way[..., 0])).mean(axis=1)).mean())
    assert orders[0] > orders[1] + 0.15


def test_groups_of_more_bodies_than_memory():
    size = esh.Size("range", area=(0.5, 2.0), count=3_000_000_000)
    tiles = group_tiles(esh.Problem(esh.Domain((1e6, 1e6)), [esh.BodyClass("a", [size])]))
    assert tiles.body_count == 3_000_000_000 and tiles.number == 24
    chosen = tiles.identities(23, 1_000_000, 1_000_005)
    assert (tiles.group_of(chosen) == 23).all() and len(np.unique(chosen)) == 5
    assert tiles.areas(np.array([0, 2_999_999_999])).tolist() == [0.5, 2.0]


def test_sums_over_cells_hold_all_of_a_part():
    image = np.random.default_rng(2).random((7, 11))
    # Between 3.2 and 6.7 of 10, in 8 cells: cell edges at 3.75, 5 and 6.25.
    first, sums = cell_sums(image, 0, (3.2, 6.7), 10.0, 8)
    assert first == 2 and sums.shape == (4, 11)
    assert np.allclose(sums.sum(axis=0), image.sum(axis=0))
    # The first pixel ends at 3.7, so that the first cell has a tenth of the second.
    assert np.allclose(sums[0], image[0] + 0.1 * image[1])
    first, sums = cell_sums(image, 1, (0.0, 10.0), 10.0, 11)
    assert first == 0 and np.allclose(sums, image)


def test_rare_lines_keep_to_their_density_and_off_obstacles(tmp_path):
    half = np.zeros((40, 80), np.float32)
    half[:, 40:] = 1.0
    line = esh.Line(length=2.0, direction=0.5)
    rare = esh.BodyClass("rare", [esh.Size("line", area=0.8, count=30, line=line)], half)
    many = esh.BodyClass("many", [esh.Size("dot", area=0.5, count=3200)])
    problem = esh.Problem(
        esh.Domain((80.0, 40.0)), [many, rare], seed=3, obstacles=[esh.Obstacle(disc=(60.0, 20.0, 7.0))]
    )
    bodies = solved(problem, tmp_path / "out", tile=33.0, steps=(60, 40, 40))
    own = bodies["class_index"] == 1
    x, y = bodies["position"][own].T
    assert own.sum() == 30 and x.min() >= 40.0
    assert np.hypot(x - 60.0, y - 20.0).min() >= 7.0 - 1e-3
    assert np.abs(bodies["angle"][own] - 0.5).max() < 0.35
    # Rare lines are stretched by their own charges. What pulls against that is handed on from window to window.
    assert bodies["length"][own].mean() == pytest.approx(2.0, rel=0.02)
    nearest = spatial.cKDTree(bodies["position"][own]).query(bodies["position"][own], 2)[0][:, 1]
    assert nearest.min() > 0.5 * math.sqrt((1600.0 - math.pi * 49.0) / 30)


def test_large_bodies_push_small_ones_as_in_one_solve_where_densities_are_read_by_window(tmp_path):
    density = np.zeros((64, 64), np.float32)
    density[:, :7] = 1.0
    np.save(tmp_path / "strip.npy", density)
    (tmp_path / "recipe.toml").write_text(
        """version = 1
avoid_overlap = true
domain = { size = [40.0, 40.0] }
[[class]]
name = "boulder"
density = "strip.npy"
size = [{ name = "s", area = 4.5, count = 10 }]
[[class]]
name = "tuft"
density = "strip.npy"
size = [{ name = "s", area = 0.03, count = 3000 }]
"""
    )
    whole = group_bodies(esh.read_recipe(tmp_path / "recipe.toml")).matrix
    run = TileRun(str(tmp_path / "recipe.toml"), str(tmp_path), None, (2, 2), (60, 20, 10), "cpu", ".npz", "")
    np.testing.assert_allclose(make_plan(run).groups.matrix, whole)


def test_nobody_strays_to_where_windows_fade(tmp_path):
    # Along an edge of the domain some would slide to a cut from both sides, and stand there in one place.
    problem = problem_of(esh.Size("any", area=(0.4, 1.6), count=4000), (63.0, 63.0))
    work = tmp_path / "out" / ".work"
    worst = []

    def look(state: esh.TileState) -> None:
        if state.name != "pass-1" or state.done < state.parts:
            return
        told = json.loads((tmp_path / "out" / "tiles.json").read_text())
        recipe = str(tmp_path / "out" / "problem" / "problem.toml")
        run = TileRun(
            recipe, str(tmp_path / "out"), None, tuple(told["tiles"]), tuple(told["steps"]), "cpu", ".npz", ""
        )
        plan = make_plan(run)
        started = PartBodies.joined([read_bodies(path) for path in sorted((work / "start").glob("*.npz"))])
        for path in sorted((work / "pass-1").glob("*.npz")):
            box, bodies = plan.layout.box(plan.passes[0].shift, int(path.stem)), read_bodies(path)
            margin = min(5.0 * max(plan.fine, math.sqrt(box.size[0] * box.size[1] / len(bodies))), 0.25 * min(box.size))
            before = started.position[np.searchsorted(started.identity, bodies.identity)]
            free = (box.depth(before) >= margin) & np.isfinite(box.depth(before))
            worst.append(float((box.depth(bodies.position)[free] / margin).min(initial=1.0)))

    solved(problem, tmp_path / "out", tile=31.0, steps=(40, 2, 2), progress=look)
    assert len(worst) == 9 and min(worst) > 0.5 - 1e-4


def test_ends_of_tiles_hold_areas_alike(tmp_path):
    # If small areas stood at one end of the curve through a tile, windows across tiles would carry bodies from one tile to the other.
    problem = problem_of(esh.Size("any", area=(0.4, 1.6), count=6400), (80.0, 80.0))
    bodies = solved(problem, tmp_path / "out", tile=40.0, steps=(30, 20, 20))
    quarter = (bodies["position"] > 40.0) @ np.array([1, 2])
    held = np.bincount(quarter, weights=bodies["area"])
    assert np.abs(held - 1600.0).max() < 5.0


def test_the_coarse_grid_counts_every_body_once():
    grid = CoarseGrid((20.0, 30.0), (15, 10))
    rng = np.random.default_rng(3)
    corners = [[0.0, 0.0], [20.0, 30.0], [20.0, 0.0]]
    position = np.concatenate([rng.uniform(0.0, (20.0, 30.0), (500, 2)), corners])
    group = rng.integers(0, 2, len(position))
    whole = np.zeros((2, 15, 10), np.int64)
    for chosen in (slice(0, 200), slice(200, None)):
        grid.deposit(position[chosen], group[chosen], 2).add_to(whole)
    assert np.allclose(whole.sum(axis=(1, 2)) / SCALE, np.bincount(group))
    at_once = np.zeros_like(whole)
    grid.deposit(position, group, 2).add_to(at_once)
    assert np.array_equal(whole, at_once)
    # The counts' mean place is the bodies', but for what the edges mirror.
    column = (np.arange(10) + 0.5) * 2.0
    assert (whole.sum(axis=(0, 1)) / SCALE) @ column / len(position) == pytest.approx(position[:, 0].mean(), abs=0.05)


@pytest.mark.parametrize("wavelength", [40.0, 20.0])
def test_the_warp_takes_back_a_wave_of_bodies(tmp_path, wavelength):
    # A hexagonal lattice, which the grid's cells do not fit, displaced by a wave along x.
    side, row = 120.0, math.sqrt(3.0) / 2.0
    y, x = np.mgrid[0:138, 0:120].astype(float)
    lattice = np.stack([x + 0.25 + 0.5 * (y % 2), (y + 0.5) * row], axis=-1).reshape(-1, 2)
    size = (side, 138 * row)
    wave = 0.2 * np.sin(2.0 * np.pi * lattice[:, 0] / wavelength)
    position = lattice + wave[:, None] * [1.0, 0.0]
    grid = CoarseGrid(size, (round(size[1] / 2.0), 60))
    count = np.zeros((1, *grid.shape), np.int64)
    grid.deposit(position, np.zeros(len(position), np.int64), 1).add_to(count)
    blur = 4.0
    flows = solve_flow(grid, count[0] / SCALE, np.full(grid.shape, len(position) / math.prod(grid.shape)), blur)
    for name, values in zip(("x", "y", "density"), flows, strict=True):
        np.save(tmp_path / f"{name}.npy", values)
    moved = displacement(tmp_path, grid, position, 1.0)
    inside = np.abs(lattice[:, 0] - 0.5 * side) < 45.0
    kept = math.exp(-0.5 * (2.0 * math.pi * blur / wavelength) ** 2)
    fit = -(moved[inside, 0] @ wave[inside]) / (wave[inside] @ wave[inside])
    assert fit == pytest.approx(kept, rel=0.05)
    left = moved[inside] + kept * wave[inside, None] * [1.0, 0.0]
    assert math.sqrt((left**2).mean()) < 0.1 * kept * 0.2


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_bodies_look_at_a_point_in_the_domain(tmp_path, boundary):
    look = esh.LookAt((50.0, 40.0, 0.0), 0.4, "y")
    classes = [
        esh.BodyClass("guest", [esh.Size("one", area=0.2, count=3000)], look_at=look),
        esh.BodyClass("stone", [esh.Size("one", area=0.2, count=600)]),
    ]
    problem = esh.Problem(esh.Domain((60.0, 60.0), boundary), classes, seed=4)
    bodies = solved(problem, tmp_path / "out", steps=(4, 2, 2))
    own = bodies["class_index"] == 0
    assert not bodies["angle"][~own].any()
    way = np.array([50.0, 40.0]) - bodies["position"][own]
    past = bodies["angle"][own] + 0.5 * math.pi - np.arctan2(way[:, 1], way[:, 0])
    past = (past + math.pi) % (2.0 * math.pi) - math.pi
    assert -0.4 <= past.min() < -0.39 and 0.39 < past.max() <= 0.4
    # Each looks past it by as much as in one solve.
    whole = esh.solve(problem, device="cpu", max_steps=2)
    way = np.array([50.0, 40.0]) - whole.position[whole.class_index == 0]
    alike = whole.angle[whole.class_index == 0] + 0.5 * math.pi - np.arctan2(way[:, 1], way[:, 0])
    assert np.allclose((alike + math.pi) % (2.0 * math.pi) - math.pi, past)


@pytest.mark.parametrize("apart", [False, True])
def test_outlines_that_look_are_parted_as_they_are_turned(tmp_path, apart):
    chair = esh.Footprints(esh.Footprint.rectangle(0.5, 0.3))
    size = esh.Size("one", area=0.15, count=20_000, footprint=chair)
    look = esh.LookAt((40.0, 140.0, 0.0), front="y")
    fixed = [esh.FixedBody((30.0, 30.0), "chair", "one", angle=1.25)]
    problem = esh.Problem(
        esh.Domain((80.0, 80.0)),
        [esh.BodyClass("chair", [size], look_at=look)],
        seed=4,
        avoid_overlap=apart,
        fixed=fixed,
        include_fixed=True,
    )
    bodies = solved(problem, tmp_path / "out", tile=40.0, steps=(12, 8, 8))
    assert bodies["angle"][-1] == 1.25
    way = np.array([40.0, 140.0]) - bodies["position"][:-1]
    past = bodies["angle"][:-1] + 0.5 * math.pi - np.arctan2(way[:, 1], way[:, 0])
    past = np.abs((past + math.pi) % (2.0 * math.pi) - math.pi)
    if not apart:
        assert past.max() < 1e-9
        return
    assert past.max() < 0.05 and np.median(past) < 0.01
    keys = ("position", "class_index", "size_index", "angle", "length", "width")
    assert overlaps_of(esh.Placement(problem, *(bodies[key] for key in keys)), launcher_of_process("cpu")).count == 0
