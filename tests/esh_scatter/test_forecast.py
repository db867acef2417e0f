"""Overlap: said before a run where it cannot be avoided, with counts that fit at a click; shown after it where there is any."""

import json
import math
import time

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.editing import forecast  # noqa: E402
from esh.esh_scatter.result import words  # noqa: E402
from esh.esh_scatter.result.attributes import OVERLAPPING  # noqa: E402
from esh.esh_scatter.sidebar import panels  # noqa: E402
from esh.esh_scatter.targets import checksums  # noqa: E402


@pytest.fixture(autouse=True)
def registered():
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    yield
    registration.unregister()


def flat(name, length, width):
    x, y = 0.5 * length, 0.5 * width
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.update()
    return item


@pytest.fixture
def scatter():
    """Boxes of 0.48 m² on 100 m²."""
    made = bpy.context.scene.esh_scatter.add_scatter(flat("Ground", 10.0, 10.0))
    made.device, made.max_steps = "CPU", 20
    body_class = made.add_class()
    body_class.name = "Box"
    body_class.sizes[0].source_object = flat("Box", 0.8, 0.6)
    body_class.sizes[0].count = 270
    return made


def cover_of(scatter):
    return forecast.forecast(scatter, bpy.context.scene)


def test_what_cannot_fit_is_said_before_a_run(scatter):
    cover = cover_of(scatter)
    assert cover.covered == pytest.approx(270 * 0.48 / 100.0, rel=1e-6)
    assert 0.7 < cover.fits < 0.82
    assert words.cover(cover) == (f"Overlap is unavoidable: it covers 130% of the ground, about {cover.fits:.0%} fits")
    scatter.classes[0].sizes[0].count = 100
    cover = cover_of(scatter)
    assert words.cover(cover) == ""
    # Room around them counts.
    scatter.classes[0].room = 1.6
    assert cover_of(scatter).covered == pytest.approx(0.48 * 1.6**2, rel=1e-6)
    scatter.classes[0].room, scatter.classes[0].gap = 1.0, 0.2
    grown = 0.48 + 2.8 * 0.1 + math.pi * 0.01
    assert cover_of(scatter).covered == pytest.approx(grown, rel=1e-6)
    scatter.avoid_overlap = False
    assert cover_of(scatter) is None


def work():
    """Let the timer work, as often as it asks for that."""
    while forecast._work() is not None:
        time.sleep(0.01)


def test_drawing_does_not_wait_and_knows_what_was_worked_out(scatter, monkeypatch):
    scene = bpy.context.scene
    assert forecast.known(scatter, scene) is None
    forecast.look(scene, 0)
    assert forecast.known(scatter, scene).covered > 1.0
    scatter.classes[0].sizes[0].count = 271
    assert forecast.known(scatter, scene) is None
    with monkeypatch.context() as patched:
        patched.setattr(forecast.live, "is_busy", lambda *_: True)
        assert forecast._work() is None and forecast.known(scatter, scene) is None, "what Live follows, it says"
    work()
    assert forecast.known(scatter, scene).covered == pytest.approx(271 * 0.0048)
    # What is changed meanwhile is worked out after that.
    scatter.classes[0].sizes[0].count = 300
    assert forecast.known(scatter, scene) is None and forecast._work() is not None
    scatter.classes[0].sizes[0].count = 200
    assert forecast.known(scatter, scene) is None
    work()
    assert forecast.known(scatter, scene).covered == pytest.approx(200 * 0.0048)
    # Scatters of other numbers and scenes are others, and what is gone is nothing.
    assert forecast.look(scene, 7) is None
    assert forecast.known(scene.esh_scatter.add_scatter(None), scene) is None
    work()
    other = bpy.data.scenes.new("Other")
    forecast.known(other.esh_scatter.add_scatter(None), other)
    bpy.data.scenes.remove(other)
    work()


@pytest.mark.parametrize("kind", ["SIZES", "TOTAL", "PER_AREA", "DISTANCE", "SHARE"])
def test_a_click_scales_counts_to_fit(scatter, kind):
    body_class = scatter.classes[0]
    second = body_class.add_size()
    second.source_object, second.count = bpy.data.objects["Box"], 30
    body_class.count_kind, body_class.total, body_class.per_area, body_class.distance = kind, 300, 3.0, 0.6
    body_class.cover_share = 1.0
    before = cover_of(scatter)
    assert before.covered > before.fits
    assert bpy.ops.esh.counts_to_fit() == {"FINISHED"}
    cover = cover_of(scatter)
    assert 0.9 * cover.fits < cover.covered <= cover.fits
    assert body_class.sizes[0].count == (
        270 if kind != "SIZES" else round(270 * 0.98 * before.fits / before.covered - 0.5)
    )
    assert bpy.ops.esh.counts_to_fit() == {"CANCELLED"}
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert scatter.report["overlaps"] == 0


def test_between_obstacles_more_room_is_left(scatter):
    scatter.obstacles.add().item = flat("Rock", 2.0, 2.0)
    bpy.context.view_layer.update()
    before = cover_of(scatter)
    assert before.too_much and bpy.ops.esh.counts_to_fit() == {"FINISHED"}
    assert scatter.classes[0].sizes[0].count == round(270 * 0.95 * before.fits / before.covered - 0.5)


def test_what_cannot_be_less_is_not_said_to_be_scaled(scatter):
    size = scatter.classes[0].sizes[0]
    size.source_object, size.count = flat("Too Large", 14.0, 12.0), 1
    assert cover_of(scatter).too_much
    assert bpy.ops.esh.counts_to_fit() == {"CANCELLED"} and size.count == 1


def test_classes_that_are_muted_keep_their_counts(scatter):
    other = scatter.add_class()
    other.sizes[0].source_object, other.sizes[0].count, other.mute = bpy.data.objects["Box"], 500, True
    bpy.ops.esh.counts_to_fit()
    assert other.sizes[0].count == 500 and scatter.classes[0].sizes[0].count < 170


def test_overlapping_objects_are_selected_and_the_worst_place_is_found(scatter):
    assert not bpy.ops.esh.select_overlapping.poll() and not bpy.ops.esh.frame_overlap.poll()
    bpy.ops.esh.scatter()
    report, result = scatter.report, scatter.result
    assert report["overlaps"] > 0 and "overlapping" not in json.loads(scatter.report_json)
    assert bpy.ops.esh.frame_overlap() == {"FINISHED"}
    place = np.array(bpy.context.scene.cursor.location)[:2]
    np.testing.assert_allclose(place + 5.0, report["deepest_place"], atol=1e-4)
    overlaps = np.zeros(len(result.data.vertices), bool)
    result.data.attributes[OVERLAPPING].data.foreach_get("value", overlaps)
    assert 2 <= overlaps.sum() <= 2 * report["overlaps"] and overlaps[report["deepest_pair"]].all()
    assert bpy.ops.esh.select_overlapping() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH" and bpy.context.object == result
    bpy.ops.object.mode_set(mode="OBJECT")
    selected = np.zeros(len(result.data.vertices), bool)
    result.data.vertices.foreach_get("select", selected)
    np.testing.assert_array_equal(selected, overlaps)
    # Where nothing overlaps any more there is nothing to show.
    bpy.ops.esh.counts_to_fit()
    bpy.ops.esh.scatter()
    assert scatter.report["overlaps"] == 0 and OVERLAPPING not in scatter.result.data.attributes
    assert not bpy.ops.esh.select_overlapping.poll() and not bpy.ops.esh.frame_overlap.poll()


def test_overlaps_on_a_whole_surface_are_found_too(scatter):
    scatter.surface = "WHOLE"
    bpy.ops.esh.scatter()
    report = scatter.report
    assert report["overlaps"] > 0 and report["deepest_overlap"] > 0.0
    assert bpy.ops.esh.frame_overlap() == {"FINISHED"}
    np.testing.assert_allclose(bpy.context.scene.cursor.location, report["deepest_place"], atol=1e-4)
    assert bpy.ops.esh.select_overlapping() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")


def test_what_automatic_takes_is_known_before_a_run_and_after_it(scatter):
    """Of what is drawn it is read from what the last run has kept, or a forecast; nothing else is looked at."""
    scene = bpy.context.scene

    def told():
        return panels._what_is_automatic(scene, scatter)

    scatter.surface, scatter.classes[0].sizes[0].count = "AUTO", 20
    assert told() == "Automatic: the run will tell"
    work()
    assert told() == "Automatic: from above"
    forecast.detach()
    scatter.avoid_overlap = False
    assert told() == "Automatic: the run will tell", "there is no forecast"
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert told() == "Automatic: from above"
    scatter.classes[0].sizes[0].count = 21
    assert scatter.outdated and told() == "Automatic: from above", "counts do not change that"
    # Folded over, half of it is below the other half.
    ground = scatter.target.data
    ground.vertices[1].co = ground.vertices[2].co = (-5.0, 0.0, 5.0)
    ground.update()
    bpy.context.view_layer.update()
    with checksums.now():
        assert told() == "Automatic: the run will tell"
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert told() == "Automatic: whole surface"
    scatter.surface = "WHOLE"
    assert scatter.stands_on_whole() is None, "it was asked for"
