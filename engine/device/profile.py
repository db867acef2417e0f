"""Where the time of a run goes, and how many processors are at work meanwhile."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

import warp as wp

from .threads import ticks

__all__ = ["Profile"]


class Profile:
    """Seconds by phase, in the order in which phases first came up; pass one to :func:`~esh.engine.solve.solve`.

    On a GPU every phase is waited for, so that a profiled run takes a little longer than others.
    """

    def __init__(self) -> None:
        # Of Python, by phase; and ticks of the processor's clock that kernels took: of all threads together, and by the wall. Those of
        # launches lie within Python's seconds, those of recordings do not.
        self._python: dict[str, float] = {}
        self._launched: dict[str, tuple[int, int]] = {}
        self._played: dict[str, tuple[int, int]] = {}
        # Ticks of kernels that one thread carries out while the others wait.
        self._alone: dict[str, int] = {}
        self._inner = 0.0
        self._began = time.perf_counter(), ticks()

    @contextlib.contextmanager
    def phase(self, name: str, device: wp.Device) -> Iterator[None]:
        """Add the time until the end of the block to a phase, less what phases within it take."""
        self._python.setdefault(name, 0.0)
        before, self._inner = self._inner, 0.0
        start = time.perf_counter()
        try:
            yield
        finally:
            wp.synchronize_device(device)
            spent = time.perf_counter() - start
            self._python[name] += spent - self._inner
            self._inner = before + spent

    def add_ticks(self, name: str, busy: int, wall: int, *, within: bool, alone: bool) -> None:
        """Add what kernels of a phase took: ``within`` a block of :meth:`phase`, or else by themselves; ``alone`` on one thread."""
        self._python.setdefault(name, 0.0)
        if alone:
            self._alone[name] = self._alone.get(name, 0) + wall
        counted = self._launched if within else self._played
        before = counted.get(name, (0, 0))
        counted[name] = before[0] + busy, before[1] + wall

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds by phase."""
        per_tick = self._seconds_per_tick()
        return {name: spent + per_tick * self._played.get(name, (0, 0))[1] for name, spent in self._python.items()}

    @property
    def busy_threads(self) -> dict[str, float]:
        """Mean number of threads that were at work, by phase: what stays near 1 does not gain from more processors.

        Kernels that wait for memory count as work. 1 on a GPU, where nothing is known of it.
        """
        per_tick = self._seconds_per_tick()
        result = {}
        for name, spent in self.seconds.items():
            busy, wall = (self._launched.get(name, (0, 0))[k] + self._played.get(name, (0, 0))[k] for k in range(2))
            result[name] = 1.0 + per_tick * (busy - wall) / spent if spent > 0.0 else 1.0
        return result

    @property
    def serial_seconds(self) -> dict[str, float]:
        """Seconds in which one thread was at work at most, by phase: Python, and kernels that are not cut into chunks.

        More processors do not shorten these. 0 on a GPU, where nothing is known of it.
        """
        per_tick = self._seconds_per_tick()
        counted = self._launched.keys() | self._played.keys()
        return {
            name: max(0.0, spent + per_tick * (self._alone.get(name, 0) - self._launched.get(name, (0, 0))[1]))
            if counted
            else 0.0
            for name, spent in self._python.items()
        }

    def _seconds_per_tick(self) -> float:
        passed = ticks() - self._began[1]
        return (time.perf_counter() - self._began[0]) / passed if passed > 0 else 0.0

    def __str__(self) -> str:
        seconds, busy, serial = self.seconds, self.busy_threads, self.serial_seconds
        total = sum(seconds.values()) or 1.0
        width = max((len(name) for name in seconds), default=0)
        return "\n".join(
            f"{name.ljust(width)}  {spent:8.3f} s  {spent / total:6.1%}  {busy[name]:5.1f} threads at work"
            f"  {1e3 * serial[name]:8.1f} ms on one"
            for name, spent in seconds.items()
        )
