"""What is asked again and again while something is drawn or read, and does not change meanwhile, is worked out once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["asked_once"]

_known: dict[Any, Any] | None = None


@contextmanager
def asked_once() -> Iterator[dict[Any, Any]]:
    """Give what is known already, and keep what comes to be known, until the outermost ``with`` block ends.

    No settings may change within it, and keys may be the addresses of these.
    """
    global _known
    if _known is not None:
        yield _known
        return
    _known = {}
    try:
        yield _known
    finally:
        _known = None
