"""Convolution of real meshes with one symmetric kernel, through Fourier transforms.

Two real rows travel through one complex transform, of which half is kept; rows that hold only padding are never transformed. The
kernel's own transform, the influence function, is real and even.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from . import kernels_fft
from .convolution_gpu import GpuTransforms

__all__ = ["Convolution", "good_length"]

SHORTEST = 64
# A block of such rows is worth a CPU thread of its own.
SHORT_ROW = 256
# Twiddle factors of so many lengths are kept: scenes of a batch have the same.
MOST_KEPT = 8


def good_length(least: float, *, power_of_two: bool = False) -> int:
    """Return the smallest length >= ``least`` that is 1, 3 or 5 times a power of two; at least 64.

    GPUs want ``power_of_two``.
    """
    power = SHORTEST
    while power < least:
        power *= 2
    if power_of_two:
        return power
    return min(length for length in (power * 5 // 8, power * 3 // 4, power) if length >= max(least, SHORTEST))


class Convolution:
    """Convolves meshes of ``shape``, several at once.

    Args:
        launcher: Where to run.
        shape: Rows (an even number) and columns of the meshes.
        padded: Rows and columns of the transforms, from :func:`good_length`; at least ``shape``.
        count: Number of meshes.
        waves: Influence functions are 0 from this wave number along x on; None where they are not. On the CPU the fewer, the quicker.

    Attributes:
        influence_size: Elements of an influence function.
        influence_strides: How far apart, in elements, its wave numbers lie along y and x.
        influence_rows: Wave numbers along y that it has: ``padded[0] // 2 + 1``, or all ``padded[0]`` of them.
        influence_columns: Wave numbers along x that it has: ``padded[1] // 2 + 1``, or fewer where those are all.
    """

    def __init__(
        self,
        launcher: Launcher,
        shape: tuple[int, int],
        padded: tuple[int, int],
        count: int = 1,
        *,
        waves: int | None = None,
    ) -> None:
        self.launcher = launcher
        self.shape = shape
        self.padded = padded
        self.count = count
        rows, columns = padded
        device = launcher.device
        self._gpu: GpuTransforms | None = None
        self.influence_columns = columns // 2 + 1
        if device.is_cuda:
            self._gpu = GpuTransforms(device, shape, padded, count)
            self.influence_rows, self.influence_strides = rows, (1, rows)
            self.influence_size = rows * (columns // 2 + 1)
            return
        if waves is not None:
            self.influence_columns = min(self.influence_columns, waves)
        self._stride = _whole_blocks(self.influence_columns) * kernels_fft.LANES
        self.influence_rows, self.influence_strides = rows // 2 + 1, (self._stride, 1)
        self.influence_size = self.influence_rows * self._stride
        self._halves = self._half_rows(count * shape[0])
        self._twiddles = {length: launcher.array(_twiddle(length), float) for length in set(padded)}
        self._scratch = self.launcher.empty((launcher.thread_count, max(padded) * kernels_fft.LANES * 4), float)

    def apply(self, influence: wp.array, meshes: wp.array, result: wp.array | None = None) -> None:
        """Convolve real ``meshes`` (flat, of ``shape``, one after the other) in place, or into ``result``."""
        result = meshes if result is None else result
        if self._gpu is not None:
            self.launcher.send()
            self._gpu.apply(influence, meshes, result)
            return
        rows, columns = self.shape
        self._transform_rows(self.count, rows, columns, meshes, self._halves)
        length = self.padded[0]
        self._each_block(
            kernels_fft.convolve_columns,
            self.count * (self._stride // kernels_fft.LANES),
            [self._twiddles[length], rows, length, self._stride, influence],
            [self._halves],
        )
        length = self.padded[1]
        self._each_block(
            kernels_fft.transform_rows_back,
            self.count * _whole_blocks(rows, 2),
            [self._twiddles[length], rows, columns, length, self._stride, self._halves],
            [result],
        )

    def _sent(self, meshes: Iterable[wp.array]) -> Iterator[wp.array]:
        """Meshes, each of which a GPU has when it is returned."""
        for mesh in meshes:
            self.launcher.send()
            yield mesh

    def add_up(self, influences: Sequence[Sequence[wp.array]], meshes: Iterable[wp.array], result: wp.array) -> None:
        """Write sums over all meshes, each convolved by an influence function of its own for every sum.

        Every mesh is transformed once, and every sum back.

        Args:
            influences: Of sum k and mesh j in ``influences[k][j]``; no more sums than meshes.
            meshes: Flat, each of ``shape``; asked for one after the other.
            result: Receives the sums, flat, one after the other.
        """
        sums, mesh_count = len(influences), len(influences[0])
        if self._gpu is not None:
            self._gpu.add_up(influences, self._sent(meshes), result)
            return
        rows, columns = self.shape
        halves = self._half_rows(mesh_count * rows)
        of_mesh = rows * self._stride
        for j, mesh in enumerate(meshes):
            own = kernels_fft.HalfRows()
            own.real = halves.real[j * of_mesh : (j + 1) * of_mesh]
            own.imaginary = halves.imaginary[j * of_mesh : (j + 1) * of_mesh]
            self._transform_rows(1, rows, columns, mesh, own)
        length = self.padded[0]
        addresses = np.array([influence.ptr for of_sum in influences for influence in of_sum], np.uint64)
        scratch = self.launcher.empty((self.launcher.thread_count, length * kernels_fft.LANES * (4 + 2 * sums)), float)
        self.launcher.launch(
            kernels_fft.convolve_columns_to_sums,
            self._stride // kernels_fft.LANES,
            [
                scratch,
                self._twiddles[length],
                rows,
                length,
                self._stride,
                self.launcher.array(addresses, wp.uint64),
                mesh_count,
                sums,
            ],
            [halves],
            grain=1,
            per_thread=True,
        )
        length = self.padded[1]
        self._each_block(
            kernels_fft.transform_rows_back,
            sums * _whole_blocks(rows, 2),
            [self._twiddles[length], rows, columns, length, self._stride, halves],
            [result],
        )

    def influence_of(self, quarter: wp.array) -> wp.array:
        """Transform a kernel that is even along x and y.

        Args:
            quarter: Its values on the rows ``0 .. padded[0] // 2`` of the padded mesh, whose node 0 is the origin; flat.
        """
        influence = self.launcher.zeros(self.influence_size, float)
        if self._gpu is not None:
            self.launcher.send()
            self._gpu.transform_even(quarter, influence)
            return influence
        rows, columns = self.padded
        halves = self._half_rows(rows // 2 + 1)
        self._transform_rows(1, rows // 2 + 1, columns, quarter, halves)
        self._each_block(
            kernels_fft.transform_even_columns,
            self._stride // kernels_fft.LANES,
            [self._twiddles[rows], rows, self._stride, halves],
            [influence],
        )
        return influence

    def _half_rows(self, count: int) -> kernels_fft.HalfRows:
        halves = kernels_fft.HalfRows()
        halves.real, halves.imaginary = (self.launcher.empty(count * self._stride, float) for _ in range(2))
        return halves

    def _transform_rows(
        self, count: int, rows: int, columns: int, meshes: wp.array, halves: kernels_fft.HalfRows
    ) -> None:
        length = self.padded[1]
        self._each_block(
            kernels_fft.transform_rows,
            count * _whole_blocks(rows, 2),
            [self._twiddles[length], rows, columns, length, self._stride, meshes],
            [halves],
        )

    def _each_block(self, kernel: wp.Kernel, blocks: int, inputs: list[Any], outputs: Sequence[Any]) -> None:
        # The shortest blocks take some microseconds.
        grain = max(1, SHORT_ROW // max(self.padded))
        self.launcher.launch(kernel, blocks, [self._scratch, *inputs], outputs, grain=grain, per_thread=True)


def _whole_blocks(count: int, rows_per_lane: int = 1) -> int:
    return -(-count // (rows_per_lane * kernels_fft.LANES))


@lru_cache(maxsize=MOST_KEPT)
def _twiddle(length: int) -> np.ndarray:
    angle = -2.0 * np.pi * np.arange(length) / length
    factors = np.concatenate([np.cos(angle), np.sin(angle)]).astype(np.float32)
    factors.setflags(write=False)
    return factors
