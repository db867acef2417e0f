"""Launching kernels on a GPU, quickly where the kernel was launched there before."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Sequence
from typing import Any

import warp as wp

from .kernel_arguments import KernelArguments
from .prebuilt_gpu_kernels import load_prebuilt_on_gpu

__all__ = ["BLOCK_DIM", "NotLoadedError", "launch_on_gpu"]

# Threads per block on a GPU. Warp compiles a module anew for every other value, and CPU code for 1.
BLOCK_DIM = 256


class NotLoadedError(RuntimeError):
    """A graph is being recorded, and a kernel in it was never launched before: its module cannot be loaded now."""


def launch_on_gpu(
    kernel: wp.Kernel,
    count: int | tuple[int, ...],
    arguments: Sequence[Any],
    device: wp.Device,
    block_dim: int = BLOCK_DIM,
) -> None:
    """Run a kernel on a GPU, with so many threads in a block; one that is prebuilt is not compiled."""
    key = kernel, device.alias, block_dim
    known = _known.get(key)
    if known is not None and known.launch(count, arguments):
        return
    if known is None and device.is_capturing:
        raise NotLoadedError
    load_prebuilt_on_gpu(kernel.module, device.alias, block_dim)
    launch = wp.launch(kernel, dim=count, inputs=arguments, device=device, block_dim=block_dim, record_cmd=True)
    launch.launch()
    if known is None:
        _known[key] = _KnownLaunch(launch, count, arguments)


class _KnownLaunch:
    """A launch that is made again with other arguments.

    Args:
        launch: It, as Warp recorded it.
        count: Of how many elements.
        given: Its arguments.
    """

    def __init__(self, launch: wp.Launch, count: int | tuple[int, ...], given: Sequence[Any]) -> None:
        for index, value in enumerate(given):
            if isinstance(value, ctypes.Array):
                # A vector, which the next one will be written to.
                launch.set_param_at_index(index, type(value)(value))
        self._launch, self._count = launch, count
        self._arguments = KernelArguments(launch.kernel, given, [type(value) for value in launch.params[1:]])
        # Warp would hold the arrays of the last launch otherwise.
        launch.fwd_args = None
        # Other threads of the program may solve something, too.
        self._lock = threading.Lock()

    def launch(self, count: int | tuple[int, ...], given: Sequence[Any]) -> bool:
        """Launch it for so many elements; False where Warp has to look at the arguments."""
        values = self._arguments.passed(given)
        if values is None:
            return False
        launch = self._launch
        with self._lock:
            if count != self._count:
                launch.set_dim(count)
                self._count = count
            # As `set_params_from_ctypes` does, which takes a call for each.
            params, addresses = launch.params, launch.params_addr
            for index, value in enumerate(values, 1):
                if isinstance(value, ctypes.Structure):
                    params[index] = value
                    addresses[index] = ctypes.addressof(value)
                else:
                    params[index].__init__(value)
            launch.launch()
        return True


_known: dict[tuple[wp.Kernel, str, int], _KnownLaunch] = {}
