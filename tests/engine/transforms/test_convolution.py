"""Convolution by the engine's own transforms against NumPy's."""

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.transforms.convolution import Convolution, good_length
from esh.engine.transforms.convolution_gpu import GpuTransforms

SHAPES = [
    ((38, 50), (96, 128)),
    ((64, 64), (64, 64)),
    ((100, 30), (384, 64)),
    ((17, 190), (160, 192)),
    ((1, 80), (64, 80)),
]


def mesh_and_kernel(shape, padded):
    """Three meshes, a quarter of an even kernel, and their convolutions by NumPy."""
    rng = np.random.default_rng(0)
    mesh = rng.standard_normal((3, *shape)).astype(np.float32)
    y, x = np.abs(np.fft.fftfreq(padded[0])), np.abs(np.fft.fftfreq(padded[1]))
    kernel = np.exp(-20.0 * (x**2 + 2.0 * y[:, None] ** 2)) * np.cos(9.0 * x + 4.0 * y[:, None])
    kernel /= np.abs(kernel).sum()
    spectrum = np.fft.fft2(kernel).real
    expected = np.fft.ifft2(np.fft.fft2(mesh, padded) * spectrum).real[:, : shape[0], : shape[1]]
    # The engine leaves it to the influence function to divide by the number of elements.
    return mesh, kernel[: padded[0] // 2 + 1] / kernel.size, expected


@pytest.mark.parametrize(("shape", "padded"), SHAPES)
def test_equals_numpy(shape, padded):
    launcher = Launcher(resolve_device("cpu"))
    mesh, kernel, expected = mesh_and_kernel(shape, padded)
    convolution = Convolution(launcher, shape, padded, 3)
    influence = convolution.influence_of(wp.array(kernel.ravel(), dtype=float, device="cpu"))
    actual = wp.array(mesh.ravel(), dtype=float, device="cpu")
    convolution.apply(influence, actual)
    assert np.abs(actual.numpy().reshape(expected.shape) - expected).max() < 5e-6 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("shape", "padded"),
    [
        ((38, 100), (128, 256)),
        ((64, 64), (64, 64)),
        ((300, 20), (512, 64)),
        ((40, 600), (64, 1024)),
        ((2, 1500), (64, 2048)),
        ((2, 3000), (64, 4096)),
        ((4, 9000), (64, 16384)),
        ((5000, 3), (8192, 64)),
    ],
)
def test_transforms_of_gpus_equal_numpy(shape, padded):
    """The GPU's code path also runs on the CPU, slowly: small transforms check its logic on every machine."""
    device = resolve_device("auto")
    mesh, kernel, expected = mesh_and_kernel(shape, padded)
    transforms = GpuTransforms(device, shape, padded, 3)
    influence = wp.empty(int(np.prod(transforms.influence_shape)), dtype=float, device=device)
    transforms.transform_even(wp.array(kernel.ravel(), dtype=float, device=device), influence)
    actual = wp.array(mesh.ravel(), dtype=float, device=device)
    transforms.apply(influence, actual, actual)
    assert np.abs(actual.numpy().reshape(expected.shape) - expected).max() < 5e-6 * np.abs(expected).max()


@pytest.mark.parametrize(("shape", "padded"), [((38, 100), (128, 256)), ((300, 20), (512, 64))])
def test_sums_on_gpus_equal_numpy(shape, padded):
    """Every mesh is in both sums, once and three times as strong."""
    device = resolve_device("auto")
    mesh, kernel, expected = mesh_and_kernel(shape, padded)
    transforms = GpuTransforms(device, shape, padded)
    once, thrice = (wp.empty(int(np.prod(transforms.influence_shape)), dtype=float, device=device) for _ in range(2))
    for influence, factor in ((once, 1.0), (thrice, 3.0)):
        transforms.transform_even(wp.array(factor * kernel.ravel(), dtype=float, device=device), influence)
    result = wp.empty(2 * int(np.prod(shape)), dtype=float, device=device)
    meshes = (wp.array(each.ravel(), dtype=float, device=device) for each in mesh)
    transforms.add_up([[once, thrice, once], [thrice, once, once]], meshes, result)
    sums = np.einsum("kj,jyx->kyx", [[1.0, 3.0, 1.0], [3.0, 1.0, 1.0]], expected)
    assert np.abs(result.numpy().reshape(sums.shape) - sums).max() < 5e-6 * np.abs(sums).max()


@pytest.mark.parametrize("meshes", [1, 2, 3])
@pytest.mark.parametrize("device", ["cpu", "auto"])
def test_sums_are_those_of_convolutions(device, meshes):
    """Of two kernels, one three times as strong as the other; what is strong in one sum is weak in the other."""
    launcher, shape, padded = Launcher(resolve_device(device)), (38, 100), (128, 256)
    mesh, kernel, expected = mesh_and_kernel(shape, padded)
    convolution = Convolution(launcher, shape, padded)
    once, thrice = (convolution.influence_of(launcher.array((factor * kernel).ravel(), float)) for factor in (1.0, 3.0))
    strengths = np.array([[1.0, 3.0, 1.0], [3.0, 1.0, 3.0]])[: min(meshes, 2), :meshes]
    influences = [[once if strength == 1.0 else thrice for strength in of_sum] for of_sum in strengths]
    result = launcher.empty(len(influences) * int(np.prod(shape)), float)
    convolution.add_up(influences, (launcher.array(each.ravel(), float) for each in mesh[:meshes]), result)
    sums = np.einsum("kj,jyx->kyx", strengths, expected[:meshes])
    assert np.abs(result.numpy().reshape(sums.shape) - sums).max() < 5e-6 * np.abs(sums).max()


def test_influence_of_a_kernel_is_its_transform():
    launcher = Launcher(resolve_device("cpu"))
    padded = (96, 80)
    _, kernel, _ = mesh_and_kernel((10, 10), padded)
    convolution = Convolution(launcher, (10, 10), padded)
    influence = convolution.influence_of(wp.array(kernel.ravel(), dtype=float, device="cpu")).numpy()
    whole = np.concatenate([kernel, kernel[-2:0:-1]])
    expected = np.fft.rfft2(whole).real
    along_y, along_x = convolution.influence_strides
    for j in range(convolution.influence_rows):
        for k in range(padded[1] // 2 + 1):
            assert influence[j * along_y + k * along_x] == pytest.approx(expected[j, k], abs=1e-6 * expected.max())


@pytest.mark.parametrize("least", [1, 64, 65, 81, 96, 97, 1000.5, 3000])
def test_good_length(least):
    length = good_length(least)
    assert length >= least
    assert length < max(4.0 / 3.0 * least + 1, 65)
    while length % 2 == 0:
        length //= 2
    assert length in (1, 3, 5)
    power = good_length(least, power_of_two=True)
    assert power >= least
    assert power & (power - 1) == 0
