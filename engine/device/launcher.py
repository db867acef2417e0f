"""How kernels are launched on a device.

Warp runs a CPU launch on the calling thread. :class:`Launcher` therefore cuts a CPU launch into chunks, which threads take one after
the other (:mod:`.threads`), so every kernel of the engine takes the index of its chunk's first element as its first argument. On a
GPU there is one chunk.

What is done again and again is *recorded*, once, and then played: on a GPU as a CUDA graph, on the CPU as a program of the threads.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NoReturn, Protocol, TypeVar

import numpy as np
import warp as wp

from .devices import core_count, resolve_device
from .gpu_launches import NotLoadedError, launch_on_gpu
from .gpu_memory import GpuMemory, keep_pool, let_pool_go
from .profile import Profile
from .threads import Operation, Program, ThreadTeam

__all__ = [
    "GRAIN",
    "GRAIN_OF_NEIGHBORS",
    "Launcher",
    "Recording",
    "Until",
    "launcher_of_process",
]

# Elements that take a CPU thread some 10 microseconds, many times as long as it takes to hand them out: by themselves, and in kernels
# that go through an element's neighbors.
GRAIN = 1024
GRAIN_OF_NEIGHBORS = 96
# From so many bytes on NumPy asks the system for large pages, of which fewer are to be looked up: a seventh less time for 1,000,000
# bodies. Warp does not.
LARGE_ARRAY = 1 << 22
# Bytes of memory that a processor reads at once, and of its longest vectors.
CACHE_LINE = 64
# Things of a kind that a launcher keeps to use them again: an edit needs what a run needed, and little else.
MOST_KEPT = 12
# Arrays that stay for the next launcher, and the largest of these [bytes]: the next run is often one of the same size.
MOST_SHARED = 24
LARGEST_SHARED = 1 << 22
Kept = TypeVar("Kept")
_shared: dict[Hashable, wp.array] = {}
_SHARED_LOCK = threading.Lock()


class Launcher:
    """Launches kernels on one device, on several threads when it is the CPU.

    Args:
        device: From :func:`resolve_device`.
        profile: Gets the time that every :meth:`phase` takes.

    Attributes:
        thread_count: Threads that carry out kernels: 1 on a GPU.
        python_launches: How many times Python had work done so far: a launch, or a recording that was played.
    """

    def __init__(self, device: wp.Device, profile: Profile | None = None) -> None:
        self.device = device
        self._team = None if device.is_cuda else ThreadTeam(core_count())
        self.thread_count = 1 if self._team is None else self._team.count
        self.python_launches = 0
        self._profile = profile
        self._phase = ""
        self._recording: CpuRecording | None = None
        self._gpu_recordings: list[GpuRecording] = []
        self._kept: dict[Hashable, dict[Hashable, Any]] = {}
        self._gpu_memory: GpuMemory | None = None
        self._keeps_pool = device.is_cuda
        if device.is_cuda:
            keep_pool(device)
            self._gpu_memory = GpuMemory(device)
        self._ask: Callable[[], None] = _go_on
        if self._team is not None and profile is not None:
            self._team.timed = True

    @contextlib.contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Count the time of a block as that of a phase, where somebody asked for a profile."""
        before, self._phase = self._phase, name
        try:
            if self._profile is None or self._recording is not None:
                yield
            else:
                with self._profile.phase(name, self.device):
                    yield
        finally:
            self._phase = before

    @contextlib.contextmanager
    def interruptible(self, ask: Callable[[], None] | None) -> Iterator[None]:
        """Call ``ask``, where there is one, before all that is launched or played in a block: for whoever no longer wants it.

        What ``ask`` raises ends the block, which must leave nothing half done that somebody uses later.
        """
        before, self._ask = self._ask, ask or _go_on
        try:
            yield
        finally:
            self._ask = before

    def ask(self) -> None:
        """Ask whether to go on, see :meth:`interruptible`; for what takes long without a launch."""
        self._ask()

    @property
    def profiled(self) -> bool:
        """Whether somebody asked for a profile, whose phases are waited for."""
        return self._profile is not None

    def count_ticks(self, phases: Sequence[str], program: Program) -> None:
        """Count what a program's operations took, each for its phase, or all of them for the phase that they were played in."""
        if self._profile is None:
            return
        for operation, phase in zip(program.operations, phases, strict=False):
            alone = operation.chunks == 1
            self._profile.add_ticks(
                self._phase or phase, operation.busy, operation.wall, within=bool(self._phase), alone=alone
            )
            operation.busy = operation.wall = 0

    def close(self) -> None:
        """Give the threads back, and let go of what was recorded: whoever recorded it is held by it."""
        for recording in self._gpu_recordings:
            recording.forget()
        self._kept.clear()
        if self._team is not None:
            self._team.close()
        if self._keeps_pool:
            self._keeps_pool = False
            let_pool_go(self.device)

    def kept(self, key: tuple[Hashable, ...], make: Callable[[], Kept], most: int = MOST_KEPT) -> Kept:
        """What ``make`` makes, or made before for the same key: something that takes long and depends on the key alone.

        Only the last few of those are kept whose keys begin alike, so that many of one kind do not drive out those of others.
        """
        of_kind = self._kept.setdefault(key[0], {})
        value = of_kind.pop(key) if key in of_kind else make()
        of_kind[key] = value
        while len(of_kind) > most:
            of_kind.pop(next(iter(of_kind)))
        return value

    def shared(self, key: tuple[Hashable, ...], make: Callable[[], wp.array]) -> wp.array:
        """What :meth:`kept` returns, an array that nobody changes; a small one stays for the launchers after this one, too."""
        here = self.device.alias, key
        with _SHARED_LOCK:
            if here in _shared:
                _shared[here] = value = _shared.pop(here)
                return value
        value = self.kept(key, make)
        if value.capacity <= LARGEST_SHARED:
            with _SHARED_LOCK:
                _shared[here] = value
                while len(_shared) > MOST_SHARED:
                    _shared.pop(next(iter(_shared)))
        return value

    def known(self, key: tuple[Hashable, ...]) -> wp.array | None:
        """What :meth:`shared` returned for this key, as long as it is there."""
        here = self.device.alias, key
        with _SHARED_LOCK:
            shared = here in _shared
        kept = key in self._kept.get(key[0], {})
        return self.shared(key, _nothing) if shared or kept else None

    def release(self, recording: Recording) -> None:
        """Let go of a recording that nobody plays again, and of all arrays that only it holds."""
        recording.forget()
        if isinstance(recording, GpuRecording):
            self._gpu_recordings.remove(recording)

    def empty(self, shape: int | tuple[int, ...], dtype: type) -> wp.array:
        """An array for kernels, whose elements are still to be written."""
        return self._array(shape, dtype, np.empty, wp.empty)

    def array(self, values: np.ndarray, dtype: type) -> wp.array:
        """An array for kernels to read: on the CPU ``values`` themselves where they are of that type, which nobody may change then.

        A GPU has them from the next launch on, so that nothing else may read or change the array before that; see :meth:`own_array`.
        It fills one that NumPy made of a single value by ``broadcast_to`` itself.
        """
        if self._gpu_memory is not None:
            shared = self._gpu_memory.array(values, dtype)
            if shared is not None:
                return shared
            if _is_single(values):
                return wp.full(len(values), values[0].item(), dtype=dtype, device=self.device)
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device, copy=self.device.is_cuda)

    def own_array(self, values: np.ndarray, dtype: type) -> wp.array:
        """A copy that kernels and all others may read and change at once."""
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device, copy=True)

    def send(self) -> None:
        """Give a GPU what :meth:`array` was given; for whoever reads it without a :meth:`launch`."""
        if self._gpu_memory is not None:
            self._gpu_memory.send()

    def alike(self, values: np.ndarray, dtype: type) -> wp.array:
        """What :meth:`array` returns, for kernels that ask for elements by their index and never for an address.

        What NumPy made of a single value by ``broadcast_to`` is there once only, and all elements are that one.
        """
        if not _is_single(values):
            return self.array(values, dtype)
        one = self.array(values[:1].copy(), dtype)
        result = wp.array(ptr=one.ptr, shape=values.shape, strides=(0,), dtype=dtype, device=self.device)
        # The memory must not go before the view does.
        result.one = one
        return result

    def zeros(self, shape: int | tuple[int, ...], dtype: type) -> wp.array:
        """An array of zeros for kernels."""
        return self._array(shape, dtype, np.zeros, wp.zeros)

    def _array(
        self,
        shape: int | tuple[int, ...],
        dtype: type,
        from_numpy: Callable[..., np.ndarray],
        from_warp: Callable[..., wp.array],
    ) -> wp.array:
        if self._gpu_memory is not None:
            shared = self._gpu_memory.zeros(shape, dtype)
            return from_warp(shape, dtype=dtype, device=self.device) if shared is None else shared
        size = wp.types.type_size_in_bytes(dtype) * (shape if isinstance(shape, int) else math.prod(shape))
        if size < LARGE_ARRAY:
            return from_warp(shape, dtype=dtype, device=self.device)
        memory = from_numpy(size + CACHE_LINE, np.uint8)
        # NumPy begins a quarter into a line, so that every vector would lie in two.
        begin = -(-memory.ctypes.data // CACHE_LINE) * CACHE_LINE
        # It goes when the array goes, which holds what is to be done then.
        return wp.array(ptr=begin, shape=shape, dtype=dtype, device=self.device, deleter=lambda *_, kept=memory: None)

    def launch(
        self,
        kernel: wp.Kernel,
        count: int,
        inputs: Sequence[Any],
        outputs: Sequence[Any] = (),
        *,
        first: int = 0,
        grain: int = GRAIN,
        per_thread: bool = False,
    ) -> None:
        """Run ``kernel`` for the elements ``first .. first + count - 1``.

        Args:
            kernel: Its first argument is the first element of a chunk.
            count: Number of elements.
            inputs: Its arguments behind the first.
            outputs: And those that it writes to.
            first: First element.
            grain: Elements that are too few for a thread of their own.
            per_thread: Whether the kernel's second argument is the number of the thread, 0 to ``thread_count - 1``; for memory that
                no two threads may share.
        """
        if count <= 0:
            return
        self._ask()
        self.python_launches += self._recording is None
        self.send()
        if self._team is None:
            launch_on_gpu(kernel, count, [first, *([0] if per_thread else []), *inputs, *outputs], self.device)
            return
        operation, kept = self._team.operation(kernel, first, count, [*inputs, *outputs], grain, per_thread)
        if self._recording is not None:
            self._recording.add(operation, kept, self._phase)
            return
        done = self._team.run_once(operation, kept)
        if self._profile is not None and self._phase:
            self._profile.add_ticks(self._phase, done.busy, done.wall, within=True, alone=done.chunks == 1)

    def record(self, run: Callable[[], None]) -> Recording:
        """What ``run`` launches, to be played any number of times.

        ``run`` must launch kernels and nothing else: what it does beside is done once, or not at all.
        """
        if self._team is None:
            on_gpu = GpuRecording(self, run)
            self._gpu_recordings.append(on_gpu)
            return on_gpu
        self._recording = recording = CpuRecording(self, self._team)
        try:
            run()
        finally:
            self._recording = None
        recording.finish()
        return recording


def _go_on() -> None:
    """Nobody asks."""


@lru_cache(maxsize=1)
def _launcher_of(device: str, process: int) -> Launcher:
    return Launcher(resolve_device(device))


def launcher_of_process(device: str) -> Launcher:
    """The threads, or the GPU, that this process uses for one problem after the other; a forked process has its own."""
    return _launcher_of(device, os.getpid())


def _is_single(values: np.ndarray) -> bool:
    return values.ndim == 1 and len(values) > 1 and values.strides == (0,)


@dataclass(frozen=True, eq=False)
class Until:
    """When a recording that is played again and again has done enough: as soon as a number that it writes is not above a limit.

    Attributes:
        array: Where the number is, float.
        index: Its place there.
        limit: The limit.
    """

    array: wp.array
    index: int
    limit: float


class Recording(Protocol):
    """Launches that can be played again; see :meth:`Launcher.record`."""

    def play(self, times: int = 1, until: Until | None = None) -> int:
        """Carry them all out, in their order, so many times; returns how often.

        With ``until`` the CPU stops when it is reached, and after a tenth of a second in any case: it may have done fewer. A GPU,
        which is not waited for, does all of them.
        """

    def forget(self) -> None:
        """Let go of the launches, which cannot be played any more."""


class GpuRecording(Recording):
    """A CUDA graph. If kernels are new, the launches are made one by one at first: modules cannot be loaded while it is recorded."""

    def __init__(self, launcher: Launcher, run: Callable[[], None]) -> None:
        self._launcher = launcher
        self._run = run
        self._graph: wp.Graph | None = None

    def play(self, times: int = 1, until: Until | None = None) -> int:
        """See :meth:`Recording.play`; launches of a run that is profiled are made one by one, to be timed."""
        launcher = self._launcher
        launcher.ask()
        launcher.send()
        for _ in range(times):
            if launcher.profiled or not self._is_recorded():
                self._run()
                continue
            launcher.python_launches += 1
            wp.capture_launch(self._graph)
        return times

    def _is_recorded(self) -> bool:
        """Record the graph, if it is not yet; False if a kernel in it has still to be loaded."""
        if self._graph is None:
            try:
                with wp.ScopedCapture(device=self._launcher.device) as capture:
                    self._run()
            except NotLoadedError:
                return False
            self._graph = capture.graph
        return True

    def forget(self) -> None:
        """See :meth:`Recording.forget`."""
        self._run = _nothing
        self._graph = None


def _nothing() -> NoReturn:
    raise RuntimeError("this recording was released")


class CpuRecording(Recording):
    """A program of the threads."""

    def __init__(self, launcher: Launcher, team: ThreadTeam) -> None:
        self._launcher = launcher
        self._team = team
        self._operations: list[Operation] = []
        self._kept: list[object] = []
        self._phases: list[str] = []
        self._program: Program | None = None

    def add(self, operation: Operation, kept: object, phase: str) -> None:
        """Append an operation."""
        self._operations.append(operation)
        self._kept.append(kept)
        self._phases.append(phase)

    def finish(self) -> None:
        """Make the program of what was added."""
        self._program = self._team.program(self._operations, self._kept)

    def play(self, times: int = 1, until: Until | None = None) -> int:
        """See :meth:`Recording.play`."""
        if self._program is None:
            _nothing()
        self._launcher.ask()
        self._launcher.python_launches += 1
        self._launcher.send()
        if until is None:
            done = 0
            while done < times:
                done += self._team.run(self._program, times - done)
        else:
            watched = until.array.ptr + until.array.strides[0] * until.index
            done = self._team.run(self._program, times, watched, until.limit)
        self._launcher.count_ticks(self._phases, self._program)
        return done

    def forget(self) -> None:
        """See :meth:`Recording.forget`."""
        if self._program is not None:
            self._team.release(self._program)
        self._program = None
        self._operations, self._kept = [], []
