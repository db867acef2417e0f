"""What errors say, in the words of the sidebar. Knows nothing of Blender."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

from ...engine.errors import EshError, Reason, Refusal
from ...engine.problem.machine_memory import format_bytes
from . import words

__all__ = ["NOT_SEEN", "as_sentence"]

# Also said before a run.
NOT_SEEN = "The target is not visible from above: choose Whole Surface"

# Counts beyond this are told as this.
LARGEST_TOLD = 1e18
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
        "The objects would cover {given_number} times the ground: lower the counts, place smaller objects, or switch Avoid Overlap off"
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
    Reason.DOMAIN_OUT_OF_RANGE: "The target is {given} along a side, and the limit is {limit}: scale it",
    Reason.SURFACE_WITHOUT_AREA: "The target has no area: all its faces are points or lines",
    Reason.NOT_SEEN_FROM_ABOVE: NOT_SEEN,
    Reason.MEMORY_FOR_BODIES: (
        "{given_number} objects do not fit into memory, about {limit_number} would: lower the counts, first that of {own}"
    ),
    Reason.TOO_MANY_BODIES: (
        "These are {given_number} objects, and at most {limit_number} can be placed: lower the counts, first that of {own}"
    ),
    Reason.MEMORY_FOR_GROUPS: (
        "The run needs {given_bytes} of memory, and there is {limit_bytes}: use fewer classes and sizes, or a less elongated target"
    ),
    Reason.MEMORY_FOR_DENSITIES: (
        "{who}: the densities need {given_bytes} of memory, and there is {limit_bytes}: use fewer classes, or smaller images"
    ),
    Reason.MEMORY_FOR_CLUMPS: "{who}: its clumps need {given_bytes} of memory, and there is {limit_bytes}: raise Clump Size",
    Reason.CLUMPS_ON_SURFACE: "{who}: a whole surface has no clumps: set Clustering to 0, or Surface to From Above",
    Reason.SHARPENED_ON_SURFACE: "{who}: a whole surface takes no Sharpen: switch it off, or set Surface to From Above",
    Reason.NO_DENSITY: "{who}: its density is zero on nearly all of the target: change its layers",
    Reason.DENSITY_ABOVE_ONE: "{who}: its density goes up to {given_share}, but a share of the ground is at most 1: lower it",
    Reason.SHARPENED_TOO_MUCH: "{who}: nothing useful is left of its density: lower Sharpen",
    Reason.COVER_BELOW_ONE_BODY: (
        "{who}: its density covers {given_area}, less than half of one object: raise the density, or place smaller objects"
    ),
    Reason.COVER_BESIDE_FIXED: "{who}: its pinned objects leave no room for others: unpin some, or raise its density",
    Reason.COVER_BESIDE_COUNTED: "{who}: the other classes leave no room for it: lower their counts, or give it a count",
    Reason.SHARE_BELOW_ONE_BODY: (
        "{who}: its share of the ground that the class takes is less than one of {given_number} objects: raise the share or the count"
    ),
    Reason.OBSTACLES_EVERYWHERE: "{who}: obstacles cover all of its ground: remove some, or lower their Margin",
    Reason.OBSTACLES_TOO_NEAR: (
        "{who}: obstacles leave no place that is {given} away from them: remove some, or lower their Margin, or the objects' Scale"
    ),
    Reason.ALL_FIXED: (
        "All objects are pinned or were moved, as by Set Origin or Apply: Select Pinned, then Unpin (Instances), or raise a count"
    ),
    Reason.FEWER_THAN_FIXED: "{who}: {limit_number} of its objects are pinned, more than its count of {given_number}: raise it",
    Reason.FIXED_OFF_SURFACE: "A pinned object is more than {limit} away from the target: move it back, or unpin it",
    Reason.MIXED_TOO_MUCH: (
        "Classes that keep apart from some and may overlap others cannot be mixed so much: lower Mix Classes to {limit_share}, or "
        "change which May Overlap"
    ),
    Reason.FORCES_NOT_FINITE: "The objects differ too much in size: make them more alike, or lower Favor Large",
    Reason.NO_SUCH_DEVICE: "This computer has no such NVIDIA GPU, or no driver for it: set Device to Automatic or CPU",
}
_KEY = re.compile(r"`([\w.]+)`")


def as_sentence(error: Exception | str) -> str:
    """Return what an error says as a sentence of the sidebar.

    Where the engine tells what it is about, in the sidebar's words; otherwise as it is, with labels of the sidebar for names of
    settings, which are in back quotes.
    """
    refusal = error.refusal if isinstance(error, EshError) else None
    if refusal is None:
        text = _KEY.sub(lambda found: _labels().get(found[1].rpartition(".")[2], found[1]), str(error)).replace("`", "")
        return text[:1].upper() + text[1:]
    return _SENTENCES[refusal.reason].format_map(_Told(refusal))


class _Told(dict[str, str]):
    """What sentences have in braces: names, and numbers in the unit that they ask for, a length where they ask for none."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(
            who=_named("Class", *refusal.who),
            own=_named("class", *refusal.who),
            other=_named("class", *refusal.other),
        )
        self._refusal = refusal

    def __missing__(self, key: str) -> str:
        which, _, unit = key.partition("_")
        return _IN_UNIT[unit](self._refusal.given if which == "given" else self._refusal.limit)


_IN_UNIT: dict[str, Callable[[float], str]] = {
    "": words.meters,
    "area": lambda value: f"{value:.3g} m²",
    "bytes": lambda value: format_bytes(round(value)),
    "number": lambda value: f"{float(min(value, LARGEST_TOLD)):,.0f}",
    "share": lambda value: f"{value:.3g}",
}


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
