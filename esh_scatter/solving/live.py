"""Live: a result that follows what it was made of, while that is changed.

A timer looks at the scatters that are live, and only while there are any; a depsgraph handler does no more than tell it to look now.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import loading, strokes, undo_steps
from .followed_scatter import FollowedScatter
from .new_result import Scatter

__all__ = ["end", "is_busy", "is_live", "look_at_edited", "reset", "resting", "status", "switched", "wake"]

# Seconds between two looks at what lives.
TICK = 0.05
# Seconds that others wait for the threads to rest, and between two looks at whether they do.
LONGEST_WAIT, A_WAIT = 0.5, 0.005

# What the depsgraph can say that may be of ours; kinds of data that nothing is made of are not looked for. Settings are the scene's:
# when one is changed in the sidebar, Blender tags the scene, and says of its objects, too, that they have changed.
_KINDS = ("OBJECT", "MESH", "IMAGE")

# Scatters that are followed, by the scene's number and their own.
_followed: dict[tuple[int, int], FollowedScatter] = {}
# What made scatters stop living, likewise, until they live again.
_stopped: dict[tuple[int, int], str] = {}
# When something was last said to change.
_last_sign = 0.0


def switched(scatter: Scatter, _context: object) -> None:
    """Follow a scatter, or no longer; called when its switch is used."""
    scene = scatter.id_data
    _stopped.pop((scene.session_uid, scatter.uid), None)
    if scatter.live:
        wake()


def wake() -> None:
    """Have the timer look for scatters that live: after a switch was used, or after one was seen that nobody follows."""
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, persistent=True)


def is_live(scene: bpy.types.Scene, scatter: Scatter) -> bool:
    """Tell whether a scatter is followed."""
    return (scene.session_uid, scatter.uid) in _followed


def status(scene: bpy.types.Scene, scatter: Scatter) -> str:
    """Return what there is to say of a scatter that lives, or that has stopped; empty where there is nothing."""
    key = scene.session_uid, scatter.uid
    live = _followed.get(key)
    if live is None:
        return _stopped.get(key, "")
    return live.message


def is_busy(scene: bpy.types.Scene, scatter: Scatter) -> bool:
    """Tell whether a scatter that lives is being solved."""
    live = _followed.get((scene.session_uid, scatter.uid))
    return live is not None and live.busy


def reset(scene: bpy.types.Scene, scatter: Scatter) -> None:
    """Have a scatter go on from its result as it is now: somebody else has written it."""
    live = _followed.get((scene.session_uid, scatter.uid))
    if live is not None:
        live.reset()


def look_at_edited(scene: bpy.types.Scene, scatter: Scatter) -> None:
    """Have a scatter follow what a button has done to instances that are edited."""
    live = _followed.get((scene.session_uid, scatter.uid))
    if live is not None:
        live.look_at_edited()


@contextmanager
def resting() -> Iterator[None]:
    """Have nothing be solved during a ``with`` block, in which operators are called with a context that is overridden.

    See :meth:`.LiveWorker.rests`. What takes too long to come to rest is not waited for.
    """
    workers = [one.worker for one in _followed.values()]
    until = time.monotonic() + LONGEST_WAIT
    while not all([worker.rests() for worker in workers]) and time.monotonic() < until:
        time.sleep(A_WAIT)
    try:
        yield
    finally:
        for worker in workers:
            worker.go_on()


def end(wait: bool = False) -> None:
    """Follow nothing any more, and take timer and handlers away."""
    ended = list(_followed.values())
    _followed.clear()
    for live in ended:
        live.end()
    undo_steps.forget()
    _detach()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if wait:
        for live in ended:
            live.join()


def _tick() -> float | None:
    """Look at all that lives; Blender calls it again after as many seconds as it returns."""
    global _last_sign
    if not loading.is_done() and not bpy.app.background:
        loading.begin()
        return TICK
    _find()
    if _followed and strokes.brush() is not None:
        # The depsgraph is silent during strokes, and about images that no material uses also after them.
        _last_sign = time.monotonic()
    for key, live in list(_followed.items()):
        if not live.look(_last_sign):
            live.end()
            _followed.pop(key, None)
            if live.stopped:
                _stopped[key] = live.stopped
    if not _followed:
        undo_steps.forget_known()
        _detach()
        return None
    return TICK


def _find() -> None:
    """Follow every scatter whose switch is on."""
    for scene in bpy.data.scenes:
        settings = getattr(scene, "esh_scatter", None)
        for scatter in settings.scatters if settings is not None and scene.is_editable else ():
            if not scatter.live:
                continue
            key = scene.session_uid, scatter.own_uid()
            if key not in _followed:
                _attach()
                _followed[key] = FollowedScatter(scene, scatter)


@persistent
def _something_changed(_scene: object, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Have the timer look: the depsgraph has news of what may be ours. It loops over nothing."""
    global _last_sign
    if depsgraph is None or any(depsgraph.id_type_updated(kind) for kind in _KINDS):
        _last_sign = time.monotonic()


@persistent
def _goes_back(*_arguments: object) -> None:
    """Before undo and redo nothing that stays may lead to what these free."""
    if not _followed:
        undo_steps.forget_known()
    undo_steps.go_back()


@persistent
def _went_back(*_arguments: object) -> None:
    """After undo and redo everything may be as it was before."""
    global _last_sign
    _last_sign = time.monotonic()
    undo_steps.went_back()
    for live in _followed.values():
        live.look_at_points()
    if not _followed:
        # Perhaps there is nothing to listen to any more.
        wake()


@persistent
def _file_goes(*_arguments: object) -> None:
    """Another file is opened."""
    _stopped.clear()
    undo_steps.forget()
    for live in _followed.values():
        live.end()
    _followed.clear()


def _hooks() -> list[tuple[list[Any], Any]]:
    handlers = bpy.app.handlers
    return [
        (handlers.depsgraph_update_post, _something_changed),
        (handlers.undo_pre, _goes_back),
        (handlers.redo_pre, _goes_back),
        (handlers.undo_post, _went_back),
        (handlers.redo_post, _went_back),
        (handlers.load_pre, _file_goes),
    ]


def _attach() -> None:
    for handlers, hook in _hooks():
        if hook not in handlers:
            handlers.append(hook)


def _detach() -> None:
    for handlers, hook in _hooks():
        if hook in handlers and not (undo_steps.is_any_noted() and hook in (_goes_back, _went_back)):
            handlers.remove(hook)
