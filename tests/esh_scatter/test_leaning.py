"""Objects whose outlines keep apart on the ground, and that meet above it because they lean: the report counts them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("scipy.optimize")

import esh  # noqa: E402
from esh.esh_scatter.properties.scene import active_scatter  # noqa: E402
from esh.esh_scatter.result import words  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from leaning_scene import GROUNDS, box, ground, meeting, placed_hulls, tree


def classes(count: int = 180, **more) -> list[esh.ScatterClass]:
    return [
        esh.ScatterClass("tree", [esh.ScatterSize("all", count, tree(), **more)]),
        esh.ScatterClass("box", [esh.ScatterSize("all", count, box(), **more)]),
    ]


def scattered(target: bpy.types.Object, asked: list[esh.ScatterClass], **settings) -> esh.ScatterResult:
    return esh.scatter(target, asked, device="cpu", avoid_overlap=True, seed=2, **settings)


@pytest.mark.usefixtures("bare_file")
@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("flat", {"tilt": 0.4}),
        ("bumps", {"align_to_normal": 1.0}),
        ("bumps", {"align_to_normal": 0.5, "tilt": 0.2}),
        ("bumps", {"align_to_normal": 1.0, "surface": "whole"}),
        ("slope", {"align_to_normal": 0.0, "surface": "whole"}),
        ("slope", {"align_to_normal": 0.3, "tilt": 0.3, "scale_jitter": 0.3, "offset": 0.2}),
    ],
)
def test_what_leans_into_each_other_is_counted_as_blender_shows_it(kind, settings):
    result = scattered(ground(GROUNDS[kind]), classes(), **settings)
    report = result.report
    assert report.overlaps == 0 and report.leaning == meeting(placed_hulls(result.object)) > 5
    marked = read_attribute(result.object.data, "overlapping")
    assert sorted(report.leaning_bodies) == np.flatnonzero(marked).tolist()
    assert set(report.leaning_pair) <= set(report.leaning_bodies)
    assert 0.0 < report.deepest_leaning < 0.6
    assert f"{report.leaning} pairs of objects lean into each other" in str(report)


@pytest.mark.usefixtures("bare_file")
@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("flat", {"align_to_normal": 1.0}),
        ("flat", {"align_to_normal": 1.0, "surface": "whole"}),
        ("slope", {"align_to_normal": 1.0}),
        ("slope", {"align_to_normal": 1.0, "surface": "whole"}),
        ("bumps", {"align_to_normal": 0.0}),
        ("flat", {"align_to_normal": 0.0, "tilt": 0.4, "avoid_overlap": False}),
    ],
)
def test_where_outlines_tell_all_nothing_is_compared(monkeypatch, kind, settings):
    """Upright, or straight on a plane; and where nobody asked for bodies to be apart."""
    monkeypatch.setattr("esh.esh_scatter.result.leaning.meeting_pairs", None)
    result = esh.scatter(ground(GROUNDS[kind]), classes(), device="cpu", **{"avoid_overlap": True, **settings})
    assert result.report.leaning is None and result.report.leaning_bodies == ()
    if result.report.overlaps == 0:
        assert meeting(placed_hulls(result.object)) == 0
        assert "no overlap ·" in words.summary(result.report.to_dict())


@pytest.mark.usefixtures("bare_file")
def test_what_leans_alike_on_a_slope_can_meet_all_the_same():
    """It is parted as it is seen from above, and meets as it is seen along its own axis."""
    target, asked = ground(GROUNDS["slope"]), classes(200)
    results = [
        esh.scatter(target, asked, device="cpu", avoid_overlap=True, seed=seed, align_to_normal=0.5, name=str(seed))
        for seed in range(3)
    ]
    found = [result.report.leaning for result in results]
    assert found == [meeting(placed_hulls(result.object)) for result in results] and any(found)
    assert not any(result.report.overlaps for result in results)


@pytest.mark.usefixtures("bare_file")
def test_classes_that_may_overlap_and_given_footprints_are_not_compared():
    target, asked = ground(GROUNDS["flat"]), classes()
    every = scattered(target, asked, tilt=0.4).report.leaning
    apart = [[1.0, 0.0], [0.0, 1.0]]
    alone = scattered(target, asked, tilt=0.4, non_overlap=apart, result=None)
    index, pairs = alone.placement.class_index, alone.report.leaning_pair
    assert every > 5 and alone.report.leaning_bodies and index[pairs[0]] == index[pairs[1]]
    given = scattered(target, classes(area=0.4), tilt=0.4)
    assert given.report.leaning is None, "somebody said what these take"


@pytest.mark.usefixtures("bare_file")
def test_pairs_that_overlap_on_the_ground_are_not_counted_twice():
    """So many that they cannot fit: nearly all that meet do so on the ground."""
    result = scattered(ground(GROUNDS["flat"], size=7.0), classes(120), tilt=0.1, max_steps=10)
    report, all_pairs = result.report, meeting(placed_hulls(result.object))
    assert report.overlaps > 20 and report.leaning > 0
    # A pair whose outlines overlap can miss each other above the ground.
    assert report.leaning < all_pairs <= report.overlaps + report.leaning


@pytest.fixture
def scatter(empty_file):
    """Leaning trees in the sidebar's settings, scattered."""
    target, item = ground(GROUNDS["flat"], size=10.0), tree()
    bpy.ops.esh.scatter_add()
    made = active_scatter(bpy.context)
    made.target, made.avoid_overlap, made.seed, made.device = target, True, 3, "CPU"
    body_class = made.classes[0] if len(made.classes) else made.add_class()
    body_class.sizes[0].source_object, body_class.align_to_normal, body_class.tilt = item, 0.0, 0.5
    body_class.sizes[0].count = 130
    bpy.ops.esh.scatter()
    return made


def test_the_status_says_what_leans_and_the_buttons_find_it(scatter):
    report = scatter.report_as_it_stands()
    count = report["leaning"]
    assert count > 1 and report["overlaps"] == 0 and "leaning_bodies" not in report
    told = words.summary(report)
    assert f"no overlap on the ground · {count} pairs lean into each other" in told
    assert not words.has_trouble(report) and words.leans(report)
    assert bpy.ops.esh.frame_overlap() == {"FINISHED"}
    pair = [scatter.result.data.vertices[number].co for number in report["leaning_pair"]]
    assert bpy.context.scene.cursor.location[:] == pytest.approx(((pair[0] + pair[1]) / 2.0)[:], abs=1e-5)
    assert bpy.ops.esh.select_overlapping() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    chosen = [vertex.index for vertex in scatter.result.data.vertices if vertex.select]
    assert set(report["leaning_pair"]) <= set(chosen) and 2 <= len(chosen) <= 2 * count


def test_a_run_after_which_all_stand_upright_says_no_overlap(scatter):
    scatter.classes[0].tilt = 0.0
    bpy.ops.esh.scatter()
    report = scatter.report_as_it_stands()
    assert report["leaning"] is None and "· no overlap ·" in words.summary(report)
    assert "overlapping" not in scatter.result.data.attributes and not bpy.ops.esh.frame_overlap.poll()


def test_reports_of_before_say_nothing_of_what_leans(scatter):
    told = json.loads(scatter.report_json)
    scatter.report_json = json.dumps({name: value for name, value in told.items() if "lean" not in name})
    report = scatter.report_as_it_stands()
    assert "· no overlap ·" in words.summary(report) and words.leaning(report) == ""


def test_live_counts_again_whenever_it_has_followed(live_file, follow):
    target, item = ground(GROUNDS["flat"], size=10.0), tree()
    made = bpy.context.scene.esh_scatter.add_scatter(target)
    body_class = made.add_class()
    body_class.sizes[0].source_object, body_class.sizes[0].count = item, 130
    body_class.align_to_normal, body_class.tilt = 0.0, 0.5
    made.device, made.max_steps, made.seed = "CPU", 40, 3
    made.live = True
    follow()
    first = made.report_as_it_stands()
    assert first["leaning"] > 0 and words.leaning(first).endswith("pairs")
    body_class.tilt = 0.0
    follow()
    assert made.report_as_it_stands()["leaning"] is None
