"""What all operators have in common that solve: in the background where there is a window, otherwise to the end."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty

from ...engine.errors import EshError
from ..properties.names import follow_names
from ..properties.renamed_on_mesh import follow_renamed
from ..properties.scatter import ESH_PG_scatter
from ..result import words
from ..result.real_objects import discard_real, real_objects_of
from ..result.scene_units import in_scene_units, sentence
from ..solving import loading, running
from ..targets import checksums

if TYPE_CHECKING:
    from ..api import ScatterJob, ScatterResult
    from ..classes.survey import Survey
    from ..editing.selection import SelectionSurvey
    from ..solving.running import Session

__all__ = ["MODES", "RunOperator", "before_a_run", "in_background", "job_of", "keep_result", "solve_now"]

# Modes in which what is painted or sculpted can be read, and results be written. What is edited, Edit Mode keeps to itself.
MODES = ("OBJECT", "SCULPT", "PAINT_TEXTURE", "PAINT_VERTEX", "PAINT_WEIGHT")


def in_background() -> bool:
    """Tell whether Blender has no window."""
    return bpy.app.background


def before_a_run(context: bpy.types.Context, settings: ESH_PG_scatter) -> tuple[str, str] | None:
    """Return what to ask before a run, a title and what there is to know; or None."""
    result = settings.result_in(context.scene)
    if result is not None and real_objects_of(result) is not None:
        return (
            "Scatter Beside the Real Objects?",
            "They stay as they are, without the scatter. To keep their changes in it, click Back to Instances first",
        )
    many = settings.too_many()
    if lost := settings.lost_by_hand(context.scene):
        # Whoever says yes is not asked again.
        return "Scatter Without What Was Placed by Hand?", f"{lost}. {many}" if many else lost
    return ("Place This Many Objects?", many) if many else None


def solve_now(context: bpy.types.Context, settings: ESH_PG_scatter) -> "ScatterResult":
    """Run a scatter to its end, and return what was placed.

    Raises:
        EshError: Something asked for cannot be done.
    """
    from ..api import scatter

    window_manager = context.window_manager
    window_manager.progress_begin(0, settings.max_steps)
    try:
        follow_names(settings)
        follow_renamed(settings)
        positional, named = settings.arguments(context.scene)
        settings.forget_deleted_result()
        return scatter(*positional, **named, progress=lambda now: window_manager.progress_update(now.step))
    finally:
        window_manager.progress_end()


def job_of(context: bpy.types.Context, settings: ESH_PG_scatter, survey: "Survey | None" = None) -> "ScatterJob":
    """Read what a scatter places, to be solved in the background.

    Raises:
        EshError: Something asked for cannot be read.
    """
    from ..api import ScatterJob

    follow_names(settings)
    follow_renamed(settings)
    positional, named = settings.arguments(context.scene)
    job = ScatterJob(*positional, **named, prepare=False, survey=survey)
    with checksums.now():
        job.made_with = settings.fingerprint()
    return job


def keep_result(
    settings: ESH_PG_scatter, result: "ScatterResult", held: str = "", made_with: str | None = None
) -> dict[str, Any]:
    """Have a scatter remember what a run has placed, and return its report.

    Args:
        settings: The scatter.
        result: What was placed.
        held: What has held the number of objects, as a sentence.
        made_with: The fingerprint of when it was read, where anything could change since; None for that of now.
    """
    report_of_run = {**result.report.to_dict(), words.HELD: held}
    settings.remember(result.object, report_of_run, settings.as_written(made_with) if made_with else None)
    if (real := real_objects_of(result.object)) is not None:
        # The new result stands for none of them.
        discard_real(real, ())
    report = settings.report
    assert report is not None
    return report


class RunOperator(bpy.types.Operator):
    """Base of what solves: in the background where there is a window, otherwise to the end."""

    bl_options = {"REGISTER", "UNDO"}

    asked: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})
    # What was seen before the run, and is told after it.
    _hints: tuple[str, ...] = ()
    # What has held the number of objects, as the panel tells it from then on; empty where nothing has.
    _held: str = ""

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run to the end before returning: for scripts, ``blender -b`` and the panel of the last operation."""
        settings = self._settings(context)
        if settings is None:
            return {"CANCELLED"}
        if self.options.is_repeat and not self.asked and (many := settings.too_many()):
            # From the panel of the last operation nobody can be asked.
            self.report({"ERROR"}, f"{many}. Lower the amount here, or set the count and click Scatter")
            self._undo(context)
            return {"CANCELLED"}
        try:
            result = solve_now(context, settings)
        except EshError as error:
            return self._failed(context, error)
        return self._finish(settings, result)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Solve in the background while the window stays alive; from the cap on, ask first."""
        if in_background() or context.window is None:
            return self.execute(context)
        if not loading.is_done():
            running.start(context, loading.Loading())
        elif not self._begin(context):
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _begin(self, context: bpy.types.Context) -> bool:
        """Begin with what has to be worked out first; tell whether that was possible, which otherwise has been reported."""
        try:
            first = self._first(context)
        except EshError as error:
            self.report({"ERROR"}, sentence(error))
            return False
        if first is None:
            return self._start(context)
        running.start(context, first)
        return True

    def _start(self, context: bpy.types.Context, survey: "Survey | None" = None) -> bool:
        """Begin to solve; tell whether that was possible, which otherwise has been reported."""
        settings = self._settings(context)
        if settings is None:
            return False
        if not self.asked and (title_and_text := before_a_run(context, settings)):
            self._undo(context)
            self._ask(context, *title_and_text)
            return False
        try:
            job = job_of(context, settings, survey)
        except EshError as error:
            self._failed(context, error)
            return False
        running.start(context, job)
        return True

    def _first(self, _context: bpy.types.Context) -> "SelectionSurvey | None":
        """Return what has to be worked out before there is anything to scatter, or None."""
        return None

    def _ask(self, context: bpy.types.Context, title: str, text: str) -> None:
        """Ask whether to run all the same; whoever says yes presses a button that does not ask."""

        def draw(popup: bpy.types.UIPopupMenu, _context: bpy.types.Context) -> None:
            popup.layout.label(text=text, translate=False)
            popup.layout.operator_context = "INVOKE_DEFAULT"
            popup.layout.operator(self.bl_idname, text="Scatter", icon="PLAY").asked = True

        context.window_manager.popup_menu(draw, title=title, icon="QUESTION")

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        """Return the settings to run, or None where there is nothing to run, which has been reported."""
        raise NotImplementedError

    def _undo(self, context: bpy.types.Context) -> None:
        """Take back what :meth:`_settings` has changed; nothing, unless it did."""

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Watch the run; Esc leaves what was there, and so does to undo what has just begun."""
        if event.value == "PRESS" and (event.type == "ESC" or _means_undo(event)):
            running.stop("Stopped. Nothing was changed")
        session = running.session
        if session is not None and event.type == "TIMER" and session.is_lost:
            running.stop("Stopped, because the scatter was removed during the run. Nothing was placed")
        if session is None or session.stop_reason:
            return self._stopped(context, session)
        if event.type == "TIMER":
            session.show()
            if not session.run.running:
                return self._write(context) if hasattr(session.job, "write") else self._go_on(context)
        return {"PASS_THROUGH"} if running.lets_through(context, event) else {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Blender takes the operator away: another file, a closed window."""
        running.end()

    def _stopped(self, context: bpy.types.Context, session: "Session | None") -> set[str]:
        running.end()
        # What was removed is not to be changed back.
        if session is None or not session.is_lost:
            self._undo(context)
        self.report({"WARNING"}, session.stop_reason if session else "Stopped. Nothing was changed")
        return {"CANCELLED"}

    def _go_on(self, context: bpy.types.Context) -> set[str]:
        """What had to be worked out first has been: begin to solve."""
        session = running.session
        assert session is not None
        running.end()
        if session.run.error is not None:
            if not isinstance(session.run.error, EshError):
                raise session.run.error
            self.report({"ERROR"}, sentence(session.run.error))
            return {"CANCELLED"}
        if isinstance(session.job, loading.Loading):
            return {"RUNNING_MODAL"} if self._begin(context) else {"CANCELLED"}
        self._found = session.job
        return {"RUNNING_MODAL"} if self._start(context, session.job.survey) else {"CANCELLED"}

    def _write(self, context: bpy.types.Context) -> set[str]:
        session = running.session
        assert session is not None
        running.end()
        try:
            if session.run.error is not None:
                raise session.run.error
            settings = session.scatter
            assert settings is not None
            settings.forget_deleted_result()
            result = session.job.write()
        except EshError as error:
            return self._failed(context, error)
        return self._finish(settings, result, session.job.made_with)

    def _failed(self, context: bpy.types.Context, error: EshError) -> set[str]:
        """Say why there is no result, and take back what was changed for it."""
        self.report({"ERROR"}, sentence(error))
        self._undo(context)
        return {"CANCELLED"}

    def _finish(self, settings: ESH_PG_scatter, result: "ScatterResult", made_with: str | None = None) -> set[str]:
        """Keep what was placed, and tell of it; ``made_with`` is what it was read from, where the window went on meanwhile."""
        report = keep_result(settings, result, self._held, made_with)
        left_out = settings.left_out()
        look = [*self._hints[:1], *words.notes(report), *left_out]
        with checksums.now():
            later = words.in_the_way([other.name for other in settings.later_in_the_way()])
        text = ". ".join([words.summary(report), *(said for said in (self._held, settings.muted(), later) if said)])
        if look:
            text += f". {look[0]}" + (f" (and {len(look) - 1} more in the panel)" if len(look) > 1 else "")
        text = in_scene_units(bpy.context.scene, text)
        self.report({"WARNING" if look or words.has_trouble(report) else "INFO"}, text)
        return {"FINISHED"}


def _means_undo(event: bpy.types.Event) -> bool:
    """Tell whether a key is that of Undo: with Cmd on a Mac, with Ctrl elsewhere."""
    return event.type == "Z" and (event.ctrl or event.oskey) and not (event.shift or event.alt)
