"""The GPU's half of :mod:`.convolution`: the same transforms, by threads that pass each other elements through shared memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import warp as wp

from ..device.gpu_launches import BLOCK_DIM, launch_on_gpu
from . import kernels_fft_gpu

__all__ = ["LONGEST_ROW", "GpuTransforms"]

# The real parts of half a row must fit into a block's shared memory, and its elements into the registers of a block.
LONGEST_ROW = 16384


class GpuTransforms:
    """Convolves real meshes on a GPU; the influence function is transposed, ``[padded columns // 2 + 1, padded rows]``.

    Args:
        device: An NVIDIA GPU.
        shape: Rows (an even number, so that no pair is of two meshes) and columns of the meshes.
        padded: Rows and columns of the transforms; powers of two.
        count: Number of meshes.
    """

    def __init__(self, device: wp.Device, shape: tuple[int, int], padded: tuple[int, int], count: int = 1) -> None:
        self._device = device
        self._shape = shape
        self._padded = padded
        self._count = count
        self.influence_shape = (padded[1] // 2 + 1, padded[0])
        self._pairs = wp.empty((count * shape[0] // 2, padded[1]), dtype=wp.vec2, device=device)
        self._columns = wp.empty((count * self.influence_shape[0], padded[0]), dtype=wp.vec2, device=device)

    def apply(self, influence: wp.array, meshes: wp.array, result: wp.array) -> None:
        """See :meth:`.convolution.Convolution.apply`."""
        self._transform_rows(meshes)
        given = [self._shape[0], influence.reshape(self.influence_shape), self._columns]
        convolve = kernels_fft_gpu.transforms_of(self._padded[0]).convolve
        self._transform(convolve, self._columns.shape, given)
        self._transform_rows_back(self._columns, result)

    def add_up(self, influences: Sequence[Sequence[wp.array]], meshes: Iterable[wp.array], result: wp.array) -> None:
        """See :meth:`.convolution.Convolution.add_up`; rows of every mesh are transformed once, and those of every sum back."""
        add = kernels_fft_gpu.transforms_of(self._padded[0]).add_convolved
        sums = [wp.zeros(self._columns.shape, dtype=wp.vec2, device=self._device) for _ in influences]
        for j, mesh in enumerate(meshes):
            self._transform_rows(mesh)
            for of_sum, total in zip(influences, sums, strict=True):
                influence = of_sum[j].reshape(self.influence_shape)
                self._transform(add, self._columns.shape, [self._shape[0], influence, self._columns, total])
        size = self._shape[0] * self._shape[1]
        for k, total in enumerate(sums):
            self._transform_rows_back(total, result[k * size : (k + 1) * size])

    def _transform_rows(self, meshes: wp.array) -> None:
        """Transform the rows of meshes, into transposed columns."""
        rows = self._count * self._shape[0], self._shape[1]
        forward = kernels_fft_gpu.transforms_of(self._padded[1]).forward
        self._transform(forward, self._pairs.shape, [meshes.reshape(rows), self._pairs])
        columns = (self._columns.shape[0], self._shape[0])
        self._launch_tiles(kernels_fft_gpu.split_pairs, columns, [self._pairs, self._shape[0]], self._columns)

    def _transform_rows_back(self, columns: wp.array, result: wp.array) -> None:
        """Transform what transposed columns hold back into the rows of meshes."""
        rows = self._count * self._shape[0], self._shape[1]
        back = kernels_fft_gpu.transforms_of(self._padded[1]).back
        self._launch_tiles(kernels_fft_gpu.join_pairs, self._pairs.shape, [columns, self._shape[0]], self._pairs)
        self._transform(back, self._pairs.shape, [self._pairs, result.reshape(rows)])

    def transform_even(self, quarter: wp.array, influence: wp.array) -> None:
        """See :meth:`.convolution.Convolution.influence_of`."""
        rows, columns = self._padded
        row_count = rows // 2 + 1
        pairs = wp.empty((row_count // 2 + 1, columns), dtype=wp.vec2, device=self._device)
        forward = kernels_fft_gpu.transforms_of(columns).forward
        self._transform(forward, pairs.shape, [quarter.reshape((row_count, columns)), pairs])
        half = wp.empty(self.influence_shape, dtype=wp.vec2, device=self._device)
        self._launch_tiles(kernels_fft_gpu.split_pairs, (half.shape[0], row_count), [pairs, row_count], half)
        whole = influence.reshape(self.influence_shape)
        self._launch(kernels_fft_gpu.unfold_columns, whole.shape, [half], whole)
        pairs = wp.empty((whole.shape[0] // 2 + 1, rows), dtype=wp.vec2, device=self._device)
        forward = kernels_fft_gpu.transforms_of(rows).forward
        self._transform(forward, pairs.shape, [whole, pairs])
        self._launch(kernels_fft_gpu.separate_pairs, whole.shape, [pairs], whole)

    def _launch(self, kernel: wp.Kernel, dim: int | tuple[int, ...], inputs: list, output: wp.array) -> None:
        self._launch_blocks(kernel, dim, [*inputs, output], BLOCK_DIM)

    def _launch_tiles(self, kernel: wp.Kernel, shape: tuple[int, int], inputs: list, output: wp.array) -> None:
        """Launch blocks of threads that write square tiles of a matrix of a shape."""
        side = kernels_fft_gpu.TILE_SIDE
        tiles = -(-shape[0] // side) * -(-shape[1] // side)
        self._launch(kernel, tiles * kernels_fft_gpu.TILE_THREADS, inputs, output)

    def _transform(self, kernel: wp.Kernel, shape: tuple[int, int], arguments: list[wp.array]) -> None:
        """Transform ``shape[0]`` rows of ``shape[1]`` elements, whole blocks of them."""
        count, length = shape
        threads, block = 1, 1
        if self._device.is_cuda:
            threads, block = kernels_fft_gpu.threads_of(length), kernels_fft_gpu.block_of(length)
        dim = -(-count * threads // block) * block
        self._launch_blocks(kernel, dim, arguments, block)

    def _launch_blocks(self, kernel: wp.Kernel, dim: int | tuple[int, ...], arguments: list, block: int) -> None:
        """Launch so many threads, on a CPU (in tests) too."""
        if self._device.is_cuda:
            launch_on_gpu(kernel, dim, arguments, self._device, block)
        else:
            wp.launch(kernel, dim=dim, inputs=arguments, device=self._device)
