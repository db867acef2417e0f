"""Threads that carry out programs: every element once, in order, asleep when there is nothing to do, and fair to others."""

import contextlib
import math
import os
import subprocess
import sys
import threading
import time
import weakref

import numpy as np
import pytest
import warp as wp
from esh.engine.device import devices
from esh.engine.device.devices import core_count, resolve_device
from esh.engine.device.launcher import Launcher, Until
from esh.engine.device.profile import Profile
from esh.engine.errors import DeviceError
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.solve import solve
from esh.engine.space.cell_sort import CellSort


@wp.kernel(enable_backward=False)
def add_one(first: int, count: wp.array(dtype=wp.int32)):
    i = first + wp.tid()
    count[i] = count[i] + 1


@wp.kernel(enable_backward=False)
def add_both_sides(first: int, source: wp.array(dtype=wp.int64), result: wp.array(dtype=wp.int64)):
    i = first + wp.tid()
    n = source.shape[0]
    result[i] = (source[(i + n - 1) % n] + source[i] + source[(i + 1) % n]) % wp.int64(1000003)


@wp.kernel(enable_backward=False)
def note_thread(first: int, thread: int, seen: wp.array(dtype=wp.int32)):
    seen[first + wp.tid()] = thread


@wp.kernel(enable_backward=False)
def copy_keys(
    first: int, given: wp.array(dtype=wp.int32), key: wp.array(dtype=wp.int32), order: wp.array(dtype=wp.int32)
):
    i = first + wp.tid()
    key[i] = given[i]
    order[i] = i


@contextlib.contextmanager
def launcher_of(threads, monkeypatch):
    monkeypatch.setenv("ESH_THREADS", str(threads))
    launcher = Launcher(resolve_device("cpu"))
    try:
        yield launcher
    finally:
        launcher.close()


@pytest.mark.parametrize("threads", [1, 2, 5, 16])
@pytest.mark.parametrize("count", [1, 2, 7, 1000])
@pytest.mark.parametrize("grain", [1, 13, 5000])
def test_every_element_is_done_once(threads, count, grain, monkeypatch):
    with launcher_of(threads, monkeypatch) as launcher:
        done = wp.zeros(count + 5, dtype=wp.int32, device="cpu")
        launcher.launch(add_one, count, [], [done], first=3, grain=grain)
        assert done.numpy().tolist() == [0] * 3 + [1] * count + [0] * 2
        launcher.launch(add_one, 0, [], [done], grain=grain)
        assert done.numpy().sum() == count


@pytest.mark.parametrize("threads", [1, 3, 9])
def test_operations_follow_one_another(threads, monkeypatch):
    """Each reads what its predecessor wrote at the edges of other chunks; programs of unlike length take turns."""
    n = 500
    with launcher_of(threads, monkeypatch) as launcher:
        arrays = [wp.array(np.arange(n), dtype=wp.int64, device="cpu"), wp.zeros(n, dtype=wp.int64, device="cpu")]

        def program(pairs):
            def run():
                for _ in range(pairs):
                    for source, result in (arrays, arrays[::-1]):
                        launcher.launch(add_both_sides, n, [source], [result], grain=7)

            return launcher.record(run)

        short, long = program(1), program(12)
        expected = np.arange(n)
        for _ in range(60):
            short.play()
            long.play()
        for _ in range(60 * 26):
            expected = (np.roll(expected, 1) + expected + np.roll(expected, -1)) % 1000003
        np.testing.assert_array_equal(arrays[0].numpy(), expected)


def test_recording_does_nothing_yet(monkeypatch):
    with launcher_of(2, monkeypatch) as launcher:
        done = wp.zeros(10, dtype=wp.int32, device="cpu")
        recording = launcher.record(lambda: launcher.launch(add_one, 10, [], [done]))
        assert done.numpy().sum() == 0
        before = launcher.python_launches
        for _ in range(3):
            recording.play()
        assert done.numpy().tolist() == [3] * 10
        assert launcher.python_launches - before == 3


@wp.kernel(enable_backward=False)
def count_down(first: int, number: wp.array(dtype=float)):
    i = first + wp.tid()
    number[i] = number[i] - 1.0


@pytest.mark.parametrize("threads", [1, 4])
def test_recording_is_repeated_until_a_number_says_so(threads, monkeypatch):
    with launcher_of(threads, monkeypatch) as launcher:
        number = wp.array([100.0, 7.0, 50.0], dtype=float, device="cpu")
        done = wp.zeros(500, dtype=wp.int32, device="cpu")

        def run():
            launcher.launch(add_one, 500, [], [done], grain=10)
            launcher.launch(count_down, 3, [], [number])

        recording = launcher.record(run)
        before = launcher.python_launches
        assert recording.play(5) == 5
        assert (done.numpy() == 5).all()
        # It is 2 now, and the last time is the one after which it is not above 0.5.
        assert recording.play(80, Until(number, 1, 0.5)) == 2
        assert number.numpy().tolist() == [93.0, 0.0, 43.0]
        # At the limit counts as reached, and there is a first time in any case.
        assert recording.play(80, Until(number, 2, 40.0)) == 3
        assert recording.play(80, Until(number, 2, 40.0)) == 1
        number.assign([1.0, math.nan, 1.0])
        assert recording.play(80, Until(number, 1, 0.5)) == 1
        assert recording.play(80, Until(number, 0, -1000.0)) == 80
        assert (done.numpy() == 92).all()
        assert launcher.python_launches - before == 6


@wp.func_native("volatile int x = 0; for (int k = 0; k < n; ++k) x = x + k; return x;")
def burn(n: int) -> int: ...


@wp.kernel(enable_backward=False)
def burn_for(first: int, rounds: int, result: wp.array(dtype=wp.int32)):
    i = first + wp.tid()
    result[i] = result[i] + burn(rounds) * 0 + 1


@pytest.mark.alone
def test_python_has_a_word_now_and_then_where_a_recording_is_repeated(monkeypatch):
    with launcher_of(2, monkeypatch) as launcher:
        result, never = wp.zeros(1, dtype=wp.int32, device="cpu"), wp.ones(1, dtype=float, device="cpu")
        recording = launcher.record(lambda: launcher.launch(burn_for, 1, [3_000_000], [result]))
        recording.play()
        start = time.perf_counter()
        assert 1 <= recording.play(100_000, Until(never, 0, 0.0)) < 100_000
        assert time.perf_counter() - start < 5.0
        before = int(result.numpy()[0])
        # Without a condition it is done as often as it was asked for.
        assert recording.play(150) == 150
        assert result.numpy()[0] == before + 150


def test_what_a_recording_needs_goes_with_it(monkeypatch):
    """Its arrays do at once; the table of its operations, which threads may still look at, is used again."""
    with launcher_of(3, monkeypatch) as launcher:
        for length in (1, 5, 6, 20) * 5:
            done = wp.zeros(1000, dtype=wp.int32, device="cpu")
            recording = launcher.record(
                lambda done=done, length=length: [
                    launcher.launch(add_one, 1000, [], [done], grain=10) for _ in range(length)
                ]
            )
            recording.play(2)
            assert (done.numpy() == 2 * length).all()
            alive = weakref.ref(done)
            launcher.release(recording)
            del done
            assert alive() is None
            with pytest.raises(RuntimeError, match="was released"):
                recording.play()
        assert len(launcher._team._tables) == 3


def test_threads_are_numbered(monkeypatch):
    with launcher_of(6, monkeypatch) as launcher:
        seen = wp.full(600, -1, dtype=wp.int32, device="cpu")
        launcher.launch(note_thread, 600, [], [seen], grain=1, per_thread=True)
        assert set(seen.numpy().tolist()) <= set(range(launcher.thread_count))


def test_threads_sleep_when_there_is_nothing_to_do_and_end(monkeypatch):
    before = threading.active_count()
    with launcher_of(4, monkeypatch) as launcher:
        done = wp.zeros(1000, dtype=wp.int32, device="cpu")
        launcher.launch(add_one, 1000, [], [done], grain=1)
        assert threading.active_count() == before + 3
        time.sleep(0.2)
        start = time.process_time()
        time.sleep(0.5)
        assert time.process_time() - start < 0.1
        # They wake again.
        launcher.launch(add_one, 1000, [], [done], grain=1)
        assert done.numpy().tolist() == [2] * 1000
    assert threading.active_count() == before


def test_two_runs_at_once_in_one_process_are_like_each_alone(monkeypatch):
    monkeypatch.setenv("ESH_THREADS", "3")
    problems = [Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, n)])]) for n in (3000, 5000)]
    alone = [solve(problem, device="cpu", max_steps=10).position for problem in problems]
    together = [None, None]

    def run(k):
        together[k] = solve(problems[k], device="cpu", max_steps=10).position

    runs = [threading.Thread(target=run, args=(k,)) for k in range(2)]
    for run_ in runs:
        run_.start()
    for run_ in runs:
        run_.join()
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


# A thread is woken late, in the middle of an operation, and wakes others that sleep since its start: one of these wakes up to find
# nothing new. A wake-up that is lost then hangs the run, or leaves a thread asleep for ever.
LATE_WAKERS = """
import os, threading, time
import numpy as np
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher

@wp.func_native("volatile int x = 0; for (int k = 0; k < n; ++k) x = x + k; return x;")
def burn(n: int) -> int: ...

@wp.kernel(enable_backward=False)
def work(first: int, rounds: wp.array(dtype=wp.int32), result: wp.array(dtype=wp.int32)):
    i = first + wp.tid()
    result[i] = burn(rounds[i])

launcher = Launcher(resolve_device("cpu"))
result = wp.zeros(3, dtype=wp.int32, device="cpu")

def launch(milliseconds):
    rounds = wp.array((np.array(milliseconds) * per_millisecond).astype(np.int32), dtype=wp.int32, device="cpu")
    launcher.launch(work, len(milliseconds), [rounds], [result], grain=1)

per_millisecond = 10_000
launch([1.0])
start = time.perf_counter()
launch([100.0])
per_millisecond *= 0.1 / (time.perf_counter() - start)

def program():
    for _ in range(4):
        launch([6.0])
        launch([2.0, 30.0, 0.01])

recording = launcher.record(program)
recording.play()
cores = sorted(os.sched_getaffinity(0))
for thread in threading.enumerate():
    others = thread is not threading.main_thread()
    os.sched_setaffinity(thread.native_id, {cores[-1] if others else cores[0]})
for _ in range(25):
    recording.play()
launcher.close()
print("ended", threading.active_count())
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="threads cannot be bound to processors here")
def test_no_wake_up_is_lost_where_threads_are_woken_late(tmp_path):
    script = tmp_path / "late_wakers.py"
    script.write_text(LATE_WAKERS, encoding="utf-8")
    environment = {**os.environ, "ESH_THREADS": "3"}
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=60, cwd=tmp_path, env=environment
    )
    assert done.stdout.strip() == "ended 1", done.stderr[-2000:]


def test_a_run_goes_on_with_the_threads_that_the_system_gives(monkeypatch):
    real = threading.Thread.start

    def start(thread):
        if thread.name.endswith(" 2"):
            raise RuntimeError("can't start new thread")
        real(thread)

    before = threading.active_count()
    monkeypatch.setattr(threading.Thread, "start", start)
    with launcher_of(5, monkeypatch) as launcher:
        done = wp.zeros(100, dtype=wp.int32, device="cpu")
        for _ in range(3):
            launcher.launch(add_one, 100, [], [done], grain=1)
        assert done.numpy().tolist() == [3] * 100
    assert threading.active_count() == before


def test_threads_have_stacks_of_their_own_size(monkeypatch):
    before = threading.stack_size(256 << 10)
    try:
        monkeypatch.setenv("ESH_THREADS", "3")
        placement = solve(Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 20_000)])]), max_steps=3)
        assert np.isfinite(placement.position).all()
        assert threading.stack_size() == 256 << 10
    finally:
        threading.stack_size(before)


@pytest.mark.alone
def test_busy_programs_slow_a_run_down_in_proportion():
    """Beside as many busy programs as there are processors its share is a half: twice the time, where nothing else is lost."""
    problem = Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 20_000)])])
    solve(problem, device="cpu", max_steps=3)

    def seconds():
        times = []
        for _ in range(3):
            start = time.perf_counter()
            solve(problem, device="cpu", max_steps=50)
            times.append(time.perf_counter() - start)
        return min(times)

    alone = seconds()
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        time.sleep(0.3)
        beside = seconds()
    finally:
        for other in others:
            other.kill()
            other.wait()
    print(f"{beside / alone:.1f} times")
    assert beside < 6.0 * alone


@pytest.mark.parametrize("threads", [1, 2, 7])
@pytest.mark.parametrize(("count", "cells"), [(1, 1), (5, 1000), (4096, 3), (20_000, 1), (20_000, 7), (30_000, 12_345)])
def test_cells_are_sorted_and_their_items_keep_their_order(threads, count, cells, monkeypatch):
    rng = np.random.default_rng(count + cells)
    # Crowded at one end, and some cells empty.
    key = np.minimum((rng.random(count) ** 3 * cells).astype(np.int32), cells - 1)
    with launcher_of(threads, monkeypatch) as launcher:
        sort = CellSort(launcher, count, cells)
        for _ in range(2):
            sort.sort(copy_keys, [wp.array(key, dtype=wp.int32, device="cpu")])
        np.testing.assert_array_equal(sort.order.numpy()[:count], np.argsort(key, kind="stable"))
        starts = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=cells))])
        np.testing.assert_array_equal(sort.cell_start.numpy(), starts)


def test_a_run_leaves_a_processor_to_others_where_there_are_four(monkeypatch):
    monkeypatch.delenv("ESH_THREADS", raising=False)
    monkeypatch.setattr(devices, "_container_cores", lambda: None)
    for cores, threads in ((1, 1), (2, 2), (3, 3), (4, 3), (16, 15)):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _, cores=cores: range(cores), raising=False)
        assert core_count() == threads
    monkeypatch.setattr(devices, "_container_cores", lambda: 2)
    assert core_count() == 2


@pytest.mark.parametrize("value", ["0", "-1", "two", "1.5", " 8", "1000000000", "9" * 5000, "٣"])
def test_a_wrong_number_of_threads_is_answered_with_a_sentence(value, monkeypatch):
    monkeypatch.setenv("ESH_THREADS", value)
    with pytest.raises(DeviceError, match="ESH_THREADS must be a whole number from 1 to 999999; got"):
        solve(Problem(Domain((8.0, 8.0)), [BodyClass("a", [Size("s", 1.0, 3)])]), device="cpu")


@pytest.mark.alone
def test_a_profile_says_how_long_phases_take_and_how_many_threads_work(monkeypatch):
    monkeypatch.setenv("ESH_THREADS", "2")
    profile = Profile()
    start = time.perf_counter()
    problem = Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 20_000)])])
    solve(problem, device="cpu", profile=profile)
    passed = time.perf_counter() - start
    seconds, busy = profile.seconds, profile.busy_threads
    assert {"set-up", "sort", "deposit", "FFT", "update", "report"} <= set(seconds)
    # Phases exclude each other; what lies between them is little.
    assert 0.6 * passed < sum(seconds.values()) < 1.05 * passed
    assert all(0.5 < threads < 2.1 for threads in busy.values())
    assert "threads at work" in str(profile)
    # Sorting takes several threads but for the prefix of its counts; the report has Python between its kernels.
    serial = profile.serial_seconds
    assert set(serial) == set(seconds) and all(0.0 <= serial[name] <= 1.01 * seconds[name] for name in seconds)
    assert serial["report"] > 0.0 and 0.0 < serial["sort"] < 0.5 * seconds["sort"]
