"""A profile of a run: seconds by phase, and how many threads were busy."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

import warp as wp

from .threads import ticks

__all__ = ["Profile"]


class Profile:
    """Records the seconds that a run spends in each phase; pass one to :func:`~esh.engine.solve.solve`.

    Phases are in the order in which they first began. A profiled run on a GPU is synchronized after every phase, and so takes a little
    longer than others.
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
        """Context manager: adds the time that its block takes to phase ``name``, without the time of phases nested in it."""
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
        """Add the time of kernels to phase ``name``, in ticks of the processor's clock.

        Args:
            name: The phase.
            busy: Ticks, summed over all threads.
            wall: Ticks from the beginning to the end.
            within: Whether the kernels ran inside a block of :meth:`phase`, whose seconds include theirs.
            alone: Whether one thread ran them while the others waited.
        """
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
        """Mean number of busy threads, by phase. A phase that stays near 1 gains nothing from more processors.

        Kernels that wait for memory count as busy. On a GPU it is always 1, as threads are not measured there.
        """
        per_tick = self._seconds_per_tick()
        result = {}
        for name, spent in self.seconds.items():
            busy, wall = (self._launched.get(name, (0, 0))[k] + self._played.get(name, (0, 0))[k] for k in range(2))
            result[name] = 1.0 + per_tick * (busy - wall) / spent if spent > 0.0 else 1.0
        return result

    @property
    def serial_seconds(self) -> dict[str, float]:
        """Seconds in which at most one thread was busy, by phase: Python, and kernels that are not cut into chunks.

        More processors do not shorten them. On a GPU it is always 0, as threads are not measured there.
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
