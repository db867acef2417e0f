"""What of a selection cannot be placed, and what is said of it. Knows nothing of Blender."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum

__all__ = ["LeftOut", "Why", "nothing_left", "told"]


class Why(Enum):
    """Why something is left out: what is said of several things, and where nothing else is there."""

    BARE = "have no faces; curves get some by a Bevel", "has faces; curves get some by a Bevel"
    REPEATS = "repeat others on their parts, which nothing measures; make those real", "can be measured"
    FLAT = "cover no ground when seen from above", "covers ground when seen from above"
    LONG = "are longer than the ground", "fits on the ground"


LeftOut = Mapping[Why, Sequence[str]]


def told(left_out: LeftOut) -> list[str]:
    """Return a sentence for each reason for which something is left out."""
    return [f"Left out, because they {why.value[0]}: {', '.join(names)}" for why, names in left_out.items() if names]


def nothing_left(left_out: LeftOut) -> str:
    """Return what is said where nothing can be placed: what the least hopeless of the objects lacks."""
    why = next((one for one in reversed(Why) if left_out.get(one)), Why.FLAT)
    return f"None of the objects {why.value[1]}. Nothing was changed"
