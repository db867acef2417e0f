"""Tiles of very large bodies among very small ones, and what tiles say of footprints that overlap."""

from __future__ import annotations

import json
import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.device.launcher import launcher_of_process
from esh.engine.quality.overlaps import overlaps_of
from esh.engine.tiles.groups import group_tiles
from esh.engine.tiles.layout import Layout
from esh.engine.tiles.plan import TileRun, make_plan
from esh.engine.tiles.reach import largest_reach, reaches
from scipy import spatial

BOULDER, GRAVEL = esh.Size("boulder", area=40.0, count=28), esh.Size("gravel", area=0.09, count=9000)
EXTENT = (120.0, 46.0)


def radius_of(size: esh.Size) -> float:
    return math.sqrt(size.area / math.pi)


def solved(problem: esh.Problem, folder: Path, **options) -> tuple[esh.TileState, dict[str, np.ndarray]]:
    options = {"device": "cpu", "ending": ".npz", "workers": 0} | options
    state = esh.solve_tiles(problem, folder, **options)
    return state, read(folder)


def read(folder: Path) -> dict[str, np.ndarray]:
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    keys = [key for key in parts[0].files if not key.endswith("_name")]
    whole = {key: np.concatenate([part[key] for part in parts]) for key in keys}
    order = np.argsort(whole["id"])
    assert np.array_equal(whole["id"][order], np.arange(len(order)))
    return {key: values[order] for key, values in whole.items()}


def as_placement(problem: esh.Problem, bodies: dict[str, np.ndarray]) -> esh.Placement:
    keys = ("position", "class_index", "size_index", "angle", "length", "width", "fixed", "variant", "scale")
    return esh.Placement(problem, **{key: bodies[key] for key in keys if key in bodies})


def counted(problem: esh.Problem, bodies: dict[str, np.ndarray]):
    return overlaps_of(as_placement(problem, bodies), launcher_of_process("cpu"))


def gaps_to_boulders(position: np.ndarray, area: np.ndarray) -> np.ndarray:
    """How far grains of gravel are from the nearest boulder [m]."""
    nearest = spatial.cKDTree(position[area == BOULDER.area]).query(position[area == GRAVEL.area])[0]
    return nearest - radius_of(BOULDER) - radius_of(GRAVEL)


def rocks(boundary: str = "open", seed: int = 1, *, classes: bool = False) -> esh.Problem:
    if classes:
        several = [esh.BodyClass("boulder", [BOULDER]), esh.BodyClass("gravel", [GRAVEL])]
    else:
        several = [esh.BodyClass("rock", [BOULDER, GRAVEL])]
    return esh.Problem(esh.Domain(EXTENT, boundary), several, seed=seed, avoid_overlap=True)


@pytest.mark.parametrize("seed", [2, 3])
def test_nobody_lies_under_a_large_body_beyond_a_cut(seed, tmp_path):
    _, bodies = solved(rocks(seed=seed), tmp_path / "out", tile=60.0, steps=(30, 25, 30))
    assert gaps_to_boulders(bodies["position"], bodies["area"]).min() > -1e-3


@pytest.mark.parametrize("classes", [False, True])
def test_large_bodies_keep_others_off_across_cuts_of_all_kinds(classes, tmp_path):
    state, bodies = solved(rocks("natural", classes=classes), tmp_path / "out", tile=60.0, steps=(20, 15, 20))
    assert gaps_to_boulders(bodies["position"], bodies["area"]).min() > -1e-3
    assert state.overlaps == 0


def test_large_bodies_keep_others_off_where_windows_wrap(tmp_path):
    # Tiles are longer along one axis, and so are their units.
    sizes = [esh.Size("boulder", area=12.0, count=36), esh.Size("gravel", area=0.03, count=18_000)]
    problem = esh.Problem(
        esh.Domain((64.0, 60.0), "periodic"), [esh.BodyClass("rock", sizes)], seed=2, avoid_overlap=True
    )
    state, bodies = solved(problem, tmp_path / "out", tile=30.0, steps=(15, 12, 15))
    assert state.tiles == (2, 2)
    assert counted(problem, bodies).count == 0
    assert state.overlaps == 0


def test_no_more_small_bodies_touch_large_ones_than_in_one_solve(tmp_path):
    _, bodies = solved(rocks(), tmp_path / "out", tile=60.0)
    at_once = esh.solve(rocks(), device="cpu")
    in_tiles, whole = (
        (gaps_to_boulders(position, area) < 0.05).sum()
        for position, area in ((bodies["position"], bodies["area"]), (at_once.position, at_once.area))
    )
    rim = BOULDER.count * 2.0 * math.pi * radius_of(BOULDER)
    spacing = math.sqrt(EXTENT[0] * EXTENT[1] / GRAVEL.count)
    # They stood in closed rows, .9 to a spacing.
    assert in_tiles * spacing / rim < 0.3
    assert in_tiles < whole + 0.2 * rim / spacing


def test_large_bodies_of_rare_classes_do_not_lie_in_each_other(tmp_path):
    classes = [
        esh.BodyClass("boulder", [BOULDER]),
        esh.BodyClass("rock", [esh.Size("rock", area=15.0, count=60)]),
        esh.BodyClass("gravel", [GRAVEL]),
    ]
    problem = esh.Problem(esh.Domain(EXTENT), classes, seed=1, avoid_overlap=True)
    state, bodies = solved(problem, tmp_path / "out", tile=60.0, steps=(20, 15, 20))
    assert counted(problem, bodies).count == 0
    assert state.overlaps == 0


def test_rare_large_bodies_make_way_for_fixed_ones(tmp_path):
    classes = [
        esh.BodyClass("house", [esh.Size("house", area=60.0, count=5)]),
        esh.BodyClass("boulder", [BOULDER]),
        esh.BodyClass("gravel", [esh.Size("gravel", area=0.09, count=8000)]),
    ]
    place = np.random.default_rng(3).random((5, 2)) * EXTENT
    fixed = esh.FixedBodies(place, "house", "house")
    problem = esh.Problem(esh.Domain(EXTENT), classes, seed=1, avoid_overlap=True, fixed=fixed)
    _, bodies = solved(problem, tmp_path / "out", tile=60.0, steps=(20, 15, 20))
    boulders = bodies["position"][bodies["class_index"] == 1]
    nearest = spatial.cKDTree(place).query(boulders)[0]
    assert nearest.min() > radius_of(BOULDER) + math.sqrt(60.0 / math.pi) - 0.01


def crowded(boundary: str) -> esh.Problem:
    """More than fits, of discs and outlines, some of them fixed; so many overlap, beside cuts too."""
    extent, many = ((120.0, 120.0), 2) if boundary == "periodic" else ((120.0, 60.0), 1)
    slab = esh.Size("slab", footprint=esh.Footprint.rectangle(4.0, 1.0), count=600 * many)
    dot = esh.Size("dot", area=0.5, count=8000 * many)
    classes = [esh.BodyClass("slab", [slab]), esh.BodyClass("dot", [dot])]
    # Those of fixed ones with each other do not count: these lie beside a cut.
    fixed = esh.FixedBodies(np.array([[59.8, 20.0], [60.2, 20.0]]), "dot", "dot")
    return esh.Problem(esh.Domain(extent, boundary), classes, seed=3, avoid_overlap=True, fixed=fixed)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_overlaps_of_all_tiles_are_those_of_the_whole(boundary, tmp_path, monkeypatch):
    problem = crowded(boundary)
    # Nobody is parted.
    monkeypatch.setattr("esh.engine.tiles.window._part", lambda *_: None)
    state, bodies = solved(problem, tmp_path / "out", tile=60.0, steps=(1, 1, 1))
    assert math.prod(state.tiles) > 1
    found = counted(problem, bodies)
    assert found.count > 100
    assert state.overlaps == found.count
    assert state.deepest_overlap == pytest.approx(found.deepest)
    assert state.notes[-1].startswith(f"{found.count} pairs of footprints still overlap, the deepest by ")
    index = json.loads((tmp_path / "out" / "index.json").read_text())
    assert index["overlaps"] == found.count
    assert index["notes"] == list(state.notes)
    again = esh.solve_tiles(
        problem, tmp_path / "out", device="cpu", ending=".npz", workers=0, tile=60.0, steps=(1, 1, 1)
    )
    assert (again.overlaps, again.deepest_overlap, again.notes) == (
        state.overlaps,
        state.deepest_overlap,
        state.notes,
    )


def test_footprints_that_may_overlap_are_not_counted(tmp_path):
    problem = esh.Problem(
        esh.Domain((60.0, 60.0)), [esh.BodyClass("dot", [esh.Size("dot", area=2.0, count=3600)])], seed=3
    )
    state, _ = solved(problem, tmp_path / "out", tile=30.0, steps=(5, 5, 5))
    assert state.overlaps is None
    assert "overlaps" not in json.loads((tmp_path / "out" / "index.json").read_text())


def test_tiles_are_long_enough_for_the_largest_body(tmp_path):
    problem = esh.Problem(
        esh.Domain((300.0, 60.0)),
        [
            esh.BodyClass(
                "rock", [esh.Size("boulder", area=400.0, count=4), esh.Size("gravel", area=0.01, count=40_000)]
            )
        ],
        avoid_overlap=True,
    )
    spacing, reach = math.sqrt(300.0 * 60.0 / 40_004), math.sqrt(400.0 / math.pi)
    least = 20.0 * spacing + 8.0 * reach
    assert least > 60.0 * spacing
    said = f"`tile` must be at least {least:.4g} m long, 20 spacings and 4 times the extent of the largest body; got 60"
    with pytest.raises(esh.ProblemError) as caught:
        esh.solve_tiles(problem, tmp_path / "out", tile=60.0, ending=".npz", device="cpu")
    assert str(caught.value) == said


def plan_of(problem: esh.Problem, folder: Path, tiles: tuple[int, int]):
    folder.mkdir()
    path = folder / "problem.toml"
    esh.write_recipe(path, problem)
    return make_plan(TileRun(str(path), str(folder), None, tiles, (5, 5, 5), "cpu", ".npz", folder.name))


def test_windows_see_around_themselves_only_where_bodies_reach_far(tmp_path):
    large = plan_of(rocks(), tmp_path / "large", (2, 1))
    assert large.rim == pytest.approx(radius_of(BOULDER))
    assert large.among_large
    assert plan_of(rocks(), tmp_path / "one", (1, 1)).rim == 0.0
    discs = [esh.Size("large", area=1.5, count=1500), esh.Size("small", area=0.4, count=4500)]
    alike = esh.Problem(esh.Domain((150.0, 56.0)), [esh.BodyClass("disc", discs)], avoid_overlap=True)
    plan = plan_of(alike, tmp_path / "alike", (2, 1))
    assert (plan.rim, plan.among_large) == (0.0, False)


def test_reaches_are_those_of_the_outlines_with_their_room():
    box = esh.Footprint.rectangle(4.0, 3.0)
    sizes = [
        esh.Size("box", footprint=esh.Footprints([box], room=1.2), count=10),
        esh.Size("disc", area=math.pi, count=10),
        esh.Size("rod", area=1.0, count=10, line=esh.Line(length=6.0, width=0.5)),
    ]
    problem = esh.Problem(esh.Domain((90.0, 90.0)), [esh.BodyClass("all", sizes, gap=0.2)], avoid_overlap=True)
    groups = group_tiles(problem)
    far = reaches(problem, groups, np.array([0, 10, 20]))
    assert far == pytest.approx([2.5 * 1.2 + 0.1, 1.0 + 0.1, 3.0 + 0.25 + 0.1])
    assert largest_reach(problem, groups) == pytest.approx(far.max())


@pytest.mark.parametrize("periodic", [False, True])
def test_what_lies_around_a_window(periodic):
    layout = Layout((90.0, 60.0), (3, 2), (900, 600), periodic)
    box = layout.box((0.0, 0.0), 0)
    assert layout.around(box, 0.0) is box
    wide = layout.around(box, 2.05)
    assert wide.size == pytest.approx((34.2, 34.2) if periodic else (32.1, 32.1))
    assert wide.cut == box.cut
    assert wide.rim == pytest.approx((2.1, 2.1, 2.1, 2.1) if periodic else (0.0, 2.1, 0.0, 2.1))
    # Depths are those from the window's own cuts, as far as the rim is wide.
    right = wide.low[0] + wide.size[0] - 2.1
    assert wide.depth(
        np.array([[right - 0.5, wide.low[1] + 20.0], [right + 0.5, wide.low[1] + 20.0]])
    ) == pytest.approx([0.5, -0.5])
    if periodic:
        # It begins within the domain, and sees what is in the window beyond its far edges.
        assert wide.low == pytest.approx((87.9, 57.9))
        assert wide.framed(np.array([[1.0, 1.0], [89.0, 59.0]])) == pytest.approx(
            np.array([[91.0, 61.0], [89.0, 59.0]])
        )
