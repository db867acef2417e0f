"""Counts again by itself which objects of a result lean into each other, once they stand otherwise than when its run counted.

In a window whoever draws a report asks, and does not wait: once nothing has changed for a moment, a timer reads what is there, and a
thread counts. The timer ends with that. Without a window no timers run: whoever asks waits.

What was counted is kept here, by what it was counted of, and not in the file: undo and other files need to know nothing of it, and
where they lead back to what is known, that is told at once.
"""

from __future__ import annotations

import threading
import time
from contextlib import nullcontext
from typing import TYPE_CHECKING, NamedTuple

import bpy

from ..targets import checksums
from ..targets.references import Reference
from . import live, loading, running, strokes
from .background_run import BackgroundRun
from .redrawing import redraw_sidebars

if TYPE_CHECKING:
    from ..result.leaning import Leaning
    from ..result.leaning_now import LeaningNow
    from .new_result import Scatter

__all__ = ["Counted", "changes", "counted", "detach", "needless", "number_of"]

# Seconds after the last change that somebody saw.
PAUSE = 0.4
# Seconds between two looks at whether the thread has ended.
LOOK = 0.05
# Counts that are kept.
MOST_KEPT = 32


class Counted(NamedTuple):
    """What was found of a result; ``leaning`` is None where nothing leans, ``known`` false where nobody can count."""

    leaning: Leaning | None
    known: bool = True


class _Key(NamedTuple):
    """What is counted: of which result, how it stands, and whether pairs that overlap on the ground are counted elsewhere."""

    uid: int
    number: str
    told: bool


class _Asked(NamedTuple):
    """A result that somebody wants counted, and the scene that it is looked at in."""

    key: _Key
    scene: Reference
    result: Reference


class _Count:
    """A count under way in a thread."""

    def __init__(self, key: _Key, read: LeaningNow) -> None:
        self.key = key
        self.found: Counted | None = None
        self._read = read
        self.run = BackgroundRun(self._work)

    def _work(self, _progress: object) -> None:
        """Count; touches nothing of Blender."""
        self.found = Counted(self._read.count(self.key.told, self._ask))

    def _ask(self) -> None:
        """End where nobody wants it any more; the thread may be here before it has a name."""
        if "run" in vars(self):
            self.run.ask()


_known: dict[_Key, Counted] = {}
# By the session's numbers of results.
_asked: dict[int, _Asked] = {}
_going: _Count | None = None
_last_change = 0.0


def changes() -> None:
    """Note that somebody changes how objects stand: nothing is counted before a pause."""
    global _last_change
    _last_change = time.monotonic()


def number_of(result: bpy.types.Object, *, exactly: bool = False) -> str:
    """Return what tells whether the objects of a result stand as they did; empty where nothing is compared, or that cannot be read.

    While drawing it may be that of a moment ago, unless it is asked for ``exactly``.
    """
    from ..result.leaning_now import number_of_leaning

    with checksums.now() if exactly else nullcontext():
        return number_of_leaning(result)


def counted(scatter: Scatter, result: bpy.types.Object, number: str, *, told: bool, wait: bool) -> Counted | None:
    """Return what is known of a result as it stands by now; None where that will be known in a moment.

    Args:
        scatter: Whose result it is.
        result: The result.
        number: Its :func:`number_of`.
        told: Whether pairs that overlap on the ground are counted elsewhere.
        wait: Whether to count at once what is not known. Without a window it always is.
    """
    key = _Key(result.session_uid, number, told)
    if key in _known:
        needless(result)
        return _known[key]
    if result.data.is_editmode:
        # There nothing can be read.
        return Counted(None, known=False)
    if wait or bpy.app.background:
        return _count_now(key, result)
    if running.session is None and not live.is_busy(scatter.id_data, scatter):
        _ask(_Asked(key, Reference(scatter.id_data, "scene"), Reference(result, "result")))
    return None


def needless(result: bpy.types.Object) -> None:
    """Note that a result need not be counted: it stands as it did when it was, as after undo."""
    _asked.pop(result.session_uid, None)


def detach() -> None:
    """Forget everything, and wait for the thread."""
    global _going
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    if _going is not None:
        _going.run.abandon()
        _going.run.join(threading.TIMEOUT_MAX)
        _going = None
    _asked.clear()
    _known.clear()


def _ask(asked: _Asked) -> None:
    """Have the timer count a result, which differs from what was asked for before if it stands otherwise."""
    before = _asked.get(asked.key.uid)
    if before is None or before.key != asked.key:
        _asked[asked.key.uid] = asked
        changes()
    if not bpy.app.timers.is_registered(_look):
        # It comes to its end by itself, also where another file is opened meanwhile.
        bpy.app.timers.register(_look, first_interval=PAUSE, persistent=True)


def _count_now(key: _Key, result: bpy.types.Object) -> Counted:
    """Count a result while the caller waits."""
    from ..result.leaning_now import read_leaning

    if _going is not None and _going.key == key:
        _going.run.join(threading.TIMEOUT_MAX)
        if _going.found is not None:
            return _keep(key, _going.found)
    read = read_leaning(result, bpy.context)
    return _keep(key, Counted(None, known=False) if read is None else Counted(read.count(key.told)))


def _keep(key: _Key, found: Counted) -> Counted:
    while len(_known) >= MOST_KEPT:
        del _known[next(iter(_known))]
    _known[key] = found
    return found


def _look() -> float | None:
    """Count what was asked for, one result after the other; Blender calls it again after as many seconds as it returns."""
    if running.session is not None:
        # Whoever draws after the run asks again.
        _asked.clear()
    elif not loading.is_done() and not bpy.app.background:
        loading.begin()
        return LOOK
    pause = _last_change + PAUSE - time.monotonic()
    if _going is not None:
        if pause > 0.0 or _going.key.uid not in _asked or _asked[_going.key.uid].result.find() is None:
            _going.run.abandon()
        if _going.run.running:
            return LOOK
        _end_count()
    if not _asked:
        return None
    if pause > 0.0:
        return pause
    if strokes.is_under_way() or bpy.app.is_job_running("RENDER"):
        return PAUSE
    for asked in list(_asked.values()):
        if _begin(asked):
            return LOOK
        _asked.pop(asked.key.uid)
    return None


def _end_count() -> None:
    """Keep what the thread has found, if somebody still wants it."""
    global _going
    count, _going = _going, None
    if count is not None and not count.run.stopped:
        _asked.pop(count.key.uid, None)
        _keep(count.key, count.found or Counted(None, known=False))
        redraw_sidebars()


def _begin(asked: _Asked) -> bool:
    """Read a result as it is by now and have it counted; tell whether there is anything to count."""
    global _going
    from ..result.leaning_now import LEANING_OF, read_leaning

    scene, result = asked.scene.find(), asked.result.find()
    window = next((one for one in bpy.context.window_manager.windows if one.scene == scene), None)
    if scene is None or result is None or (window is None and not bpy.app.background):
        return False
    if any(live.is_busy(scene, scatter) for scatter in scene.esh_scatter.scatters if scatter.result == result):
        # What Live shows, it counts; whoever draws that asks again.
        return False
    with bpy.context.temp_override(**({"window": window} if window else {"scene": scene})):
        key = asked.key._replace(number=number_of(result, exactly=True))
        if not key.number or key in _known or result.data.get(LEANING_OF) == key.number:
            # It is as it was before, and what is drawn by now may not know that yet.
            redraw_sidebars()
            return False
        read = read_leaning(result, bpy.context)
    if read is None:
        if not result.data.is_editmode:
            # Too little is known of it. In Edit Mode the next one to ask sees that.
            _keep(key, Counted(None, known=False))
            redraw_sidebars()
        return False
    _asked[key.uid] = asked._replace(key=key)
    _going = _Count(key, read)
    return True
