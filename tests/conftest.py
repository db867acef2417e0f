"""What all tests share: a Blender without the developer's settings, and markers that skip by themselves."""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

try:
    import fcntl
except ImportError:  # Windows, where one process runs all tests
    fcntl = None

ROOT = Path(__file__).resolve().parent.parent

# Before anything imports bpy: Blender reads the folder once. Warp's kernel cache is left where it is, in the user's
# cache folder, so that kernels are compiled once and not once a run.
_blender_folder = tempfile.mkdtemp(prefix="esh-test-blender-")
if "bpy" not in sys.modules:
    os.environ["BLENDER_USER_RESOURCES"] = _blender_folder
atexit.register(shutil.rmtree, _blender_folder, ignore_errors=True)


_EXIT_STATUS = pytest.StashKey[int]()


class RootAsPlainFolder:
    """Has pytest take the root for a folder: as a package it could be imported only where its name is one for Python."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collect_directory(self, path: Path, parent: pytest.Collector) -> pytest.Collector | None:
        """Answer for the root, and leave all other folders to pytest."""
        return pytest.Dir.from_parent(parent, path=path) if path == ROOT else None


def pytest_configure(config: pytest.Config) -> None:
    """Let a checkout lie in a folder of any name, such as ``esh-scatter``, and tests be run in the background."""
    config.pluginmanager.register(RootAsPlainFolder())
    # A script's job in the background ignores Ctrl-C, and so would all processes that tests start and press it for.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Keep the status for :func:`pytest_unconfigure`."""
    session.config.stash[_EXIT_STATUS] = int(exitstatus)


# The same inputs in every run of continuous integration: what fails there, fails again.
if "CI" in os.environ:
    with contextlib.suppress(ImportError):  # only some of the tests need it
        import hypothesis

        hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
        hypothesis.settings.load_profile("repeatable")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests marked ``cuda`` where Warp sees no GPU; begin with the files of ``slow`` tests, which should not come last."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    marked = [item for item in items if item.get_closest_marker("cuda")]
    if marked:
        import warp as wp

        if not wp.is_cuda_available():
            for item in marked:
                item.add_marker(pytest.mark.skip(reason="no CUDA device on this machine"))


def pytest_collection_finish() -> None:
    """Have Python's collector of garbage look no more at what stays until the end: thousands of tests and all modules."""
    gc.freeze()


# What :func:`_fixed_work` takes on two idle cores of an Intel Xeon, whose seconds tests name [s of a processor].
IDLE_SECONDS = 0.03


@pytest.fixture
def slowness() -> Callable[[], float]:
    """How many times as long as on an idle machine work takes on this one now, by a piece of work that is always the same; at least 1.

    Limits on seconds are multiplied by it: they are about the code, and not about what else the machine has to do.
    """
    return lambda: max(1.0, sum(_fixed_work() for _ in range(5)) / (5.0 * IDLE_SECONDS))


def _fixed_work() -> float:
    """Seconds of a processor for some of what most code does: loops of Python, and of NumPy over arrays."""
    start = time.process_time()
    values = np.random.default_rng(1).random(100_000)
    for _ in range(4):
        np.sort(values)
        np.exp(values)
    sums: dict[int, int] = {}
    for number in range(50_000):
        sums[number % 1000] = sums.get(number % 1000, 0) + number
    return time.process_time() - start


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let no other test run beside one that is marked ``alone``, whatever the number of processes; the others have a thread each."""
    alone = item.get_closest_marker("alone") is not None
    with _turn(alone), contextlib.nullcontext() if alone else _one_thread():
        return (yield)


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Compute with one thread where tests run in several processes: more would wait for each other, a sixth of all time.

    Tests of threads ask for more, and all tests of kernels run with more again where ``ESH_THREADS`` is given.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ or "ESH_THREADS" in os.environ:
        yield
        return
    os.environ["ESH_THREADS"] = "1"
    try:
        yield
    finally:
        os.environ.pop("ESH_THREADS", None)


@contextlib.contextmanager
def _turn(alone: bool) -> Iterator[None]:
    """Hold a lock that all tests share, but for one that is alone.

    Who waits for it holds the door meanwhile, so that others, who come again and again, cannot keep one out who wants to be alone.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    if run is None or fcntl is None:
        yield
        return
    folder = Path(tempfile.gettempdir())
    with open(folder / f"esh-tests-{run}.door", "w") as door, open(folder / f"esh-tests-{run}.room", "w") as room:
        fcntl.flock(door, fcntl.LOCK_EX)
        fcntl.flock(room, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(door, fcntl.LOCK_UN)
        yield


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End at once where Blender 4.5 was imported.

    Its module waits for ever at the end of Python for a thread of its own (for sound) if anything still refers to it, such as
    the traceback of a test that failed; 5.0 has mended that.
    """
    bpy = sys.modules.get("bpy")
    if bpy is None or bpy.app.version >= (5, 0):
        return
    # What Python would do on its way out, but for Blender's part.
    shutil.rmtree(_blender_folder, ignore_errors=True)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(config.stash.get(_EXIT_STATUS, pytest.ExitCode.INTERNAL_ERROR))
