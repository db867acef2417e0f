"""The least and the largest of numbers on a device are those that NumPy finds."""

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.extremes import BLOCK_ON_CPU, extremes
from esh.engine.device.launcher import Launcher


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
@pytest.mark.parametrize("count", [1, 2, 255, BLOCK_ON_CPU, 3 * BLOCK_ON_CPU + 1])
def test_they_are_those_of_all_blocks(device, count):
    launcher = Launcher(resolve_device(device))
    try:
        for seed in range(5):
            values = np.random.default_rng([seed, count]).normal(size=count).astype(np.float32)
            assert extremes(launcher, launcher.array(values, float)) == (values.min(), values.max())
    finally:
        launcher.close()
