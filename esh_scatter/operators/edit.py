"""What the buttons of the sidebar share: when they can be pressed, and lists that are changed."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...engine.errors import EshError
from ..properties.scene import active_scatter, selected_scatter
from ..result.points_in_front import show_points
from ..result.scene_units import sentence
from ..solving import running
from ..targets.modes import to_object_mode
from ..targets.target import RESULT_TARGET, is_result

__all__ = [
    "BOUNDARY",
    "REGULARITY",
    "ClassEdit",
    "Edit",
    "EntryEdit",
    "MoveEntry",
    "RemoveEntry",
    "ground_in",
    "remove_at",
    "select_points",
    "settings_editable",
    "stood_on",
    "warn_of_unplaced",
]

# What scatters begin with that a button makes: nobody who scatters on a terrain asks for hedges along its edges, nor for rows, which a
# large ground shows from far away.
BOUNDARY, REGULARITY = "NATURAL", 0.4


class Edit(bpy.types.Operator):
    """Base of the small edits of the settings."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not settings_editable(cls, context):
            return False
        if cls._needs(context) is None:
            cls.poll_message_set(cls._missing)
            return False
        return True

    _missing = "Add a scatter first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return active_scatter(context)


class ClassEdit(Edit):
    """Base of the edits of the selected class."""

    _missing = "Select a class first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter and scatter.active_class


# Lists that the sidebar shows: what they are called, by what is in them; those of the scatter, and of its selected class.
_LISTS = {"class": "classes", "obstacle": "obstacles", "layer": "layers", "size": "sizes"}
_OF_SCATTER = ("class", "obstacle")


class EntryEdit(Edit):
    """Base of what is done to the selected entry of a list."""

    _entry = ""

    @classmethod
    def _owner(cls, context: bpy.types.Context) -> Any:
        """Whose list it is; None where nothing is selected."""
        scatter = active_scatter(context)
        return scatter if scatter is None or cls._entry in _OF_SCATTER else scatter.active_class

    @classmethod
    def _needs(cls, context: bpy.types.Context) -> object:
        owner = cls._owner(context)
        return owner and getattr(owner, f"active_{cls._entry}")

    @classmethod
    def _select(cls, owner: Any, index: int) -> None:
        setattr(owner, f"{cls._entry}_index", index)

    @classmethod
    def _list_and_index(cls, owner: Any) -> tuple[Any, int]:
        return getattr(owner, _LISTS[cls._entry]), getattr(owner, f"{cls._entry}_index")


class RemoveEntry(EntryEdit):
    """Base of the buttons that take the selected entry out of its list."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        owner = self._owner(context)
        self._select(owner, remove_at(*self._list_and_index(owner)))
        return {"FINISHED"}


class MoveEntry(EntryEdit):
    """Base of the buttons that move the selected entry within its list."""

    direction: EnumProperty(
        items=(("UP", "Up", "Towards the top of the list"), ("DOWN", "Down", "Towards the end of the list")),
        name="Direction",
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Move it by one place."""
        owner = self._owner(context)
        entries, index = self._list_and_index(owner)
        to = max(0, min(index + (-1 if self.direction == "UP" else 1), len(entries) - 1))
        entries.move(index, to)
        self._select(owner, to)
        return {"FINISHED"}


def stood_on(item: bpy.types.Object | None) -> bpy.types.Object | bpy.types.Collection | None:
    """Return what to scatter on where an object is active: a mesh, or of a result what it stands on; None for anything else."""
    if item is None or item.type != "MESH":
        return None
    # A click on free ground between the objects of a result often picks the result.
    return item.get(RESULT_TARGET) if is_result(item) else item


def ground_in(context: bpy.types.Context) -> bpy.types.Object | bpy.types.Collection | None:
    """Return what to scatter on: the active mesh, what the active result stands on, or else the target of the active scatter."""
    ground = stood_on(context.view_layer.objects.active)
    if ground is not None:
        return ground
    scatter = active_scatter(context)
    return scatter.chosen_target if scatter is not None else None


def settings_editable(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Tell whether settings can be changed now; otherwise the tooltip of ``operator`` says why not."""
    reason = None
    if running.session is not None:
        reason = "A run is in progress. Press Esc to stop it"
    elif context.scene is None or not context.scene.is_editable:
        reason = "This scene is linked from a library and cannot be changed"
    if reason:
        operator.poll_message_set(reason)
    return reason is None


def select_points(operator: bpy.types.Operator, context: bpy.types.Context, chosen: np.ndarray) -> set[str]:
    """Show points of the selected scatter's result in Edit Mode, and select these and no others; returns what the operator answers.

    Args:
        operator: Which one; it reports that the result is hidden, where it is.
        context: Where it was pressed.
        chosen: Whether to select each point, shape ``[n]``.
    """
    result = selected_scatter(context).result_in(context.scene)
    assert result is not None
    try:
        to_object_mode(context)
    except EshError as error:
        operator.report({"ERROR"}, sentence(error))
        return {"CANCELLED"}
    if not result.visible_get():
        operator.report({"ERROR"}, f'"{result.name}" is hidden. Show it first')
        return {"CANCELLED"}
    for item in context.selected_objects:
        item.select_set(False)
    result.select_set(True)
    context.view_layer.objects.active = result
    result.data.vertices.foreach_set("select", chosen)
    context.tool_settings.mesh_select_mode = (True, False, False)
    show_points(result)
    bpy.ops.object.mode_set(mode="EDIT")
    # Whatever stands on the points of a selected object has an outline, also where its point is not selected.
    result.select_set(False)
    return {"FINISHED"}


def remove_at(collection: Any, index: int) -> int:
    """Remove an entry of one of Blender's lists and return which is selected then."""
    collection.remove(index)
    return max(0, min(index, len(collection) - 1))


def warn_of_unplaced(
    operator: bpy.types.Operator, candidates: Iterable[bpy.types.Object], heads: Sequence[bpy.types.Object]
) -> None:
    """Say which of some objects are not placed, and which of the things that hang on those that are, because of their kind."""
    from ..editing.families import metaballs_on, unmeasured

    if names := unmeasured(candidates, heads):
        operator.report({"WARNING"}, f"Left out; convert to a mesh: {', '.join(names)}")

    if names := metaballs_on(heads):
        operator.report(
            {"WARNING"}, f"Left out: geometry nodes show no metaballs; convert to a mesh: {', '.join(names)}"
        )
