"""The classes of a scatter: added, removed, moved, sorted, copied, and which of them may overlap."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty

from ..classes.flat_objects import lift_of_class
from ..classes.name_lists import joined_names
from ..classes.sunk_objects import sunk_share_of_class
from ..editing.class_copy import CLASS_PARTS, copy_class
from ..properties.body_class import ESH_PG_class
from ..properties.names import unused_name
from ..properties.scene import active_scatter, selected_class, selected_scatter
from .edit import ClassEdit, Edit, MoveEntry

__all__ = ["CLASSES"]


class ESH_OT_class_add(Edit):
    """Add a class: one kind of thing, for example pines, with its own density"""

    bl_idname = "esh.class_add"
    bl_label = "Add Class"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        selected_scatter(context).add_class().waits_for_first = True
        return {"FINISHED"}


class ESH_OT_class_remove(ClassEdit):
    """Remove the selected class"""

    bl_idname = "esh.class_remove"
    bl_label = "Remove Class"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        scatter = selected_scatter(context)
        scatter.remove_class(scatter.class_index)
        return {"FINISHED"}


class ESH_OT_class_lift(ClassEdit):
    """Lift the flat objects of the selected class a little off the ground, so that it does not show through them. Rotation and Scale has the Offset"""  # noqa: E501

    bl_idname = "esh.class_lift"
    bl_label = "Lift off the Ground"
    _missing = "Select a class of flat objects that lie in the ground"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        body_class = scatter and scatter.active_class
        return (body_class and lift_of_class(body_class)) or None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Lift them; the result shows it at once."""
        body_class = selected_class(context)
        body_class.offset = lift_of_class(body_class)
        return {"FINISHED"}


class ESH_OT_class_raise(ClassEdit):
    """Have the objects of the selected class stand on their lowest points: their origins are in their middles. Rotation and Scale has Stand On"""  # noqa: E501

    bl_idname = "esh.class_raise"
    bl_label = "Stand on Lowest Point"
    _missing = "Select a class of objects whose origin is in their middle and stands on the ground"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        body_class = scatter and scatter.active_class
        return (body_class and sunk_share_of_class(body_class)) or None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Raise them; the result shows it at once."""
        selected_class(context).stand_on = "LOWEST"
        return {"FINISHED"}


class ESH_OT_class_duplicate(ClassEdit):
    """Add a copy of the selected class, with all of its settings"""

    bl_idname = "esh.class_duplicate"
    bl_label = "Duplicate Class"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it below the selected one."""
        scatter = selected_scatter(context)
        index, name = scatter.class_index, selected_class(context).name
        copy = scatter.add_class()
        copy_class(scatter.classes[index], copy, CLASS_PARTS)
        copy.name = unused_name(name, {other.name for other in scatter.classes[:-1]})
        if name == scatter.classes[index].named_after:
            copy.named_after = copy.name
            for size, copied in zip(scatter.classes[index].sizes, copy.sizes, strict=True):
                copied.names_class = size.names_class
        scatter.classes.move(len(scatter.classes) - 1, index + 1)
        scatter.class_index = index + 1
        return {"FINISHED"}


# Blender needs the texts of an enumeration to stay in memory, also those that it was given before: a dialog that is open shows these.
_other_classes: list[tuple[str, str, str, int]] = []
_texts: dict[str, str] = {}


def _list_other_classes(_operator: Any, context: bpy.types.Context | None) -> list[tuple[str, str, str, int]]:
    scatter = active_scatter(context) if context else None
    _other_classes.clear()
    if scatter:
        # An enumeration of which several can be chosen has 32 bits.
        numbers = [i for i in range(len(scatter.classes)) if i != scatter.class_index][:31]
        for bit, i in enumerate(numbers):
            uid, name = (
                _texts.setdefault(text, text) for text in (str(scatter.classes[i].uid), scatter.classes[i].name)
            )
            _other_classes.append((uid, name, "Give this class the settings", 1 << bit))
    return _other_classes


class ESH_OT_class_copy(ClassEdit):
    """Give settings of the selected class to other classes"""

    bl_idname = "esh.class_copy"
    bl_label = "Copy Settings to Classes"

    what: EnumProperty(
        name="Settings",
        description="Which settings to copy",
        items=[(name, label, told) for name, (label, told, _names) in CLASS_PARTS.items()],
        default={"DENSITY", "STANDING"},
        options={"ENUM_FLAG"},
    )
    classes: EnumProperty(
        name="To", description="The classes that get the settings", items=_list_other_classes, options={"ENUM_FLAG"}
    )

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return (scatter and scatter.active_class and len(scatter.classes) > 1) or None

    _missing = "Add another class first"

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Ask for settings and classes."""
        self.classes = {entry[0] for entry in _list_other_classes(self, context)}
        return context.window_manager.invoke_props_dialog(self, width=280)

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the dialog."""
        self.layout.label(text="Settings", translate=False)
        self.layout.column(align=True).prop(self, "what", expand=True)
        self.layout.label(text="To", translate=False)
        self.layout.column(align=True).prop(self, "classes", expand=True)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Copy them."""
        source = selected_class(context)
        parts = {name: CLASS_PARTS[name] for name in CLASS_PARTS if name in self.what}
        chosen = [c for c in selected_scatter(context).classes if str(c.uid) in self.classes and c != source]
        for body_class in chosen:
            copy_class(source, body_class, parts)
        many = "1 class" if len(chosen) == 1 else f"{len(chosen)} classes"
        self.report({"INFO"}, f"Copied settings to {many}")
        return {"FINISHED"}


class ESH_OT_classes_sort(ClassEdit):
    """Sort the classes. The result is then out of date, because the order of the classes affects it"""

    bl_idname = "esh.classes_sort"
    bl_label = "Sort Classes"

    by: EnumProperty(
        name="By",
        description="What the classes are sorted by",
        items=(("NAME", "Name", "In alphabetical order"), ("COUNT", "Count", "The most numerous first")),
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Sort them."""
        scatter = selected_scatter(context)
        active = selected_class(context).uid

        def key(body_class: ESH_PG_class) -> Any:
            return body_class.name.casefold() if self.by == "NAME" else -body_class.count

        for place, uid in enumerate([c.uid for c in sorted(scatter.classes, key=key)]):
            scatter.classes.move(next(i for i, c in enumerate(scatter.classes) if c.uid == uid), place)
        scatter.class_index = next(i for i, c in enumerate(scatter.classes) if c.uid == active)
        return {"FINISHED"}


class ESH_OT_class_overlap(ClassEdit):
    """Let this class and the selected one overlap, or keep them apart"""

    bl_idname = "esh.class_overlap"
    bl_label = "May Overlap"

    other: StringProperty(name="Class", description="The other class")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Change it, whichever of the two had it written down."""
        scatter, mine = selected_scatter(context), selected_class(context)
        other = scatter.classes.get(self.other)
        if other is None or other == mine:
            self.report({"ERROR"}, f'There is no other class "{self.other}"')
            return {"CANCELLED"}
        if mine.overlaps_with(other):
            for one, two in ((mine, other), (other, mine)):
                one.may_overlap = joined_names(one.names_that_may_overlap - {two.name})
        else:
            mine.may_overlap = joined_names(mine.names_that_may_overlap | {other.name})
        return {"FINISHED"}


class ESH_OT_class_move(MoveEntry):
    """Move the selected class in the list"""

    bl_idname = "esh.class_move"
    bl_label = "Move Class"
    _entry, _missing = "class", "Select a class first"


CLASSES = (
    ESH_OT_class_add,
    ESH_OT_classes_sort,
    ESH_OT_class_duplicate,
    ESH_OT_class_copy,
    ESH_OT_class_overlap,
    ESH_OT_class_remove,
    ESH_OT_class_lift,
    ESH_OT_class_raise,
    ESH_OT_class_move,
)
