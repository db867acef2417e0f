"""Types of the commands' arguments: each turns a word of the command line into a value, or says what it must be."""

from __future__ import annotations

import argparse
import contextlib
import math
from collections.abc import Callable

__all__ = ["positive_number", "whole_number"]


def positive_number(text: str, what: str = "a number above 0") -> float:
    """Return a finite number above 0; ``what`` is what the message says that it must be."""
    with contextlib.suppress(ValueError):
        if 0.0 < float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"must be {what}; got {text!r}")


def whole_number(least: int) -> Callable[[str], int]:
    """Return the type of whole numbers of at least ``least`` and below 2**63."""

    def read(text: str) -> int:
        shown = repr(text if len(text) <= 60 else f"{text[:57]}...")
        try:
            number = int(text)
        except ValueError:
            # Python reads no whole numbers of thousands of digits.
            number = 2**63 if text.isdecimal() else least - 1
        if number >= 2**63:
            raise argparse.ArgumentTypeError(f"must be below 2**63 = {2**63}; got {shown}")
        if number < least:
            raise argparse.ArgumentTypeError(f"must be a whole number of at least {least}; got {shown}")
        return number

    return read
