"""How much memory a problem takes, and a refusal in time where the machine has less."""

from __future__ import annotations

import ctypes
import os
import sys

from .errors import ProblemError
from .problem import Problem

__all__ = ["check_memory", "required_memory"]

# Measured with the peak resident size of runs from 10,000 to 1,000,000 bodies: positions, forces, sorted copies and the
# report's arrays, and per group the mesh (integer and float charge, potential, target) at about eight nodes a body.
BYTES_PER_BODY = 600
BYTES_PER_BODY_AND_GROUP = 400
BYTES_FIXED = 300e6


def required_memory(problem: Problem) -> float:
    """Estimate of the memory that solving ``problem`` takes [bytes]."""
    groups = sum(len(body_class.sizes) for body_class in problem.classes)
    return BYTES_FIXED + problem.body_count * (BYTES_PER_BODY + BYTES_PER_BODY_AND_GROUP * groups)


def check_memory(problem: Problem) -> None:
    """Raise where ``problem`` needs more memory than the machine has.

    Raises:
        ProblemError: Says how much it would take, and how much there is.
    """
    needed, there = required_memory(problem), _physical_memory()
    if needed > there:
        raise ProblemError(
            f"`count` adds up to {problem.body_count:,} bodies, which would take about {needed / 1e9:,.0f} GB of memory; "
            f"this machine has {there / 1e9:,.0f} GB: lower the counts"
        )


def _physical_memory() -> float:
    if sys.platform == "win32":

        class MemoryStatus(ctypes.Structure):
            _fields_ = (
                ("length", ctypes.c_ulong),
                ("load", ctypes.c_ulong),
                *((name, ctypes.c_ulonglong) for name in ("total", "free", "a", "b", "c", "d", "e")),
            )

        status = MemoryStatus(length=ctypes.sizeof(MemoryStatus))
        ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
        return float(status.total)
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
