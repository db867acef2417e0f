"""How much memory this machine has."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from pathlib import Path

from .given_values import show

__all__ = ["format_bytes", "machine_memory"]


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
