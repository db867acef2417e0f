"""Instances set by hand, in any order with undo and redo: points, places that stay free, pins and settings belong together."""

import random

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import bmesh  # noqa: E402
from esh.esh_scatter.result import pins  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


@pytest.fixture
def scattered():
    bpy.ops.mesh.primitive_cone_add(vertices=24, radius1=0.4, depth=1.0, location=(80, 0, 0))
    cone = bpy.context.object
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=10, y_subdivisions=10)
    made = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
    size = made.add_class().sizes[0]
    size.source_object, size.count = cone, 40
    made.device, made.max_steps = "CPU", 5
    done("scatter")


def scatter():
    return bpy.context.scene.esh_scatter.scatters[0]


def is_edited():
    return scatter().result.mode == "EDIT"


def done(button, **asked):
    """Press a button, which makes a step, as it does in a window."""
    getattr(bpy.ops.esh, button)(**asked)
    bpy.ops.ed.undo_push(message=button)


def select(*rows):
    mesh = scatter().result.data
    if not is_edited():
        mesh.vertices.foreach_set("select", np.isin(np.arange(len(mesh.vertices)), rows))
        return
    edited = bmesh.from_edit_mesh(mesh)
    for row, point in enumerate(edited.verts):
        point.select_set(row in rows)
    bmesh.update_edit_mesh(mesh)


def move():
    bpy.ops.transform.translate(value=(0.3, 0.0, 0.0))


def copy():
    bpy.ops.mesh.duplicate()
    move()


def delete():
    """From Blender's menu, which keeps no places free."""
    bpy.ops.mesh.delete(type="VERT")


def count():
    scatter().classes[0].sizes[0].count += 5


def new_seed():
    scatter().seed += 1


def take(step):
    """Take one of these steps, as done in a window: with a step of undo."""
    step()
    bpy.ops.ed.undo_push(message=step.__name__)


def points():
    mesh = scatter().result.data
    if not is_edited():
        return len(mesh.vertices), read_attribute(mesh, "position").tobytes()
    where = [point.co[:] for point in bmesh.from_edit_mesh(mesh).verts]
    return len(where), np.array(where, np.float32).tobytes()


def places():
    return sorted((*one.place, one.radius, one.height) for one in scatter().free_places)


def state():
    """All that the next run takes; who stays, and what is changed, is told outside Edit Mode alone."""
    found = is_edited(), points(), places(), scatter().seed, scatter().classes[0].sizes[0].count
    if is_edited():
        return found
    mesh = scatter().result.data
    return *found, np.flatnonzero(pins.staying(mesh)).tolist(), scatter().changes()


def test_what_done_has_left_is_undone_with_its_places(scattered):
    """Blender leads back to Edit Mode with the settings of before it."""
    where = read_attribute(scatter().result.data, "position")[[5, 6, 7], :2]
    done("instances_edit")
    select(5, 6, 7)
    done("instances_delete")
    removed = state()
    assert len(places()) == 3
    done("instances_edit")
    bpy.ops.ed.undo()
    assert state() == removed
    # Tab
    bpy.ops.object.mode_set(mode="OBJECT")
    assert scatter().changes() == ["instances set by hand"]
    done("scatter")
    now = read_attribute(scatter().result.data, "position")[:, :2]
    assert len(now) == 40 and np.linalg.norm(now[:, None] - where, axis=2).min() > 0.7, "nothing is put there"


def test_what_is_brought_back_and_moved_leaves_no_place_free(scattered):
    done("instances_edit")
    select(5)
    done("instances_delete")
    bpy.ops.ed.undo()
    select(5)
    take(move)
    done("instances_edit")
    assert points()[0] == 40 and not places() and not bpy.ops.esh.instances_refill.poll()


def test_all_that_is_removed_is_brought_back_and_removed_again(scattered):
    done("instances_edit")
    select(*range(40))
    done("instances_delete")
    assert points()[0] == 0 and len(places()) == 40
    done("instances_edit")
    bpy.ops.ed.undo()
    assert is_edited() and points()[0] == 0 and len(places()) == 40
    bpy.ops.ed.undo()
    assert points()[0] == 40 and not places()
    bpy.ops.ed.redo()
    assert points()[0] == 0 and len(places()) == 40


def test_settings_that_are_changed_in_edit_mode_are_undone_there_one_by_one(scattered):
    done("instances_edit")
    take(count)
    select(5)
    done("instances_delete")
    before = state()
    take(count)
    done("class_add")
    for step, counts, classes, gaps in (("undo", 50, 1, 1), ("undo", 45, 1, 1), ("undo", 45, 1, 0), ("undo", 40, 1, 0)):
        getattr(bpy.ops.ed, step)()
        found = scatter()
        assert (found.classes[0].sizes[0].count, len(found.classes), len(places())) == (counts, classes, gaps)
    for _ in range(2):
        bpy.ops.ed.redo()
    assert state() == before


def test_refilled_in_edit_mode_is_undone_there(scattered):
    done("instances_edit")
    select(5, 6)
    done("instances_delete")
    before = state()
    done("instances_refill")
    assert is_edited() and not places()
    bpy.ops.ed.undo()
    assert state() == before and len(places()) == 2
    bpy.ops.ed.redo()
    assert not places()


BUTTONS = (
    *("instances_delete", "instances_remove", "instances_refill", "instances_edit", "instances_edit", "scatter"),
    *("instances_pin", "instances_unpin", "instances_turn", "instances_select_pinned", "class_duplicate"),
)
BY_HAND = (move, move, copy, delete)


@pytest.mark.parametrize("seed", range(8))
def test_every_step_leads_to_what_was_there(scattered, seed):
    dice = random.Random(seed)
    known, at = [state()], 0
    for _ in range(40):
        step = dice.choice((*BUTTONS, *BY_HAND, count, new_seed, *["undo", "redo"] * 4))
        if step in ("undo", "redo"):
            to = at + (1 if step == "redo" else -1)
            if 0 <= to < len(known):
                getattr(bpy.ops.ed, step)()
                at = to
                assert state() == known[at]
            continue
        if points()[0] > 3:
            select(*dice.sample(range(points()[0]), 3))
        if step in BUTTONS and getattr(bpy.ops.esh, step).poll():
            done(step)
        elif step in (count, new_seed) or (step in BY_HAND and is_edited()):
            take(step)
        else:
            continue
        at += 1
        known[at:] = [state()]
