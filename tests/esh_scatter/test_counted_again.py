"""What leans into each other is counted again by itself, once objects stand otherwise than when the run counted."""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("scipy")

from esh.esh_scatter.properties.scene import active_scatter  # noqa: E402
from esh.esh_scatter.result import leaning_now, words  # noqa: E402
from esh.esh_scatter.result.display import our_modifier, set_inputs  # noqa: E402
from esh.esh_scatter.result.leaning_now import LEANING_OF  # noqa: E402
from esh.esh_scatter.solving import counted_again, running  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from drawn_panels import draw_all
    from leaning_scene import GROUNDS, box, ground, meeting, placed_hulls, tree


def scattered(**settings):
    """Trees on a plane in the sidebar's settings."""
    target, item = ground(GROUNDS["flat"], size=10.0), tree()
    bpy.ops.esh.scatter_add()
    made = active_scatter(bpy.context)
    made.target, made.avoid_overlap, made.seed, made.device, made.max_steps = target, True, 3, "CPU", 60
    body_class = made.classes[0] if len(made.classes) else made.add_class()
    body_class.sizes[0].source_object, body_class.align_to_normal, body_class.tilt = item, 0.0, 0.5
    body_class.sizes[0].count = 130
    for name, value in settings.items():
        setattr(body_class, name, value)
    bpy.ops.esh.scatter()
    return made


@pytest.fixture
def scatter(empty_file):
    """Trees that lean."""
    return scattered()


def shown_pairs():
    """Pairs that meet as Blender shows them."""
    bpy.context.view_layer.update()
    return meeting(placed_hulls(active_scatter(bpy.context).result))


def told(scatter):
    return scatter.report_as_it_stands()


def tilt(scatter):
    scatter.classes[0].tilt = 0.75


def align_and_offset(scatter):
    scatter.classes[0].offset, scatter.classes[0].align_to_normal = 0.4, 0.5


def vary(scatter):
    scatter.classes[0].scale_jitter = 0.5


def place_higher_ones(scatter):
    scatter.classes[0].sizes[0].source_object = tree("Fir", height=4.0)


def sculpt(scatter):
    top = scatter.classes[0].sizes[0].source_object.data
    top.vertices[16].co.z = 3.5
    top.update()


def move_by_hand(scatter):
    mesh = scatter.result.data
    first, second = (mesh.vertices[k] for k in (0, 60))
    first.co = second.co
    first.co.x += 0.1


def enlarge(scatter):
    set_inputs(our_modifier(scatter.result), {"Scale": 1.4})


@pytest.mark.parametrize("change", [tilt, align_and_offset, vary, place_higher_ones, sculpt, move_by_hand, enlarge])
def test_what_is_shown_otherwise_is_counted_as_blender_shows_it(scatter, change):
    before, kept, points = told(scatter), scatter.report_json, scatter.result.data.get(LEANING_OF)
    assert before["leaning"] == shown_pairs() > 0 and words.COUNTED_AGAIN not in before
    change(scatter)
    report = told(scatter)
    assert report[words.COUNTED_AGAIN] and report["leaning"] == shown_pairs() > 0
    assert report["leaning"] != before["leaning"] or report["leaning_pair"] != before["leaning_pair"]
    assert words.leaning(report) == f"{report['leaning']} pairs" and words.worst(report)[1] == report["deepest_leaning"]
    assert scatter.report_json == kept and scatter.result.data.get(LEANING_OF) == points, "nothing is written"
    assert bpy.ops.esh.frame_overlap() == {"FINISHED"}
    pair = [scatter.result.data.vertices[number].co for number in report["leaning_pair"]]
    assert bpy.context.scene.cursor.location[:] == pytest.approx(((pair[0] + pair[1]) / 2.0)[:], abs=1e-5)
    assert bpy.ops.esh.select_overlapping() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [one.index for one in scatter.result.data.vertices if one.select] == sorted(report["leaning_bodies"])


def test_the_words_say_it_beside_what_has_changed(scatter):
    scatter.classes[0].offset = 0.3
    report = told(scatter)
    assert not scatter.changes() and f"{report['leaning']} pairs lean into each other" in words.summary(report)
    assert words.leans_by_now(report) == f"{report['leaning']} pairs lean into each other"
    scatter.classes[0].offset = 0.0
    assert words.leans_by_now(told(scatter)) == "" and told(scatter) == scatter.report, "as it was"
    enlarge(scatter)
    assert f"· {told(scatter)['leaning']} pairs meet at Scale 1.4 ·" in words.summary(told(scatter))
    assert "on the ground" not in words.summary(told(scatter))
    set_inputs(our_modifier(scatter.result), {"Scale": 1.0})
    # Everything is carried away together.
    scatter.result.location.z = 4.0
    bpy.context.view_layer.update()
    assert told(scatter) == scatter.report


def test_the_status_says_it_beside_a_change_where_the_line_has_room(scatter):
    """Nothing moves away below the mouse when the count comes."""
    tilt(scatter)
    pairs = told(scatter)["leaning"]
    changed = f"Changed: {', '.join(scatter.changes())}"
    assert f"{changed} · {pairs} pairs lean into each other" in draw_all(800)
    narrow = draw_all(230)
    assert changed in narrow and not any("lean into" in line for line in narrow) and f"{pairs} pairs" in narrow


@pytest.mark.usefixtures("empty_file")
def test_what_stood_upright_leans_once_it_is_tilted():
    scatter = scattered(tilt=0.0)
    assert scatter.report["leaning"] is None and told(scatter) == scatter.report
    assert not bpy.ops.esh.frame_overlap.poll()
    scatter.classes[0].tilt = 0.5
    assert told(scatter)["leaning"] == shown_pairs() > 0 and bpy.ops.esh.frame_overlap() == {"FINISHED"}
    scatter.classes[0].tilt = 0.0
    scatter.classes[0].offset = 0.2
    assert told(scatter)["leaning"] is None and "· no overlap ·" in words.summary(told(scatter))
    enlarge(scatter)
    assert told(scatter)["leaning"] == shown_pairs() > 0, "they are upright, and too large for their places"


def test_what_overlaps_on_the_ground_stays_selected_with_what_leans_by_now(scatter):
    scatter.target, scatter.max_steps = ground(GROUNDS["flat"], size=6.6), 10
    scatter.classes[0].sizes[0].source_object, scatter.classes[0].tilt = box(), 0.3
    bpy.ops.esh.scatter()
    run = scatter.report
    assert run["overlaps"] > 0 and run["leaning"] > 0
    marked = on_ground(scatter)
    tilt(scatter)
    report = told(scatter)
    bpy.ops.esh.select_overlapping()
    bpy.ops.object.mode_set(mode="OBJECT")
    chosen = {one.index for one in scatter.result.data.vertices if one.select}
    assert chosen == marked | set(report["leaning_bodies"]) != marked
    assert report["leaning_bodies"] != run.get("leaning_bodies")


def on_ground(scatter):
    values = scatter.result.data.attributes["overlapping_on_ground"].data
    return {number for number, one in enumerate(values) if one.value}


def test_a_file_that_is_opened_is_counted_again(scatter, tmp_path):
    tilt(scatter)
    count = told(scatter)["leaning"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    report = told(active_scatter(bpy.context))
    assert report[words.COUNTED_AGAIN] and report["leaning"] == count


def test_undo_and_redo_lead_back_to_what_is_known(scatter, monkeypatch):
    bpy.ops.ed.undo_push(message="Scattered")
    first, pair = told(scatter)["leaning"], told(scatter)["leaning_pair"]
    tilt(scatter)
    bpy.ops.ed.undo_push(message="Tilted")
    second = told(scatter)
    assert second["leaning"] != first
    monkeypatch.setattr(leaning_now, "count_leaning", None)
    for _ in range(2):
        bpy.ops.ed.undo()
        back = told(active_scatter(bpy.context))
        assert (back["leaning"], tuple(back["leaning_pair"])) == (first, tuple(pair))
        assert words.COUNTED_AGAIN not in back
        bpy.ops.ed.redo()
        again = told(active_scatter(bpy.context))
        assert (again["leaning"], again["leaning_pair"]) == (second["leaning"], second["leaning_pair"])


class _Context:
    """Blender's context, with a window that shows its scene."""

    def __getattr__(self, name):
        return getattr(bpy.context, name)

    @property
    def window_manager(self):
        return SimpleNamespace(windows=[SimpleNamespace(scene=bpy.context.scene)])

    def temp_override(self, window):
        return bpy.context.temp_override(scene=window.scene)


@pytest.fixture
def window(scatter, monkeypatch):
    """The scatter, as if there was a window: nobody waits, and timers are at work, which tests call."""
    app = SimpleNamespace(background=False, timers=bpy.app.timers, is_job_running=lambda _kind: False)
    monkeypatch.setattr(counted_again, "bpy", SimpleNamespace(app=app, context=_Context(), types=bpy.types))
    monkeypatch.setattr(counted_again, "redraw_sidebars", lambda: drawn.append(time.monotonic()))
    monkeypatch.setattr(counted_again.loading, "is_done", lambda: True)
    # The brush of another window.
    monkeypatch.setattr(counted_again.strokes, "is_under_way", lambda: False)
    drawn: list[float] = []
    yield SimpleNamespace(scatter=scatter, drawn=drawn)
    counted_again.detach()
    assert not bpy.app.timers.is_registered(counted_again._look)


def turn_timer(seconds=20.0):
    """Call the timer as Blender does, until it ends."""
    deadline = time.monotonic() + seconds
    while (wait := counted_again._look()) is not None:
        assert time.monotonic() < deadline
        time.sleep(wait)


def test_in_a_window_nobody_waits_and_the_count_comes_after_a_pause(window):
    scatter, handlers = window.scatter, [list(one) for one in handler_lists()]
    tilt(scatter)
    report = told(scatter)
    assert "counting what leans" in words.summary(report) and words.leaning(report) == "counting …"
    assert bpy.ops.esh.frame_overlap.poll(), "it counts at once"
    assert bpy.app.timers.is_registered(counted_again._look)
    wait = counted_again._look()
    assert 0.0 < wait <= counted_again.PAUSE and counted_again._going is None
    turn_timer()
    report = told(scatter)
    assert report["leaning"] == shown_pairs() and report[words.COUNTED_AGAIN] and len(window.drawn) == 1
    assert counted_again._look() is None, "nothing more is to be done"
    assert [list(one) for one in handler_lists()] == handlers


def handler_lists():
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    return [one for one in lists if isinstance(one, list)]


def test_a_slider_that_is_dragged_is_counted_once(window, monkeypatch):
    counts, count = [], leaning_now.count_leaning
    monkeypatch.setattr(leaning_now, "count_leaning", lambda *given, **more: counts.append(1) or count(*given, **more))
    for step in range(8):
        window.scatter.classes[0].tilt = 0.52 + 0.03 * step
        told(window.scatter)
        assert counted_again._look() is not None and counted_again._going is None
        time.sleep(0.1)
    # What was drawn last need not be what is there.
    window.scatter.classes[0].tilt = 0.8
    turn_timer()
    assert len(counts) == 1 and told(window.scatter)["leaning"] == shown_pairs() and len(counts) == 1


@pytest.mark.parametrize("what", ["setting", "undo", "file", "run"])
def test_a_count_that_nobody_wants_any_more_is_abandoned(window, monkeypatch, what):
    asked, scatter = [], window.scatter

    def count(*_given, ask, **_more):
        while True:
            asked.append(ask())
            time.sleep(0.01)

    bpy.ops.ed.undo_push(message="Scattered")
    tilt(scatter)
    bpy.ops.ed.undo_push(message="Tilted")
    with monkeypatch.context() as patch:
        patch.setattr(leaning_now, "count_leaning", count)
        told(scatter)
        deadline = time.monotonic() + 10.0
        while not asked:
            assert counted_again._look() is not None and time.monotonic() < deadline
            time.sleep(0.02)
        thread = counted_again._going.run
        if what == "setting":
            scatter.classes[0].tilt = 0.3
        elif what == "undo":
            # Its panel is drawn then, and stands as it did after the run.
            bpy.ops.ed.undo()
            told(active_scatter(bpy.context))
        elif what == "file":
            bpy.ops.wm.read_homefile(use_empty=True)
        else:
            monkeypatch.setattr(running, "session", "a run")
        counted_again._look()
        thread.join(5.0)
        assert not thread.running and thread.stopped
    turn_timer()
    assert counted_again._going is None and not counted_again._asked
    if what == "setting":
        assert told(scatter)["leaning"] == shown_pairs()
    else:
        assert not counted_again._known


def test_what_is_hidden_from_view_is_not_counted(window):
    """Nothing runs while no panel asks."""
    tilt(window.scatter)
    assert not bpy.app.timers.is_registered(counted_again._look) and counted_again._look() is None


def test_a_count_that_fails_is_said_not_to_be_known(window, monkeypatch):
    tilt(window.scatter)
    told(window.scatter)
    monkeypatch.setattr(leaning_now, "count_leaning", None)
    turn_timer()
    report = told(window.scatter)
    assert "leaning not counted again" in words.summary(report) and words.leaning(report) == "changed since"
    assert not bpy.ops.esh.frame_overlap.poll() and counted_again._look() is None, "it is not tried again and again"


def test_buttons_do_not_wait_for_the_pause(window):
    tilt(window.scatter)
    assert bpy.ops.esh.frame_overlap() == {"FINISHED"}
    assert told(window.scatter)["leaning"] == shown_pairs(), "and then it is known"
    vary(window.scatter)
    assert bpy.ops.esh.select_overlapping() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    window.scatter.classes[0].tilt = window.scatter.classes[0].scale_jitter = 0.0
    told(window.scatter)
    assert bpy.ops.esh.select_overlapping.poll(), "it may be that some still do"
    assert bpy.ops.esh.select_overlapping() == {"CANCELLED"} and bpy.context.mode == "OBJECT"


def test_in_edit_mode_it_is_told_what_was_known_before(window):
    tilt(window.scatter)
    told(window.scatter)
    bpy.context.view_layer.objects.active = window.scatter.result
    bpy.ops.object.mode_set(mode="EDIT")
    report = told(window.scatter)
    assert words.leaning(report) == "changed since" and not bpy.ops.esh.select_overlapping.poll()
    turn_timer()
    assert counted_again._look() is None and not counted_again._known
    bpy.ops.object.mode_set(mode="OBJECT")
    told(window.scatter)
    turn_timer()
    count = told(window.scatter)["leaning"]
    bpy.ops.object.mode_set(mode="EDIT")
    assert told(window.scatter)["leaning"] == count and bpy.ops.esh.frame_overlap() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")


def test_live_tells_nothing_as_counted_before_it_has_measured(live_file, follow):
    target, item = ground(GROUNDS["flat"], size=10.0), tree()
    made = bpy.context.scene.esh_scatter.add_scatter(target)
    body_class = made.add_class()
    body_class.sizes[0].source_object, body_class.sizes[0].count = item, 130
    body_class.align_to_normal, body_class.tilt = 0.0, 0.5
    made.device, made.max_steps, made.seed = "CPU", 40, 3
    made.live = True
    follow()
    report = told(made)
    assert report["leaning"] == shown_pairs() > 0 and words.COUNTED_AGAIN not in report
    # They were shown before their report had come.
    assert bpy.ops.esh.select_overlapping() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    chosen = np.array([one.select for one in made.result.data.vertices])
    assert set(report["leaning_pair"]) <= set(np.flatnonzero(chosen).tolist())
    assert json.loads(made.report_json)["leaning"] == report["leaning"]
