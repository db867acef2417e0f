"""What a solver has placed and can go back to, by checksums of what stands in the result: undo and redo lead there."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING

from .strokes import Stroke

if TYPE_CHECKING:
    from .job import ScatterJob
    from .live_worker import Request

__all__ = ["KnownResults"]


class KnownResults:
    """Jobs by checksums of what they have placed, as long as somebody else holds on to them."""

    def __init__(self) -> None:
        self._placed: weakref.WeakValueDictionary[int, ScatterJob] = weakref.WeakValueDictionary()
        # What has followed a stroke as a whole, by what its parts had left: an undo step holds one of these.
        self._followed: weakref.WeakValueDictionary[int, ScatterJob] = weakref.WeakValueDictionary()
        self._left: list[int] = []

    def begin(self, standing: int, job: ScatterJob) -> None:
        """Know a job that begins with what stands there."""
        self._placed[standing] = job

    def find(self, standing: int) -> tuple[ScatterJob | None, bool]:
        """Return the job that has placed what stands there, and False; or that which has followed it at a stroke's end, and True."""
        followed = self._followed.get(standing)
        return (self._placed.get(standing), False) if followed is None else (followed, True)

    def note(self, request: Request, standing: int, job: ScatterJob) -> None:
        """Know what a job has placed, and if that ends a stroke, what has come of it wherever its parts have led."""
        self._placed[standing] = job
        if request.stroke is Stroke.ENDS:
            self._followed.update(dict.fromkeys(self._left, job))
        # What runs on is shown once more, as is what undo leads to.
        for left, led_to in list(self._followed.items()):
            if led_to is request.job or (request.again and led_to is request.back_to):
                self._followed[left] = job
        if request.stroke is not Stroke.GOES_ON:
            self._left.clear()
        if request.stroke in (Stroke.BEGINS, Stroke.GOES_ON):
            self._left.append(standing)
