"""CPU threads that carry out programs of kernels together (see :mod:`.kernels_threads` for how).

The threads stay inside compiled code from the first program to the last, where Python's global lock is not held: a program
costs Python one call, however many kernels and threads it has.

**Limitations**: reads how Warp lays out a kernel's arguments and its launch bounds, which its documentation does not promise;
:func:`~ThreadTeam.operation` says so where it finds them changed.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import warp as wp

from ..errors import DeviceError
from . import kernels_threads
from .kernel_arguments import KernelArguments
from .prebuilt_kernels import load_prebuilt
from .quiet_start import start_warp

__all__ = ["Operation", "Program", "ThreadTeam", "ticks"]

# Chunks for every thread: enough that one which was held up leaves little behind, few enough that taking them costs nothing.
# On 16 processors, 100,000 bodies take 11 % less time with 8 than with 4 (8 % with contact).
CHUNKS_PER_THREAD = 8
# Of every thread [bytes]: kernels keep some hundred kilobytes there, and the host program may have set less.
STACK_SIZE = 4 << 20
# The size of stacks is a setting of the whole process.
_starting = threading.Lock()


class Operation(ctypes.Structure):
    """A kernel for ``count`` elements from ``first`` on; times are in ticks of the processor's clock."""

    _fields_ = (
        ("kernel", ctypes.c_void_p),
        ("arguments", ctypes.c_void_p),
        ("arguments_size", ctypes.c_int64),
        ("first", ctypes.c_int64),
        ("count", ctypes.c_int64),
        ("chunks", ctypes.c_int64),
        ("per_thread", ctypes.c_int64),
        ("busy", ctypes.c_int64),
        ("wall", ctypes.c_int64),
    )


class _Shared(ctypes.Structure):
    """What all threads see."""

    _fields_ = (
        ("cursor", ctypes.c_uint64),
        ("pad_0", ctypes.c_char * 120),
        ("sequence", ctypes.c_uint64),
        ("pad_1", ctypes.c_char * 120),
        ("done", ctypes.c_int64),
        ("pad_2", ctypes.c_char * 120),
        ("asleep", ctypes.c_uint64),
        ("pad_3", ctypes.c_char * 120),
        ("operations", ctypes.c_void_p),
        ("base", ctypes.c_int64),
        ("operation_count", ctypes.c_int64),
        ("stop", ctypes.c_int64),
        ("timed", ctypes.c_int64),
        ("started", ctypes.c_int64),
        ("lock", ctypes.c_void_p),
        ("wakes", ctypes.c_void_p),
        ("take_lock", ctypes.c_void_p),
        ("give_lock", ctypes.c_void_p),
        ("sleep", ctypes.c_void_p),
        ("wake", ctypes.c_void_p),
    )


class Program:
    """Operations in their order, with all that they need kept alive.

    Args:
        table: Room for them, and for one more.
        operations: The operations.
        kept: What they need.

    Attributes:
        operations: The table.
        count: How many there are.
        most_chunks: Of the operation that has most.
    """

    def __init__(self, table: ctypes.Array[Operation], operations: Sequence[Operation], kept: Sequence[object]) -> None:
        for number, operation in enumerate(operations):
            table[number] = operation
        self.operations = table
        self.count = len(operations)
        self.most_chunks = max((operation.chunks for operation in operations), default=1)
        self._kept = kept

    def forget(self) -> None:
        """Let go of what the operations need: they cannot be carried out any more."""
        self.count, self._kept = 0, ()


class ThreadTeam:
    """This thread and ``count - 1`` others, which start when there is work for them.

    Args:
        count: Threads in all, >= 1; at most 64 are used.
    """

    def __init__(self, count: int) -> None:
        self.count = min(count, kernels_threads.MOST_THREADS)
        self._threads: list[threading.Thread] = []
        # The compiled code uses both until the last thread has left it. What is written to all the time has a line of the cache of its
        # own.
        self._memory, at = _aligned_memory(ctypes.sizeof(_Shared))
        self._sleeping, lock = _aligned_memory((1 + self.count) * kernels_threads.BYTES_OF_A_CONDITION)
        self._shared = _Shared.from_address(at)
        self._shared.cursor = 0xFFFFFFFF
        self._shared.lock = lock
        self._shared.wakes = lock + kernels_threads.BYTES_OF_A_CONDITION
        functions, initialize = _system_functions()
        for name, function in functions.items():
            setattr(self._shared, name, function)
        initialize(lock, [self._condition(thread) for thread in range(self.count)])
        # Threads may look at a program's table for a moment after its end (not at what it points to), so that none is freed before
        # they are gone; those of programs that are released are used again, by their length.
        self._tables: list[ctypes.Array[Operation]] = []
        self._spare: dict[int, list[ctypes.Array[Operation]]] = {}
        self._single: Program | None = None
        # Looked up here: a thread that starts must not load a module beside others.
        self._carry_out, self._join_in = (
            _native(kernel) for kernel in (kernels_threads.carry_out, kernels_threads.join_in)
        )
        self._bounds = _bounds()

    @property
    def timed(self) -> bool:
        """Whether operations count their ticks."""
        return bool(self._shared.timed)

    @timed.setter
    def timed(self, timed: bool) -> None:
        self._shared.timed = int(timed)

    def operation(
        self, kernel: wp.Kernel, first: int, count: int, arguments: Sequence[Any], grain: int, per_thread: bool
    ) -> tuple[Operation, object]:
        """Prepare a kernel.

        Args:
            kernel: Its first argument is the first element of a chunk; where ``per_thread``, its second one is the thread's number.
            first: First element.
            count: Number of elements, >= 1.
            arguments: All others.
            grain: Elements that are too few to be worth a second thread.
            per_thread: See ``kernel``.

        Returns:
            The operation, and what has to be kept alive for it.
        """
        given = [*((0, 0) if per_thread else (0,)), *arguments]
        known = _known.get(kernel)
        fast = None if known is None else known.packed(given)
        if known is None or fast is None:
            load_prebuilt(kernel.module)
            launch = wp.launch(kernel, dim=1, inputs=given, device="cpu", record_cmd=True)
            packed, kept = _pack(launch), launch
            if known is None:
                _known[kernel] = known = _KnownKernel(launch, given)
        else:
            packed, kept = fast
        operation = Operation()
        operation.kernel = known.address
        operation.arguments = ctypes.addressof(packed)
        operation.arguments_size = ctypes.sizeof(packed)
        operation.first, operation.count = first, count
        operation.chunks = 1
        if self.count > 1:
            operation.chunks = max(1, min(-(-count // grain), CHUNKS_PER_THREAD * self.count))
        operation.per_thread = int(per_thread)
        return operation, (kept, packed)

    def program(self, operations: Sequence[Operation], kept: Sequence[object]) -> Program:
        """A program that can be carried out any number of times."""
        length = 1 << len(operations).bit_length()
        spare = self._spare.get(length)
        if spare:
            return Program(spare.pop(), operations, kept)
        table = (Operation * length)()
        self._tables.append(table)
        return Program(table, operations, kept)

    def release(self, program: Program) -> None:
        """Let go of a program that nobody carries out again."""
        program.forget()
        self._spare.setdefault(len(program.operations), []).append(program.operations)

    def run_once(self, operation: Operation, kept: object) -> Operation:
        """Carry out a single operation; returns it with its times."""
        if self._single is None:
            self._single = self.program([operation], [])
        self._single.operations[0] = operation
        self._single.most_chunks = operation.chunks
        self.run(self._single)
        del kept
        return self._single.operations[0]

    def run(self, program: Program, times: int = 1, watched: int = 0, limit: float = 0.0) -> int:
        """Carry out a program, up to so many times one after the other; returns how often, at the end of the last.

        Args:
            program: What to carry out.
            times: How often at most, >= 1. After a tenth of a second the rest is left, so that Python has a word now and then.
            watched: Address of a float, 0 for none: the time after which it is not above ``limit`` is the last one.
            limit: See there.
        """
        if not program.count:
            return times
        wanted = min(self.count, program.most_chunks)
        while len(self._threads) < wanted - 1 and self._start_thread():
            pass
        done = ctypes.c_int32(0)
        arguments = _CarryOut(
            ctypes.addressof(self._shared),
            ctypes.addressof(program.operations),
            program.count,
            times,
            watched,
            limit,
            ctypes.addressof(done),
        )
        self._carry_out(ctypes.byref(self._bounds), ctypes.byref(arguments))
        return done.value

    def close(self) -> None:
        """Let the threads go; the team cannot be used again."""
        self._shared.stop = 1
        try:
            self._wake_all()
        finally:
            # Once more where Ctrl-C came in between: a thread that sleeps on would keep all arrays.
            self._wake_all()
        for thread in self._threads:
            thread.join()
        self._threads = []
        self._tables, self._spare = [], {}

    def _wake_all(self) -> None:
        if not self._threads:
            return
        # For those that look for work; whoever has not seen the word yet is on its way to sleep with the lock held.
        self._shared.sequence += 1
        take, give, wake = (
            ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(getattr(self._shared, name))
            for name in ("take_lock", "give_lock", "wake")
        )
        take(self._shared.lock)
        give(self._shared.lock)
        for number in range(1, len(self._threads) + 1):
            wake(self._condition(number))

    def _condition(self, thread: int) -> int:
        return self._shared.wakes + kernels_threads.BYTES_OF_A_CONDITION * thread

    def _start_thread(self) -> bool:
        """Start another thread; False where the system gives no more, and those that there are do its work."""
        number = len(self._threads) + 1
        thread = threading.Thread(target=self._work, args=(number,), name=f"ESH Scatter {number}", daemon=True)
        with _starting:
            before = threading.stack_size(STACK_SIZE)
            try:
                thread.start()
            except RuntimeError:
                return False
            finally:
                threading.stack_size(before)
        self._threads.append(thread)
        return True

    def _work(self, number: int) -> None:
        arguments = _JoinIn(ctypes.addressof(self._shared), number)
        self._join_in(ctypes.byref(self._bounds), ctypes.byref(arguments))


def _aligned_memory(size: int) -> tuple[object, int]:
    """Zeros, and where they begin: at a line of the cache."""
    memory = ctypes.create_string_buffer(size + 128)
    return memory, -(-ctypes.addressof(memory) // 128) * 128


class _CarryOut(ctypes.Structure):
    """Arguments of :func:`.kernels_threads.carry_out`."""

    _fields_ = (
        ("shared", ctypes.c_uint64),
        ("operations", ctypes.c_uint64),
        ("operation_count", ctypes.c_int32),
        ("times", ctypes.c_int32),
        ("watched", ctypes.c_uint64),
        ("limit", ctypes.c_float),
        ("done", ctypes.c_uint64),
    )


class _JoinIn(ctypes.Structure):
    """Arguments of :func:`.kernels_threads.join_in`."""

    _fields_ = (("shared", ctypes.c_uint64), ("thread", ctypes.c_int32))


def ticks() -> int:
    """Reading of the clock that operations are timed by."""
    start_warp()
    reading = (ctypes.c_int64 * 1)()
    array = wp.array(ptr=ctypes.addressof(reading), shape=(1,), dtype=wp.int64, device="cpu")
    load_prebuilt(kernels_threads.read_clock.module)
    wp.launch(kernels_threads.read_clock, dim=1, outputs=[array], device="cpu")
    return reading[0]


def _native(kernel: wp.Kernel) -> Any:
    """The compiled function behind a kernel, which takes launch bounds and arguments."""
    load_prebuilt(kernel.module)
    module = kernel.module.load(wp.get_device("cpu"), 1)
    return module.get_kernel_hooks(kernel).forward


def _bounds() -> ctypes.Structure:
    """Launch bounds of a single element, checked to be laid out as the compiled code writes them."""
    bounds = wp.launch(kernels_threads.join_in, dim=1, inputs=[0, 0], device="cpu", record_cmd=True).bounds
    layout = [(name, ctypes.sizeof(kind)) for name, kind in type(bounds)._fields_]
    if layout != [("shape", 4), ("size", 8), ("coord_mult", 8)]:
        raise DeviceError(
            f"warp-lang {wp.__version__} lays out kernel launches in a way that this version of ESH Scatter does not know; "
            "install warp-lang 1.19"
        )
    return bounds


def _pack(launch: wp.Launch) -> ctypes.Array[ctypes.c_char]:
    """A kernel's arguments as the structure that its compiled function takes, padded to whole words."""
    structure = _structure(launch.kernel, tuple(type(value) for value in launch.params[1:]))
    size = -(-ctypes.sizeof(structure) // 8) * 8
    if size > kernels_threads.LARGEST_ARGUMENTS:
        raise ValueError(f"the arguments of {launch.kernel.key} take {size} bytes")
    packed = ctypes.create_string_buffer(size)
    fields = structure.from_buffer(packed)
    for argument, value in zip(launch.kernel.adj.args, launch.params[1:], strict=True):
        setattr(fields, argument.label, value)
    return packed


class _KnownKernel:
    """A kernel that was launched before: Warp has loaded it, and looked through its arguments once.

    Args:
        launch: That launch.
        given: Its arguments.

    Attributes:
        address: Of its compiled function.
    """

    def __init__(self, launch: wp.Launch, given: Sequence[Any]) -> None:
        self.address = ctypes.cast(launch.hooks.forward, ctypes.c_void_p).value
        # Warp unloads a module's code once nobody holds it, and loads another when a kernel is added to the module.
        self._code = launch.module_exec
        taken = [type(value) for value in launch.params[1:]]
        self._layout = _structure(launch.kernel, tuple(taken))
        self._size = -(-ctypes.sizeof(self._layout) // 8) * 8
        self._arguments = KernelArguments(launch.kernel, given, taken)
        self._labels = [argument.label for argument in launch.kernel.adj.args]

    def packed(self, given: Sequence[Any]) -> tuple[ctypes.Array[ctypes.c_char], object] | None:
        """Its arguments as :func:`_pack` makes them, and what these are made of; None where Warp has to look at them."""
        values = self._arguments.passed(given)
        if values is None:
            return None
        packed = ctypes.create_string_buffer(self._size)
        fields = self._layout.from_buffer(packed)
        for label, value in zip(self._labels, values, strict=True):
            setattr(fields, label, value)
        # With the arrays themselves, which nobody else may hold.
        return packed, (values, tuple(given))


_known: dict[wp.Kernel, _KnownKernel] = {}


@cache
def _structure(kernel: wp.Kernel, kinds: tuple[type, ...]) -> type[ctypes.Structure]:
    fields = [(argument.label, kind) for argument, kind in zip(kernel.adj.args, kinds, strict=True)]
    return type("Arguments", (ctypes.Structure,), {"_fields_": fields})


@cache
def _system_functions() -> tuple[dict[str, int | None], Callable[[int, Sequence[int]], None]]:
    """Addresses of what the system has for sleeping threads, and what makes a lock and conditions of zeros."""
    if sys.platform == "win32":
        library: Any = ctypes.WinDLL("kernel32")
        names = {
            "take_lock": "AcquireSRWLockExclusive",
            "give_lock": "ReleaseSRWLockExclusive",
            "sleep": "SleepConditionVariableSRW",
            "wake": "WakeConditionVariable",
        }
    else:
        library = ctypes.CDLL(None)
        names = {
            "take_lock": "pthread_mutex_lock",
            "give_lock": "pthread_mutex_unlock",
            "sleep": "pthread_cond_wait",
            "wake": "pthread_cond_signal",
        }

    def initialize(lock: int, conditions: Sequence[int]) -> None:
        # On Windows zeros are what they start as.
        if sys.platform != "win32":
            library.pthread_mutex_init(ctypes.c_void_p(lock), None)
            for condition in conditions:
                library.pthread_cond_init(ctypes.c_void_p(condition), None)

    return {field: ctypes.cast(library[name], ctypes.c_void_p).value for field, name in names.items()}, initialize
