"""What can be said of a scatter of the sidebar before it is solved: how much of the ground it covers, and whether that fits.

Drawing asks, and must not wait: what is not known yet is read a moment later, once for everything that has changed, and worked out in
a thread on a coarse chart of the target: among the instances of another scatter that takes half a second.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import bpy

from ...engine.errors import EshError
from ..solving import live, loading, running
from ..solving.background_run import BackgroundRun
from ..solving.redrawing import redraw_sidebars
from ..targets.references import Reference

if TYPE_CHECKING:
    from ...engine.problem.cover import Cover
    from ...engine.problem.problem import Problem
    from ..api import ScatterJob
    from ..classes.survey import Survey

__all__ = [
    "MOST_BODIES",
    "Forecast",
    "detach",
    "forecast",
    "known",
    "problem_of",
    "scale_counts",
    "scale_counts_to_fit",
    "takes_whole_surface",
]

# Cells along the longer side of the chart: enough for a share of the ground.
RESOLUTION = 192
# Seconds after the last change that somebody saw.
PAUSE = 0.4
# Seconds between two looks at whether the thread has ended.
LOOK = 0.05
# Bodies of which it is worked out: each has an outline of its own.
MOST_BODIES = 500_000
# Counts are scaled to this share of what fits, and so many times at most: some cannot be scaled, or not below one.
MARGIN = 0.98
# Between obstacles what fits is known less well, and bodies that are stuck there find no other place where all are full.
MARGIN_BESIDE_OBSTACLES = 0.95
TIMES = 4


class Forecast(NamedTuple):
    """What is known of a scatter with certain settings.

    Attributes:
        fingerprint: Names the settings.
        cover: How much its footprints cover; None where nothing can be said.
        whole: Whether it stands on the whole surface, and not on what is seen from above; None where nobody knows.
    """

    fingerprint: str
    cover: Cover | None
    whole: bool | None


_survey: Survey | None = None
# By scene and the number of a scatter in it.
_known: dict[tuple[int, int], Forecast] = {}
_asked: tuple[Reference, int] | None = None
# What is worked out in a thread just now, and for whom.
_going: tuple[BackgroundRun, _Work] | None = None


class _Work:
    """What is worked out in a thread: the cover of a job that was read, for the scatter that it was read from."""

    def __init__(self, job: ScatterJob | None, scene: bpy.types.Scene, number: int) -> None:
        self.key = scene.session_uid, number
        self.scene = Reference(scene, "scene")
        self.fingerprint = _fingerprint(scene.esh_scatter.scatters[number])
        self._job = job
        self.cover: Cover | None = None

    def run(self, _progress: object) -> None:
        """Work it out; touches nothing of Blender."""
        self.cover = _cover(self._job)

    @property
    def whole(self) -> bool | None:
        """Whether it stands on the whole surface, once that is worked out; None where nobody knows."""
        return None if self._job is None else self._job.stands_on_whole


def forecast(scatter: Any, scene: bpy.types.Scene) -> Cover | None:
    """Work out what the footprints of a scatter will cover; None where overlap is allowed, or nothing can be placed."""
    # Both use the same survey.
    _end()
    return _cover(_read(scatter, scene))


def problem_of(scatter: Any, scene: bpy.types.Scene, **changes: Any) -> Problem | None:
    """Return what the sampler would be asked for a scatter, on a coarse chart; None where nothing can be said of it.

    ``changes`` are settings that are otherwise than the scatter's.
    """
    _end()
    job = _read(scatter, scene, **changes)
    try:
        if job is not None:
            job.prepare()
    except EshError:
        # The run will say it.
        return None
    return None if job is None else job.problem


def _read(scatter: Any, scene: bpy.types.Scene, **changes: Any) -> ScatterJob | None:
    """Read a scatter from Blender; None where nothing can be said of it."""
    from ..api import ScatterJob
    from ..classes.survey import Survey

    global _survey
    if not scatter.avoid_overlap or scatter.obstacle(scene) is not None:
        return None
    if sum(body_class.count for body_class in scatter.ready_classes()) > MOST_BODIES:
        return None
    positional, named = scatter.arguments(scene)
    _survey = _survey or Survey(RESOLUTION)
    try:
        return ScatterJob(
            *positional, **{**named, **changes, "device": "cpu", "result": None}, survey=_survey, prepare=False
        )
    except EshError:
        # The run will say it.
        return None


def _cover(job: ScatterJob | None) -> Cover | None:
    """Work out what the footprints of a job will cover; in any thread."""
    from ...engine.problem.cover import cover_of

    if job is None:
        return None
    try:
        job.prepare()
    except EshError:
        return None
    return cover_of(job.problem)


def _end() -> None:
    """Wait for what is worked out just now, and forget it: who still wants it asks again."""
    global _going
    if _going is not None:
        _going[0].join(threading.TIMEOUT_MAX)
        _going = None


def known(scatter: Any, scene: bpy.types.Scene, record: dict[str, Any] | None = None) -> Cover | None:
    """Return what is known of a scatter as it is now, without waiting; what is not known will be, a moment later.

    ``record`` is that of its settings as they are now, where it has been made.
    """
    found = _known_of(scatter, scene, record)
    return None if found is None else found.cover


def takes_whole_surface(scatter: Any, scene: bpy.types.Scene) -> bool | None:
    """Return whether a scatter takes the whole surface of its target, or what is seen from above, as :func:`known` knows it."""
    found = _known_of(scatter, scene, None)
    return None if found is None else found.whole


def _known_of(scatter: Any, scene: bpy.types.Scene, record: dict[str, Any] | None) -> Forecast | None:
    """Return what is known of a scatter as it is now; what is not known will be, a moment later."""
    global _asked
    number = _number_of(scatter)
    found = _known.get((scene.session_uid, number))
    if found is not None and found.fingerprint == _fingerprint(scatter, record):
        return found
    _asked = Reference(scene, "scene"), number
    if not bpy.app.background and not bpy.app.timers.is_registered(_work):
        bpy.app.timers.register(_work, first_interval=PAUSE)
    return None


def look(scene: bpy.types.Scene, number: int) -> Forecast | None:
    """Work out a forecast anew and remember it; None where there is no such scatter."""
    scatters = scene.esh_scatter.scatters
    if number >= len(scatters):
        return None
    _end()
    work = _Work(_read(scatters[number], scene), scene, number)
    work.run(None)
    made = _known[work.key] = Forecast(work.fingerprint, work.cover, work.whole)
    return made


def scale_counts_to_fit(scatter: Any, scene: bpy.types.Scene) -> float:
    """Scale the counts of a scatter's classes so that its footprints fit; returns the share of them that is left, 1 where all fit."""
    whole = 1.0
    margin = MARGIN_BESIDE_OBSTACLES if scatter.arguments(scene)[1]["obstacles"] else MARGIN
    for _ in range(TIMES):
        cover = forecast(scatter, scene)
        if cover is None or not cover.too_much:
            break
        factor = margin * cover.fits / cover.covered
        before = scale_counts(scatter.ready_classes(), factor)
        if all(getattr(group, name) == value for group, name, value in before):
            # Nothing can be less.
            break
        whole *= factor
    return whole


def detach() -> None:
    """Forget everything."""
    global _survey, _asked
    if bpy.app.timers.is_registered(_work):
        bpy.app.timers.unregister(_work)
    _end()
    _known.clear()
    _survey, _asked = None, None


def scale_counts(classes: Iterable[Any], factor: float) -> list[tuple[Any, str, Any]]:
    """Scale how many objects classes have, in whatever way that is given; return whose what was how before."""
    changed = []
    for body_class in classes if factor != 1.0 else ():
        for group, name, value in _scaled(body_class, factor):
            changed.append((group, name, getattr(group, name)))
            setattr(group, name, value)
    return changed


def _scaled(body_class: Any, factor: float) -> list[tuple[Any, str, Any]]:
    """Return what says how many objects a class has, and what it is scaled: whose, its name, its value."""
    kind = body_class.count_kind
    if kind == "SIZES":
        return [(size, "count", max(1, math.floor(size.count * factor))) for size in body_class.sizes]
    if kind == "TOTAL":
        return [(body_class, "total", max(len(body_class.sizes), math.floor(body_class.total * factor)))]
    if kind == "DISTANCE":
        return [(body_class, "distance", body_class.distance / math.sqrt(factor))]
    name = {"PER_AREA": "per_area", "SHARE": "cover_share"}.get(kind)
    return [] if name is None else [(body_class, name, factor * getattr(body_class, name))]


def _work() -> float | None:
    """Work out what was asked for last, and show it; Blender calls it, and again after so many seconds as it returns."""
    global _asked, _going
    if running.session is not None:
        # Whoever draws after the run asks again.
        return None
    if not loading.is_done() and not bpy.app.background:
        loading.begin()
        return LOOK
    if _going is not None:
        run, work = _going
        if run.running:
            return LOOK
        _going = None
        _known[work.key] = Forecast(work.fingerprint, work.cover, work.whole)
        if bpy.context.scene == work.scene.find():
            redraw_sidebars()
    asked, _asked = _asked, None
    scene = asked[0].find() if asked is not None else None
    # Scripts and panels see what the context's scene holds.
    if asked is None or not isinstance(scene, bpy.types.Scene) or bpy.context.scene != scene:
        return None
    scatters = scene.esh_scatter.scatters
    if asked[1] >= len(scatters) or live.is_busy(scene, scatters[asked[1]]):
        # What Live follows, its report says; whoever draws that asks again.
        return None
    work = _Work(_read(scatters[asked[1]], scene), scene, asked[1])
    _going = BackgroundRun(work.run), work
    return LOOK


def _number_of(scatter: Any) -> int:
    return int(scatter.path_from_id().rpartition("[")[2].rstrip("]"))


def _fingerprint(scatter: Any, record: dict[str, Any] | None = None) -> str:
    return str(scatter.fingerprint(record))
