"""The GPU's half of :mod:`.convolution`: the same transforms, as tiles in shared memory."""

from __future__ import annotations

import warp as wp

from . import kernels_fft_gpu

__all__ = ["LONGEST_ROW", "GpuTransforms"]

# A row of complex float32 must fit into a block's shared memory (227 kB on recent GPUs, 99 kB on consumer ones).
LONGEST_ROW = 8192
# Elements of a row per thread: fewer leave threads idle at the barriers, more spill registers.
ELEMENTS_PER_THREAD = 16


class GpuTransforms:
    """Convolves pairs of real meshes on a GPU.

    Args:
        device: An NVIDIA GPU.
        shape: Rows and columns of the meshes.
        padded: Rows and columns of the transforms; powers of two.
    """

    def __init__(self, device: wp.Device, shape: tuple[int, int], padded: tuple[int, int]) -> None:
        self._device = device
        self._shape = shape
        self._padded = padded
        self._rows = wp.empty((shape[0], padded[1]), dtype=wp.vec2, device=device)
        self._columns = wp.empty((padded[1], padded[0]), dtype=wp.vec2, device=device)
        self._row_kernels = kernels_fft_gpu.row_kernels(padded[1])
        self._column_kernels = kernels_fft_gpu.row_kernels(padded[0])

    def apply(self, influence: wp.array, fields: tuple[wp.array, wp.array], results: tuple[wp.array, wp.array]) -> None:
        """See :meth:`.convolution.Convolution.apply`."""
        columns = self._shape[1]
        self._launch(kernels_fft_gpu.pack_rows, self._rows.shape, [*fields, columns], [self._rows])
        self._transform(self._row_kernels[0], self._rows)
        self._launch(kernels_fft_gpu.transpose, self._columns.shape, [self._rows], [self._columns])
        self._transform(self._column_kernels[0], self._columns)
        self._launch(
            kernels_fft_gpu.multiply_influence, self._columns.shape, [influence, self._padded[1]], [self._columns]
        )
        self._transform(self._column_kernels[1], self._columns)
        self._launch(kernels_fft_gpu.transpose, self._rows.shape, [self._columns], [self._rows])
        self._transform(self._row_kernels[1], self._rows)
        self._launch(kernels_fft_gpu.unpack_rows, self._shape, [self._rows, columns], results)

    def _launch(self, kernel: wp.Kernel, dim: tuple[int, ...], inputs: list, outputs: list | tuple) -> None:
        wp.launch(kernel, dim=dim, inputs=inputs, outputs=list(outputs), device=self._device)

    def _transform(self, kernel: wp.Kernel, rows: wp.array) -> None:
        count, length = rows.shape
        threads = max(32, min(512, length // ELEMENTS_PER_THREAD)) if self._device.is_cuda else 1
        wp.launch_tiled(kernel, dim=[count], inputs=[rows], block_dim=threads, device=self._device)
