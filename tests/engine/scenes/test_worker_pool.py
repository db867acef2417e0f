"""Warm processes: what each of them sees of the machine, and who waits for whom."""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import pytest
import warp as wp
from esh.engine.device.devices import gpu_environments
from esh.engine.scenes import warm_pools
from esh.engine.scenes.worker_pool import WorkerPool


@pytest.fixture(autouse=True)
def nobodys_processes():
    """What other tests left for the next use is not used here."""
    warm_pools.close_warm_pools()


def asked_of_each(pool: WorkerPool, count: int, folder: Path, expression: str) -> list:
    """What an expression is in so many processes, of which each waits until all have been asked."""
    folder.mkdir()
    call = (
        f"(lambda os, time: (open(os.path.join({str(folder)!r}, str(os.getpid())), 'w').close(), "
        f"[time.sleep(0.05) for _ in range(1200) if len(os.listdir({str(folder)!r})) < {count}], {expression})[2])"
        "(__import__('os'), __import__('time'))"
    )
    return [answer for _, answer in pool.map(eval, [(call,)] * count, first_alone=False)]


def test_processes_share_several_environments_evenly(tmp_path):
    given = [{"PATH_OF_A_TEST": "a"}, {"PATH_OF_A_TEST": "b"}]
    pool = WorkerPool(3, environments=given, keep=True)
    try:
        seen = Counter(asked_of_each(pool, 3, tmp_path / "asked", "os.environ['PATH_OF_A_TEST']"))
        assert sorted(seen.values()) == [1, 2] and set(seen) == {"a", "b"}
    finally:
        pool.close()


def test_a_process_that_is_lost_leaves_its_environment_to_the_next(tmp_path):
    pool = WorkerPool(2, environments=[{"PATH_OF_A_TEST": "a"}, {"PATH_OF_A_TEST": "b"}], keep=True)
    look = "__import__('time').sleep(0.5) or __import__('os').environ['PATH_OF_A_TEST']"
    try:
        failed = dict(pool.map(eval, [("__import__('os')._exit(3)",), (look,), (look,)], first_alone=False))
        assert "3 times" in failed[0].text and {failed[1], failed[2]} <= {"a", "b"}
        again = Counter(asked_of_each(pool, 2, tmp_path / "asked", "os.environ['PATH_OF_A_TEST']"))
        assert again == {"a": 1, "b": 1}
    finally:
        pool.close()


@pytest.mark.alone
@pytest.mark.parametrize("alone", [True, False])
def test_others_wait_for_the_first_call_only_where_that_is_asked_for(alone):
    pool = WorkerPool(2, keep=True)
    try:
        list(pool.map(eval, [("1",), ("2",)], first_alone=False))
        answers = dict(
            pool.map(eval, [("__import__('time').sleep(1.5)",), ("__import__('time').time()",)], first_alone=alone)
        )
        ended = time.time()
        assert (ended - answers[1] < 0.7) is alone
    finally:
        pool.close()


def test_processes_on_several_gpus_see_one_each(monkeypatch):
    monkeypatch.setattr(wp, "get_cuda_devices", lambda: ["cuda:0", "cuda:1"])
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    assert gpu_environments("auto") == [{"CUDA_VISIBLE_DEVICES": "0"}, {"CUDA_VISIBLE_DEVICES": "1"}]
    assert gpu_environments("cuda:1") == [] and gpu_environments("cpu") == []
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "2, GPU-ab")
    assert gpu_environments("cuda") == [{"CUDA_VISIBLE_DEVICES": "2"}, {"CUDA_VISIBLE_DEVICES": "GPU-ab"}]
    monkeypatch.setattr(wp, "get_cuda_devices", lambda: ["cuda:0"])
    assert gpu_environments("auto") == []


def pids(pool: WorkerPool, folder: Path) -> set[int]:
    return set(asked_of_each(pool, 2, folder, "os.getpid()"))


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_processes_stay_for_the_next_use_and_go_after_a_while(monkeypatch, tmp_path):
    monkeypatch.setattr(warm_pools, "PATIENCE", 3.0)
    with warm_pools.warm_pool(2, 1) as (pool, is_warm):
        assert not is_warm
        first = pids(pool, tmp_path / "first")
    with warm_pools.warm_pool(2, 1) as (pool, is_warm):
        assert is_warm and pids(pool, tmp_path / "again") == first
        # Whoever else wants some meanwhile gets others.
        with warm_pools.warm_pool(2, 1) as (other, was_used):
            assert not was_used and not pids(other, tmp_path / "other") & first
    deadline = time.time() + 30.0
    while any(alive(process) for process in first) and time.time() < deadline:
        time.sleep(0.1)
    assert not any(alive(process) for process in first)


def test_processes_of_a_use_that_failed_do_not_stay(tmp_path):
    with pytest.raises(RuntimeError), warm_pools.warm_pool(2, 1) as (pool, _):
        gone = pids(pool, tmp_path / "gone")
        raise RuntimeError
    with warm_pools.warm_pool(2, 1) as (pool, is_warm):
        assert not is_warm and not pids(pool, tmp_path / "new") & gone
    warm_pools.close_warm_pools()


def test_a_process_has_no_more_threads_than_it_is_given_and_keeps_its_memory(tmp_path, monkeypatch):
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    pool = WorkerPool(1, threads=2, keep=True)
    names = ("ESH_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "MALLOC_TRIM_THRESHOLD_")
    try:
        (seen,) = asked_of_each(pool, 1, tmp_path / "asked", f"[os.environ.get(name) for name in {names}]")
        # What somebody has set stays.
        assert seen[:3] == ["2", "2", "3"] and int(seen[3]) > 1 << 20
    finally:
        pool.close()
