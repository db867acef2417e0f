"""Bodies as they lie in space."""

import math

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.model.spatial_order import order_of_groups, spatial_order


@pytest.mark.parametrize("threads", [1, 5])
@pytest.mark.parametrize("n", [1, 2, 3, 300, 7000])
def test_bodies_are_listed_row_after_row_and_from_left_to_right(n, threads, monkeypatch):
    """Also those in one corner, on a lattice, and all of them in one place."""
    monkeypatch.setenv("ESH_THREADS", str(threads))
    launcher = Launcher(resolve_device("cpu"))
    size = (30.0, 7.3)
    anywhere = np.random.default_rng(n).random((n, 2)) * size
    try:
        for place in (anywhere, 0.01 * anywhere, np.round(anywhere), np.full((n, 2), 3.0), np.array(size) - anywhere):
            pose = np.zeros((n, 4), np.float32)
            pose[:, :2] = place
            rows = max(1, int(math.sqrt(n / 4.0)))
            row = np.minimum(pose[:, 1] / np.float32(size[1]) * rows, rows - 1).astype(int)
            order = spatial_order(launcher, wp.array(pose, dtype=wp.vec4, device="cpu"), size)
            np.testing.assert_array_equal(order, np.lexsort((pose[:, 0], row)))
    finally:
        launcher.close()


def test_groups_come_one_after_the_other_each_in_rows_of_its_own():
    """A group of 400 has 10 rows of 5 cells, one of 16 has 2 rows, and an empty one nothing; bodies of a cell keep their order."""
    launcher = Launcher(resolve_device("cpu"))
    size, rng = (30.0, 7.3), np.random.default_rng(2)
    group = rng.permutation(np.repeat([0, 2], [400, 16])).astype(np.int32)
    pose = np.zeros((416, 4), np.float32)
    pose[:, :2] = rng.random((416, 2)) * size
    rows, columns = np.where(group == 0, 10, 2), np.where(group == 0, 5, 1)
    row, column = (pose[:, 1] / np.float32(size[1]) * rows).astype(int), (pose[:, 0] / 30.0 * columns).astype(int)
    try:
        given = wp.array(pose, dtype=wp.vec4, device="cpu"), size, launcher.array(group, wp.int32)
        order = order_of_groups(launcher, *given, np.bincount(group, minlength=3)).numpy()
    finally:
        launcher.close()
    np.testing.assert_array_equal(order[:416], np.lexsort((column, row, group)))
