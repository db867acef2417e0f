"""What may be special about a body."""

from __future__ import annotations

import enum

__all__ = ["BodyFlags"]


class BodyFlags(enum.IntFlag):
    """What is special about a body."""

    # It acts on others, and does not move.
    PINNED = 1
    # It acts on others, and is no part of the result.
    GHOST = 2
