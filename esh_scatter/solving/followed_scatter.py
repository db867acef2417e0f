"""One scatter that Live follows: what has changed is read, solved in a thread of its own, and shown once that is done.

Nothing of the file is held on to between two looks: everything is looked up again by its number.
"""

from __future__ import annotations

import copy
import time
import zlib
from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bpy

from ...engine.errors import EshError
from ..result.edited_points import outside_edit_mode
from ..result.real_objects import real_objects_of
from ..result.refused import as_sentence
from ..targets import checksums
from ..targets.depsgraph import evaluated_depsgraph
from ..targets.in_scenes import is_in
from ..targets.mesh_attributes import read_attribute
from ..targets.references import Reference
from ..targets.vertex_groups import can_be_listed
from . import running, strokes, undo_steps
from .edited_result import EditedResult, may_be_left
from .known_results import KnownResults
from .new_result import Scatter
from .redrawing import redraw_sidebars
from .strokes import Stroke

if TYPE_CHECKING:
    from .job import ScatterJob
    from .live_worker import LiveWorker, Outcome, Request

__all__ = ["FollowedScatter"]

# Seconds between two looks at whether anything has changed while nothing says so.
AT_REST = 0.3
# Seconds after the last sign of a change for which it is looked at with every tick.
ATTENTIVE = 0.6
# Share of the time that may go into looking at contents, while something changes and while nothing does.
SHARE_ATTENTIVE, SHARE_AT_REST = 0.25, 0.02
# Seconds of the main thread that reading may take for strokes to be followed before they end; what other programs take does not count.
# What takes up to twice as long is read for a tenth of the time: one slow reading says little of the next.
FOLLOWS_STROKES = 0.05
SHARE_SLOW = 0.1
# Seconds that quitting waits for the thread.
LONGEST_JOIN = 5.0


class FollowedScatter:
    """One scatter that is followed.

    Attributes:
        message: What is wrong with it now, as a sentence; empty where nothing is.
        stopped: Why it cannot be followed any more, as a sentence; empty where it can, or nobody wants it to be.
        seconds: How long the last update took, from reading to being shown [s].
    """

    def __init__(self, scene: bpy.types.Scene, scatter: Scatter) -> None:
        from ..classes.survey import Survey
        from .live_worker import LiveWorker

        self._scene = Reference(scene, "scene")
        self._uid = scatter.uid
        self._worker: LiveWorker = LiveWorker(Survey())
        # What the solver was told last, and what it showed; as fingerprints.
        self._told: str | None = None
        self._asked: Request | None = None
        self._record: dict[str, Any] = {}
        # How many requests have followed the stroke that is under way, or ended only just.
        self._parts = 0
        self._looked = 0.0
        self._reading = 0.0
        # As many objects may be placed unasked as the button has placed.
        self._granted = 0
        self._waiting: Outcome | None = None
        # What was written last, and a checksum of the points then: undo may have put others in their place.
        self._shown: ScatterJob | None = None
        self._points: int | None = None
        self._edited = EditedResult()
        # What was written before, as long as the solver can go back to it.
        self._known = KnownResults()
        # The settings that the last one was made with, and its report.
        self._written: tuple[str, str] | None = None
        self._submitted_at = 0.0
        self.message = self.stopped = self._refused = ""
        self.seconds = 0.0

    @property
    def worker(self) -> LiveWorker:
        """What solves it."""
        return self._worker

    @property
    def busy(self) -> bool:
        """Whether something is being solved or waits to be shown, or a stroke that has ended is to be followed as one."""
        solves = self._worker.busy or self._worker.has_outcome or self._waiting is not None
        return solves or (self._is_in_parts and not strokes.is_under_way())

    @property
    def _is_in_parts(self) -> bool:
        return self._parts > 1 and self._worker.knows_beginning and not self._refused

    def look(self, last_sign: float) -> bool:
        """Show what came out, and have solved what has changed; returns False where there is nothing to follow any more.

        Args:
            last_sign: When something was last said to change, as :func:`time.monotonic` tells the time.
        """
        scene = self._scene.find()
        scatter = _scatter_of(scene, self._uid)
        if scene is None or scatter is None or not scatter.live:
            return False
        takes_edits = self._worker.takes_edits
        self._waiting = self._worker.take() or self._waiting
        window = next((w for w in bpy.context.window_manager.windows if w.scene == scene), None)
        if window is None and not bpy.app.background:
            return True
        with bpy.context.temp_override(**({"window": window} if window else {"scene": scene})):
            return self._look(bpy.context, scatter, takes_edits, last_sign)

    def end(self) -> None:
        """Let the solver go."""
        self._worker.end()

    def join(self) -> None:
        """Wait for the solver to be gone."""
        self._worker.join(LONGEST_JOIN)

    def reset(self) -> None:
        """The result is another now: the next update starts from there."""
        self._told = self._asked = self._waiting = self._shown = self._written = None
        self._edited.forget()
        self._parts = 0

    def look_at_edited(self) -> None:
        """Points that are edited were pinned, turned or removed by a button, which Edit Mode does not tell."""
        self._edited.forget()

    def look_at_points(self) -> None:
        """The result may be another now, or the same with settings and a report of before."""
        scatter = _scatter_of(self._scene.find(), self._uid)
        if scatter is None or _points_of(scatter.result) != self._points:
            self.reset()
        elif self._written is not None and scatter.ran_with != self._written[0]:
            scatter.ran_with, scatter.report_json = self._written

    def _look(self, context: bpy.types.Context, scatter: Scatter, takes_edits: bool, last_sign: float) -> bool:
        if running.session is not None:
            # What it makes is where to go on from.
            self.reset()
            return True
        why = self._gone(context, scatter)
        if why:
            scatter.live = False
            self.stopped = f"Live stopped: {why}"
            redraw_sidebars()
            return False
        attentive = time.monotonic() - last_sign < ATTENTIVE or strokes.brush() is not None
        if self._waiting is not None and self._may_write(context, scatter):
            self._write(context, scatter)
        if takes_edits and self._time_to_look(attentive) and self._worker.rests():
            try:
                if _can_be_read(context, scatter):
                    with checksums.at_most(SHARE_ATTENTIVE if attentive else SHARE_AT_REST):
                        self._read(context, scatter, last_sign)
            finally:
                self._worker.go_on()
        return True

    def _read(self, context: bpy.types.Context, scatter: Scatter, last_sign: float) -> None:
        """Have what has changed solved; Edit Mode of the result is left for that, if something has."""
        result = scatter.result
        if result is None or not may_be_left(context, result):
            if result is None or result.mode == "OBJECT":
                self._edited.forget()
            self._submit(context, scatter)
        elif self._edited.has_changed(scatter, result, last_sign):
            with outside_edit_mode(result):
                self._submit(context, scatter)
            self._edited.note(scatter, result)

    def _may_write(self, context: bpy.types.Context, scatter: Scatter) -> bool:
        """Tell whether the result can be written now: not while it is rendered, nor over what was just moved in Edit Mode."""
        result = scatter.result
        if bpy.app.is_job_running("RENDER"):
            return False
        if result is None or result.mode == "OBJECT":
            self._edited.forget()
            return True
        return may_be_left(context, result) and self._edited.has_its_points(result)

    def _write(self, context: bpy.types.Context, scatter: Scatter) -> None:
        """Show what waits, unless the result became another one since that was asked for; Edit Mode of it is left for that."""
        outcome, result = self._waiting, scatter.result
        if outcome is None or outcome.request is not self._asked:
            self._waiting = None
        elif result is None or result.mode == "OBJECT" or self._shown is outcome.job:
            self._waiting = None
            self._show(context, scatter, outcome)
        elif self._worker.rests():
            self._waiting = None
            try:
                with outside_edit_mode(result):
                    self._show(context, scatter, outcome)
                self._edited.note_points(result)
            finally:
                self._worker.go_on()

    def _gone(self, context: bpy.types.Context, scatter: Scatter) -> str:
        """Return what is no longer there, as a sentence; empty where all is."""
        targets = scatter.targets
        if not targets or not all(is_in(context.scene, target) for target in targets):
            return "its target is no longer in the scene"
        if scatter.report_json and scatter.result_in(context.scene) is None:
            return "its result is no longer in the scene; click Scatter to make it anew"
        for entry in scatter.placed:
            if entry.uid and entry.item is None and entry.collection is None:
                names = [c.name for c in scatter.classes if c.uid == entry.uid]
                if names:
                    return f"an object of {names[0]} was deleted"
        return next(filter(None, (c.gone for c in scatter.classes if not c.mute)), "")

    def _time_to_look(self, attentive: bool) -> bool:
        if not attentive and time.monotonic() - self._looked < AT_REST:
            return False
        stroke = strokes.brush()
        # Colors and weights are read during the stroke, if that is quick; shapes only when the brush is lifted.
        if stroke is None:
            return True
        if self._reading >= FOLLOWS_STROKES and time.monotonic() - self._looked < self._reading / SHARE_SLOW:
            return False
        return stroke in strokes.COLORS | {strokes.WEIGHTS} and self._reading < 2.0 * FOLLOWS_STROKES

    def _submit(self, context: bpy.types.Context, scatter: Scatter) -> None:
        """Have the scatter solved as it is now, if it differs from what was solved last."""
        from .job import ScatterJob
        from .job_as_placed import job_as_placed, places_in_order
        from .live_worker import Request

        self._looked = time.monotonic()
        result = scatter.result_in(context.scene)
        goes_on = strokes.is_under_way()
        if self._has_to_wait(context, scatter, result):
            # A stroke that has ended is not followed as one any more: what is edited now is where the next one begins.
            self._parts = self._parts if goes_on else 0
            return
        # What is told of a while ago lacks the end of a stroke.
        with checksums.now() if self._parts and not goes_on else nullcontext():
            record = scatter.record()
        made_with = scatter.fingerprint(record)
        if made_with == self._told:
            self._say(self._refused)
            if not (goes_on or self._refused):
                self._follow_as_one()
            return
        if lost := scatter.lost_by_hand(context.scene):
            self._say(f"{lost}: Live waits. Click Update to go on without them")
            return
        if self._exceeds_cap(scatter, result):
            return
        if self._told is not None and scatter.shows_at_once(self._record, record):
            self._told, self._record = made_with, record
            self._points = _points_of(scatter.result)
            redraw_sidebars()
            return
        first = self._told is None
        start = time.thread_time()
        try:
            positional, named = scatter.arguments(context.scene)
            job = ScatterJob(*positional, **named, prepare=False)
            job.made_with = made_with
            places = places_in_order(result) if result is not None and (first or not self._worker.has_solver) else None
            anew = scatter.has_other_border(record) if first else _needs_a_new_start(self._record, record)
            ready_only = first and result is not None and not scatter.outdated
            if ready_only and not scatter.report_json:
                # A copy with settings of its own has no report yet, by which to know whether its counts are others now.
                ready_only = len(result.data.vertices) == sum(one.count for one in scatter.ready_classes())
            # Counts may be others than those that are there, since it was off.
            before = None
            if result is not None and places is not None and not (anew or ready_only):
                before = job_as_placed(result, places, positional, named)
        except EshError as error:
            self._told, self._record = made_with, record
            self._refuse(as_sentence(error))
            return
        self._reading = time.thread_time() - start
        self._refuse("")
        few_steps = before is not None and scatter.only_counts_changed(record)
        self._told, self._record = made_with, record
        self._submitted_at = time.perf_counter()
        back_to, again = None, False
        if first and result is not None and _points_of(result) is not None:
            standing = _standing_of(result)
            back_to, follows = self._known.find(standing)
            # Undo and redo lead to a part of a stroke, and not to what has followed it as a whole.
            again = follows and back_to is not None and back_to.made_with == made_with
            if back_to is None and not anew:
                self._known.begin(standing, job if before is None else before[0])
        start_at = None if anew else places
        stroke = self._part_of_stroke(goes_on)
        self._parts = self._parts + 1 if goes_on and not (first or anew) else 0
        self._ask(Request(job, anew, start_at, before, few_steps, ready_only, back_to, again, stroke))

    def _exceeds_cap(self, scatter: Scatter, result: bpy.types.Object | None) -> bool:
        """Tell whether more objects are asked for than are placed unasked, and than the button has placed, and say so."""
        try:
            many = scatter.too_many(self._granted)
        except EshError:
            # Whoever solves it says what is wrong with its target.
            return False
        if many and result is not None and not scatter.outdated:
            self._granted = scatter.bodies_ahead()
        elif many:
            self._say(f"{many}: Live waits. Click Update to place them")
            return True
        return False

    def _part_of_stroke(self, goes_on: bool) -> Stroke | None:
        """Return which part of a stroke the next request follows; None for none."""
        if goes_on:
            return Stroke.GOES_ON if self._parts else Stroke.BEGINS
        return Stroke.ENDS if self._parts and self._worker.knows_beginning else None

    def _has_to_wait(self, context: bpy.types.Context, scatter: Scatter, result: bpy.types.Object | None) -> bool:
        """Tell whether nothing can be solved now, and say why; what is edited is followed once that is done."""
        edited = [item for item in (*scatter.targets, result) if item is not None and item.mode == "EDIT"]
        if edited or scatter.obstacle(context.scene):
            self._say(scatter.obstacle(context.scene) or "")
            return True
        if result is not None and real_objects_of(result) is not None:
            self._say("Its instances are real objects: click Back to Instances first")
            return True
        return False

    def _ask(self, request: Request) -> None:
        self._asked = request
        self._worker.submit(request)

    def _follow_as_one(self) -> None:
        """Have a stroke that was followed in parts, and has ended, followed as one."""
        in_parts = self._is_in_parts
        self._parts = 0
        if in_parts and self._asked is not None:
            self._submitted_at = time.perf_counter()
            # Somebody may be writing the one that was shown.
            job = copy.copy(self._asked.job)
            self._ask(replace(self._asked, job=job, back_to=None, stroke=Stroke.ENDS))

    def _show(self, context: bpy.types.Context, scatter: Scatter, outcome: Outcome) -> None:
        """Write what came out into the result."""
        if outcome.error is not None:
            # Once that is put right, the stroke is followed as one all the same.
            self._parts = 1 if outcome.request.stroke is Stroke.ENDS else self._parts
            self._refuse(as_sentence(outcome.error))
            return
        job, placement = outcome.job, outcome.placement
        assert job is not None and placement is not None
        result = scatter.result
        if self._shown is not job or result is None:
            before = undo_steps.Before.by(scatter, context.scene)
            try:
                result, _ = job.show(context)
            except EshError as error:
                self._refuse(as_sentence(error))
                return
            undo_steps.note(before, scatter, result, _scatter_of)
            self.seconds = time.perf_counter() - self._submitted_at
        elif placement.report is not None and _points_of(result) == self._points:
            job.keep_report(result, placement)
        report = placement.report.to_dict() if placement.report is not None else scatter.report
        if report is None:
            scatter.result = result
        else:
            # With a report of what is shown already, that is what it was, and what was changed at once since.
            known = self._shown is job and scatter.ran_with
            scatter.remember(result, report, known or job.made_with)
        if self._shown is not job:
            _show_since(scatter, job, result)
            self._shown, self._points = job, _points_of(result)
            if self._points is not None:
                self._known.note(outcome.request, _standing_of(result), job)
        self._written = scatter.ran_with, scatter.report_json
        redraw_sidebars()

    def _refuse(self, message: str) -> None:
        """Say what is wrong with what was asked for last, for as long as nothing else is."""
        self._refused = message
        self._say(message)

    def _say(self, message: str) -> None:
        if message != self.message:
            self.message = message
            redraw_sidebars()


def _can_be_read(context: bpy.types.Context, scatter: Scatter) -> bool:
    """Tell whether no stroke is under way that data must not meet which has to be made for reading weights."""
    if strokes.brush() != strokes.WEIGHTS:
        return True
    depsgraph = evaluated_depsgraph(context)
    return all(can_be_listed(target.evaluated_get(depsgraph)) for target in scatter.targets if target.vertex_groups)


def _scatter_of(scene: bpy.types.Scene | None, uid: int) -> Scatter | None:
    scatters = scene.esh_scatter.scatters if scene is not None else ()
    return next((scatter for scatter in scatters if scatter.uid == uid), None)


def _needs_a_new_start(before: dict[str, Any], now: dict[str, Any]) -> bool:
    """Tell whether bodies are to be other ones, and not the same in other places."""

    def drawn(record: dict[str, Any]) -> list[Any]:
        standing = [
            [c["values"].get(name) for name in ("random_turn", "scale_jitter")] for c in record["classes"].values()
        ]
        of_all = [record["scatter"].get(name) for name in ("seed", "boundary")]
        return [*of_all, standing if len(before["classes"]) == len(now["classes"]) else None]

    return drawn(before) != drawn(now)


def _show_since(scatter: Scatter, job: ScatterJob, result: bpy.types.Object) -> None:
    """Give a result what was changed at once while it was solved: how objects stand, colors, and which of a size's objects."""
    from ..result.kept_ground import CLASSES_OF_POINTS, can_stand_anew, paint_points, stand_anew
    from ..result.kept_variants import choose_anew

    classes = {c.uid: c for c in scatter.classes}
    for number, (uid, made) in enumerate(zip(result.data.get(CLASSES_OF_POINTS, ()), job.classes, strict=False)):
        now = classes.get(uid)
        if now is None:
            continue
        if (made.standing, made.look_at) != (now.standing(), now.look_at()) and can_stand_anew(result):
            stand_anew(result, number, now.standing(), now.look_at())
        if tuple(made.color or ()) != tuple(now.color):
            paint_points(result, number, tuple(now.color))
        for k, (one, size) in enumerate(zip(made.sizes, now.sizes, strict=False)):
            if dict(one.weights or {}) != size.weights and choose_anew(result, (number, k), *size.choices()):
                scatter.remember_variants(now, k)


def _points_of(result: bpy.types.Object | None) -> int | None:
    """Return a checksum of a result's points; None where they cannot be seen."""
    if result is None or result.type != "MESH" or result.mode == "EDIT" or "position" not in result.data.attributes:
        return None
    return zlib.crc32(read_attribute(result.data, "position").tobytes())


def _standing_of(result: bpy.types.Object) -> int:
    """Return a checksum of what stands on a result's points, and how."""
    with checksums.now():
        return checksums.of_points(result)
