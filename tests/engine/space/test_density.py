"""Integrals of piecewise constant images, against sums over ever finer pixels."""

import tracemalloc

import numpy as np
import pytest
from esh.engine.space.density import box_integrals, move_into_support, sample_density, spline_deposit

IMAGE = np.random.default_rng(0).random((6, 4)).astype(np.float32)


def test_box_integrals_keep_orientation_and_total():
    image = np.array([[1.0, 0.0], [0.0, 3.0]])
    result = box_integrals(image, (2, 2))
    # Row 0 of an image is its top; row 0 of a grid is its bottom.
    np.testing.assert_allclose(result, [[0.0, 0.75], [0.25, 0.0]])


@pytest.mark.parametrize("shape", [(6, 4), (12, 8), (5, 9), (1, 1), (31, 2)])
def test_box_integrals_equal_those_of_a_finer_image(shape):
    fine = np.kron(IMAGE, np.ones((5 * 31 * 2, 9 * 2 * 4), dtype=np.float64))[::-1]
    rows = np.add.reduceat(fine, np.arange(shape[0]) * fine.shape[0] // shape[0], axis=0)
    expected = np.add.reduceat(rows, np.arange(shape[1]) * fine.shape[1] // shape[1], axis=1)
    if fine.shape[0] % shape[0] == 0 and fine.shape[1] % shape[1] == 0:
        np.testing.assert_allclose(box_integrals(IMAGE, shape), expected / expected.sum(), rtol=1e-5)
    assert box_integrals(IMAGE, shape).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("periodic", [False, True])
def test_spline_deposit_equals_that_of_many_points(periodic):
    size, shape, margin = (4.0, 6.0), (18, 12) if periodic else (23, 17), 0 if periodic else 2
    spacing = (4.0 / 12, 6.0 / 18)
    actual = spline_deposit(IMAGE, size, shape, spacing, margin, periodic)
    per = 120
    expected = np.zeros(shape)
    weights = []
    for axis, (nodes, length, step) in enumerate(zip(shape, size[::-1], spacing[::-1], strict=True)):
        pixels = IMAGE.shape[axis]
        point = (np.arange(pixels * per) + 0.5) / (pixels * per) * length / step + margin
        w = np.zeros((nodes, pixels * per))
        first = np.floor(point).astype(int) - 1
        for k in range(4):
            x = np.abs(point - first - k)
            value = np.where(x < 1, (4 - 6 * x**2 + 3 * x**3) / 6, np.maximum(2 - x, 0) ** 3 / 6)
            np.add.at(w, ((first + k) % nodes if periodic else first + k, np.arange(pixels * per)), value)
        weights.append(w.reshape(nodes, pixels, per).mean(axis=2))
    expected = weights[0] @ IMAGE[::-1].astype(float) @ weights[1].T
    np.testing.assert_allclose(actual, expected / expected.sum(), rtol=0, atol=1e-6)


def test_sample_density_reads_the_pixel_under_a_point():
    image = np.array([[1.0, 2.0], [3.0, 4.0]])
    at = np.array([[0.1, 2.9], [3.9, 2.9], [0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    np.testing.assert_array_equal(sample_density(image, at, (4.0, 3.0)), [1.0, 2.0, 3.0, 4.0, 2.0])


@pytest.mark.parametrize("periodic", [False, True])
def test_the_devices_deposit_equals_the_hosts(periodic):
    from esh.engine.device.devices import resolve_device
    from esh.engine.device.launcher import Launcher
    from esh.engine.space.mesh_layout import open_mesh, periodic_mesh
    from esh.engine.space.space import Space
    from esh.engine.space.target_deposit import deposit_images, mix_images

    size = (5.0, 3.0)
    lay = periodic_mesh if periodic else open_mesh
    layout = lay(Space(size, periodic), 0.08, on_gpu=False)
    images = [IMAGE, np.random.default_rng(1).random((97, 150)).astype(np.float32), np.ones((1, 1), np.float32)]
    launcher = Launcher(resolve_device("cpu"))
    deposited = deposit_images(launcher, images, layout)
    expected = [spline_deposit(image, size, layout.shape, layout.spacing, layout.margin, periodic) for image in images]
    actual = deposited.numpy().reshape(3, *layout.shape)
    np.testing.assert_allclose(actual, expected, rtol=2e-5, atol=1e-10)
    weight = np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 4.0]])
    mixed = mix_images(launcher, deposited, weight, layout.node_count).numpy().reshape(2, *layout.shape)
    np.testing.assert_allclose(mixed, np.tensordot(weight, expected, axes=1), rtol=1e-4, atol=1e-9)
    launcher.close()


def test_bodies_far_from_all_support_find_it_whatever_the_resolution():
    """The nearest pixel within a quarter of a circle's error, without a look at all pixels for each body."""
    image = np.zeros((512, 512), np.float32)
    image[100, 400] = image[300, 20] = 1.0
    position = np.random.default_rng(0).random((200, 2)) * [2.0, 1.0]
    moved = move_into_support(image, position, (2.0, 1.0))
    pixel = np.array([2.0, 1.0]) / 512
    full = (np.array([[400, 511 - 100], [20, 511 - 300]]) + 0.5) * pixel
    away = np.linalg.norm(moved[:, None] - full, axis=2)
    assert (np.abs(moved[:, None] - full) <= 0.5 * pixel).all(axis=2).any(axis=1).all()
    nearest = np.abs((position[:, None] - full) / pixel).max(axis=2).argmin(axis=1)
    assert (away.argmin(axis=1) == nearest).mean() > 0.8


@pytest.mark.parametrize("shape", [(1, 200_000), (200_000, 1)])
def test_an_image_of_one_row_is_not_made_as_high_as_a_mesh(shape):
    image = np.random.default_rng(4).random(shape)
    tracemalloc.start()
    try:
        cells = box_integrals(image, (200, 200))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    # 200 rows of 200,000 pixels would take 320 MB.
    assert peak < 60e6
    blocks = image.ravel().reshape(200, 1000).sum(axis=1) / image.sum() / 200.0
    expected = np.tile(blocks, (200, 1)) if shape[0] == 1 else np.tile(blocks[::-1, None], (1, 200))
    np.testing.assert_allclose(cells, expected, rtol=1e-9)
