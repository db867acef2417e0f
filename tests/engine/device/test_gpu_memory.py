"""Memory that many small arrays share: it works on any device of Warp, though only GPUs need it."""

import numpy as np
import pytest
import warp as wp
from esh.engine.device.gpu_memory import GpuMemory

wp.set_module_options({"enable_backward": False})


@wp.kernel
def double(value: wp.array(dtype=float), result: wp.array(dtype=float)):
    i = wp.tid()
    result[i] = 2.0 * value[i]


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def test_what_still_waits_to_be_sent_is_sent_when_it_is_read(device):
    memory = GpuMemory(wp.get_device(device))
    one, vectors = memory.array(np.arange(5.0), float), memory.array(np.eye(3), wp.vec3)
    np.testing.assert_array_equal(one.numpy(), np.arange(5.0))
    np.testing.assert_array_equal(vectors.numpy(), np.eye(3))
    # What comes after that waits again.
    other = memory.array(np.full(4, 7), wp.int32)
    np.testing.assert_array_equal(other.numpy(), [7, 7, 7, 7])


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def test_kernels_read_what_was_sent(device):
    memory = GpuMemory(wp.get_device(device))
    values, result = memory.array(np.arange(5.0), float), memory.zeros(5, float)
    memory.send()
    wp.launch(double, 5, inputs=[values], outputs=[result], device=device)
    np.testing.assert_array_equal(result.numpy(), 2.0 * np.arange(5.0))
