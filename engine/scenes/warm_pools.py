"""Processes that stay for a while after their work is done: starting them takes longer than many small scenes."""

from __future__ import annotations

import atexit
import contextlib
import threading
from collections.abc import Iterator, Mapping, Sequence

from .worker_pool import WorkerPool

__all__ = ["close_warm_pools", "warm_pool"]

# Seconds after which processes go that nobody has asked for anything.
PATIENCE = 30.0


class _Idle:
    """A pool that waits for its next use, or for its end."""

    def __init__(self, pool: WorkerPool) -> None:
        self.pool = pool
        self.timer = threading.Timer(PATIENCE, _end, args=(self,))
        self.timer.daemon = True
        self.timer.start()


_idle: dict[tuple[object, ...], _Idle] = {}
_lock = threading.Lock()


@contextlib.contextmanager
def warm_pool(
    workers: int, threads: int, environments: Sequence[Mapping[str, str]] = ()
) -> Iterator[tuple[WorkerPool, bool]]:
    """Yield a pool, and whether its processes have been at work before; they stay for half a minute after the block.

    Args:
        workers: See :class:`~.worker_pool.WorkerPool`.
        threads: As there.
        environments: As there.
    """
    key = (workers, threads, *(tuple(sorted(given.items())) for given in environments))
    with _lock:
        found = _idle.pop(key, None)
    if found is not None:
        found.timer.cancel()
    pool = found.pool if found is not None else WorkerPool(workers, threads, keep=True, environments=environments)
    try:
        yield pool, found is not None
    except BaseException:
        pool.close()
        raise
    with _lock:
        # Of two that were used at once, one stays.
        before = _idle.pop(key, None)
        _idle[key] = _Idle(pool)
    if before is not None:
        before.timer.cancel()
        before.pool.close()


def close_warm_pools() -> None:
    """End all processes that wait for their next use."""
    with _lock:
        idle = list(_idle.values())
        _idle.clear()
    for one in idle:
        one.timer.cancel()
        one.pool.close()


def _end(idle: _Idle) -> None:
    with _lock:
        keys = [key for key, one in _idle.items() if one is idle]
        for key in keys:
            del _idle[key]
    if keys:
        idle.pool.close()


atexit.register(close_warm_pools)
