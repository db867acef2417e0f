"""Where the time of a run goes."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

import warp as wp

__all__ = ["Profile"]


class Profile:
    """Seconds by phase, in the order in which phases first came up; pass one to :func:`~esh.engine.relaxation.solve`.

    On a GPU every phase is waited for, so that a profiled run takes a little longer than others.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner = 0.0

    @contextlib.contextmanager
    def phase(self, name: str, device: wp.Device) -> Iterator[None]:
        """Add the time until the end of the block to a phase, less what phases within it take."""
        self.seconds.setdefault(name, 0.0)
        before, self._inner = self._inner, 0.0
        start = time.perf_counter()
        try:
            yield
        finally:
            wp.synchronize_device(device)
            spent = time.perf_counter() - start
            self.seconds[name] += spent - self._inner
            self._inner = before + spent

    def __str__(self) -> str:
        total = sum(self.seconds.values()) or 1.0
        width = max((len(name) for name in self.seconds), default=0)
        return "\n".join(
            f"{name.ljust(width)}  {spent:8.3f} s  {spent / total:6.1%}" for name, spent in self.seconds.items()
        )
