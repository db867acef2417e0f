"""Whether a problem fits into this machine's memory, asked before anything is allocated."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from pathlib import Path

from ..errors import ProblemError
from ..field.mirrored_field import COPIES
from ..problem.interaction import LEVELS
from ..problem.problem import Problem
from ..problem.validation import show

__all__ = ["check_memory", "machine_memory", "required_memory"]

# Measured with the peak resident size of runs from 10,000 to 1,000,000 bodies: positions, forces, sorted copies and the
# report's arrays, and per group the mesh (integer and float charge, potential, target) at about eight nodes a body.
BYTES_PER_BODY = 600
BYTES_PER_BODY_AND_GROUP = 400
BYTES_FIXED = 300_000_000
# Bodies are counted by signed 32-bit integers in the kernels.
MOST_BODIES = 2**31 - 1


def required_memory(problem: Problem) -> int:
    """Estimate the memory that solving ``problem`` takes [bytes].

    ``300 MB + charges * (600 + 400 * groups)``: a dot has one charge, a line several; a group is one size of one class, or one level
    of a range. A whole number, exact for counts of any size.
    """
    return BYTES_FIXED + problem.charge_count * _bytes_per_body(problem)


def _bytes_per_body(problem: Problem) -> int:
    groups = sum(LEVELS if size.is_range else 1 for body_class in problem.classes for size in body_class.sizes)
    # Borders that are mirrors have images of all charges behind them.
    return (BYTES_PER_BODY + BYTES_PER_BODY_AND_GROUP * groups) * (COPIES if problem.domain.mirrored else 1)


def check_memory(problem: Problem) -> None:
    """Refuse a problem that this machine cannot hold.

    Raises:
        ProblemError: Naming the largest count, what all bodies would take and what the machine has.
    """
    required = required_memory(problem)
    available = machine_memory()
    fits = available is None or required <= available
    if fits and problem.body_count <= MOST_BODIES:
        return
    body_class, size = max(
        ((k, size) for k in problem.classes for size in k.sizes), key=lambda pair: pair[1].count or 0
    )
    sentence = (
        f'`count` of size "{size.name}" of class "{body_class.name}" is too large ({show(size.count)}): '
        f"{show(problem.body_count)} bodies in all would take about {format_bytes(required)} of memory"
    )
    if not fits and available is not None:
        most = min(max(available - BYTES_FIXED, 0) // _bytes_per_body(problem), MOST_BODIES)
        raise ProblemError(f"{sentence}, this machine has {format_bytes(available)}, enough for about {_rounded(most)}")
    raise ProblemError(f"{sentence}, and at most {MOST_BODIES} bodies can be placed")


def machine_memory() -> int | None:
    """Return the memory that this process may use at most [bytes]; None where the system does not tell.

    The physical memory, or less inside a container that is given less.
    """
    if sys.platform == "win32":
        return _windows_memory()
    physical = None
    with contextlib.suppress(OSError, ValueError):
        physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limits = [amount for amount in (physical, _container_limit()) if amount is not None and amount > 0]
    return min(limits, default=None)


def format_bytes(amount: int) -> str:
    """Return an amount of memory as people say it: ``"1.5 GB"``."""
    for power, unit in enumerate(("bytes", "kB", "MB", "GB", "TB", "PB", "EB")):
        if amount < 1000 ** (power + 1):
            # Whole numbers throughout: the amount may be larger than any float.
            return f"{amount * 10 // 1000**power / 10:.4g} {unit}"
    return f"{show(max(amount // 1000**6, 10**18)) if amount // 1000**6 >= 10**18 else amount // 1000**6} EB"


def _rounded(count: int) -> str:
    """Two digits are all that the estimate is worth."""
    return f"{float(f'{count:.1e}'):,.0f}"


def _container_limit() -> int | None:
    """The memory limit of a Linux container (control groups, version 2, then 1)."""
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with contextlib.suppress(OSError, ValueError):  # no such file, or the word "max"
            return int(Path(path).read_text(encoding="ascii"))
    return None


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = (
        ("length", ctypes.c_ulong),
        ("load", ctypes.c_ulong),
        ("total_physical", ctypes.c_ulonglong),
        ("available_physical", ctypes.c_ulonglong),
        ("total_page_file", ctypes.c_ulonglong),
        ("available_page_file", ctypes.c_ulonglong),
        ("total_virtual", ctypes.c_ulonglong),
        ("available_virtual", ctypes.c_ulonglong),
        ("available_extended_virtual", ctypes.c_ulonglong),
    )


def _windows_memory() -> int | None:
    status = _MemoryStatus(length=ctypes.sizeof(_MemoryStatus))
    answered = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))  # type: ignore[attr-defined]
    return int(status.total_physical) if answered else None
