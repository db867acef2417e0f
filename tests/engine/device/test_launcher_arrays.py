"""Arrays that kernels read are the given ones where they can be, and copies of them where they cannot."""

import gc

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import CACHE_LINE, LARGE_ARRAY, Launcher


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


@wp.struct
class Shift:
    way: wp.vec2
    factor: wp.array(dtype=float)


@wp.kernel
def shift_by(
    first: int,
    times: int,
    share: float,
    way: wp.vec2,
    shift: Shift,
    place: wp.array(dtype=wp.vec2),
    result: wp.array(dtype=wp.vec2),
):
    i = first + wp.tid()
    result[i] = place[i] + float(times) * share * (way + shift.factor[i] * shift.way)


def test_every_launch_of_a_kernel_has_its_own_arguments(launcher):
    rng = np.random.default_rng(1)
    for times, share in ((2, 0.5), (3, 1), (-4, 0.25), (5, np.float32(2.0))):
        place = rng.random((50, 2)).astype(np.float32)
        factor = rng.random(50).astype(np.float32)
        shift = Shift()
        shift.way, shift.factor = wp.vec2(1.0, float(times)), wp.array(factor, dtype=float, device="cpu")
        result = launcher.empty(50, wp.vec2)
        inputs = [times, share, wp.vec2(float(share), -1.0), shift, wp.array(place, dtype=wp.vec2, device="cpu")]
        launcher.launch(shift_by, 50, inputs, [result])
        way = np.array([share, -1.0]) + factor[:, None] * np.array([1.0, times])
        np.testing.assert_allclose(result.numpy(), place + times * share * way, rtol=1e-5, atol=1e-5)


def test_what_does_not_fit_a_kernel_is_refused_however_often_it_was_launched(launcher):
    right, result = launcher.zeros(9, float), launcher.zeros(9, float)
    for _ in range(3):
        launcher.launch(add_up, 9, [right], [result])
    wrong = [launcher.zeros(9, wp.float64), launcher.zeros((3, 3), float), launcher.zeros(9, wp.vec2), 3]
    for values in wrong:
        with pytest.raises((RuntimeError, TypeError), match="argument 'values' expects an array"):
            launcher.launch(add_up, 9, [values], [result])
    with pytest.raises(RuntimeError, match="passed 2 arguments"):
        launcher.launch(add_up, 9, [right])


def test_a_recording_holds_the_arrays_of_every_launch(launcher):
    result = [launcher.zeros(20_000, float) for _ in range(6)]

    def run():
        for number, each in enumerate(result):
            # Nobody else holds these.
            launcher.launch(add_up, 20_000, [launcher.array(np.full(20_000, 10.0 * number, np.float32), float)], [each])

    recording = launcher.record(run)
    gc.collect()
    others = [np.full(20_000, -1.0, np.float32) for _ in range(20)]
    recording.play()
    for number, each in enumerate(result):
        assert np.array_equal(each.numpy(), 10.0 * number + np.arange(20_000.0)), len(others)


def kernel_that_adds(addend: float) -> wp.Kernel:
    @wp.kernel(module="esh_test_grows")
    def add(first: int, values: wp.array(dtype=float), result: wp.array(dtype=float)):
        i = first + wp.tid()
        result[i] = values[i] + wp.static(addend)

    return add


def test_a_kernel_is_launched_again_when_its_module_has_got_another(launcher):
    """Its code was let go with the module's, and was carried out nevertheless."""
    result, values = launcher.zeros(9, float), launcher.zeros(9, float)
    kernels = []
    for number in range(4):
        kernels.append(kernel_that_adds(float(number)))
        for addend, kernel in enumerate(kernels):
            launcher.launch(kernel, 9, [values], [result])
            np.testing.assert_array_equal(result.numpy(), np.full(9, addend))
            gc.collect()


@pytest.mark.parametrize("size", [64, LARGE_ARRAY, LARGE_ARRAY + 4])
def test_room_begins_with_a_cache_line_and_zeros_are_zeros(launcher, size):
    assert launcher.empty(size // 4, float).ptr % CACHE_LINE == 0
    zeros = launcher.zeros(size // 4, float)
    assert zeros.ptr % CACHE_LINE == 0
    values = zeros.numpy()
    assert values.shape == (size // 4,)
    assert not values.any()
