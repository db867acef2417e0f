"""Tiles of bodies with shapes of their own: outlines that keep apart, and lines that bend."""

from __future__ import annotations

import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.tiles.groups import group_tiles
from scipy import spatial

# A plank, a wedge and a kite, about their centers.
PLANK = [(-1.0, -0.25), (1.0, -0.25), (1.0, 0.25), (-1.0, 0.25)]
WEDGE = [(-0.6, -0.4), (0.8, 0.0), (-0.6, 0.4)]
KITE = [(-0.5, 0.0), (0.0, -0.4), (0.9, 0.0), (0.0, 0.4)]


def solved(problem: esh.Problem, folder: Path, **options) -> dict[str, np.ndarray]:
    """The bodies of all tiles, by their numbers."""
    options = {"device": "cpu", "ending": ".npz", "tile": 30.0, "steps": (12, 8, 8), "workers": 0} | options
    esh.solve_tiles(problem, folder, **options)
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    assert len(parts) > 1
    named = ("class_name", "size_name")
    whole = {key: np.concatenate([part[key] for part in parts]) for key in parts[0].files if key not in named}
    order = np.argsort(whole["id"])
    assert np.array_equal(whole["id"][order], np.arange(len(order)))
    return {key: values[order] for key, values in whole.items()}


def polygons(bodies: dict[str, np.ndarray], outlines: list[esh.Footprint]) -> list:
    from shapely.geometry import Polygon

    cosine, sine = np.cos(bodies["angle"]), np.sin(bodies["angle"])
    result = []
    for k, (x, y) in enumerate(bodies["position"]):
        corners = outlines[bodies["variant"][k]].corners * bodies["scale"][k]
        turned = corners @ np.array([[cosine[k], sine[k]], [-sine[k], cosine[k]]])
        result.append(Polygon(turned + [x, y]))
    return result


def domain_of(size: esh.Size, cover: float, shape: float = 3.0) -> tuple[esh.Domain, float]:
    """A domain ``shape`` times as wide as high that outlines cover so much of, and the length of two tiles side by side."""
    high = math.sqrt(size.count * size.mean_area / cover / shape)
    return esh.Domain((shape * high, high)), 0.5 * shape * high


def overlapping(shapes: list) -> int:
    """Pairs that share more than a thousandth of the smaller one."""
    from shapely.strtree import STRtree

    first, second = STRtree(shapes).query(shapes, predicate="intersects")
    pairs = [(a, b) for a, b in zip(first.tolist(), second.tolist(), strict=True) if a < b]
    return sum(shapes[a].intersection(shapes[b]).area > 1e-3 * min(shapes[a].area, shapes[b].area) for a, b in pairs)


def test_outlines_keep_apart_across_all_cuts(tmp_path):
    pytest.importorskip("shapely")
    outlines = [esh.Footprint(PLANK), esh.Footprint(WEDGE), esh.Footprint(KITE)]
    size = esh.Size("one", count=4600, footprint=esh.Footprints(outlines, weights=[2.0, 1.0, 1.0], scale_jitter=0.1))
    domain, tile = domain_of(size, 0.6, 3.3)
    problem = esh.Problem(domain, [esh.BodyClass("thing", [size])], seed=3, avoid_overlap=True)
    bodies = solved(problem, tmp_path / "out", tile=tile, steps=(20, 12, 12))
    shapes = polygons(bodies, outlines)
    assert sum(shape.area for shape in shapes) > 0.59 * domain.area
    assert overlapping(shapes) == 0
    # What is said of each is what it has, and all kinds of outlines are everywhere, as often as asked.
    assert np.allclose([shape.area for shape in shapes], bodies["area"], rtol=1e-5)
    assert np.bincount(bodies["variant"]) / 4600 == pytest.approx([0.5, 0.25, 0.25], abs=0.03)
    assert bodies["scale"].min() >= 0.9 and bodies["scale"].max() <= 1.1
    place = bodies["position"]
    assert (place >= 0.0).all() and (place <= problem.rectangle.size).all()
    # As even as one solve of the same, near the cuts, too.
    whole = esh.solve(problem, device="cpu")
    density = [
        np.histogram2d(*p.T, bins=(33, 10), range=[(0, x) for x in domain.size])[0] for p in (place, whole.position)
    ]
    assert density[0].std() < 1.25 * density[1].std()


def test_outlines_that_differ_in_area_are_mixed_everywhere(tmp_path):
    outlines = [esh.Footprint(KITE), esh.Footprint([(x * 2.0, y * 2.0) for x, y in PLANK])]
    size = esh.Size("one", count=4000, footprint=esh.Footprints(outlines, scale_jitter=0.2))
    side = math.sqrt(4000 * size.mean_area / 0.3)
    problem = esh.Problem(esh.Domain((side, side)), [esh.BodyClass("thing", [size])], seed=5)
    groups = group_tiles(problem)
    assert groups.number > 1 and (np.diff(groups.mean_area) > 0.0).all()
    bodies = solved(problem, tmp_path / "out", tile=side / 2.0)
    assert np.bincount(bodies["variant"]).tolist() == [2000, 2000]
    assert bodies["area"].mean() == pytest.approx(size.mean_area, rel=0.02)
    for left in (0.0, 0.5):
        for low in (0.0, 0.5):
            here = (
                (bodies["position"] / side >= [left, low]) & (bodies["position"] / side < [left + 0.5, low + 0.5])
            ).all(axis=1)
            assert bodies["variant"][here].mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("turn", ["random", 0.5])
def test_outlines_keep_the_turn_that_they_have(tmp_path, turn):
    size = esh.Size("one", count=2000, footprint=esh.Footprints([esh.Footprint(WEDGE)], turn=turn))
    domain, tile = domain_of(size, 0.4, 8.0)
    problem = esh.Problem(domain, [esh.BodyClass("thing", [size])], seed=5, avoid_overlap=True)
    bodies = solved(problem, tmp_path / "out", tile=tile)
    assert overlapping(polygons(bodies, [esh.Footprint(WEDGE)])) == 0
    if turn == "random":
        turned = group_tiles(problem).outlines(bodies["id"]).turn
        assert np.allclose(np.cos(bodies["angle"] - turned), 1.0)
        assert abs(np.exp(1j * bodies["angle"]).mean()) < 0.06
    else:
        assert np.allclose(bodies["angle"], 0.5)


def test_any_number_of_workers_makes_the_same_outlines(tmp_path):
    size = esh.Size("one", count=1500, footprint=esh.Footprints([esh.Footprint(KITE)]))
    domain, tile = domain_of(size, 0.45, 12.0)
    problem = esh.Problem(domain, [esh.BodyClass("thing", [size])], seed=5, avoid_overlap=True)
    made = []
    for workers in (0, 2):
        folder = tmp_path / str(workers)
        solved(problem, folder, tile=tile, steps=(6, 4, 4), workers=workers)
        made.append({path.name: path.read_bytes() for path in sorted(folder.glob("tile-*"))})
    assert made[0] == made[1]


def bent_problem(count: int) -> esh.Problem:
    v, u = np.mgrid[0:64, 0:64] / 63.0 * 2.0 * math.pi
    angle = 0.8 * np.sin(2.0 * u) * np.cos(2.0 * v)
    flow = np.stack([np.cos(angle), np.sin(angle)], axis=-1).astype(np.float32)
    line = esh.Line(length=2.2, direction=flow, charges=7, straightness=0.1)
    side = math.sqrt(count)
    domain = esh.Domain((side, side))
    return esh.Problem(domain, [esh.BodyClass("hair", [esh.Size("one", area=0.3, count=count, line=line)])], seed=9)


def shape_of(bends: np.ndarray) -> np.ndarray:
    """How far lines are bent: farthest point from the straight line between their ends over that, shape ``[n]``."""
    way = bends[:, -1] - bends[:, 0]
    chord = np.linalg.norm(way, axis=1)
    offset = bends - bends[:, :1]
    across = (way[:, None, 0] * offset[..., 1] - way[:, None, 1] * offset[..., 0]) / chord[:, None]
    return np.abs(across).max(axis=1) / chord


def test_lines_bend_as_in_one_solve(tmp_path):
    problem = bent_problem(4800)
    bodies = solved(problem, tmp_path / "out", tile=34.6, steps=(40, 30, 30))
    whole = esh.solve(problem, device="cpu")
    bends = bodies["bends"]
    assert bends.shape == (4800, 7, 2) and np.isfinite(bends).all()
    # The points lie around the body's place, and along its length.
    assert np.abs(bends.mean(axis=1) - bodies["position"]).max() < 0.5
    chord = np.linalg.norm(bends[:, -1] - bends[:, 0], axis=1)
    assert chord == pytest.approx(bodies["length"], rel=0.2)
    assert np.median(shape_of(bends)) == pytest.approx(np.median(shape_of(whole.bends)), rel=0.15)
    assert bodies["length"].mean() == pytest.approx(whole.length.mean(), rel=0.03)
    # Those near cuts are bent as others are.
    side = problem.rectangle.size[0]
    near = (np.abs(bodies["position"] - 0.5 * side) < 2.0).any(axis=1)
    inner = ((bodies["position"] > 4.0) & (bodies["position"] < side - 4.0)).all(axis=1)
    assert shape_of(bends[near & inner]).mean() == pytest.approx(shape_of(bends[~near & inner]).mean(), rel=0.15)
    # And their charges are as even as those of one solve.
    points, others = bends.reshape(-1, 2), whole.bends.reshape(-1, 2)
    counts = [np.histogram2d(*p.T, bins=18, range=[(2.0, side - 2.0)] * 2)[0] for p in (points, others)]
    assert counts[0].std() < 1.15 * counts[1].std()
    nearest = [spatial.cKDTree(p).query(p, 2)[0][:, 1] for p in (bodies["position"], whole.position)]
    assert np.percentile(nearest[0], 5) > 0.9 * np.percentile(nearest[1], 5)


def test_bends_are_in_geoparquet_too(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    problem = bent_problem(4800)
    expected = solved(problem, tmp_path / "npz", tile=34.6, steps=(6, 4, 4))["bends"]
    esh.solve_tiles(problem, tmp_path / "out", device="cpu", tile=34.6, steps=(6, 4, 4), workers=0)
    tables = [parquet.read_table(path) for path in sorted((tmp_path / "out").glob("*.parquet"))]
    identity = np.concatenate([table["id"].to_numpy() for table in tables])
    bends = np.concatenate([np.array(table["bends"].to_pylist()) for table in tables])
    assert np.array_equal(bends[np.argsort(identity)].reshape(expected.shape), expected)
    back = esh.load_placement(sorted((tmp_path / "out").glob("*.parquet"))[0])
    assert len(back.position) == len(tables[0])


def test_the_gap_of_a_class_is_kept_across_cuts(tmp_path):
    size = esh.Size("disc", area=0.3, count=4000)
    body_class = esh.BodyClass("a", [size], gap=0.25)
    problem = esh.Problem(esh.Domain((126.0, 32.0)), [body_class], seed=3, avoid_overlap=True)
    bodies = solved(problem, tmp_path / "out", tile=63.0, steps=(10, 8, 8))
    nearest = spatial.cKDTree(bodies["position"]).query(bodies["position"], 2)[0][:, 1]
    assert nearest.min() > (2.0 * math.sqrt(0.3 / math.pi) + 0.25) * (1.0 - 1e-3)


def test_classes_that_may_overlap_do_in_tiles_too(tmp_path):
    pytest.importorskip("shapely")
    disc = esh.Size("one", count=3600, footprint=esh.Footprint.disc(0.5))
    domain, tile = domain_of(disc, 0.5)
    classes = [esh.BodyClass(name, [disc]) for name in "ab"]
    problem = esh.Problem(domain, classes, esh.Balance(non_overlap=np.eye(2)), avoid_overlap=True, seed=3)
    bodies = solved(problem, tmp_path / "out", tile=tile)
    tree = spatial.cKDTree(bodies["position"])
    pairs = tree.query_pairs(0.998, output_type="ndarray")
    same = bodies["class_index"][pairs[:, 0]] == bodies["class_index"][pairs[:, 1]]
    assert same.sum() == 0 and len(pairs) > 300
