"""What errors say, in the words of the sidebar. Knows nothing of Blender."""

from __future__ import annotations

import re
from functools import cache

from ...engine.errors import ProblemError, Reason
from . import words

__all__ = ["as_sentence"]

# Lengths and areas are told in meters, which whoever shows the sentence turns into the scene's units.
_SENTENCES = {
    Reason.LINE_TOO_LONG: (
        "{who}: its objects are {given} long, and the ground is only {limit} long: lower their Scale, or place shorter ones"
    ),
    Reason.LINE_TOO_SHORT: (
        "{who}: its long objects are too small for ground that is {limit} long: raise their Scale, or place them on less of it"
    ),
    Reason.BODY_TOO_LONG: (
        "{who}: its objects are {given} long, far too long for ground of {limit}: lower their Scale, Room or Gap"
    ),
    Reason.AREAS_TOO_DIFFERENT: (
        "{who}: one object takes {given_area}, and one of {other} only {limit_area}: make them more alike, or scatter one by itself"
    ),
    Reason.TOO_MUCH_GROUND: (
        "The objects would cover {times} times the ground: lower the counts, place smaller objects, or switch Avoid Overlap off"
    ),
    Reason.TOO_MUCH_EMPHASIS: "{who}: its sizes differ too much for so high a Favor Large: lower it",
    Reason.FIXED_AREA: (
        "A pinned object takes {given_area}, and another object {limit_area}: they differ too much, so unpin it, or scale it"
    ),
    Reason.FIXED_LENGTH: "{who}: a pinned object is {given} long, which does not fit ground of {limit}: unpin it, or scale it",
    Reason.CLUMPS_TOO_SMALL: "{who}: its clumps are {given} wide, and on so large ground Clump Size must be at least {limit}",
    Reason.DOMAIN_TOO_NARROW: (
        "The target is {given} by {limit}, too narrow to be scattered on from above: choose Whole Surface, or scale it"
    ),
    Reason.DOMAIN_OUT_OF_RANGE: "The target is {given} along a side; it can be scattered on from {limit}: scale it",
}
_KEY = re.compile(r"`([\w.]+)`")


def as_sentence(error: Exception | str) -> str:
    """Return what an error says as a sentence of the sidebar.

    Where the engine tells what it is about, in the sidebar's words; otherwise as it is, with labels of the sidebar for names of
    settings, which are in back quotes.
    """
    refusal = error.refusal if isinstance(error, ProblemError) else None
    if refusal is None:
        text = _KEY.sub(lambda found: _labels().get(found[1].rpartition(".")[2], found[1]), str(error)).replace("`", "")
        return text[:1].upper() + text[1:]
    return _SENTENCES[refusal.reason].format(
        who=_named("Class", *refusal.who),
        other=_named("class", *refusal.other),
        given=words.meters(refusal.given),
        limit=words.meters(refusal.limit),
        given_area=f"{refusal.given:.3g} m²",
        limit_area=f"{refusal.limit:.3g} m²",
        times=f"{refusal.given:,.0f}",
    )


def _named(word: str, body_class: str, size: str) -> str:
    return f'{word} "{body_class}"' + (f', size "{size}"' if size else "")


@cache
def _labels() -> dict[str, str]:
    """Return what the sidebar calls settings, by their names."""
    from ...engine.problem.body_class import ClassSettings
    from ...engine.problem.scatter_settings import ScatterSettings
    from ...engine.problem.settings import settings_of
    from ...engine.problem.size import Size

    return {name: one.label for cls in (ScatterSettings, ClassSettings, Size) for name, one in settings_of(cls).items()}
