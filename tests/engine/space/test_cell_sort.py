"""Cells of positions: one kernel for charges, and for poses that hold a position and more."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.space import kernels_cells
from esh.engine.space.cell_sort import CellSort, position_of
from esh.engine.space.space import Space


@pytest.fixture
def launcher():
    launcher = Launcher(resolve_device("cpu"))
    yield launcher
    launcher.close()


@pytest.mark.parametrize("count", [1, 500, 20_000])
def test_poses_are_sorted_by_their_positions(launcher, count):
    pose = np.random.default_rng(count).random((count, 4)).astype(np.float32)
    pose[:, :2] *= (6.0, 4.0)
    pose[:, 2:] *= 1e6  # angles and lengths say nothing of the cell
    grid = kernels_cells.CellGrid()
    grid.count_x, grid.count_y = 12, 8
    grid.inverse_size = wp.vec2(2.0, 2.0)
    grid.space = Space((6.0, 4.0)).for_kernels()
    cell = np.minimum((pose[:, 1] * 2).astype(int), 7) * 12 + np.minimum((pose[:, 0] * 2).astype(int), 11)
    positions = wp.array(np.ascontiguousarray(pose[:, :2]), dtype=wp.vec2, device="cpu")
    for given in (positions, position_of(wp.array(pose, dtype=wp.vec4, device="cpu"))):
        gc.collect()  # a view keeps what it looks at
        sort = CellSort(launcher, count, 96)
        sort.sort(kernels_cells.compute_cell_keys, [given, grid])
        np.testing.assert_array_equal(sort.order.numpy()[:count], np.argsort(cell, kind="stable"))


def test_a_view_follows_its_poses():
    pose = wp.zeros(3, dtype=wp.vec4, device="cpu")
    view = position_of(pose)
    pose.assign(np.arange(12, dtype=np.float32).reshape(3, 4))
    np.testing.assert_array_equal(view.numpy(), [[0, 1], [4, 5], [8, 9]])


@pytest.mark.parametrize(
    ("count", "cells"), [(1, 1), (5, 1_000_000), (500, 7), (3000, 1), (5000, 40_000), (20_000, 3001)]
)
def test_counting_sorts_as_others_do(monkeypatch, count, cells):
    """As a GPU does it; one thread, since no other may count at once on the CPU."""
    monkeypatch.setenv("ESH_THREADS", "1")
    launcher = Launcher(resolve_device("cpu"))
    try:
        sort = CellSort(launcher, count, cells)
        counting = sort._room_for_counting()
        for seed in range(3):
            # Some cells hold many, most of them none.
            key = (np.random.default_rng(seed).random(count) ** 3 * cells).astype(np.int32)
            counting.key.assign(key)
            elements = sort.count(counting, kernels_cells.count_items, [])
            launcher.launch(kernels_cells.order_items, elements, [count, sort.cell_start], [counting, sort.order])
            np.testing.assert_array_equal(sort.order.numpy()[:count], np.argsort(key, kind="stable"))
            start = np.searchsorted(np.sort(key), np.arange(cells + 1))
            np.testing.assert_array_equal(sort.cell_start.numpy(), start)
    finally:
        launcher.close()


@pytest.mark.cuda
@pytest.mark.parametrize("spread", [False, True])
@pytest.mark.parametrize(
    ("count", "cells"), [(1, 1), (5, 1_000_000), (500, 7), (3000, 1), (20_000, 3001), (1_000_000, 700_000)]
)
def test_a_gpu_sorts_as_others_do(count, cells, spread):
    launcher = Launcher(resolve_device("cuda:0"))
    try:
        grid = kernels_cells.CellGrid()
        grid.count_x, grid.count_y, grid.inverse_size = cells, 1, wp.vec2(float(cells), 1.0)
        grid.space = Space((1.0, 1.0)).for_kernels()
        sort = CellSort(launcher, count, cells, spread=spread)
        for seed in range(3):
            place = np.random.default_rng(seed).random((count, 2)).astype(np.float32) ** 2
            sort.sort(kernels_cells.compute_cell_keys, [launcher.own_array(place, wp.vec2), grid])
            key = np.minimum((place[:, 0] * np.float32(cells)).astype(np.int32), cells - 1)
            np.testing.assert_array_equal(sort.order.numpy()[:count], np.argsort(key, kind="stable"))
            start = np.searchsorted(np.sort(key), np.arange(cells + 1))
            np.testing.assert_array_equal(sort.cell_start.numpy(), start)
    finally:
        launcher.close()
