"""Calls in warm processes of this machine: each is started once, and answers one call after the other."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import IO, Any

from .worker import Failure

__all__ = ["WorkerPool"]

# A process that ends during a call is replaced, and the call made again, so often at most.
ATTEMPTS = 3
# How long a thread that has an answer waits at a time for somebody to take it [s].
PATIENCE = 0.2
# NumPy's linear algebra would start as many threads in every process as the machine has processors.
OTHER_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
# For Linux: memory that a problem gives back stays with the process for the next one, up to 64 MB and in pieces of up to 32. To get it
# from the system again takes a sixth of the time of 200 bodies.
KEEPS_MEMORY = {"MALLOC_TRIM_THRESHOLD_": str(64 << 20), "MALLOC_MMAP_THRESHOLD_": str(32 << 20)}


class WorkerPool:
    """Some processes, and a thread for each that hands it calls.

    Args:
        workers: Number of processes.
        threads: Threads that each of them solves with.
        keep: Whether processes stay for another :meth:`map`, until :meth:`close`.
        environments: Variables of the environment of the first process, the second and so on, and from the first again; none where
            all have this one's.
    """

    def __init__(
        self, workers: int, threads: int = 1, *, keep: bool = False, environments: Sequence[Mapping[str, str]] = ()
    ) -> None:
        self.workers = workers
        self.threads = threads
        self._keep = keep
        self._environments = environments
        # Which processes have which of them, so that one that is replaced gets that of the lost one.
        self._users = [0] * len(environments)
        self._idle: list[_Process] = []
        self._processes: set[_Process] = set()
        self._lock = threading.Lock()
        self._closed = threading.Event()

    def map(
        self, function: Callable[..., Any], calls: Iterable[tuple[Any, ...]], *, first_alone: bool = True
    ) -> Iterator[tuple[int, Any]]:
        """Carry out a call for each tuple of arguments.

        Args:
            function: At the top level of a module; it and its arguments can be pickled.
            calls: Arguments; taken when a process is free.
            first_alone: Whether the others wait for the end of the first call, which compiles the kernels for all.

        Yields:
            The number of the call and what it returned or a :class:`~.worker.Failure`, in the order in which they end.
        """
        waiting = enumerate(calls)
        answers: queue.Queue[tuple[int, Any] | BaseException | None] = queue.Queue(maxsize=2 * self.workers)
        warm = threading.Event()
        if not first_alone:
            warm.set()

        def deliver(answer: tuple[int, Any] | BaseException | None) -> None:
            while not self._closed.is_set():
                with contextlib.suppress(queue.Full):
                    answers.put(answer, timeout=PATIENCE)
                    return

        def serve(number: int) -> None:
            process: _Process | None = None
            try:
                with self._lock:
                    process = self._idle.pop() if self._idle else None
                if number:
                    process = process or self._start()
                    warm.wait()
                while not self._closed.is_set():
                    with self._lock:
                        call = next(waiting, None)
                    if call is None:
                        break
                    process, answer = self._ask(process, function, call[1])
                    deliver((call[0], answer))
                    warm.set()
            except BaseException as error:  # of the iterable, say: told to whoever asked
                deliver(error)
            finally:
                warm.set()
                if process is not None and self._keep and not self._closed.is_set():
                    with self._lock:
                        self._idle.append(process)
                elif process is not None:
                    process.end()
                deliver(None)

        threads = [threading.Thread(target=serve, args=(number,), daemon=True) for number in range(self.workers)]
        for thread in threads:
            thread.start()
        complete = False
        try:
            yield from _delivered(answers, len(threads))
            complete = True
        finally:
            if not (complete and self._keep):
                self.close()

    def close(self) -> None:
        """End all processes at once."""
        self._closed.set()
        with self._lock:
            for process in self._processes:
                process.kill()

    def _start(self) -> _Process:
        place = -1
        with self._lock:
            if self._users:
                place = self._users.index(min(self._users))
                self._users[place] += 1
        process = _Process(self.threads, place, self._environments[place] if place >= 0 else {})
        with self._lock:
            self._processes.add(process)
        if self._closed.is_set():
            process.kill()
        return process

    def _ask(
        self, process: _Process | None, function: Callable[..., Any], arguments: tuple[Any, ...]
    ) -> tuple[_Process | None, Any]:
        call = pickle.dumps((function, arguments), pickle.HIGHEST_PROTOCOL)
        reason = ""
        for _ in range(ATTEMPTS):
            if self._closed.is_set():
                break
            process = process or self._start()
            try:
                return process, process.ask(call)
            except (EOFError, OSError, pickle.UnpicklingError):
                reason = process.kill()
                if process.place >= 0:
                    with self._lock:
                        self._users[process.place] -= 1
                process = None
        return None, Failure(f"its process ended {ATTEMPTS} times{reason}", False)


def _delivered(answers: queue.Queue[tuple[int, Any] | BaseException | None], count: int) -> Iterator[tuple[int, Any]]:
    """Yield what so many threads deliver, each of which ends with None; raise what any of them raised."""
    while count:
        try:
            # In short waits, so that Ctrl-C is noticed on every system.
            answer = answers.get(timeout=PATIENCE)
        except queue.Empty:
            continue
        if isinstance(answer, BaseException):
            raise answer
        if answer is None:
            count -= 1
        else:
            yield answer


class _Process:
    def __init__(self, threads: int, place: int, environment: Mapping[str, str]) -> None:
        # That of its environment among those of the pool, or -1.
        self.place = place
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - it is closed with the process
        # Not by -m: what answers are made of would then be in another module than the one that reads them knows.
        start = f"from {__package__}.worker import main; main()"
        # Ctrl-C of a terminal goes to a whole group of processes; these are ended by the one that started them.
        apart: dict[str, Any] = (
            {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
            if sys.platform == "win32"
            else {"start_new_session": True}
        )
        of_others = dict.fromkeys(OTHER_THREADS, str(threads))
        self._process = subprocess.Popen(
            [sys.executable, "-c", start],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**KEEPS_MEMORY, **of_others, **os.environ, "ESH_THREADS": str(threads), **environment},
            **apart,
        )

    def ask(self, call: bytes) -> Any:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(call)
        self._process.stdin.flush()
        return pickle.load(self._process.stdout)

    def end(self) -> None:
        """Let the process end by itself."""
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=5.0)
        self.kill()

    def kill(self) -> str:
        """End the process; returns what its last words were, with a colon before them."""
        with contextlib.suppress(OSError):
            self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=5.0)
        with contextlib.suppress(OSError, ValueError):
            self._errors.seek(0)
            lines = self._errors.read().decode("utf-8", "replace").split("\n")
            last = next((line.strip() for line in reversed(lines) if line.strip()), "")
            return f": {last[:300]}" if last else ""
        return ""
