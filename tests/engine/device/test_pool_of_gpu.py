"""A GPU's pool keeps memory while somebody computes there; tested without one."""

from types import SimpleNamespace

import pytest
import warp as wp
from esh.engine.device import gpu_memory
from esh.engine.device.gpu_memory import KEPT_SHARE, keep_pool, let_pool_go

TOTAL = 8_000_000_000


@pytest.fixture
def kept(monkeypatch):
    """What the pool keeps [bytes], by the name of the device; and "waited" among it, once somebody waited."""
    found = {"gpu": 0}
    monkeypatch.setattr(gpu_memory, "_keeping", {})
    monkeypatch.setattr(wp, "get_mempool_release_threshold", lambda device: found[device.alias])
    monkeypatch.setattr(wp, "set_mempool_release_threshold", lambda device, size: found.update({device.alias: size}))
    monkeypatch.setattr(wp, "synchronize_device", lambda device: found.update(waited=found[device.alias]))
    return found


def device(pool=True):
    return SimpleNamespace(alias="gpu", is_mempool_supported=pool, total_memory=TOTAL)


def test_the_pool_keeps_memory_until_the_last_one_has_gone(kept):
    keep_pool(device())
    keep_pool(device())
    assert kept == {"gpu": KEPT_SHARE * TOTAL}
    let_pool_go(device())
    assert kept == {"gpu": KEPT_SHARE * TOTAL}
    let_pool_go(device())
    # It gives back what is free when somebody waits.
    assert kept == {"gpu": 0, "waited": 0}


def test_who_has_a_pool_that_keeps_more_has_it_afterwards(kept):
    kept["gpu"] = TOTAL
    keep_pool(device())
    assert kept["gpu"] == TOTAL
    let_pool_go(device())
    assert kept["gpu"] == TOTAL


def test_a_gpu_without_a_pool_is_left_alone(kept):
    keep_pool(device(pool=False))
    let_pool_go(device(pool=False))
    assert kept == {"gpu": 0}
