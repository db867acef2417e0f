"""A few numbers of many are those that NumPy finds, to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.device.summaries import (
    BLOCK_OF_ROW,
    BLOCK_ON_CPU,
    extremes,
    largest_by_kind,
    largest_of_rows,
    least_and_number,
    median_of_least,
    sum_of_squares,
    sum_of_whole,
)


@pytest.fixture(scope="module", params=["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def launcher(request):
    result = Launcher(resolve_device(request.param))
    yield result
    result.close()


def floats(launcher, values):
    return wp.array(np.asarray(values, np.float32), dtype=float, device=launcher.device)


@pytest.mark.parametrize("count", [1, 2, 3, 4095, 4096, 4097, 20_000])
@pytest.mark.parametrize("unseen", [0, 1, 300])
def test_median_of_the_least(launcher, count, unseen):
    rng = np.random.default_rng(count + unseen)
    values = rng.gamma(4.0, 0.2, count).astype(np.float32)
    # Equal ones about the middle, and zeros.
    values[rng.random(count) < 0.3] = np.float32(0.75)
    values[rng.random(count) < 0.05] = 0.0
    both = rng.permutation(np.concatenate([values, np.full(unseen, 1e6, np.float32)]))
    assert median_of_least(launcher, floats(launcher, both), count) == float(np.median(values))


def test_median_of_numbers_of_all_sizes(launcher):
    values = (10.0 ** np.random.default_rng(1).uniform(-30.0, 30.0, 1001)).astype(np.float32)
    for count in (1, 500, 501, 1001):
        assert median_of_least(launcher, floats(launcher, values), count) == float(np.median(np.sort(values)[:count]))


def test_least_and_how_many_are_below_a_limit(launcher):
    values = np.random.default_rng(2).random(9_999).astype(np.float32) + 0.5
    least, number = least_and_number(launcher, floats(launcher, values), 0.9)
    assert least == float(values.min()) and number == int((values < np.float32(0.9)).sum())
    assert least_and_number(launcher, floats(launcher, values), 0.1)[1] == 0


@pytest.mark.parametrize("count", [1, 2, 255, BLOCK_ON_CPU, 3 * BLOCK_ON_CPU + 1])
def test_extremes_are_those_of_all_blocks(launcher, count):
    for seed in range(5):
        values = np.random.default_rng([seed, count]).normal(size=count).astype(np.float32)
        assert extremes(launcher, floats(launcher, values)) == (values.min(), values.max())


@pytest.mark.parametrize("count", [1, BLOCK_OF_ROW, 3 * BLOCK_OF_ROW + 1])
def test_largest_of_rows(launcher, count):
    values = np.random.default_rng(count).normal(1.0, 1.0, (3, count)).astype(np.float32)
    found = largest_of_rows(launcher, floats(launcher, values.ravel()), 3).numpy()
    assert found.tolist() == values.max(axis=1, initial=0.0).tolist()


def test_sum_of_squares(launcher):
    values = np.random.default_rng(4).normal(0.0, 3.0, 9_999).astype(np.float32)
    expected = float((values.astype(np.float64) ** 2).sum())
    assert sum_of_squares(launcher, floats(launcher, values)) == pytest.approx(expected, rel=1e-13)


def test_largest_by_kind(launcher):
    rng = np.random.default_rng(3)
    values, kind = rng.random(10_000), rng.integers(0, 3, 10_000).astype(np.int32) * 2
    on_device = wp.array(values, dtype=wp.float64, device=launcher.device)
    found = largest_by_kind(launcher, on_device, launcher.array(kind, wp.int32), 7)
    assert found.tolist() == [values[kind == k].max(initial=0.0) for k in range(7)]
    same = launcher.alike(np.broadcast_to(np.int32(0), 10_000), wp.int32)
    assert largest_by_kind(launcher, on_device, same, 1).tolist() == [values.max()]


def test_sums_of_whole_numbers_are_longer_than_these(launcher):
    values = np.full(9_000, 2**30, np.int32)
    assert sum_of_whole(launcher, launcher.array(values, wp.int32)) == 9_000 * 2**30
    assert math.log2(9_000 * 2**30) > 31
