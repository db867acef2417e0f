"""Live goes back and forth with undo and redo, and no step leads to what is gone."""

import threading
import time
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.result.display import followed_targets, our_modifier  # noqa: E402
from esh.esh_scatter.result.node_group_contents import MADE_OF, placed_objects  # noqa: E402
from esh.esh_scatter.result.result import is_copy  # noqa: E402
from esh.esh_scatter.solving import live  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from live_scene import active, moved, new_scatter, points, switch_on


@pytest.fixture
def scatter(live_file):
    return new_scatter()


def test_undo_is_followed(scatter, follow):
    bpy.ops.ed.undo_push(message="before")
    switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="scattered")
    scatter.classes["Pine"].sizes[0].count = 260
    follow()
    assert len(points("Pine")) == 260
    bpy.ops.ed.undo_push(message="more")
    bpy.ops.ed.undo()
    follow()
    assert len(points("Pine")) == active().classes["Pine"].sizes[0].count == 200 and not active().outdated
    bpy.ops.ed.redo()
    follow()
    assert len(points("Pine")) == active().classes["Pine"].sizes[0].count == 260 and not active().outdated


def test_what_was_asked_for_before_an_undo_is_not_shown_after_it(scatter, follow, monkeypatch):
    from esh.engine.solver import solver

    bpy.ops.ed.undo_push(message="before")
    there = switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    measured, measuring, may_measure = solver.measure, threading.Event(), threading.Event()

    def measure(placement, launcher, *others):
        measuring.set()
        assert may_measure.wait(30.0)
        return measured(placement, launcher, *others)

    monkeypatch.setattr(solver, "measure", measure)
    scatter.classes["Pine"].sizes[0].count = 220
    bpy.ops.ed.undo_push(message="count")
    follow(lambda: measuring.is_set() and len(points("Pine")) == 220)
    bpy.ops.ed.undo()
    (one,) = live._followed.values()
    may_measure.set()
    while one._worker.busy:
        time.sleep(0.01)
    # Its report comes out only now.
    follow()
    assert moved(there, points()).max() == 0.0 and len(points("Pine")) == 200 and not active().outdated


@pytest.mark.parametrize("surface", ["ABOVE", "WHOLE"])
def test_undo_goes_back_to_the_solver_of_that_time(scatter, follow, monkeypatch, surface):
    from esh.esh_scatter.solving import live_worker

    made = []

    class Counted(live_worker.Solver):
        def __init__(self, *arguments, **named):
            made.append(1)
            super().__init__(*arguments, **named)

    monkeypatch.setattr(live_worker, "Solver", Counted)
    scatter.surface = surface
    bpy.ops.ed.undo_push(message="before")
    there = switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    assert len(made) == 1

    def ask(count):
        active().classes["Pine"].sizes[0].count = count
        bpy.ops.ed.undo_push(message="count")
        follow()
        assert len(points("Pine")) == count and not active().outdated

    ask(220)
    ask(240)
    bpy.ops.ed.undo()
    follow()
    assert len(points("Pine")) == 220 and not active().outdated
    bpy.ops.ed.undo()
    follow()
    assert moved(there, points()).max() == 0.0 and not active().outdated
    bpy.ops.ed.redo()
    follow()
    assert len(points("Pine")) == 220
    ask(250)
    for _ in range(2):
        bpy.ops.ed.undo()
        follow()
        bpy.ops.ed.redo()
        follow()
    assert len(points("Pine")) == 250 and not active().outdated
    assert live.status(bpy.context.scene, active()) == "" and len(made) == 1
    # What was moved by hand, or is made for another target, is nowhere to go back to.
    bpy.data.objects["Ground"].scale.x = 1.2
    bpy.ops.ed.undo_push(message="scaled")
    follow()
    bpy.ops.ed.undo()
    follow()
    assert live.status(bpy.context.scene, active()) == "" and not active().outdated and len(made) > 1


def test_only_so_many_results_are_there_to_go_back_to(scatter, follow, monkeypatch):
    from esh.esh_scatter.solving import earlier_results

    switch_on(scatter, follow)
    (one,) = live._followed.values()
    for count in range(210, 290, 10):
        scatter.classes["Pine"].sizes[0].count = count
        follow()
    worker = one._worker
    assert len(worker._earlier) == earlier_results.MOST_EARLIER == len(worker._solver._placing.bookmarks)
    monkeypatch.setattr(earlier_results, "MOST_BODIES_EARLIER", 1000)
    scatter.classes["Pine"].sizes[0].count = 200
    follow()
    assert len(worker._earlier) == 2 == len(worker._solver._placing.bookmarks)


def a_class_of_a_collection(scatter):
    collection = bpy.data.collections.new("Kinds")
    collection.objects.link(bpy.data.objects.new("One", bpy.data.objects["Pine"].data))
    bpy.ops.esh.class_add()
    size = scatter.classes[-1].sizes[0]
    size.source_kind, size.source_collection, size.count = "ASSET", collection, 30


CHANGES = {
    "a count": lambda scatter: setattr(scatter.classes["Pine"].sizes[0], "count", 260),
    "a class of a collection": a_class_of_a_collection,
}


@pytest.mark.parametrize("wait", [True, False], ids=["followed", "at once"])
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_undo_steps_that_are_older_than_what_was_written_are_followed(scatter, follow, change, wait):
    """As in the sidebar: a field makes its step when it is let go, and Live writes after that, in no step of its own."""
    bpy.ops.esh.scatter()
    bpy.ops.ed.undo_push(message="before")
    switch_on(active(), follow)
    bpy.ops.ed.undo_push(message="live")
    before = len(active().result.data.vertices)
    change(active())
    bpy.ops.ed.undo_push(message="changed")
    follow()
    after = len(active().result.data.vertices)
    assert after > before
    for _ in range(2):
        bpy.ops.ed.undo()
        if wait:
            follow()
            assert len(active().result.data.vertices) == before and not active().outdated
        bpy.ops.ed.redo()
        if wait:
            follow()
            assert len(active().result.data.vertices) == after and not active().outdated
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    # It is not live any more, or not yet.
    follow()
    assert not active().live and (len(active().result.data.vertices) == before or active().outdated)
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    follow()
    assert len(active().result.data.vertices) == after and not active().outdated
    group = active().result.modifiers[0].node_group
    assert len(placed_objects(group)) >= 2 and None not in placed_objects(group)
    shown = bpy.context.evaluated_depsgraph_get()
    assert sum(one.is_instance for one in shown.object_instances) == after


@pytest.mark.parametrize("linked", [True, False])
def test_undo_beside_a_copy_of_the_result_leads_to_nothing_that_is_gone(scatter, follow, linked):
    """What copies use a result lets be, and takes another mesh and another node group, of which no undo step knows."""
    switch_on(scatter, follow)
    bpy.ops.object.select_all(action="DESELECT")
    active().result.select_set(True)
    bpy.ops.object.duplicate(linked=linked)
    # As it is after the file was opened anew.
    our_modifier(active().result).node_group[MADE_OF] = "[[], [], 0]"
    bpy.ops.ed.undo_push(message="copied")
    counts = [len(points())]
    for count in (220, 240):
        active().classes["Pine"].sizes[0].count = count
        bpy.ops.ed.undo_push(message="changed")
        follow()
        counts.append(len(points()))
    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    for step, wanted in ((undo, 1), (undo, 0), (redo, 1), (redo, 2)):
        step()
        result = active().result
        assert result.data.as_pointer() in {mesh.as_pointer() for mesh in bpy.data.meshes}
        assert our_modifier(result).node_group.as_pointer() in {group.as_pointer() for group in bpy.data.node_groups}
        follow()
        assert len(points()) == counts[wanted] and not active().outdated
        (told,) = followed_targets(our_modifier(active().result))
        assert told.target == active().target
        copies = [item for item in bpy.context.scene.objects if is_copy(item, active().result)]
        shown = [
            one.parent.original for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance
        ]
        assert sorted(shown.count(item) for item in copies) == sorted((counts[0], counts[wanted]))


def shown_beside_copies():
    """How many objects each result and copy shows, once all nodes lead to groups that are there."""
    there = {group.as_pointer() for group in bpy.data.node_groups}
    for group in bpy.data.node_groups:
        assert all(n.node_tree.as_pointer() in there for n in group.nodes if n.bl_idname == "GeometryNodeGroup")
    shown = [one.parent.original for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance]
    return [shown.count(item) for item in bpy.context.scene.objects if is_copy(item, active().result)]


def test_many_steps_back_and_forth_beside_a_copy_lead_to_no_parts_of_nodes_that_are_gone(scatter, follow):
    """The group that only a copy still uses was made anew for an undo, as that of the result."""

    def change(name):
        active().classes["Pine"].sizes[0].source_object = bpy.data.objects[name]
        bpy.ops.ed.undo_push(message=name)
        follow()

    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    bpy.data.objects.new("Rock", bpy.data.objects["Beech"].data)
    switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    change("Beech")
    bpy.ops.object.select_all(action="DESELECT")
    active().result.select_set(True)
    bpy.ops.object.duplicate()
    for name in ("copied", "later"):
        bpy.ops.ed.undo_push(message=name)
    undo()
    follow()
    assert shown_beside_copies() == [400, 400]
    change("Rock")
    for step in (undo, redo, undo, undo, redo, redo, undo, redo):
        step()
        assert shown_beside_copies() in ([400, 400], [400])
        follow()
        assert shown_beside_copies() in ([400, 400], [400])
    assert placed_objects(our_modifier(active().result).node_group)[0] == bpy.data.objects["Rock"]


def leads_to_nothing_that_is_gone():
    """Whether all objects and meshes to which the scene leads are there; asked by their addresses, which freed ones still have."""
    there = {item.as_pointer() for item in bpy.data.objects}
    meshes = {mesh.as_pointer() for mesh in bpy.data.meshes}
    linked = [item.as_pointer() for item in bpy.context.scene.collection.objects]
    result = active().result
    if not there.issuperset(linked) or (result is not None and result.as_pointer() not in there):
        return False
    return all(item.data.as_pointer() in meshes for item in bpy.data.objects if item.type == "MESH")


def raise_ground(ground, height):
    """Change nothing but the mesh."""
    for vertex in ground.data.vertices:
        vertex.co.z = height
    ground.data.update()


def test_a_result_made_after_a_step_in_which_only_the_mesh_changed_is_undone_and_redone(scatter, follow):
    """The scene is the same in both steps: undo keeps it as it is, with a result of which no step knows."""
    ground, undo, redo = scatter.target, bpy.ops.ed.undo, bpy.ops.ed.redo
    ground.select_set(True)
    scatter.live = True
    for height in (0.0, 0.0, 0.0, 1.0):
        raise_ground(ground, height)
        bpy.ops.ed.undo_push(message="changed")
    follow()
    assert len(points()) == 400
    active().result.select_set(True)
    height = 1
    for number in range(8):
        height = 1 - height
        (redo if height else undo)()
        assert leads_to_nothing_that_is_gone()
        if number % 3:
            follow()
            assert active().live and leads_to_nothing_that_is_gone()
            assert len(points()) == 400 and {place[2] for place in points().values()} == {float(height)}
            assert len([item for item in bpy.context.scene.objects if item.name.startswith("Ground Scatter")]) == 1


def test_a_result_that_undo_steps_know_stays_as_it_was_shown(scatter, follow):
    """It is taken out of the scene for the undo, and put again: the scene is the same in both steps."""
    scatter.live = True
    follow()
    result = active().result
    bpy.context.view_layer.objects.active = result
    result.select_set(True)
    for height in (0.0, 1.0, 2.0):
        raise_ground(bpy.data.objects["Ground"], height)
        bpy.ops.ed.undo_push(message="changed")
    before, uid = points(), result.session_uid
    bpy.ops.ed.undo()
    result = active().result
    assert result.session_uid == uid and bpy.context.view_layer.objects.active == result and result.select_get()
    assert moved(before, points()).max() == 0.0 and active().report_json
    follow()
    assert active().live and active().result == result and {place[2] for place in points().values()} == {1.0}


def listening():
    return [hook for handlers, hook in live._hooks() if hook in handlers]


def test_undo_is_listened_to_no_longer_once_a_step_holds_what_live_has_made(scatter, follow):
    """As in the sidebar: the switch makes a step of its own. Blender 4.5 does not tell of steps: it is listened to as before."""
    hooks = 0 if hasattr(bpy.app, "memory_usage_undo") else 4
    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    bpy.ops.ed.undo_push(message="made")
    scatter.live = True
    bpy.ops.ed.undo_push(message="live")
    follow()
    active().classes["Pine"].sizes[0].count = 260
    bpy.ops.ed.undo_push(message="more")
    a_class_of_a_collection(active())
    follow()
    active().live = False
    bpy.ops.ed.undo_push(message="live no longer")
    follow()
    assert len(listening()) == hooks and not live._followed
    shown, ready = len(points()), active().report_json
    for step in (undo, undo, undo, redo, redo, redo):
        step()
        assert leads_to_nothing_that_is_gone()
    follow()
    # Undo and redo have shown all of it by now, on either.
    assert not listening() and len(points()) == shown and active().report_json == ready
    for step in (undo, undo):
        step()
        active().live and live.wake()
        follow()
        assert leads_to_nothing_that_is_gone()
        assert len(points()) == sum(size.count for one in active().classes for size in one.sizes)
    redo()
    redo()
    assert leads_to_nothing_that_is_gone() and len(points()) == shown


def test_undo_is_listened_to_as_long_as_no_step_holds_what_live_has_made(scatter, follow):
    for name in ("made", "later"):
        bpy.ops.ed.undo_push(message=name)
    scatter.live = True
    follow()
    active().live = False
    follow()
    assert len(listening()) == 4 and not live._followed
    bpy.ops.ed.undo()
    assert leads_to_nothing_that_is_gone()
    if hasattr(bpy.app, "memory_usage_undo"):
        bpy.ops.ed.undo_push(message="another")
        bpy.ops.ed.undo()
        follow()
        assert not listening() and leads_to_nothing_that_is_gone()
