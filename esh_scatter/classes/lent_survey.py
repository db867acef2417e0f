"""What the last run has worked out of meshes and images, lent to the next one."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

# Warp is not imported before something is computed.
if TYPE_CHECKING:
    from .survey import Survey

__all__ = ["detach", "lent_survey"]

# Whoever presses Update again has the same target and the same objects most of the time.
_last: Survey | None = None
_is_lent = threading.Lock()


@contextmanager
def lent_survey() -> Iterator[Survey]:
    """Lend the survey of the last run; while somebody else has it, a new one."""
    from .survey import Survey

    global _last
    if not _is_lent.acquire(blocking=False):
        yield Survey()
        return
    try:
        _last = _last or Survey()
        # What is placed follows from what is there now, and not from what was there before.
        _last.forget_domain()
        yield _last
    finally:
        _is_lent.release()


def detach() -> None:
    """Forget everything."""
    global _last
    _last = None
