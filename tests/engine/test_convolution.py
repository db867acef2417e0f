"""Convolution by the engine's own transforms against NumPy's."""

import numpy as np
import pytest
import warp as wp
from esh.engine.convolution import Convolution, good_length
from esh.engine.convolution_gpu import GpuTransforms
from esh.engine.device import Launcher, resolve_device

SHAPES = [((37, 50), (96, 128)), ((64, 64), (64, 64)), ((100, 30), (384, 64)), ((17, 190), (64, 192))]


def fields_and_influence(shape, padded):
    rng = np.random.default_rng(0)
    fields = rng.standard_normal((2, *shape)).astype(np.float32)
    ky, kx = np.fft.fftfreq(padded[0])[:, None], np.fft.fftfreq(padded[1])[None, :]
    influence = np.exp(-20.0 * (kx**2 + 2.0 * ky**2)) / (padded[0] * padded[1])
    expected = [
        np.fft.ifft2(np.fft.fft2(field, padded) * influence).real[: shape[0], : shape[1]] * (padded[0] * padded[1])
        for field in fields
    ]
    return fields, influence, np.stack(expected)


@pytest.mark.parametrize(("shape", "padded"), SHAPES)
def test_equals_numpy(shape, padded):
    launcher = Launcher(resolve_device("cpu"))
    fields, influence, expected = fields_and_influence(shape, padded)
    convolution = Convolution(launcher, shape, padded)
    arrays = [wp.array(field.ravel(), dtype=float, device="cpu") for field in fields]
    results = [wp.zeros_like(array) for array in arrays]
    convolution.apply(convolution.influence_array(influence[: padded[0] // 2 + 1]), tuple(arrays), tuple(results))
    actual = np.stack([result.numpy().reshape(shape) for result in results])
    assert np.abs(actual - expected).max() < 2e-6 * np.abs(expected).max()


def test_tile_transforms_of_gpus_equal_numpy():
    """The GPU's code path also runs on the CPU, slowly: small transforms check its logic on every machine."""
    shape, padded = (37, 100), (128, 256)
    device = resolve_device("auto")
    fields, influence, expected = fields_and_influence(shape, padded)
    arrays = [wp.array(field.ravel(), dtype=float, device=device) for field in fields]
    results = [wp.zeros_like(array) for array in arrays]
    folded = wp.array(influence[: padded[0] // 2 + 1].astype(np.float32).ravel(), dtype=float, device=device)
    GpuTransforms(device, shape, padded).apply(folded, tuple(arrays), tuple(results))
    actual = np.stack([result.numpy().reshape(shape) for result in results])
    assert np.abs(actual - expected).max() < 2e-6 * np.abs(expected).max()


@pytest.mark.parametrize("least", [1, 64, 65, 96, 97, 1000.5, 3000])
def test_good_length(least):
    length = good_length(least)
    assert length >= least
    assert length < max(1.5 * least + 1, 65)
    while length % 2 == 0:
        length //= 2
    assert length in (1, 3)
    power = good_length(least, power_of_two=True)
    assert power >= least
    assert power & (power - 1) == 0
