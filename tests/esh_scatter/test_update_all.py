"""All scatters of a scene that are out of date are run by one button, each making room for those before it."""

import inspect
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.operators.update_all import ESH_OT_scatter_all  # noqa: E402
from esh.esh_scatter.result.kept_ground import CLASSES_OF_POINTS  # noqa: E402
from esh.esh_scatter.solving import running  # noqa: E402
from esh.esh_scatter.targets import checksums  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def scatters():
    return bpy.context.scene.esh_scatter.scatters


def place(scatter):
    return np.array([vertex.co[:2] for vertex in scatter.result.data.vertices])


def outdated():
    with checksums.now():
        return [one.name for one in scatters() if one.outdated]


@pytest.fixture
def woods():
    """Three scatters on one ground, each run once."""
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=20, y_subdivisions=20)
    ground = bpy.context.object
    bpy.ops.mesh.primitive_cylinder_add(vertices=32, radius=0.3, depth=1.0, location=(80, 0, 0))
    tree = bpy.context.object
    for name in ("Wood", "Fern", "Moss"):
        made = bpy.context.scene.esh_scatter.add_scatter(ground)
        made.name = name
        size = made.add_class().sizes[0]
        size.source_object, size.count = tree, 60
        made.device, made.max_steps = "CPU", 10
        assert bpy.ops.esh.scatter() == {"FINISHED"}
    bpy.context.scene.esh_scatter.scatter_index = 1
    return ground


def test_all_that_is_out_of_date_is_updated_in_order(woods):
    assert outdated() == []
    woods.data.vertices[40].co.z += 0.4
    assert outdated() == ["Wood", "Fern", "Moss"]
    assert bpy.ops.esh.scatter_all() == {"FINISHED"}
    assert outdated() == [] and bpy.context.scene.esh_scatter.active.name == "Fern", "the one that was shown"
    away = [np.linalg.norm(place(scatters()[i])[:, None] - place(scatters()[j]), axis=2) for i, j in ((0, 1), (1, 2))]
    assert min(one.min() for one in away) > 0.55, "each makes room for those before it"


def test_only_what_is_out_of_date_is_run_and_what_has_to_make_room_then(woods):
    before = place(scatters()[0])
    scatters()[1].seed = 7
    fern, moss = place(scatters()[1]), place(scatters()[2])
    reports = [one.report_json for one in scatters()]
    assert bpy.ops.esh.scatter_all() == {"FINISHED"}
    assert np.array_equal(place(scatters()[0]), before) and scatters()[0].report_json == reports[0]
    assert not np.array_equal(place(scatters()[1]), fern) and not np.array_equal(place(scatters()[2]), moss)
    assert bpy.ops.esh.scatter_all() == {"CANCELLED"}, "nothing is out of date any more"


def test_what_cannot_be_run_unasked_is_left_out_and_told_of(woods, capfd):
    wood, fern, moss = scatters()
    wood.classes[0].sizes[0].count = 61
    wood.cap = 10
    fern.classes[0].sizes[0].source_object = None
    moss.classes[0].sizes[0].count = 50
    assert bpy.ops.esh.scatter_all() == {"FINISHED"}
    assert [len(one.result.data.vertices) for one in (wood, fern, moss)] == [60, 60, 50]
    told = capfd.readouterr().out
    assert '"Moss" updated. "Wood" was left out: ' in told and '"Fern" was left out: ' in told


def test_what_was_deleted_does_not_come_back_and_what_was_never_run_stays_so(woods):
    wood, fern, moss = scatters()
    bpy.data.objects.remove(wood.result)
    moss.report_json, moss.result = "", None
    count = len(bpy.data.objects)
    woods.data.vertices[40].co.z += 0.4
    assert bpy.ops.esh.scatter_all() == {"FINISHED"}
    assert len(bpy.data.objects) == count and wood.result is None and moss.result is None and "Fern" not in outdated()
    assert fern.report["steps"] > 0


def test_it_is_gray_before_anything_was_run():
    assert not bpy.ops.esh.scatter_all.poll()
    bpy.context.scene.esh_scatter.add_scatter(None)
    assert not bpy.ops.esh.scatter_all.poll()


class WindowContext:
    """The context as it is in a window, with timers that do nothing."""

    window, screen, workspace = "window", None, None

    def __init__(self, manager) -> None:
        self.window_manager = manager

    def __getattr__(self, name):
        return getattr(bpy.context, name)


class Window:
    """Drives the operator as a window would, one event at a time."""

    def __init__(self, monkeypatch) -> None:
        self.reports: list[tuple[str, str]] = []
        manager = SimpleNamespace(
            event_timer_add=lambda *_a, **_k: "timer",
            event_timer_remove=lambda _timer: None,
            modal_handler_add=lambda _operator: None,
            windows=[],
        )
        self.context = WindowContext(manager)
        self.operator = SimpleNamespace(report=lambda kind, text: self.reports.append((*kind, text)), asked=False)
        for name, function in inspect.getmembers(ESH_OT_scatter_all, inspect.isfunction):
            setattr(self.operator, name, function.__get__(self.operator))
        self.operator._hints, self.operator._held = (), ""
        monkeypatch.setattr("esh.esh_scatter.operators.run_operator.in_background", lambda: False)
        monkeypatch.setattr(running, "bpy", SimpleNamespace(context=self.context, app=bpy.app))

    def invoke(self) -> set[str]:
        # The base class is named by its own methods.
        base = ESH_OT_scatter_all.__mro__[1]
        self.operator._list(self.context)
        answer = base.invoke(self.operator, self.context, None)
        # What computes is loaded first.
        return answer if running.session is None or running.session.scatter else self.one_done()

    def one_done(self) -> set[str]:
        running.session.run.join(120)
        return self.send("TIMER")

    def send(self, kind: str) -> set[str]:
        held = dict.fromkeys(("ctrl", "oskey", "shift", "alt"), False)
        value = "NOTHING" if kind == "TIMER" else "PRESS"
        return self.operator.modal(self.context, SimpleNamespace(type=kind, value=value, mouse_x=0, mouse_y=0, **held))


def test_in_a_window_one_follows_the_other(woods, monkeypatch):
    woods.data.vertices[40].co.z += 0.4
    settings = bpy.context.scene.esh_scatter
    window = Window(monkeypatch)
    answer, shown = window.invoke(), []
    while answer == {"RUNNING_MODAL"}:
        shown.append(settings.active.name)
        answer = window.one_done()
    assert answer == {"FINISHED"} and shown == ["Wood", "Fern", "Moss"] and outdated() == []
    assert settings.active.name == "Fern" and running.session is None
    assert window.reports == [("INFO", '"Wood", "Fern" and "Moss" updated')]


def test_what_changes_during_a_run_is_not_taken_for_seen(woods, monkeypatch):
    wood, fern, moss = scatters()
    woods.data.vertices[40].co.z += 0.4
    wood.add_class().sizes[0].source_object = wood.classes[0].sizes[0].source_object
    window = Window(monkeypatch)
    assert window.invoke() == {"RUNNING_MODAL"}
    # A script or an animation does so while the window goes on.
    wood.classes[0].sizes[0].count = 50
    uids = [one.uid for one in wood.classes]
    wood.classes.move(0, 1)
    assert window.one_done() == {"RUNNING_MODAL"}
    assert list(wood.result.data[CLASSES_OF_POINTS]) == uids, "points belong to the classes that they were made for"
    fern.seed += 1
    assert window.one_done() == {"RUNNING_MODAL"}
    woods.data.vertices[41].co.z += 0.4
    assert window.one_done() == {"FINISHED"}
    assert outdated() == ["Wood", "Fern", "Moss"]
    with checksums.now():
        assert moss.changes() == ["shape or place of the target"]
    assert len(wood.result.data.vertices) > 60 and wood.changes()


def test_what_a_run_writes_itself_does_not_make_it_out_of_date(woods, monkeypatch):
    wood = scatters()[0]
    # Its own result lies in what it keeps off and stands near, and has pins.
    around = bpy.data.collections.new("Around")
    bpy.context.scene.collection.children.link(around)
    around.objects.link(wood.result)
    obstacle = wood.obstacles.add()
    obstacle.kind, obstacle.collection = "COLLECTION", around
    assert wood.obstacles[0].ready
    wood.result.data.vertices[3].co.x += 0.2
    wood.seed += 1
    window = Window(monkeypatch)
    answer = window.invoke()
    while answer == {"RUNNING_MODAL"}:
        answer = window.one_done()
    assert answer == {"FINISHED"} and outdated() == []


def test_esc_keeps_what_is_done(woods, monkeypatch):
    woods.data.vertices[40].co.z += 0.4
    settings = bpy.context.scene.esh_scatter
    window = Window(monkeypatch)
    assert window.invoke() == {"RUNNING_MODAL"}
    assert window.one_done() == {"RUNNING_MODAL"}
    assert window.send("ESC") == {"FINISHED"}, "what is done can be undone"
    assert outdated() == ["Fern", "Moss"] and settings.active.name == "Fern" and running.session is None
    assert window.reports == [("WARNING", '"Wood" updated. Stopped. The others were not changed')]
