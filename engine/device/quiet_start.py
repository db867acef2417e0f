"""Starting Warp without what it says about itself, and with a folder for kernels that can be written."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..native_output import muted
from .kernel_cache import ensure_kernel_cache

__all__ = ["start_warp"]


def start_warp() -> None:
    """Start Warp where it has not been: before its first use, which would start it with a greeting on the standard output."""
    # Warp announces its version and every module it loads; a library keeps quiet.
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    _start()


@cache
def _start() -> None:
    """Without the native remark, too, that a machine has no GPU; who asks for one gets a DeviceError."""
    ensure_kernel_cache()
    with muted():
        wp.init()
