"""Buttons of the sidebar. They translate between Blender and the API, and turn its errors into sentences."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import random
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from ..engine.errors import EshError, ProblemError
from ..engine.problem.ink_models import DEFAULT_MODEL, INK_MODELS
from . import running
from .properties import ESH_PG_scatter, active_scatter, selected_class, selected_scatter

if TYPE_CHECKING:
    from .api import ScatterResult
    from .running import Session

__all__ = ["CLASSES"]

_MOVES = (("UP", "Up", "Towards the top of the list"), ("DOWN", "Down", "Towards the end of the list"))


class _Edit(bpy.types.Operator):
    """Base of the small edits of the settings."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

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


class ESH_OT_scatter(bpy.types.Operator):
    """Place all classes and sizes. Counts are exact. Esc stops the run and leaves the scene as it is"""

    bl_idname = "esh.scatter"
    bl_label = "Scatter"
    bl_options = {"REGISTER", "UNDO"}

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

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run to the end before returning: for scripts and ``blender -b``."""
        from .api import scatter

        settings = selected_scatter(context)
        window_manager = context.window_manager
        window_manager.progress_begin(0, settings.max_steps)
        try:
            positional, named = settings.arguments(context.scene)
            result = scatter(*positional, **named, progress=lambda now: window_manager.progress_update(now.step))
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            return {"CANCELLED"}
        finally:
            window_manager.progress_end()
        return self._finish(settings, result)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Solve in the background while the window stays alive."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        from .api import ScatterJob

        settings = selected_scatter(context)
        try:
            positional, named = settings.arguments(context.scene)
            job = ScatterJob(*positional, **named)
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            return {"CANCELLED"}
        running.start(context, job, settings)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Watch the run; Esc leaves what was there."""
        if event.type == "ESC" and event.value == "PRESS":
            running.stop("Stopped. Nothing was changed")
        session = running.session
        if session is None or session.stop_reason:
            return self._stopped(session)
        if event.type == "TIMER":
            session.show()
            if not session.run.running:
                return self._write(context)
        return {"PASS_THROUGH"} if running.lets_through(context, event) else {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Blender takes the operator away: another file, a closed window."""
        running.end()

    def _stopped(self, session: "Session | None") -> set[str]:
        running.end()
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
            result = session.job.write()
            settings = scatters[session.scatter_index]
        except EshError as error:
            self.report({"ERROR"}, _sentence(error))
            return {"CANCELLED"}
        return self._finish(settings, result)

    def _finish(self, settings: ESH_PG_scatter, result: "ScatterResult") -> set[str]:
        report = result.report
        settings.remember(result.object, report.to_dict())
        placed = sum(size.placed for body_class in report.classes for size in body_class.sizes)
        look = [_sentence(note) for note in report.notes]
        if report.overlaps:
            look.append(f"{report.overlaps:,} footprints overlap")
        if not report.converged:
            look.append("not converged")
        summary = f"Placed {placed:,} in {report.seconds:.1f} s on {report.device}"
        self.report({"WARNING" if look else "INFO"}, "; ".join([summary, *look]))
        return {"FINISHED"}


class ESH_OT_stop(bpy.types.Operator):
    """Stop the run. The scene stays as it is"""

    bl_idname = "esh.stop"
    bl_label = "Stop"
    bl_options = {"INTERNAL"}

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
        scatter.class_index = _remove(scatter.classes, scatter.class_index)
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
    ESH_OT_stop,
    ESH_OT_scatter_add,
    ESH_OT_scatter_remove,
    ESH_OT_class_add,
    ESH_OT_classes_from_image,
    ESH_OT_class_remove,
    ESH_OT_class_move,
    ESH_OT_size_add,
    ESH_OT_size_remove,
    ESH_OT_size_move,
    ESH_OT_seed_roll,
)
