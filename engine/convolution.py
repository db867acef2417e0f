"""Convolution of pairs of real meshes with one symmetric kernel.

Two real fields travel through one complex transform, as its real and imaginary parts: the kernel's transform is real and
even, so the parts never mix. Rows that hold only padding are never transformed.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from . import kernels_fft
from .convolution_gpu import GpuTransforms
from .device import Launcher

__all__ = ["Convolution", "good_length"]


def good_length(least: float, *, power_of_two: bool = False) -> int:
    """Return the smallest length >= ``least`` that is a power of two, or else three times one; at least 64.

    GPUs want ``power_of_two``.
    """
    power = 64
    while power < least:
        power *= 2
    three = power * 3 // 4
    return three if three >= max(least, 64) and not power_of_two else power


class Convolution:
    """Convolves meshes of ``shape`` with the kernel whose discrete Fourier transform is ``influence``.

    Args:
        launcher: Where to run.
        shape: Rows and columns of the meshes.
        padded: Rows and columns of the transforms, from :func:`good_length`; at least ``shape``.
    """

    def __init__(self, launcher: Launcher, shape: tuple[int, int], padded: tuple[int, int]) -> None:
        self.launcher = launcher
        self.shape = shape
        self.padded = padded
        device = launcher.device
        self._spectrum = [wp.empty(shape[0] * padded[1], dtype=float, device=device) for _ in range(2)]
        self._gpu: GpuTransforms | None = None
        if device.is_cuda:
            self._gpu = GpuTransforms(device, shape, padded)
            return
        self._twiddles = {length: wp.array(_twiddle(length), dtype=float, device=device) for length in set(padded)}
        longest = max(padded)
        self._scratch = [
            wp.empty(longest * kernels_fft.LANES * 4, dtype=float, device=device) for _ in range(launcher.thread_count)
        ]

    def influence_array(self, influence: np.ndarray) -> wp.array:
        """Put a kernel's transform, shape ``[padded rows // 2 + 1, padded columns]``, on the device."""
        return wp.array(
            np.ascontiguousarray(influence, dtype=np.float32).ravel(), dtype=float, device=self.launcher.device
        )

    def apply(
        self,
        influence: wp.array,
        fields: tuple[wp.array, wp.array],
        results: tuple[wp.array, wp.array],
    ) -> None:
        """Convolve two real ``fields`` (flat, of ``shape``) into ``results``, which may be the same arrays."""
        if self._gpu is not None:
            self._gpu.apply(influence, fields, results)
            return
        rows, columns = self.shape
        padded_rows, padded_columns = self.padded
        self._each_block(
            kernels_fft.transform_rows,
            rows,
            [self._twiddles[padded_columns], rows, padded_columns, columns, padded_columns, 0, *fields],
            self._spectrum,
        )
        self._each_block(
            kernels_fft.convolve_columns,
            padded_columns,
            [self._twiddles[padded_rows], padded_columns, padded_rows, rows, influence],
            self._spectrum,
        )
        self._each_block(
            kernels_fft.transform_rows,
            rows,
            [self._twiddles[padded_columns], rows, padded_columns, padded_columns, columns, 1, *self._spectrum],
            results,
        )

    def _each_block(self, kernel: wp.Kernel, count: int, inputs: list, outputs: list | tuple) -> None:
        blocks = -(-count // kernels_fft.LANES)
        threads = self.launcher.thread_count
        parts = [
            (blocks * t // threads, blocks * (t + 1) // threads, [self._scratch[t], *inputs]) for t in range(threads)
        ]
        self.launcher.launch_each(kernel, parts, outputs)


def _twiddle(length: int) -> np.ndarray:
    angle = -2.0 * np.pi * np.arange(length) / length
    return np.concatenate([np.cos(angle), np.sin(angle)]).astype(np.float32)
