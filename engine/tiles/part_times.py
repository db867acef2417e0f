"""Where the time of a part goes: what the process that makes it does, by the wall."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

__all__ = ["PartTimes"]


class PartTimes:
    """Seconds of one part by what was done in them.

    Attributes:
        seconds: Of what was done -> seconds, in the order in which it first came up.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def of(self, what: str) -> Iterator[None]:
        """Add the time until the end of the block; blocks do not lie within each other."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[what] = self.seconds.get(what, 0.0) + time.perf_counter() - start
