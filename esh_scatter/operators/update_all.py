"""The button that runs all scatters of a scene which are out of date, one after the other."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

from typing import TYPE_CHECKING, Any

import bpy

from ...engine.errors import EshError
from ..properties.scatter import ESH_PG_scatter
from ..result import words
from ..result.scene_units import in_scene_units, sentence
from ..solving import running
from ..targets import checksums
from .edit import settings_editable
from .run_operator import MODES, RunOperator, before_a_run, job_of, keep_result, solve_now

if TYPE_CHECKING:
    from ..api import ScatterResult
    from ..classes.survey import Survey
    from ..solving.running import Session

__all__ = ["CLASSES"]


class ESH_OT_scatter_all(RunOperator):
    """Update all scatters of the scene that are out of date, from the first to the last: later ones make room for earlier ones. Esc stops after those that are done"""  # noqa: E501

    bl_idname = "esh.scatter_all"
    bl_label = "Update All"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Say in the button's tooltip why it is gray."""
        if not settings_editable(cls, context):
            return False
        obstacle = "" if context.mode in MODES else "Switch to Object Mode first"
        if not any(one.report_json for one in context.scene.esh_scatter.scatters):
            obstacle = "No scatter of this scene has been run yet"
        if obstacle:
            cls.poll_message_set(obstacle)
        return not obstacle

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run all of them to the end before returning."""
        self._list(context)
        while (settings := self._settings(context)) is not None:
            try:
                self._done.append((settings.name, keep_result(settings, solve_now(context, settings))))
            except EshError as error:
                self._leave_out(settings, sentence(error))
        return self._end(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Solve in the background while the window stays alive. Nothing is asked: what would need that is left out, and told of."""
        self._list(context)
        return super().invoke(context, event)

    def _list(self, context: bpy.types.Context) -> None:
        """Note which scatters there are, by their numbers: they may be removed meanwhile."""
        scatters = context.scene.esh_scatter.scatters
        self._left = [one.own_uid() for one in scatters]
        self._shown = scatters[context.scene.esh_scatter.scatter_index].uid
        # What was run, with its reports, and what was not, with the reasons.
        self._done: list[tuple[str, dict[str, Any]]] = []
        self._left_out: list[str] = []

    def _settings(self, context: bpy.types.Context) -> ESH_PG_scatter | None:
        """Show the next scatter that is out of date and return it; only now is it known whether it has to make room for another."""
        while self._left:
            settings = _choose(context, self._left.pop(0))
            if settings is None or settings.live or settings.result_in(context.scene) is None:
                # What Live follows needs nobody, and what was deleted is not to come back.
                continue
            with checksums.now():
                if not settings.outdated:
                    continue
            question = before_a_run(context, settings)
            why = settings.obstacle(context.scene) or (question[1] if question else "")
            if not why:
                return settings
            self._leave_out(settings, why)
        return None

    def _start(self, context: bpy.types.Context, survey: "Survey | None" = None) -> bool:
        """Begin with the next one that can be solved; tell whether there was one."""
        while (settings := self._settings(context)) is not None:
            try:
                running.start(context, job_of(context, settings, survey))
                return True
            except EshError as error:
                self._leave_out(settings, sentence(error))
        self._end(context)
        return False

    def _finish(self, settings: ESH_PG_scatter, result: "ScatterResult", made_with: str | None = None) -> set[str]:
        self._done.append((settings.name, keep_result(settings, result, made_with=made_with)))
        return self._next(bpy.context)

    def _failed(self, context: bpy.types.Context, error: EshError) -> set[str]:
        settings = context.scene.esh_scatter.active
        if settings is not None:
            self._leave_out(settings, sentence(error))
        return self._next(context)

    def _next(self, context: bpy.types.Context) -> set[str]:
        if self._start(context):
            return {"RUNNING_MODAL"}
        return {"FINISHED"} if self._done else {"CANCELLED"}

    def _stopped(self, context: bpy.types.Context, session: "Session | None") -> set[str]:
        if not self._done:
            _choose(context, self._shown)
            return super()._stopped(context, session)
        # What is done stays, and can be undone.
        running.end()
        self._left_out.append("Stopped. The others were not changed")
        return self._end(context)

    def _leave_out(self, settings: ESH_PG_scatter, why: str) -> None:
        self._left_out.append(f'"{settings.name}" was left out: {why}')

    def _end(self, context: bpy.types.Context) -> set[str]:
        """Show the scatter again that was shown before, and say what was done."""
        _choose(context, self._shown)
        troubled = [f'"{name}": {words.summary(report)}' for name, report in self._done if words.has_trouble(report)]
        look = [*troubled, *self._left_out]
        text = ". ".join([words.updated([name for name, _ in self._done]), *look])
        self.report({"WARNING" if look else "INFO"}, in_scene_units(context.scene, text))
        return {"FINISHED"} if self._done else {"CANCELLED"}


def _choose(context: bpy.types.Context, uid: int) -> ESH_PG_scatter | None:
    """Show the scatter of this number in the sidebar and return it; None where it is gone."""
    settings = context.scene.esh_scatter
    number = next((number for number, one in enumerate(settings.scatters) if one.uid == uid), None)
    if number is None:
        return None
    settings.scatter_index = number
    return settings.active


CLASSES = (ESH_OT_scatter_all,)
