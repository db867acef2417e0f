"""Objects scattered at once: a new scatter with a class of each of those that are selected."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import sys
from typing import TYPE_CHECKING

import bpy
from bpy.props import FloatProperty, IntProperty

from ...engine.errors import EshError
from ...engine.problem.scatter_settings import ScatterSettings, TargetSettings
from ...engine.problem.settings import settings_of
from ..editing.beside_others import fit_beside_others, free_share
from ..editing.left_out import nothing_left, told
from ..properties.described import identifier_of, property_of, value_of
from ..properties.scatter import ESH_PG_scatter
from ..result import words
from ..result.scene_units import sentence
from ..targets.shown_instances import instead_of_instance
from ..targets.target import members_of, shown_collection
from .edit import BOUNDARY, REGULARITY, remove_at, settings_editable, stood_on, warn_of_unplaced
from .run_operator import RunOperator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..editing.selection import Measured, SelectionSurvey

__all__ = ["CLASSES", "ScatterObjects"]

_SETTINGS = settings_of(ScatterSettings)
# Settings of the panel of the last operation that are those of the new scatter.
_TAKEN = ("surface", "class_separation", "boundary", "regularity", "seed")


class ScatterObjects(RunOperator):
    """Base of what makes a class of each of some objects, and scatters them on the active one, or what its result stands on."""

    cover: FloatProperty(
        name="Cover",
        description="Share of the ground that all objects cover together. A larger share means more objects",
        default=0.25,
        min=0.001,
        max=0.9,
        subtype="FACTOR",
    )
    most: IntProperty(
        name="Max Objects",
        description="Largest number of objects, all classes together",
        default=2000,
        min=1,
        soft_max=100_000,
    )
    # Of this ground: the next one is another.
    surface: property_of(_SETTINGS["surface"], options={"SKIP_SAVE"})
    class_separation: property_of(_SETTINGS["class_separation"])
    boundary: property_of(_SETTINGS["boundary"], default=BOUNDARY)
    regularity: property_of(_SETTINGS["regularity"], default=REGULARITY)
    seed: property_of(_SETTINGS["seed"], options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the button's tooltip what to select."""
        if not settings_editable(cls, context):
            return False
        obstacle = "Switch to Object Mode first" if context.mode != "OBJECT" else cls._lacks(context)
        if obstacle:
            cls.poll_message_set(obstacle)
        return not obstacle

    @classmethod
    def _lacks(cls, context: bpy.types.Context) -> str | None:
        """Return what has to be selected first, as a sentence, or None."""
        raise NotImplementedError

    def _sources(self, context: bpy.types.Context) -> list:
        """Return what to place; may raise an EshError."""
        raise NotImplementedError

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the panel of the last operation."""
        layout = self.layout
        layout.use_property_split = True
        for name in ("cover", "most", *_TAKEN):
            layout.prop(self, name)

    def _first(self, context: bpy.types.Context) -> "SelectionSurvey":
        from ..editing.selection import SelectionSurvey

        settings = None
        if self.properties.is_property_set("surface"):
            settings = TargetSettings(surface=value_of(_SETTINGS["surface"], self.surface))
        return SelectionSurvey(stood_on(context.view_layer.objects.active), self._sources(context), context, settings)

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        found = getattr(self, "_found", None)
        if found is None:
            try:
                found = self._first(context)
                found.solve()
            except EshError as error:
                self.report({"ERROR"}, sentence(error))
                return None
        # The panel of the last operation looks again.
        self._found = None
        self.surface = identifier_of(_SETTINGS["surface"], found.settings.surface)
        measured, left_out = found.measured()
        if not measured:
            self.report({"ERROR"}, nothing_left(left_out))
            return None
        for text in told(left_out):
            self.report({"WARNING"}, text)
        stands_on = stood_on(context.view_layer.objects.active)
        if (larger := found.larger(measured)) and stands_on is not None:
            text = f'"{larger[0]}" is larger than "{stands_on.name}", which is taken for the ground: select the ground last'
            self.report({"ERROR"}, f"{text}. Nothing was changed")
            return None
        self._hints = tuple(
            f'"{name}" is as large as the ground: to scatter on it as well, choose a collection of both as the target'
            for name in found.as_large(measured)
        )
        scatter = context.scene.esh_scatter.add_scatter(stands_on)
        if not self.properties.is_property_set("seed"):
            self.seed = scatter.seed
        for name in _TAKEN:
            setattr(scatter, name, getattr(self, name))
        self._add_classes(scatter, measured, found.ground_for(measured))
        scatter.class_index = 0
        self._made = scatter.name
        return scatter

    def _add_classes(self, scatter: ESH_PG_scatter, measured: "Sequence[Measured]", ground: float) -> None:
        """Make a class of each of some objects, which together cover as much of the ground [m²] as is asked, or as fits there."""
        from ..editing.selection import add_classes, pleasant_counts

        free, areas = ground * free_share(scatter), [one.taken for one in measured]
        counts = pleasant_counts(areas, free, self.cover, self.most)
        wanted = sum(pleasant_counts(areas, free, self.cover, sys.maxsize))
        self._held = words.held(self.most, self.cover, wanted) if wanted > max(self.most, sum(counts)) else ""
        add_classes(scatter, measured, counts)
        if scatter.other_results():
            fit_beside_others(scatter, free, [one.item for one in measured])
            left = sum(one.count for one in scatter.classes)
            if left < sum(counts):
                self._held = words.beside_others(left, sum(counts))

    def _undo(self, context: bpy.types.Context) -> None:
        settings = context.scene.esh_scatter
        if not getattr(self, "_made", ""):
            return
        # After Ctrl+Z it is gone already.
        last = settings.scatters[-1] if settings.scatters else None
        if last is not None and last.name == self._made and not last.report_json:
            settings.scatter_index = remove_at(settings.scatters, len(settings.scatters) - 1)


class ESH_OT_scatter_selection(ScatterObjects):
    """Scatter the selected objects on the active one: select what to place, then the ground, then click. If only the ground is selected, the objects of the active collection are placed"""  # noqa: E501

    bl_idname = "esh.scatter_selection"
    bl_label = "Scatter Selection"

    @classmethod
    def _lacks(cls, context: bpy.types.Context) -> str | None:
        from ..editing.families import CONVERTED

        active = context.view_layer.objects.active
        if stood_on(active) is None:
            # Of several that are selected it is meant to be the ground.
            if active is not None and shown_collection(active) is not None and len(context.selected_objects) > 1:
                return instead_of_instance(active)
            return "Select the objects to place, then the ground, which must be a mesh"
        if _selected_sources(context):
            return None
        others = [item for item in context.selected_objects if item != context.view_layer.objects.active]
        if others:
            text = f'"{others[0].name}" cannot be placed: select meshes'
            return f"{text}, or convert it to one" if others[0].type in CONVERTED else text
        return "Select the objects to place as well, then the ground last"

    def _sources(self, context: bpy.types.Context) -> list[bpy.types.Object | bpy.types.Collection]:
        from ..editing.families import as_placed

        heads = _selected_sources(context)
        warn_of_unplaced(self, context.selected_objects, heads)
        return as_placed(heads, members_of(stood_on(context.view_layer.objects.active)))


def _selected_sources(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the selected objects to place; where only the ground is selected, those of the active collection."""
    from ..editing.families import heads_in

    active = context.view_layer.objects.active
    ground = members_of(stood_on(active))
    chosen = heads_in(context.selected_objects, ground)
    if chosen or any(item != active and item not in ground for item in context.selected_objects):
        return chosen
    collection = context.collection
    if collection is None or collection == context.scene.collection:
        return []
    return heads_in(collection.all_objects, ground)


CLASSES = (ESH_OT_scatter_selection,)
