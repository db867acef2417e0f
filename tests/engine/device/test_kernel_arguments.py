"""Arguments of a launch that is made again are passed on without Warp, where they are of the types that they were."""

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.kernel_arguments import KernelArguments
from esh.engine.device.launcher import Launcher

wp.set_module_options({"enable_backward": False})


@wp.kernel
def add(first: int, whole: int, single: float, fine: wp.float64, result: wp.array(dtype=wp.float64)):
    result[first + wp.tid()] = wp.float64(whole) + wp.float64(single) + fine


def test_numbers_of_every_type_are_passed_on():
    result = wp.zeros(1, dtype=wp.float64, device=resolve_device("cpu"))
    given = [0, 1, 0.5, 0.1, result]
    launch = wp.launch(add, dim=1, inputs=given, device="cpu", record_cmd=True)
    arguments = KernelArguments(launch.kernel, given, [type(value) for value in launch.params[1:]])
    assert arguments.passed(given) is not None
    assert arguments.passed([0, 2**31, 0.5, 0.1, result]) is None
    assert arguments.passed([0, 1, 0.5, np.float64(0.1), result]) is None


@pytest.mark.parametrize("fine", [0.1, 1.0 / 3.0])
def test_doubles_keep_all_their_digits(fine):
    launcher = Launcher(resolve_device("cpu"))
    result = launcher.zeros(1, wp.float64)
    for factor in (1.0, 2.0):
        launcher.launch(add, 1, [1, 0.5, factor * fine], [result])
        assert result.numpy()[0] == 1.5 + factor * fine
    launcher.close()
