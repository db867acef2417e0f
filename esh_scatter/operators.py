"""Buttons of the sidebar. They translate between Blender and the API, and turn its errors into sentences."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import random
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ..engine.errors import EshError, ProblemError
from ..engine.problem.ink_models import DEFAULT_MODEL, INK_MODELS
from ..engine.problem.scatter_settings import ScatterSettings
from ..engine.problem.settings import settings_of
from . import running, words
from .class_copy import CLASS_PARTS, copy_class
from .described_properties import property_of
from .properties import ESH_PG_class, ESH_PG_scatter, active_scatter, selected_class, selected_scatter, unused_name
from .target import is_result

if TYPE_CHECKING:
    from .api import ScatterResult
    from .running import Session

__all__ = ["CLASSES"]

_SETTINGS = settings_of(ScatterSettings)
_MOVES = (("UP", "Up", "Towards the top of the list"), ("DOWN", "Down", "Towards the end of the list"))


class _Edit(bpy.types.Operator):
    """Base of the small edits of the settings."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _settings_editable(cls, context):
            return False
        if cls._needs(context) is None:
            cls.poll_message_set(cls._missing)
            return False
        return True

    _missing = "Add a scatter first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return active_scatter(context)


class _Run(bpy.types.Operator):
    """Base of what solves: in the background where there is a window, otherwise to the end."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run to the end before returning: for scripts, ``blender -b`` and the panel of the last operation."""
        from .api import scatter

        settings = self._settings(context)
        if settings is None:
            return {"CANCELLED"}
        window_manager = context.window_manager
        window_manager.progress_begin(0, settings.max_steps)
        try:
            positional, named = settings.arguments(context.scene)
            settings.forget_deleted_result()
            result = scatter(*positional, **named, progress=lambda now: window_manager.progress_update(now.step))
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            self._undo(context)
            return {"CANCELLED"}
        finally:
            window_manager.progress_end()
        return self._finish(settings, result)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Solve in the background while the window stays alive."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        from .api import ScatterJob

        settings = self._settings(context)
        if settings is None:
            return {"CANCELLED"}
        try:
            positional, named = settings.arguments(context.scene)
            job = ScatterJob(*positional, **named)
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            self._undo(context)
            return {"CANCELLED"}
        running.start(context, job, settings)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        """Return the settings to run, or None where there is nothing to run, which has been reported."""
        raise NotImplementedError

    def _undo(self, context: bpy.types.Context) -> None:
        """Take back what :meth:`_settings` has changed; nothing, unless it did."""

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Watch the run; Esc leaves what was there."""
        if event.type == "ESC" and event.value == "PRESS":
            running.stop("Stopped. Nothing was changed")
        session = running.session
        if session is None or session.stop_reason:
            return self._stopped(context, session)
        if event.type == "TIMER":
            session.show()
            if not session.run.running:
                return self._write(context)
        return {"PASS_THROUGH"} if running.lets_through(context, event) else {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Blender takes the operator away: another file, a closed window."""
        running.end()

    def _stopped(self, context: bpy.types.Context, session: "Session | None") -> set[str]:
        running.end()
        self._undo(context)
        self.report({"WARNING"}, session.stop_reason if session else "Stopped. Nothing was changed")
        return {"CANCELLED"}

    def _write(self, context: bpy.types.Context) -> set[str]:
        session = running.session
        assert session is not None
        running.end()
        try:
            if session.run.error is not None:
                raise session.run.error
            scatters = session.scene.esh_scatter.scatters
            if session.scatter_index >= len(scatters):
                raise ProblemError("the settings of this scatter were removed during the run; nothing was placed")
            settings = scatters[session.scatter_index]
            settings.forget_deleted_result()
            result = session.job.write()
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            self._undo(context)
            return {"CANCELLED"}
        return self._finish(settings, result)

    def _finish(self, settings: ESH_PG_scatter, result: "ScatterResult") -> set[str]:
        report = result.report.to_dict()
        settings.remember(result.object, report)
        left_out = settings.left_out()
        look = [*words.notes(report), *left_out]
        text = words.summary(report)
        if look:
            text += f". {look[0]}" + (f" (and {len(look) - 1} more in the panel)" if len(look) > 1 else "")
        self.report({"WARNING" if look or report["overlaps"] else "INFO"}, text)
        return {"FINISHED"}


class ESH_OT_scatter(_Run):
    """Place all classes and sizes. Counts are exact. Esc stops the run and leaves the scene as it is"""

    bl_idname = "esh.scatter"
    bl_label = "Scatter"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the button's tooltip why it is grey."""
        if not _settings_editable(cls, context):
            return False
        scatter = active_scatter(context)
        obstacle = scatter.obstacle(context.scene) if scatter else "Add a scatter first"
        if context.mode != "OBJECT":
            obstacle = "Switch to Object Mode first"
        if obstacle:
            cls.poll_message_set(obstacle)
        return not obstacle

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        return selected_scatter(context)


class ESH_OT_scatter_selection(_Run):
    """Scatter the selected objects on the active one: select what to place, then the ground, then click. With only the ground selected, the objects of the active collection are placed"""  # noqa: E501

    bl_idname = "esh.scatter_selection"
    bl_label = "Scatter Selection"

    cover: FloatProperty(
        name="Cover",
        description="Share of the ground that all objects take together. More means more objects",
        default=0.25,
        min=0.001,
        max=0.9,
        subtype="FACTOR",
    )
    most: IntProperty(
        name="At Most",
        description="Largest number of objects, all classes together",
        default=2000,
        min=1,
        soft_max=100_000,
    )
    class_separation: property_of(_SETTINGS["class_separation"], name="Mix Classes")
    seed: property_of(_SETTINGS["seed"])

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the button's tooltip what to select."""
        if not _settings_editable(cls, context):
            return False
        active = context.view_layer.objects.active
        obstacle = None
        if context.mode != "OBJECT":
            obstacle = "Switch to Object Mode first"
        elif active is None or active.type != "MESH":
            obstacle = "Select the objects to place, then the ground, which must be a mesh"
        elif is_result(active):
            obstacle = "The active object is the result of a scatter. Select the ground last"
        elif not _selected_sources(context, active):
            obstacle = "Select the objects to place as well, then the ground last"
        if obstacle:
            cls.poll_message_set(obstacle)
        return not obstacle

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the panel of the last operation."""
        layout = self.layout
        layout.use_property_split = True
        for name in ("cover", "most", "class_separation", "seed"):
            layout.prop(self, name)

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        from ..engine.surface.chart import Chart
        from .selection import add_classes, measure, pleasant_counts
        from .target import check_target, read_target

        ground = context.view_layer.objects.active
        try:
            chart = Chart(read_target(check_target(ground, context), context, set()))
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            return None
        measured, flat = measure(_selected_sources(context, ground), context)
        if flat:
            self.report({"WARNING"}, f"Left out, because they take no ground seen from above: {', '.join(flat)}")
        if not measured:
            self.report({"ERROR"}, "None of the selected objects takes ground seen from above. Nothing was changed")
            return None
        counts = pleasant_counts([one.area for one in measured], float(chart.area.sum()), self.cover, self.most)
        scatter = context.scene.esh_scatter.add_scatter(ground)
        add_classes(scatter, measured, counts)
        scatter.class_separation, scatter.seed, scatter.class_index = self.class_separation, self.seed, 0
        self._made = scatter.name
        return scatter

    def _undo(self, context: bpy.types.Context) -> None:
        settings = context.scene.esh_scatter
        # After Ctrl+Z it is gone already.
        last = settings.scatters[-1] if settings.scatters else None
        if last is not None and last.name == self._made and not last.report_json:
            settings.scatter_index = _remove(settings.scatters, len(settings.scatters) - 1)


class ESH_OT_stop(bpy.types.Operator):
    """Stop the run. The scene stays as it is"""

    bl_idname = "esh.stop"
    bl_label = "Stop Scattering"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Only while something runs."""
        return running.session is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Stop."""
        running.stop("Stopped. Nothing was changed")
        return {"FINISHED"}


class ESH_OT_scatter_add(_Edit):
    """Add a scatter. If the active object is a mesh, it becomes the target"""

    bl_idname = "esh.scatter_add"
    bl_label = "Add Scatter"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        return context.scene

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        candidate = context.view_layer.objects.active
        settings = context.scene.esh_scatter
        results = {scatter.result for scatter in settings.scatters}
        usable = candidate is not None and candidate.type == "MESH" and candidate not in results
        settings.add_scatter(candidate if usable else None)
        return {"FINISHED"}


class ESH_OT_scatter_remove(_Edit):
    """Remove the settings of this scatter. What it has placed stays in the scene"""

    bl_idname = "esh.scatter_remove"
    bl_label = "Remove Scatter"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        settings = context.scene.esh_scatter
        settings.scatter_index = _remove(settings.scatters, settings.scatter_index)
        return {"FINISHED"}


class ESH_OT_scatter_choose(_Edit):
    """Show this scatter in the sidebar"""

    bl_idname = "esh.scatter_choose"
    bl_label = "Choose Scatter"

    index: IntProperty(name="Number", description="Which of the scene's scatters, counted from 0", min=0)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show it."""
        settings = context.scene.esh_scatter
        settings.scatter_index = min(self.index, len(settings.scatters) - 1)
        return {"FINISHED"}


class ESH_OT_class_add(_Edit):
    """Add a class: one kind of thing, for example pines, with its own density"""

    bl_idname = "esh.class_add"
    bl_label = "Add Class"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        selected_scatter(context).add_class()
        return {"FINISHED"}


class ESH_OT_classes_from_image(_Edit):
    """Split a color image into inks. Each ink becomes a class of colored dots with its own density"""

    bl_idname = "esh.classes_from_image"
    bl_label = "Classes from Image"

    image: StringProperty(name="Image", description="Color image. It is stretched over the target, seen from above")
    model: EnumProperty(
        name="Inks",
        description="Which inks the image is split into",
        items=[(name, name, f"Use the inks {name}") for name in INK_MODELS],
        default=DEFAULT_MODEL,
    )
    dots: IntProperty(
        name="Dots",
        description="How many dots a black image would get. The area of a dot follows from this number",
        default=20_000,
        min=10,
        soft_max=200_000,
    )

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter and scatter.target

    _missing = "Choose a target first"

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Ask for image and inks."""
        if not self.image and bpy.data.images:
            self.image = next((i.name for i in bpy.data.images if i.type == "IMAGE"), "")
        return context.window_manager.invoke_props_dialog(self, width=320)

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the dialog."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop_search(self, "image", bpy.data, "images")
        layout.prop(self, "model")
        layout.prop(self, "dots")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the classes."""
        from ..engine.surface.chart import Chart
        from .inks import add_ink_classes
        from .target import check_target, read_target

        scatter = selected_scatter(context)
        image = bpy.data.images.get(self.image)
        if image is None:
            self.report({"ERROR"}, f'There is no image "{self.image}". Open one first')
            return {"CANCELLED"}
        try:
            chart = Chart(read_target(check_target(scatter.target, context), context, set()))
            count = add_ink_classes(scatter, image, self.model, self.dots, chart)
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Added {count} classes, one for each ink of {self.model}")
        return {"FINISHED"}


class _ClassEdit(_Edit):
    _missing = "Select a class first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter and scatter.active_class


class ESH_OT_class_remove(_ClassEdit):
    """Remove the selected class"""

    bl_idname = "esh.class_remove"
    bl_label = "Remove Class"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        scatter = selected_scatter(context)
        scatter.remove_class(scatter.class_index)
        return {"FINISHED"}


class ESH_OT_class_duplicate(_ClassEdit):
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
        scatter.classes.move(len(scatter.classes) - 1, index + 1)
        scatter.class_index = index + 1
        return {"FINISHED"}


# Blender needs the texts of an enumeration to stay in memory.
_other_classes: list[tuple[str, str, str, int]] = []


def _list_other_classes(_operator: Any, context: bpy.types.Context | None) -> list[tuple[str, str, str, int]]:
    scatter = active_scatter(context) if context else None
    _other_classes.clear()
    if scatter:
        # An enumeration of which several can be chosen has 32 bits.
        numbers = [i for i in range(len(scatter.classes)) if i != scatter.class_index][:31]
        _other_classes.extend(
            (str(scatter.classes[i].uid), scatter.classes[i].name, "Give this class the settings", 1 << bit)
            for bit, i in enumerate(numbers)
        )
    return _other_classes


class ESH_OT_class_copy(_ClassEdit):
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
        self.layout.label(text="Settings")
        self.layout.column(align=True).prop(self, "what", expand=True)
        self.layout.label(text="To")
        self.layout.column(align=True).prop(self, "classes", expand=True)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Copy them."""
        source = selected_class(context)
        parts = {name: CLASS_PARTS[name] for name in CLASS_PARTS if name in self.what}
        chosen = [c for c in selected_scatter(context).classes if str(c.uid) in self.classes and c != source]
        for body_class in chosen:
            copy_class(source, body_class, parts)
        self.report({"INFO"}, f"Copied settings to {len(chosen)} classes")
        return {"FINISHED"}


class _ClassesFromObjects(_Edit):
    """Base of what adds a class for each of some objects."""

    count: IntProperty(
        name="Count", description="How many of each object to place", default=100, min=1, soft_max=100_000
    )

    def _add(self, context: bpy.types.Context, items: list[bpy.types.Object]) -> set[str]:
        from .selection import add_classes, measure

        scatter = selected_scatter(context)
        measured, flat = measure(items, context)
        add_classes(scatter, measured, [self.count] * len(measured))
        if not measured:
            self.report({"ERROR"}, "None of the objects takes ground seen from above. Nothing was changed")
            return {"CANCELLED"}
        if flat:
            self.report({"WARNING"}, f"Left out, because they take no ground seen from above: {', '.join(flat)}")
        return {"FINISHED"}


class ESH_OT_classes_from_selection(_ClassesFromObjects):
    """Add a class for each selected object, named after it"""

    bl_idname = "esh.classes_from_selection"
    bl_label = "Classes from Selection"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        from .selection import sources_in

        scatter = active_scatter(context)
        return (scatter and sources_in(context.selected_objects, scatter.target)) or None

    _missing = "Select objects to place, other than the target"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add them."""
        from .selection import sources_in

        return self._add(context, sources_in(context.selected_objects, selected_scatter(context).target))


class ESH_OT_classes_from_collection(_ClassesFromObjects):
    """Add a class for each object of a collection, named after it"""

    bl_idname = "esh.classes_from_collection"
    bl_label = "Classes from Collection"

    collection: StringProperty(name="Collection", description="Each of its objects becomes a class")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Ask for the collection."""
        if not self.collection and context.collection != context.scene.collection:
            self.collection = context.collection.name
        return context.window_manager.invoke_props_dialog(self, width=280)

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the dialog."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop_search(self, "collection", bpy.data, "collections")
        layout.prop(self, "count")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add them."""
        from .selection import sources_in

        collection = bpy.data.collections.get(self.collection)
        if collection is None:
            self.report({"ERROR"}, f'There is no collection "{self.collection}"')
            return {"CANCELLED"}
        return self._add(context, sources_in(collection.all_objects, selected_scatter(context).target))


class ESH_OT_classes_sort(_ClassEdit):
    """Sort the classes. The result is out of date then, because their order has an influence on it"""

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


class ESH_OT_class_overlap(_ClassEdit):
    """Let this class and the selected one lie on each other, or keep them apart"""

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
                one.may_overlap = ", ".join(sorted(one.names_that_may_overlap - {two.name}))
        else:
            mine.may_overlap = ", ".join(sorted(mine.names_that_may_overlap | {other.name}))
        return {"FINISHED"}


class ESH_OT_class_move(_ClassEdit):
    """Move the selected class in the list"""

    bl_idname = "esh.class_move"
    bl_label = "Move Class"

    direction: EnumProperty(items=_MOVES, name="Direction")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Move it."""
        scatter = selected_scatter(context)
        scatter.class_index = _move(scatter.classes, scatter.class_index, self.direction)
        return {"FINISHED"}


class ESH_OT_size_add(_ClassEdit):
    """Add a size to the selected class. Larger sizes keep more distance"""

    bl_idname = "esh.size_add"
    bl_label = "Add Size"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it."""
        selected_class(context).add_size()
        return {"FINISHED"}


class _SizeEdit(_Edit):
    _missing = "Select a size first"

    @staticmethod
    def _needs(context: bpy.types.Context) -> object:
        scatter = active_scatter(context)
        return scatter and scatter.active_class and scatter.active_class.active_size


class ESH_OT_size_remove(_SizeEdit):
    """Remove the selected size"""

    bl_idname = "esh.size_remove"
    bl_label = "Remove Size"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        body_class = selected_class(context)
        body_class.size_index = _remove(body_class.sizes, body_class.size_index)
        return {"FINISHED"}


class ESH_OT_size_move(_SizeEdit):
    """Move the selected size in the list"""

    bl_idname = "esh.size_move"
    bl_label = "Move Size"

    direction: EnumProperty(items=_MOVES, name="Direction")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Move it."""
        body_class = selected_class(context)
        body_class.size_index = _move(body_class.sizes, body_class.size_index, self.direction)
        return {"FINISHED"}


class ESH_OT_seed_roll(_Edit):
    """Choose another seed. The result is another placement of the same quality"""

    bl_idname = "esh.seed_roll"
    bl_label = "Randomize Seed"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it."""
        scatter = selected_scatter(context)
        scatter.seed = random.choice([seed for seed in range(10_000) if seed != scatter.seed])
        return {"FINISHED"}


def _settings_editable(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Tell whether settings can be changed now; otherwise the tooltip of ``operator`` says why not."""
    reason = None
    if running.session is not None:
        reason = "A run is in progress. Press Esc to stop it"
    elif running.still_stopping():
        reason = "The stopped run has not ended yet. Try again in a moment"
    elif context.scene is None or not context.scene.is_editable:
        reason = "This scene is linked from a library and cannot be changed"
    if reason:
        operator.poll_message_set(reason)
    return reason is None


def _selected_sources(context: bpy.types.Context, ground: bpy.types.Object) -> list[bpy.types.Object]:
    """Return the selected objects to place; where only the ground is selected, those of the active collection."""
    from .selection import sources_in

    chosen = sources_in(context.selected_objects, ground)
    if chosen or any(item != ground for item in context.selected_objects):
        return chosen
    collection = context.collection
    if collection is None or collection == context.scene.collection:
        return []
    return sources_in(collection.all_objects, ground)


def _remove(collection: Any, index: int) -> int:
    collection.remove(index)
    return max(0, min(index, len(collection) - 1))


def _move(collection: Any, index: int, direction: str) -> int:
    to = max(0, min(index + (-1 if direction == "UP" else 1), len(collection) - 1))
    collection.move(index, to)
    return to


def _sentence(error: Exception | str) -> str:
    """Return a sentence as Blender's status line shows it: with a capital letter, without back quotes."""
    text = str(error).replace("`", "")
    return text[:1].upper() + text[1:]


CLASSES = (
    ESH_OT_scatter,
    ESH_OT_scatter_selection,
    ESH_OT_stop,
    ESH_OT_scatter_add,
    ESH_OT_scatter_remove,
    ESH_OT_scatter_choose,
    ESH_OT_class_add,
    ESH_OT_classes_from_image,
    ESH_OT_classes_from_selection,
    ESH_OT_classes_from_collection,
    ESH_OT_classes_sort,
    ESH_OT_class_duplicate,
    ESH_OT_class_copy,
    ESH_OT_class_overlap,
    ESH_OT_class_remove,
    ESH_OT_class_move,
    ESH_OT_size_add,
    ESH_OT_size_remove,
    ESH_OT_size_move,
    ESH_OT_seed_roll,
)
