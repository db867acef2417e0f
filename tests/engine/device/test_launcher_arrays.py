"""Arrays that kernels read are the given ones where they can be, and copies of them where they cannot."""

import gc

import numpy as np
import pytest
import warp as wp
from esh.engine.device.launcher import Launcher, resolve_device


@pytest.fixture
def launcher():
    launcher = Launcher(resolve_device("cpu"))
    yield launcher
    launcher.close()


def test_an_array_of_the_right_type_is_not_copied(launcher):
    values = np.arange(6, dtype=np.float32)
    array = launcher.array(values, float)
    assert array.ptr == values.ctypes.data
    pairs = np.arange(6.0).reshape(3, 2)
    assert launcher.array(pairs, wp.vec2d).ptr == pairs.ctypes.data
    assert launcher.array(pairs, wp.vec2d).shape == (3,)


@pytest.mark.parametrize(
    ("given", "dtype"),
    [
        (np.arange(6.0), float),
        (np.arange(6, dtype=np.int64), wp.int32),
        (np.arange(12, dtype=np.float32)[::2], float),
        (np.arange(6, dtype=np.float32)[::-1], float),
        (np.array([], np.float32), float),
    ],
    ids=["longer floats", "longer integers", "every other", "backwards", "none"],
)
def test_others_are_converted_and_lie_side_by_side(launcher, given, dtype):
    array = launcher.array(given, dtype)
    np.testing.assert_array_equal(array.numpy(), given)
    assert len(given) < 2 or array.strides[0] == 4


def test_what_it_was_made_of_stays_as_long_as_it_does(launcher):
    array = launcher.array(np.full(1 << 20, 7.0, np.float32), float)
    gc.collect()
    other = np.full(1 << 20, 3.0, np.float32)
    assert (array.numpy() == 7.0).all() and (other == 3.0).all()
