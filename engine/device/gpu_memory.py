"""Memory of a GPU for the many small arrays of a problem, which lie side by side in a few blocks.

To ask for an array, to fill it and to send it take Python 20 to 40 microseconds each, however small it is, and a run of a few thousand
bodies has 200 of them. Here an array is a view of a block that was asked for, and zeroed, as a whole; and what is to be sent waits
until something is launched, so that what lies side by side is sent in one piece.

Large arrays come from a pool of the driver's. By itself it gives all that is free back to the system as soon as somebody waits for the
GPU, and has to ask for it anew; while something is computed there, it keeps some.
"""

from __future__ import annotations

import math
import threading

import numpy as np
import warp as wp

__all__ = ["GpuMemory", "keep_pool", "let_pool_go"]

# Bytes of the largest array that shares a block, and of a block.
LARGEST = 1 << 18
BLOCK = 1 << 22
# Arrays begin at multiples of so many bytes, as those begin that the driver gives.
ALIGNMENT = 256
# Share of a GPU's memory that its pool keeps at most: what is drawn there meanwhile needs memory, too.
KEPT_SHARE = 0.125
# How many keep the pool of a GPU, and what it kept before [bytes].
_keeping: dict[str, tuple[int, int]] = {}
_KEEPING_LOCK = threading.Lock()


class GpuMemory:
    """Small arrays on a GPU; a block goes once the last of its arrays has gone.

    Args:
        device: The GPU.
    """

    def __init__(self, device: wp.Device) -> None:
        self._device = device
        self._zeros = _Block(device)
        self._sent = _Block(device)
        self._mirror = np.empty(0, np.uint8)
        # The mirror as Warp copies it.
        self._source: wp.array | None = None
        # Which part of the mirror has not been sent yet.
        self._begin = self._end = 0

    def zeros(self, shape: int | tuple[int, ...], dtype: type) -> wp.array | None:
        """An array of zeros; None where it is too large to share a block."""
        size = _bytes_of(shape, dtype)
        if not 0 < size <= LARGEST:
            return None
        if self._zeros.room < size:
            self._zeros = _Block(self._device, BLOCK)
        return self._zeros.view(shape, dtype, size)

    def array(self, values: np.ndarray, dtype: type) -> wp.array | None:
        """An array for kernels to read, which has its values from the next :meth:`send` on; None where it is too large for a block.

        Args:
            values: Its values; of vectors, with an axis for their components.
            dtype: Type of its elements.
        """
        number, length = _number_of(dtype)
        values = np.asarray(values)
        shape = values.shape
        if length > 1:
            if not shape or shape[-1] != length:
                return None
            shape = shape[:-1]
        size = values.size * number.itemsize
        if not 0 < size <= LARGEST or len(shape) == 0:
            return None
        if self._sent.room < size:
            self.send()
            self._sent, self._mirror = _Block(self._device, BLOCK), np.zeros(BLOCK, np.uint8)
            address = self._mirror.ctypes.data
            self._source = wp.array(ptr=address, shape=BLOCK, dtype=wp.uint8, device="cpu")
            self._begin = self._end = 0
        begin = self._sent.end
        view = self._sent.view(shape, dtype, size)
        self._mirror[begin : begin + size].view(number).reshape(values.shape)[...] = values
        self._end = begin + size
        return view

    def send(self) -> None:
        """Send what waits, before anything that is launched from now on."""
        if self._begin == self._end:
            return
        begin, count = self._begin, self._end - self._begin
        # The driver has taken it out of memory that is not pinned when this returns.
        wp.copy(self._sent.memory, self._source, dest_offset=begin, src_offset=begin, count=count)
        self._begin = self._end = -(-self._end // ALIGNMENT) * ALIGNMENT


def keep_pool(device: wp.Device) -> None:
    """Let a GPU's pool keep memory until whoever called this has called :func:`let_pool_go`."""
    if not device.is_mempool_supported:
        return
    with _KEEPING_LOCK:
        count, before = _keeping.get(device.alias, (0, 0))
        if not count:
            before = wp.get_mempool_release_threshold(device)
            wp.set_mempool_release_threshold(device, max(before, int(KEPT_SHARE * device.total_memory)))
        _keeping[device.alias] = count + 1, before


def let_pool_go(device: wp.Device) -> None:
    """Let the pool give back what is free in it, once nobody keeps it any more."""
    if not device.is_mempool_supported:
        return
    with _KEEPING_LOCK:
        count, before = _keeping.pop(device.alias)
        if count > 1:
            _keeping[device.alias] = count - 1, before
            return
        wp.set_mempool_release_threshold(device, before)
    # It does so when somebody waits.
    wp.synchronize_device(device)


class _Block:
    """Zeros that are given away one part after the other; nothing without a size.

    Attributes:
        memory: All of them, ``wp.uint8``.
        end: Where the part begins that is left.
    """

    def __init__(self, device: wp.Device, size: int = 0) -> None:
        self._device = device
        self.memory = wp.zeros(size, dtype=wp.uint8, device=device) if size else None
        self._size, self.end = size, 0

    @property
    def room(self) -> int:
        """Bytes that are left."""
        return self._size - self.end

    def view(self, shape: int | tuple[int, ...], dtype: type, size: int) -> wp.array:
        """The next part, as an array."""
        assert self.memory is not None
        result = wp.array(ptr=self.memory.ptr + self.end, shape=shape, dtype=dtype, device=self._device)
        # The memory must not go before the array does.
        result.block = self.memory
        self.end = -(-(self.end + size) // ALIGNMENT) * ALIGNMENT
        return result


def _bytes_of(shape: int | tuple[int, ...], dtype: type) -> int:
    return wp.types.type_size_in_bytes(dtype) * (shape if isinstance(shape, int) else math.prod(shape))


def _number_of(dtype: type) -> tuple[np.dtype, int]:
    """NumPy's type for the numbers of an element, and how many of them it has."""
    if dtype not in _numbers:
        scalar = getattr(dtype, "_wp_scalar_type_", dtype)
        scalar = {float: wp.float32, int: wp.int32}.get(scalar, scalar)
        number = np.dtype(wp.dtype_to_numpy(scalar))
        _numbers[dtype] = number, wp.types.type_size_in_bytes(dtype) // number.itemsize
    return _numbers[dtype]


_numbers: dict[type, tuple[np.dtype, int]] = {}
