"""Which device a run uses, and how kernels are launched on it.

Warp runs a CPU launch on the calling thread. :class:`Launcher` therefore cuts a CPU launch into ranges and gives them to
threads (the call into compiled code releases Python's global lock), so every kernel of the engine takes the index of its
range's first element as its first argument. On a GPU there is one range.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

import warp as wp

from .errors import DeviceError
from .native_output import muted
from .profile import Profile

__all__ = ["Launcher", "resolve_device"]

# Threads per block on a GPU. Warp compiles a module anew for every other value, and CPU code for 1.
BLOCK_DIM = 256
# Below this many elements a second thread costs more than it saves; elements of kernels that go through neighbours are many times
# as much work.
SMALLEST_RANGE = 8192
SMALLEST_RANGE_OF_NEIGHBOURS = 1024


def resolve_device(name: str = "auto") -> wp.Device:
    """Return the Warp device called ``name``.

    Args:
        name: ``"auto"`` (the first NVIDIA GPU, or the CPU where there is none), ``"cpu"``, ``"cuda"`` or ``"cuda:N"``.

    Raises:
        DeviceError: An unknown name, or a GPU that this machine lacks.
    """
    # Warp announces its version and every module it loads; a library keeps quiet.
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    _start_warp()
    gpu_names = [device.alias for device in wp.get_cuda_devices()]
    if name == "auto":
        name = gpu_names[0] if gpu_names else "cpu"
    if name == "cuda" and gpu_names:
        name = gpu_names[0]
    if name == "cpu" or name in gpu_names:
        return wp.get_device(name)
    accepted = ", ".join(f'"{choice}"' for choice in ["auto", "cpu", *gpu_names])
    number = name.removeprefix("cuda:") if isinstance(name, str) else ""
    if name == "cuda" or number.isdigit():
        why = "this machine has no such NVIDIA GPU, or no driver for it"
        raise DeviceError(f"`device` {name!r} is not there: {why}; use one of {accepted}")
    raise DeviceError(f"`device` must be one of {accepted}; got {name!r}")


@cache
def _start_warp() -> None:
    """Start Warp without its native remark that a machine has no GPU; who asks for one gets a DeviceError."""
    with muted():
        wp.init()


def core_count() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Launcher:
    """Launches kernels on one device, on all cores when it is the CPU.

    Args:
        device: From :func:`resolve_device`.
        profile: Gets the time that every :meth:`phase` takes.
    """

    def __init__(self, device: wp.Device, profile: Profile | None = None) -> None:
        self.device = device
        self._profile = profile
        self.thread_count = 1 if device.is_cuda else core_count()
        self._pool = ThreadPoolExecutor(self.thread_count - 1) if self.thread_count > 1 else None

    def phase(self, name: str) -> AbstractContextManager[None]:
        """Count the time of a block as that of a phase, where somebody asked for a profile."""
        return nullcontext() if self._profile is None else self._profile.phase(name, self.device)

    @property
    def profiled(self) -> bool:
        """Whether somebody asked for a profile, whose phases are waited for."""
        return self._profile is not None

    def close(self) -> None:
        """Give the threads back."""
        if self._pool is not None:
            self._pool.shutdown()

    def launch(
        self,
        kernel: wp.Kernel,
        count: int,
        inputs: Sequence[Any],
        outputs: Sequence[Any] = (),
        smallest: int = SMALLEST_RANGE,
    ) -> None:
        """Run ``kernel`` for the elements ``0 .. count - 1``; its first argument is the first element of its range."""
        self.launch_ranges(kernel, self.cut(0, count, smallest), inputs, outputs)

    def cut(self, first: int, end: int, smallest: int = SMALLEST_RANGE) -> list[tuple[int, int]]:
        """Cut the range ``first .. end - 1`` into one for every thread, unless it has at most ``smallest`` elements."""
        if self.thread_count == 1 or end - first <= smallest:
            return [(first, end)]
        cuts = [first + (end - first) * part // self.thread_count for part in range(self.thread_count + 1)]
        return list(itertools.pairwise(cuts))

    def launch_ranges(
        self,
        kernel: wp.Kernel,
        ranges: Sequence[tuple[int, int]],
        inputs: Sequence[Any],
        outputs: Sequence[Any] = (),
    ) -> None:
        """Run ``kernel`` for several ranges ``(first, last + 1)`` at once; returns when all are done (on the CPU)."""
        self.launch_each(kernel, [(first, end, inputs) for first, end in ranges], outputs)

    def launch_each(
        self, kernel: wp.Kernel, parts: Sequence[tuple[int, int, Sequence[Any]]], outputs: Sequence[Any] = ()
    ) -> None:
        """Like :meth:`launch_ranges`, with inputs of its own (a scratch array, say) for every range."""

        def run(part: tuple[int, int, Sequence[Any]]) -> None:
            first, end, inputs = part
            wp.launch(
                kernel,
                dim=end - first,
                inputs=[first, *inputs],
                outputs=list(outputs),
                device=self.device,
                block_dim=BLOCK_DIM,
            )

        parts = [part for part in parts if part[1] > part[0]]
        # Two threads that meet an unloaded module would both compile it.
        kernel.module.load(self.device, BLOCK_DIM if self.device.is_cuda else 1)
        if self._pool is None:
            for part in parts:
                run(part)
            return
        # This thread works too: waking another one takes longer than a small kernel.
        others = [self._pool.submit(run, part) for part in parts[1:]]
        for part in parts[:1]:
            run(part)
        for other in others:
            other.result()
