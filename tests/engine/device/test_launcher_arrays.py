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


@wp.kernel
def add_up(first: int, values: wp.array(dtype=float), result: wp.array(dtype=float)):
    i = first + wp.tid()
    result[i] = values[i] + float(i)


@pytest.mark.parametrize("values", [np.broadcast_to(2.5, 5000), np.full(5000, 2.5), np.arange(5000.0)])
def test_what_is_the_same_of_all_is_there_once(launcher, values):
    array, result = launcher.alike(values, float), launcher.empty(5000, float)
    assert array.shape == (5000,) and (array.strides == (0,)) == (values.strides == (0,))
    gc.collect()
    launcher.launch(add_up, 5000, [array], [result])
    np.testing.assert_array_equal(result.numpy(), values.astype(np.float32) + np.arange(5000, dtype=np.float32))


def test_an_array_for_all_kernels_is_filled(launcher):
    """Some kernels ask for addresses, so that every element must be there."""
    array = launcher.array(np.broadcast_to(np.int32(7), 5000), wp.int32)
    assert array.strides == (4,)
    np.testing.assert_array_equal(array.numpy(), np.full(5000, 7))
