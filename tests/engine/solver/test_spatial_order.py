"""Bodies as they lie in space."""

import math

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.solver.spatial_order import spatial_order


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
