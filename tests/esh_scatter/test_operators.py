"""Every button: what it does, why it is gray, and that it does what the API does."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.errors import EshError  # noqa: E402
from esh.esh_scatter import operators  # noqa: E402
from esh.esh_scatter.operators.run import ESH_OT_scatter  # noqa: E402
from esh.esh_scatter.result import result as writing  # noqa: E402
from esh.esh_scatter.solving import background_run, running  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def new_object(name: str, size: float = 1.0) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    corners = [(0, 0, 0), (size, 0, 0), (size, size, 0), (0, size, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def scatter():
    ground, tree = new_object("Ground", 20.0), new_object("Tree")
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name, count in (("Pine", 30), ("Beech", 50)):
        body_class = made.add_class()
        body_class.name = name
        size = body_class.sizes[0]
        size.source_object, size.count, size.area_kind, size.area = tree, count, "VALUE", 0.5
    made.device, made.max_steps = "CPU", 5
    return made


def positions(item: bpy.types.Object) -> bytes:
    values = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", values)
    return values.tobytes()


def attributes(item: bpy.types.Object) -> dict[str, bytes]:
    """Return the bytes of every attribute of the points."""
    found = {}
    for attribute in item.data.attributes:
        if attribute.domain == "POINT" and attribute.data_type in {"FLOAT", "INT", "FLOAT_VECTOR", "QUATERNION"}:
            width = {"FLOAT": 1, "INT": 1, "FLOAT_VECTOR": 3, "QUATERNION": 4}[attribute.data_type]
            values = np.empty(width * len(attribute.data), np.int32 if attribute.data_type == "INT" else np.float32)
            attribute.data.foreach_get("vector" if width == 3 else "value", values)
            found[attribute.name] = values.tobytes()
    return found


def test_operator_and_api_give_the_same_result(scatter):
    from esh.esh_scatter import api

    assert bpy.ops.esh.scatter() == {"FINISHED"}
    by_button = scatter.result
    assert len(by_button.data.vertices) == 80
    (target, classes), named = scatter.arguments(bpy.context.scene)
    by_script = api.scatter(target, classes, **named | {"result": None, "name": "By script"}).object
    assert by_script != by_button
    assert positions(by_script) == positions(by_button)
    assert attributes(by_script) == attributes(by_button)


def test_the_report_is_kept_and_running_again_replaces_the_result(scatter):
    before = set(bpy.context.scene.objects)
    bpy.ops.esh.scatter()
    asked = [size["asked"] for entry in scatter.report["classes"] for size in entry["sizes"]]
    placed = [size["placed"] for entry in scatter.report["classes"] for size in entry["sizes"]]
    assert asked == placed == [30, 50] and not scatter.outdated
    first = positions(scatter.result)
    scatter.seed = 3
    assert scatter.outdated
    bpy.ops.esh.scatter()
    assert positions(scatter.result) != first
    assert set(bpy.context.scene.objects) - before == {scatter.result}
    scatter.seed = 0
    bpy.ops.esh.scatter()
    assert positions(scatter.result) == first


def test_the_panel_of_the_last_operation_has_more_or_fewer_of_all_and_another_seed(scatter):
    scatter.classes[0].count_kind, scatter.classes[0].distance = "DISTANCE", 4.0
    assert bpy.ops.esh.scatter(amount=0.5, seed=7) == {"FINISHED"}
    assert scatter.classes[0].distance == pytest.approx(4.0 * 2.0**0.5)
    assert scatter.classes[1].count == 25 and scatter.seed == 7 and not scatter.outdated
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert scatter.classes[1].count == 25 and scatter.seed == 7, "without a word it is what the sidebar shows"


def test_a_run_that_is_refused_leaves_counts_and_seed_as_they_were(scatter, monkeypatch):
    def fail(*_arguments, **_named):
        raise EshError("it was refused")

    monkeypatch.setattr("esh.esh_scatter.api.scatter", fail)
    with pytest.raises(RuntimeError, match="It was refused"):
        bpy.ops.esh.scatter(amount=3.0, seed=9)
    assert [c.count for c in scatter.classes] == [30, 50] and scatter.seed == 0


@pytest.mark.parametrize("mode", ["TEXTURE_PAINT", "WEIGHT_PAINT", "VERTEX_PAINT", "SCULPT"])
def test_what_is_painted_or_sculpted_is_scattered_on_without_leaving_the_mode(scatter, mode):
    bpy.context.view_layer.objects.active = scatter.target
    bpy.ops.object.mode_set(mode=mode)
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert scatter.target.mode == mode and len(scatter.result.data.vertices) == 80 and not scatter.outdated
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.esh.scatter.poll(), "what Edit Mode holds cannot be read"


def test_a_scatter_takes_the_name_that_its_result_was_given(scatter):
    bpy.ops.esh.scatter()
    result, first = scatter.result, scatter.name
    other = bpy.context.scene.esh_scatter.add_scatter(scatter.target)
    other.name = "Meadow"
    bpy.context.scene.esh_scatter.scatter_index = 0
    result.name = "Forest"
    assert scatter.name == first
    bpy.ops.esh.scatter()
    assert scatter.name == result.name == "Forest" and scatter.result == result
    result.name = "Meadow"
    bpy.ops.esh.scatter()
    assert scatter.name == result.name == "Meadow 2", "no two scatters have one name"
    # Blender numbers what is taken, and cuts what is long.
    bpy.data.objects.new("Hill", None)
    scatter.name = "Hill"
    assert result.name == "Hill.001"
    bpy.ops.esh.scatter()
    assert (scatter.name, result.name) == ("Hill", "Hill.001")
    scatter.name = "Hill " * 80
    long = scatter.name
    bpy.ops.esh.scatter()
    assert scatter.name == long != result.name


def test_renaming_a_scatter_renames_its_result(scatter):
    bpy.ops.esh.scatter()
    result = scatter.result
    scatter.name = "Forest"
    assert result.name == "Forest" and result["esh_scatter_name"] == "Forest" and not scatter.outdated
    bpy.ops.esh.scatter()
    assert scatter.result == result


def test_incomplete_classes_are_skipped_with_a_sentence(scatter, capfd):
    scatter.classes[1].add_layer("IMAGE")
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert len(scatter.result.data.vertices) == 30
    assert "Beech is left out: choose its density image" in capfd.readouterr().out
    assert not scatter.outdated
    scatter.classes[1].layers[0].use = False
    assert scatter.changes() == ["Beech is new"]


def test_two_scatters_keep_apart(scatter):
    bpy.ops.esh.scatter()
    first = scatter.result
    bpy.context.view_layer.objects.active = bpy.data.objects["Ground"]
    bpy.ops.esh.scatter_add()
    bpy.ops.esh.class_add()
    second = bpy.context.scene.esh_scatter.active
    second.classes[0].sizes[0].source_object = bpy.data.objects["Tree"]
    second.classes[0].sizes[0].count = 12
    second.max_steps = 5
    bpy.ops.esh.scatter()
    assert second.result != first and len(second.result.data.vertices) == 12
    assert len(first.data.vertices) == 80 and bpy.context.scene.objects.get(first.name) == first


def test_a_deleted_result_is_made_anew(scatter):
    bpy.ops.esh.scatter()
    name, mesh, group = scatter.result.name, scatter.result.data.name, scatter.result.modifiers[0].node_group.name
    bpy.context.scene.collection.objects.unlink(scatter.result)
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert scatter.result.name == name == scatter.name, "and it is not the second of its name"
    assert (scatter.result.data.name, scatter.result.modifiers[0].node_group.name) == (mesh, group)
    assert bpy.context.scene.objects.get(name) == scatter.result


def test_the_node_group_is_built_anew_only_for_other_things(scatter, monkeypatch):
    """To build it takes longer than all else that is written, and Live writes with every count that is dragged."""
    built, build = [], writing.set_node_group
    monkeypatch.setattr(writing, "set_node_group", lambda *given: (built.append(1), build(*given)))

    def group():
        return next(m.node_group for m in scatter.result.modifiers if m.type == "NODES")

    def shown():
        instances = bpy.context.evaluated_depsgraph_get().object_instances
        return sum(1 for one in instances if one.is_instance)

    bpy.ops.esh.scatter()
    first, mesh, groups = group().session_uid, scatter.result.data.name, len(bpy.data.node_groups)
    scatter.classes["Pine"].show_viewport = False
    scatter.classes["Beech"].sizes[0].count = 70
    bpy.ops.esh.scatter()
    assert len(built) == 1 and group().session_uid == first and shown() == 70 and scatter.result.data.name == mesh
    assert len(scatter.result.data.vertices) == 100 and len(bpy.data.node_groups) == groups
    assert len([one for one in bpy.data.meshes if one.name.startswith(mesh)]) == 1
    scatter.classes["Beech"].sizes[0].source_object = new_object("Oak", 2.0)
    bpy.ops.esh.scatter()
    assert len(built) == 2 and group().session_uid == first and shown() == 70 and len(bpy.data.node_groups) == groups


def test_nothing_is_selected_after_a_run(scatter):
    """So that what is done with selected instances is done with none, and not with all."""
    bpy.ops.esh.scatter()
    count = len(scatter.result.data.vertices)
    for name in ("instances_pin", "instances_turn", "instances_remove"):
        assert getattr(bpy.ops.esh, name)() == {"CANCELLED"}
    assert len(scatter.result.data.vertices) == count


def test_undo_brings_back_what_was_there(scatter):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.esh.scatter()
    bpy.ops.ed.undo_push(message="first run")
    name, first = scatter.result.name, positions(scatter.result)
    scatter.seed = 9
    bpy.ops.esh.scatter()
    bpy.ops.ed.undo_push(message="second run")
    bpy.ops.ed.undo()
    restored = bpy.context.scene.esh_scatter.active
    assert positions(restored.result) == first and restored.seed == 0 and not restored.outdated
    bpy.ops.ed.undo()
    restored = bpy.context.scene.esh_scatter.active
    assert restored.result is None and restored.report is None and name not in bpy.context.scene.objects


def test_what_the_engine_refuses_is_one_sentence_and_changes_nothing(scatter):
    scatter.device = "CUDA"
    import warp as wp

    if wp.is_cuda_available():
        pytest.skip("this machine has the device that the test asks for in vain")
    before = set(bpy.data.objects)
    with pytest.raises(RuntimeError) as refused:
        bpy.ops.esh.scatter()
    message = str(refused.value)
    assert message.startswith("Error: ") and len(message.strip().splitlines()) == 1 and "Traceback" not in message
    assert set(bpy.data.objects) == before and scatter.result is None and not scatter.report_json


def test_the_button_is_gray_with_a_reason(scatter):
    assert bpy.ops.esh.scatter.poll()
    scatter.target = None
    assert not bpy.ops.esh.scatter.poll()
    with pytest.raises(RuntimeError, match="Choose a target"):
        bpy.ops.esh.scatter()


def test_nothing_can_be_edited_or_started_during_a_run(scatter, monkeypatch):
    monkeypatch.setattr(running, "session", SimpleNamespace())
    for cls in operators.CLASSES:
        name = cls.bl_idname.split(".")[1]
        assert getattr(bpy.ops.esh, name).poll() == (name == "stop"), name
    monkeypatch.undo()
    assert not bpy.ops.esh.stop.poll()


def test_a_run_waits_for_the_thread_of_one_that_was_stopped(scatter, monkeypatch):
    may_end, order = threading.Event(), []
    before = background_run.BackgroundRun(lambda _progress: may_end.wait(30) and order.append("first"))
    monkeypatch.setattr(running, "_stopping", before)
    assert bpy.ops.esh.scatter.poll(), "everything is usable at once"
    job = Job()
    job.solve = lambda _progress, _ask: order.append("second")
    window = Window(monkeypatch, job)
    assert running.session.text == "Waiting for the stopped run"
    may_end.set()
    assert window.run_to_end() == {"FINISHED"} and order == ["first", "second"] and job.written


class Window:
    """Drives the modal operator as a window would, one event at a time."""

    def __init__(self, monkeypatch, job) -> None:
        self.timers, self.reports = [], []
        manager = SimpleNamespace(
            event_timer_add=lambda *_a, **_k: self.timers.append("timer") or "timer",
            event_timer_remove=self.timers.remove,
            windows=[],
        )
        scene = bpy.context.scene
        self.context = SimpleNamespace(
            window_manager=manager,
            scene=scene,
            window="window",
            screen=None,
            workspace=None,
            view_layer=bpy.context.view_layer,
            evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
        )
        monkeypatch.setattr(running.bpy, "context", self.context)
        running.start(self.context, job)
        operator = SimpleNamespace(
            report=lambda kind, text: self.reports.append((*kind, text)),
            _undo=lambda _context: None,
            _hints=(),
            _held="",
        )
        for name in ("_stopped", "_write", "_failed", "_finish"):
            setattr(operator, name, getattr(ESH_OT_scatter, name).__get__(operator))
        if isinstance(job, Job):
            operator._finish = lambda _settings, _result, _made_with: {"FINISHED"}
        self.operator = operator

    def send(self, kind: str, value: str = "PRESS", *keys: str) -> set[str]:
        held = {name: name in keys for name in ("ctrl", "oskey", "shift", "alt")}
        event = SimpleNamespace(type=kind, value=value, mouse_x=0, mouse_y=0, **held)
        return ESH_OT_scatter.modal(self.operator, self.context, event)

    def run_to_end(self) -> set[str]:
        running.session.run.join(120)
        return self.send("TIMER", "NOTHING")


def test_the_modal_run_gives_what_the_script_gives(scatter, monkeypatch):
    from esh.esh_scatter import api

    bpy.ops.esh.scatter()
    expected = positions(scatter.result)
    positional, named = scatter.arguments(bpy.context.scene)
    job = api.ScatterJob(*positional, **named | {"result": None, "name": "Modal"})
    real_context = bpy.context
    window = Window(monkeypatch, job)
    job_write = job.write
    monkeypatch.setattr(job, "write", lambda: job_write(real_context), raising=False)
    assert window.send("A") == {"RUNNING_MODAL"}, "what would change the scene is held back"
    assert window.send("MIDDLEMOUSE") == {"PASS_THROUGH"}, "looking around is not"
    assert window.run_to_end() == {"FINISHED"}
    assert positions(scatter.result) == expected
    assert window.timers == [] and running.session is None
    assert [kind for kind, _ in window.reports] in (["INFO"], ["WARNING"])


def test_the_panel_of_the_last_operation_keeps_what_its_own_run_was_read_from(scatter, monkeypatch):
    """Blender runs the same operator once more, which has been modal before."""
    from esh.esh_scatter.operators.run_operator import job_of

    real_context = bpy.context
    job = job_of(real_context, scatter)
    window = Window(monkeypatch, job)
    job_write = job.write
    monkeypatch.setattr(job, "write", lambda: job_write(real_context), raising=False)
    assert window.run_to_end() == {"FINISHED"} and not scatter.outdated
    monkeypatch.setattr(running.bpy, "context", real_context)
    scatter.seed += 1
    assert scatter.outdated
    window.operator._settings, window.operator.asked = lambda _context: scatter, False
    window.operator.options = SimpleNamespace(is_repeat=True)
    assert ESH_OT_scatter.execute(window.operator, real_context) == {"FINISHED"}
    assert not scatter.outdated and scatter.changes() == []


class Job:
    """A job that takes until it is stopped."""

    def __init__(self) -> None:
        self.written = False
        # What the operator does with what was written is not looked at, nor what it was read from.
        self.result, self.made_with = SimpleNamespace(report=None), ""

    def solve(self, progress, _ask):
        while progress(SimpleNamespace(step=1, steps=5)):
            pass

    def write(self):
        self.written = True
        return self.result


@pytest.mark.parametrize("how", ["ESC", "Ctrl Z", "Cmd Z", "undo", "stop button"])
def test_a_stopped_run_leaves_what_was_there(scatter, monkeypatch, how):
    job = Job()
    window = Window(monkeypatch, job)
    run = running.session.run
    if how == "undo":
        assert running._interrupt in bpy.app.handlers.undo_pre
        running._interrupt(bpy.context.scene)
    elif how == "stop button":
        running.stop("Stopped; nothing was changed")
    pressed = {"ESC": ("ESC", "PRESS"), "Ctrl Z": ("Z", "PRESS", "ctrl"), "Cmd Z": ("Z", "PRESS", "oskey")}
    if how in pressed:
        assert window.send("Z") == window.send("Z", "PRESS", "ctrl", "shift") == {"RUNNING_MODAL"}
    assert window.send(*pressed.get(how, ("TIMER",))) == {"CANCELLED"}
    run.join(30)
    assert not run.running and not job.written and window.timers == [] and running.session is None
    assert not any(running._interrupt in handlers for handlers in running._interrupting())
    assert [kind for kind, _ in window.reports] == ["WARNING"]


@pytest.mark.parametrize("what", ["the scatter", "the one before it", "the scene", "the scene of a survey"])
def test_a_run_whose_scatter_is_removed_by_a_script_ends_at_once(scatter, monkeypatch, what):
    """It was solved to its end, and what it placed was taken for that of the scatter that came into its place."""
    scenes = bpy.context.scene.esh_scatter
    scene = bpy.context.scene
    scenes.add_scatter(scatter.target)
    if what == "the one before it":
        scenes.add_scatter(scatter.target)
    scenes.scatter_index = 1 if what == "the one before it" else 0
    job = Job()
    if what == "the scene of a survey":
        job = SimpleNamespace(solve=job.solve, written=False)
    window = Window(monkeypatch, job)
    chosen = scenes.scatters[scenes.scatter_index].name
    run = running.session.run
    assert window.send("TIMER") == {"PASS_THROUGH"}
    undone, finished = [], []
    window.operator._undo = lambda _context: undone.append(1)
    window.operator._finish = lambda settings, _result, _made_with: finished.append(settings.name) or {"FINISHED"}
    if "scene" in what:
        bpy.data.scenes.new("Other")
        bpy.data.scenes.remove(scene)
    else:
        scenes.scatters.remove(0)
    if what == "the one before it":
        assert window.send("TIMER") == {"PASS_THROUGH"}, "it goes on, and its result is its own"
        running.keep()
        assert window.run_to_end() == {"FINISHED"} and finished == [chosen]
        return
    assert window.send("TIMER") == {"CANCELLED"}
    run.join(30)
    assert not run.running and not job.written and not undone and running.session is None
    told = "Stopped, because the scatter was removed during the run. Nothing was placed"
    assert window.reports == [("WARNING", told)]


def test_keep_takes_what_is_there(scatter, monkeypatch):
    job = Job()
    window = Window(monkeypatch, job)
    deadline = time.monotonic() + 30
    while running.session.run.progress is None and time.monotonic() < deadline:
        time.sleep(0.01)
    assert bpy.ops.esh.keep.poll()
    running.keep()
    assert running.session.text == "Keeping what is there" and not bpy.ops.esh.keep.poll()
    assert window.run_to_end() == {"FINISHED"} and job.written and running.session is None


def test_errors_of_the_thread_reach_the_user_as_a_sentence(scatter, monkeypatch):
    from esh.engine.errors import ProblemError

    job = Job()
    job.solve = lambda _progress, _ask: (_ for _ in ()).throw(ProblemError("`count` is too large"))
    window = Window(monkeypatch, job)
    assert window.run_to_end() == {"CANCELLED"}
    assert window.reports == [("ERROR", "Count is too large")] and not job.written and window.timers == []


def test_unregistering_ends_a_run(scatter, monkeypatch):
    window = Window(monkeypatch, Job())
    run = running.session.run
    running.end(wait=True)
    assert not run.running and window.timers == [] and running.session is None
    assert isinstance(run, background_run.BackgroundRun)


def test_lists_are_edited_by_their_buttons(scatter):
    def names():
        return [c.name for c in scatter.classes]

    bpy.ops.esh.class_add()
    assert len(names()) == 3 and scatter.class_index == 2
    bpy.ops.esh.class_move(direction="UP")
    assert names() == ["Pine", "Class", "Beech"] and scatter.class_index == 1
    bpy.ops.esh.class_move(direction="DOWN")
    bpy.ops.esh.class_move(direction="DOWN")
    assert names() == ["Pine", "Beech", "Class"] and scatter.class_index == 2
    bpy.ops.esh.class_remove()
    assert names() == ["Pine", "Beech"] and scatter.class_index == 1
    bpy.ops.esh.size_add()
    sizes = scatter.active_class.sizes
    assert len(sizes) == 2 and scatter.active_class.size_index == 1
    second = sizes[1].name
    bpy.ops.esh.size_move(direction="UP")
    assert sizes[0].name == second and scatter.active_class.size_index == 0
    bpy.ops.esh.size_remove()
    bpy.ops.esh.size_remove()
    assert len(sizes) == 0 and not bpy.ops.esh.size_remove.poll() and bpy.ops.esh.size_add.poll()
    bpy.ops.esh.class_remove()
    bpy.ops.esh.class_remove()
    assert not bpy.ops.esh.class_remove.poll() and not bpy.ops.esh.size_add.poll()
    bpy.ops.esh.scatter_remove()
    assert not bpy.ops.esh.class_add.poll() and bpy.ops.esh.scatter_add.poll()


def test_the_dice_always_give_another_seed(scatter):
    for _ in range(20):
        before = scatter.seed
        bpy.ops.esh.seed_roll()
        assert scatter.seed != before and scatter.seed >= 0


def test_a_class_that_follows_one_that_is_left_out_is_left_out_too(scatter):
    one, other = scatter.classes[0], scatter.add_class()
    other.name = "Follower"
    other.sizes[0].source_object = one.sizes[0].source_object
    follows = other.add_layer("CLASS")
    follows.class_name = one.name
    assert len(scatter.ready_classes()) == len(scatter.classes)
    lacks = one.add_layer("VERTEX_GROUP")
    assert f'it follows "{one.name}", which is left out' in scatter.obstacle_of(other)
    one.layers.remove(list(one.layers).index(lacks))
    back = one.add_layer("CLASS")
    back.class_name = "Follower"
    for c, name in ((one, "Follower"), (other, one.name)):
        assert f'it and "{name}" follow each other' in scatter.obstacle_of(c)


def test_new_scatters_have_seeds_of_their_own_and_no_hedges():
    """Two of the same settings stood in the same places."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=10)
    for _ in range(3):
        assert bpy.ops.esh.scatter_add() == {"FINISHED"}
    scatters = bpy.context.scene.esh_scatter.scatters
    assert [one.seed for one in scatters] == [0, 1, 2]
    assert {(one.boundary, round(one.regularity, 3)) for one in scatters} == {("NATURAL", 0.4)}
    scatters.remove(1)
    assert bpy.ops.esh.scatter_add() == {"FINISHED"}
    assert [one.seed for one in scatters] == [0, 2, 1]


@pytest.mark.parametrize(
    ("extent", "unit", "far"), [(20.0, 1.0, 5.0), (0.4, 1.0, 0.1), (400.0, 1.0, 5.0), (40_000.0, 0.01, 500.0)]
)
def test_what_is_near_something_is_nearer_on_small_ground(extent, unit, far):
    """On a table that is 0.4 m wide all was within 5 m."""
    bpy.context.scene.unit_settings.scale_length = unit
    bpy.ops.mesh.primitive_plane_add(size=extent)
    scatter = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
    layers = scatter.add_class().layers
    assert bpy.ops.esh.layer_add(kind="DISTANCE") == {"FINISHED"}
    assert layers[0].distance_far == pytest.approx(far)
