"""Live while points of the result are edited."""

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.result import pins  # noqa: E402
from esh.esh_scatter.solving import followed_scatter, live, strokes  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from live_scene import moved, new_scatter, points, switch_on


@pytest.fixture
def scatter(live_file):
    return new_scatter()


@pytest.fixture
def edit_points(scatter):
    """Enter Edit Mode of the result with some points selected, by their numbers."""

    def begin(numbers):
        bpy.ops.object.select_all(action="DESELECT")
        bpy.context.view_layer.objects.active = scatter.result
        mesh = scatter.result.data
        mesh.vertices.foreach_set("select", np.isin(read_attribute(mesh, "id"), numbers))
        bpy.ops.object.mode_set(mode="EDIT")

    return begin


def selected_numbers(result):
    """Return the numbers of the points that are selected, outside Edit Mode."""
    return sorted(read_attribute(result.data, "id")[pins.selected_points(result.data)].tolist())


def test_instances_that_are_moved_in_edit_mode_are_followed_there(scatter, follow, edit_points):
    before = switch_on(scatter, follow)
    near, far = (number for number, _ in sorted(before.items(), key=lambda one: np.hypot(*one[1][:2]))[:2])
    edit_points([near, far])
    follow()
    bpy.ops.transform.translate(value=(1.2, 0.0, 0.0))
    follow()
    assert scatter.result.mode == "EDIT" and live.status(bpy.context.scene, scatter) == ""
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not scatter.outdated
    after = points()
    assert selected_numbers(scatter.result) == sorted([near, far])
    for one in (near, far):
        assert np.linalg.norm(after[one] - before[one] - (1.2, 0.0, 0.0)) < 1e-3
    assert after.keys() == before.keys() and moved(before, after).max() > 0.2, "others make room"
    middle = np.array(list(before.values())) - before[near]
    away = [n for n, way in zip(before, middle, strict=True) if np.hypot(*way[:2]) > 10.0]
    assert np.median([np.linalg.norm(after[n] - before[n]) for n in away]) < 0.2, "a tenth of their spacing"
    # What was solved in Edit Mode is what is there: nothing is left to do.
    follow()
    assert moved(after, points()).max() == 0.0 and not scatter.outdated


def test_what_changes_while_points_are_edited_is_followed_with_the_same_points_selected(scatter, follow, edit_points):
    before = switch_on(scatter, follow)
    edit_points(list(before)[::7])
    bpy.ops.mesh.hide(unselected=True)
    scatter.classes["Beech"].sizes[0].count = 150
    bpy.context.view_layer.update()
    follow()
    assert scatter.result.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(points()) == 350
    left = [number for number in list(before)[::7] if number in points()]
    assert selected_numbers(scatter.result) == sorted(left) and len(left) > 40
    hidden = np.zeros(350, bool)
    scatter.result.data.vertices.foreach_get("hide", hidden)
    assert (~hidden).sum() == len(left)


def test_what_is_pinned_or_removed_by_a_button_in_edit_mode_is_followed_there(scatter, follow, edit_points):
    before = switch_on(scatter, follow)
    one = next(iter(before))
    edit_points([one])
    follow()
    bpy.ops.esh.instances_remove()
    follow()
    assert scatter.result.mode == "EDIT" and len(scatter.free_places) == 1
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(points()) == 400
    gap = min(np.linalg.norm(place[:2] - before[one][:2]) for place in points().values())
    assert gap > 0.29, "its place stays free"


def test_what_is_moved_while_the_others_make_room_is_not_put_back(scatter, follow, edit_points, monkeypatch):
    """An answer to where it was before comes too late."""
    before = switch_on(scatter, follow)
    one = next(iter(before))
    edit_points([one])
    follow()
    bpy.ops.transform.translate(value=(0.6, 0.0, 0.0))
    monkeypatch.setattr(followed_scatter.FollowedScatter, "_may_write", lambda *_: False)
    follow_until_answered(follow)
    bpy.ops.transform.translate(value=(0.6, 0.0, 0.0))
    monkeypatch.undo()
    follow()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert np.linalg.norm(points()[one] - before[one] - (1.2, 0.0, 0.0)) < 1e-3


def follow_until_answered(follow):
    """Let the timer run until what was asked for has come out."""
    one = next(iter(live._followed.values()))
    follow(until=lambda: one._waiting is not None)


def test_settings_that_change_without_a_sign_are_followed_in_edit_mode(scatter, follow, edit_points):
    """Blender says nothing of what scripts change."""
    import bmesh

    switch_on(scatter, follow)
    edit_points([])
    follow()
    for count in (200, 400):
        scatter.classes["Pine"].mute = count == 200
        follow()
        assert scatter.result.mode == "EDIT" and len(bmesh.from_edit_mesh(scatter.result.data).verts) == count


def test_an_operator_of_edit_mode_is_waited_for(scatter, follow, edit_points, monkeypatch):
    before = switch_on(scatter, follow)
    edit_points([next(iter(before))])
    follow()
    bpy.ops.transform.translate(value=(1.2, 0.0, 0.0))
    monkeypatch.setattr(strokes, "edits_points", lambda: True)
    follow()
    assert not live.is_busy(bpy.context.scene, scatter) and live.status(bpy.context.scene, scatter) == ""
    scatter.result.update_from_editmode()
    monkeypatch.setattr(strokes, "edits_points", lambda: False)
    follow()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert moved(before, points()).max() > 1.0 and np.median(moved(before, points())) > 0.0
