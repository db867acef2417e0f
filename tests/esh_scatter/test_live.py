"""Live: a result follows what changes, from where its objects are, and stops with a sentence where it cannot."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.solving import followed_scatter, live  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from live_scene import active, moved, new_scatter, paint, points, switch_on


@pytest.fixture
def scatter(live_file):
    return new_scatter()


def test_a_painted_image_is_followed_and_what_is_far_from_it_stays(scatter, follow):
    before = switch_on(scatter, follow)
    there = points("Pine")
    paint(0.0, 16)
    follow()
    after = points("Pine")
    assert len(after) == 200 and active().result is not None
    assert min(place[0] for place in after.values()) > -10.6, "nothing is left of the stroke"
    assert len(there.keys() - after.keys()) > 30, "who stood there is gone"
    far = {n: p for n, p in points("Beech").items() if p[0] > 5.0}
    # They make room for the pines that came, and that is all.
    assert np.median(moved(before, far)) < 0.3
    assert not active().outdated and active().report["classes"][0]["sizes"][0]["placed"] == 200


def test_while_something_is_solved_operators_can_be_called_with_another_context(scatter, follow):
    """With Python 3.11 Blender crashes where another thread has Python's lock meanwhile."""
    switch_on(scatter, follow)
    one = next(iter(live._followed.values()))
    held = []
    for count in (1500, 200, 1500):
        scatter.classes["Beech"].sizes[0].count = count
        one._looked = 0.0
        live._tick()
        with live.resting(), bpy.context.temp_override(active_object=scatter.target, object=scatter.target):
            held.append((one.busy, one.worker._held))
            for _ in range(20):
                bpy.ops.object.mode_set(mode="EDIT")
                bpy.ops.object.mode_set(mode="OBJECT")
            assert one.worker._held
        assert not one.worker._held
    assert held == [(True, True)] * 3
    follow()
    assert len(points()) == 1700 and not scatter.outdated


@pytest.mark.parametrize("even, steps", [(0.15, 5), (0.0, 45)])
def test_what_looks_uneven_after_a_change_runs_on(scatter, follow, monkeypatch, even, steps):
    from esh.esh_scatter.solving import live_worker

    monkeypatch.setattr(live_worker, "EVEN", even)
    monkeypatch.setattr(live_worker, "MUCH_LESS_EVEN", 1e-6)
    switch_on(scatter, follow)
    paint(0.1, 32)
    follow()
    assert active().report["steps"] == steps and not active().outdated
    there, placed = points(), active().report["coverage_error"]
    follow()
    assert moved(there, points()).max() == 0.0 and placed < 0.1


def test_what_was_wrong_is_said_no_longer_once_it_is_as_before(scatter, follow):
    switch_on(scatter, follow)
    for body_class in scatter.classes:
        body_class.mute = True
    follow()
    assert "muted" in live.status(bpy.context.scene, scatter)
    for body_class in scatter.classes:
        body_class.mute = False
    follow()
    assert live.status(bpy.context.scene, scatter) == ""


def test_what_was_placed_by_hand_is_not_lost_without_being_asked(scatter, follow):
    """A class was muted, and unmuted again: its tree that had been moved by hand was elsewhere, and nothing had been said."""
    switch_on(scatter, follow)
    mesh = active().result.data
    number = next(iter(points("Pine")))
    at = read_attribute(mesh, "id").tolist().index(number)
    mesh.vertices[at].co = (7.3, 5.1, 0.0)
    follow()
    moved_to = points()[number]
    scatter.classes["Pine"].mute = True
    follow()
    assert live.status(bpy.context.scene, scatter).startswith(
        "1 moved or pinned object of Pine will be lost: Live waits"
    )
    assert len(points()) == 400
    scatter.classes["Pine"].mute = False
    follow()
    assert live.status(bpy.context.scene, scatter) == ""
    np.testing.assert_allclose(points()[number], moved_to, atol=1e-5)
    scatter.classes["Pine"].mute = True
    follow()
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    follow()
    assert len(points()) == 200 and live.status(bpy.context.scene, scatter) == ""


def test_more_than_the_cap_are_not_placed_without_being_asked(scatter, follow):
    """A count that was dragged too far, or a distance without its zero, began to place millions."""
    scatter.cap = 500
    before = switch_on(scatter, follow)
    pine = scatter.classes["Pine"]
    pine.sizes[0].count = 800
    follow()
    assert live.status(bpy.context.scene, scatter) == (
        "1,000 objects will take about 1 s and 0.1 GB of memory: Live waits. Click Update to place them"
    )
    assert points().keys() == before.keys()
    pine.sizes[0].count = 200
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and not active().outdated
    pine.count_kind, pine.distance = "DISTANCE", 0.05
    follow()
    assert "Live waits" in live.status(bpy.context.scene, scatter) and len(points()) == 400
    # Whoever has placed them once is not asked about as many.
    pine.count_kind, pine.sizes[0].count = "SIZES", 800
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    follow()
    paint(0.0, 16)
    pine.sizes[0].count = 790
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and len(points()) == 990
    assert min(place[0] for place in points("Pine").values()) > -10.6


@pytest.mark.parametrize("more", [0, 10])
def test_a_copy_with_settings_of_its_own_is_followed_from_where_it_is(scatter, follow, more):
    bpy.ops.esh.scatter()
    result = scatter.result
    bpy.ops.object.select_all(action="DESELECT")
    result.select_set(True)
    bpy.context.view_layer.objects.active = result
    bpy.ops.object.duplicate(linked=False)
    bpy.ops.esh.scatter_of_copy()
    scatters = bpy.context.scene.esh_scatter
    (own,) = (one for one in scatters.scatters if one.result == bpy.context.view_layer.objects.active)
    scatters.scatter_index = list(scatters.scatters).index(own)
    before = points()
    if more:
        own.classes[0].sizes[0].count += 10
    own.live = True
    follow()
    assert len(points()) == len(before) + more and before.keys() <= points().keys()
    assert more or moved(before, points()).max() == 0.0
    own.classes[0].sizes[0].count += 10
    follow()
    assert len(points()) == len(before) + more + 10


def test_the_handler_takes_no_time_beside_ten_thousand_objects(scatter, follow):
    """At most a twentieth of a millisecond for an update in which nothing of ours changes."""
    mesh = bpy.data.meshes.new("Speck")
    for number in range(10_000):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Speck {number}", mesh))
    switch_on(scatter, follow)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert live._something_changed in bpy.app.handlers.depsgraph_update_post
    seconds = []
    for _ in range(200):
        start = time.perf_counter()
        live._something_changed(bpy.context.scene, depsgraph)
        seconds.append(time.perf_counter() - start)
    assert np.median(seconds) < 5e-5


def test_counts_weights_and_the_target_are_followed(scatter, follow):
    before = switch_on(scatter, follow)
    scatter.classes["Beech"].sizes[0].count = 230
    follow()
    after = points()
    assert len(after) == 430 and len(before.keys() & after.keys()) == 400
    assert np.median(moved(before, after)) < 0.5
    group = scatter.target.vertex_groups["here"]
    group.add([v.index for v in scatter.target.data.vertices if v.co.y > 0], 0.0, "REPLACE")
    follow()
    # Weights fall to 0 in the two meters to the next row of vertices, where a twentieth of the class has its place.
    up = np.array([place[1] for place in points("Beech").values()])
    assert up.max() < 2.0 and 5 < (up > 0.0).sum() < 20 and (up > 1.0).sum() < 8
    for vertex in scatter.target.data.vertices:
        vertex.co.z = 3.0
    scatter.target.data.update()
    follow()
    assert {round(float(place[2]), 3) for place in points().values()} == {3.0}
    before = points()
    scatter.target.location.x += 100.0
    bpy.context.view_layer.update()
    follow()
    after = points()
    assert before.keys() == after.keys()
    way = np.array([after[n] - before[n] for n in before])
    assert np.abs(np.median(way, axis=0) - (100, 0, 0)).max() < 0.05


def test_what_was_changed_while_it_was_off_is_followed_from_what_is_there(scatter, follow):
    """Counts, a class that is new, and one that is gone: all others stay about where they are, and are the same."""
    bpy.ops.esh.scatter()
    before = points()
    scatter.classes["Beech"].sizes[0].count = 230
    scatter.live = True
    follow()
    after = points()
    assert len(after) == 430 and before.keys() <= after.keys()
    # Spacing is about 1.9 m; few steps are enough.
    assert np.median(moved(before, after)) < 0.5 and not scatter.outdated
    scatter.live = False
    follow()
    pines = points("Pine")
    scatter.classes["Beech"].mute = True
    bush = scatter.add_class()
    bush.name = "Bush"
    bush.sizes[0].source_object, bush.sizes[0].count = bpy.data.objects["Beech"], 20
    scatter.classes["Pine"].sizes[0].count = 190
    scatter.live = True
    follow()
    now = points("Pine")
    assert len(now) == 190 and now.keys() <= pines.keys() and not scatter.outdated
    assert np.median(moved(pines, now)) < 2.0, "they have the room of the beeches now"
    # They are others than the pines that went.
    assert len(points("Bush")) == 20 and not points("Bush").keys() & pines.keys()


def test_a_class_comes_and_goes(scatter, follow):
    switch_on(scatter, follow)
    scatter.classes["Beech"].mute = True
    follow()
    assert len(points()) == 200 and [e["name"] for e in active().report["classes"]] == ["Pine"]
    scatter.classes["Beech"].mute = False
    follow()
    assert len(points("Beech")) == len(points("Pine")) == 200
    assert set(scatter.result.data["esh_scatter_classes"]) == {c.uid for c in scatter.classes}


def test_another_seed_places_others(scatter, follow):
    before = switch_on(scatter, follow)
    scatter.seed = 5
    follow()
    assert np.median(moved(before, points())) > 1.0


def test_without_a_result_it_makes_one(scatter, follow):
    scatter.live = True
    follow()
    assert len(points()) == 400 and scatter.report["overlaps"] == 0 and not scatter.outdated


def test_what_is_shown_at_once_is_not_taken_back(scatter, follow):
    switch_on(scatter, follow)
    scatter.classes["Pine"].sizes[0].count = 210
    follow(until=lambda: live._followed[next(iter(live._followed))]._worker.busy)
    scatter.classes["Pine"].tilt = 0.3
    scatter.classes["Pine"].color = (1.0, 0.0, 0.0)
    follow()
    assert len(points("Pine")) == 210
    mesh = scatter.result.data
    color = np.empty(4 * len(mesh.vertices), np.float32)
    mesh.attributes["class_color"].data.foreach_get("color", color)
    assert color[:3].tolist() == [1.0, 0.0, 0.0]
    turned = np.empty(4 * len(mesh.vertices), np.float32)
    mesh.attributes["rotation"].data.foreach_get("value", turned)
    assert np.abs(turned.reshape(-1, 4)[:210, 1:3]).max() > 0.05, "they still lean"


def test_discs_that_are_turned_are_not_solved_anew(scatter, follow):
    for body_class in scatter.classes:
        body_class.sizes[0].area_kind, body_class.sizes[0].area = "VALUE", 0.2
    switch_on(scatter, follow)
    one = live._followed[next(iter(live._followed))]
    shown, report = one._shown, scatter.report_json
    scatter.classes["Pine"].random_turn, scatter.classes["Pine"].tilt = 1.0, 0.3
    follow()
    assert one._shown is shown and scatter.report_json == report and not scatter.outdated, "the points have shown it"
    scatter.classes["Pine"].scale_jitter = 0.2
    follow()
    assert one._shown is not shown and not scatter.outdated


def remove_target():
    bpy.data.objects.remove(active().target)


def remove_source():
    bpy.data.objects.remove(bpy.data.objects["Pine"])


def delete_source():
    bpy.context.scene.collection.objects.unlink(bpy.data.objects["Pine"])


def delete_result():
    bpy.context.scene.collection.objects.unlink(active().result)


@pytest.mark.parametrize(
    ("loss", "said"),
    [
        (remove_target, "target is no longer"),
        (remove_source, "an object of Pine was deleted"),
        (delete_source, '"Pine" was deleted'),
        (delete_result, "result is no longer"),
    ],
)
def test_it_stops_with_a_sentence_when_something_is_gone(scatter, loss, said, follow):
    switch_on(scatter, follow)
    loss()
    follow()
    scatter = active()
    assert not scatter.live and said in live.status(bpy.context.scene, scatter)
    assert not live._followed and not any(hook in handlers for handlers, hook in live._hooks())


def test_what_cannot_be_solved_is_said_and_it_goes_on_when_it_can(scatter, follow):
    switch_on(scatter, follow)
    group = scatter.target.vertex_groups["here"]
    group.add(list(range(441)), 0.0, "REPLACE")
    follow()
    said = live.status(bpy.context.scene, scatter)
    assert (
        scatter.live and "above 0 somewhere" in said and said.endswith("0 everywhere: paint where objects are to stand")
    )
    assert len(points()) == 400
    group.add(list(range(200)), 1.0, "REPLACE")
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and not scatter.outdated


@pytest.mark.parametrize("surface", ["ABOVE", "WHOLE"])
def test_a_report_that_is_being_made_does_not_hold_up_the_next_edit(scatter, follow, monkeypatch, surface):
    from esh.engine.solver import solver

    scatter.surface = surface
    switch_on(scatter, follow)
    measured, ended = solver.measure, []
    (one,) = live._followed.values()

    def measure(placement, launcher, *others):
        launches = launcher.python_launches
        try:
            if not ended:
                ended.append(False)
                while True:
                    launcher.ask()
                    time.sleep(0.01)
            return measured(placement, launcher, *others)
        finally:
            ended.append(launcher.python_launches - launches)

    monkeypatch.setattr(solver, "measure", measure)
    pine = scatter.classes["Pine"].sizes[0]
    pine.count = 220
    follow(lambda: bool(ended) and len(points("Pine")) == 220)
    # It is shown without a report, which is still being made.
    assert one.busy and one._worker.takes_edits
    pine.count = 240
    follow()
    assert ended[1] == 0, "nothing was launched for the first report any more"
    assert len(points("Pine")) == 240 and not active().outdated
    assert active().report["classes"][0]["sizes"][0]["placed"] == 240


def test_switching_it_off_ends_an_edit_under_way(scatter, follow, monkeypatch):
    from esh.esh_scatter.solving import live_worker

    switch_on(scatter, follow)
    (one,) = live._followed.values()
    begun, launches = threading.Event(), []

    class Watched(live_worker.Solver):
        def edit(self, problem, **steps):
            begun.set()
            while not one._worker._ended:
                time.sleep(0.01)
            before = self.launcher.python_launches
            try:
                return super().edit(problem, **steps)
            finally:
                launches.append(self.launcher.python_launches - before)

    monkeypatch.setattr(one._worker._solver, "__class__", Watched)
    scatter.classes["Pine"].sizes[0].count = 220
    follow(begun.is_set)
    scatter.live = False
    follow()
    one._worker.join(10.0)
    assert launches == [0] and not one._worker._thread.is_alive()


def test_another_file_ends_it(scatter, tmp_path, follow):
    switch_on(scatter, follow)
    scatter.classes["Pine"].sizes[0].count = 260
    live._tick()
    worker = next(iter(live._followed.values()))._worker
    bpy.data.images["mask.png"].pack()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not live._followed
    worker.join(60)
    assert not worker._thread.is_alive()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "live.blend"))
    assert active().live
    live.wake()
    follow()
    assert len(points("Pine")) == 260 and not active().outdated


def test_nothing_listens_while_nothing_is_live(scatter, follow):
    def listening():
        return [hook for handlers, hook in live._hooks() if hook in handlers]

    assert not listening()
    switch_on(scatter, follow)
    assert len(listening()) == 6
    scatter.live = False
    follow()
    assert not listening() and not live._followed


def test_a_setting_changed_in_the_sidebar_is_looked_at_with_the_next_tick(scatter, follow, monkeypatch):
    """Blender tags the scene for it, which a script that sets a property has to do itself."""
    switch_on(scatter, follow)
    (followed,) = live._followed.values()
    looked = []
    monkeypatch.setattr(followed, "_submit", lambda *_: looked.append(time.monotonic()))
    monkeypatch.setattr(followed_scatter, "AT_REST", 1e6)
    # What the result has changed is told before.
    bpy.context.view_layer.update()
    monkeypatch.setattr(live, "_last_sign", 0.0)
    scatter.classes["Pine"].sizes[0].count = 150
    live._tick()
    assert not looked, "nothing has said so"
    bpy.context.scene.update_tag()
    bpy.context.view_layer.update()
    live._tick()
    assert len(looked) == 1


def test_looking_is_no_sign_of_a_change(scatter, follow):
    """Otherwise it would go on looking with every tick."""
    switch_on(scatter, follow)
    scatter.classes["Pine"].sizes[0].count = 150
    follow()
    bpy.context.view_layer.update()
    sign = live._last_sign
    for _ in range(5):
        time.sleep(followed_scatter.AT_REST)
        live._tick()
        bpy.context.view_layer.update()
    assert live._last_sign == sign


def test_a_run_by_hand_is_where_it_goes_on_from(scatter, follow):
    switch_on(scatter, follow)
    scatter.seed = 3
    bpy.ops.esh.scatter()
    live.reset(bpy.context.scene, scatter)
    by_hand = points()
    follow()
    assert moved(by_hand, points()).max() == 0.0
    scatter.classes["Pine"].sizes[0].count = 205
    follow()
    assert np.median(moved(by_hand, points())) < 0.5 and len(points("Pine")) == 205


def test_what_another_scatter_has_on_a_wall_is_followed(scatter, follow):
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    wall = bpy.context.object
    wall.scale = (0.02, 6.0, 6.0)
    bpy.ops.mesh.primitive_plane_add(size=0.4, location=(60, 0, 0))
    tile = bpy.context.object
    bpy.context.view_layer.update()
    scatters = bpy.context.scene.esh_scatter
    made = []
    for number in range(2):
        one = scatters.add_scatter(wall)
        one.surface, one.device, one.max_steps = "WHOLE", "CPU", 40
        size = one.add_class().sizes[0]
        size.source_object, size.count = tile, 60
        bpy.ops.esh.scatter_choose(index=1 + number)
        if number == 0:
            bpy.ops.esh.scatter()
        made.append(one)

    def nearest():
        one, other = (np.array([v.co for v in m.result.data.vertices]) for m in made)
        away = np.linalg.norm(one[:, None] - other, axis=2)
        return away[(one[:, None] * other)[:, :, 0] > 0.0].min()

    before = switch_on(made[1], follow)
    assert nearest() > 0.399
    for vertex in made[0].result.data.vertices:
        vertex.co.y += 0.2
    made[0].result.data.update()
    follow()
    after = points()
    # Some that it came upon are gone, and others have come instead.
    assert len(after) == 60 and len(before.keys() & after.keys()) > 45
    assert nearest() > 0.399
    assert (moved(before, after) > 0.02).any()


def test_a_mask_that_came_while_it_was_off_is_followed_as_a_run_would(scatter, follow):
    """Nearly all of a class stands where nothing of it is to be any more."""
    bpy.ops.esh.scatter()
    image = bpy.data.images["mask.png"]
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[22:42, 7:57] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    scatter.live = True
    follow()
    report = active().report
    assert report["overlaps"] == 0 and report["coverage_error"] < 0.05
    assert max(c["coverage_error"] for c in report["classes"]) < 0.1


def test_the_solver_rests_while_blenders_data_are_read_and_not_for_long_where_nobody_comes_back():
    from esh.esh_scatter.classes.survey import Survey
    from esh.esh_scatter.solving.live_worker import LONGEST_REST, LiveWorker

    worker, asked = LiveWorker(Survey()), []

    def work():
        while not worker._ended:
            worker._go_on()
            asked.append(time.monotonic())
            time.sleep(0.001)

    assert worker.rests(), "with nothing to do"
    worker.go_on()
    worker._busy = True
    thread = threading.Thread(target=work)
    thread.start()
    try:
        while not worker.rests():
            time.sleep(0.001)
        before = len(asked)
        time.sleep(2.0 * LONGEST_REST)
        assert len(asked) == before
        worker.go_on()
        while len(asked) < before + 10:
            time.sleep(0.001)
        # Asked to rest by somebody who does not come back.
        worker.rests()
        until = time.monotonic() + LONGEST_REST + 1.0
        before = len(asked)
        while len(asked) < before + 100:
            assert time.monotonic() < until
            time.sleep(0.001)
    finally:
        worker.end()
        thread.join()
        worker.join(5.0)
