"""Ways to where a density is above zero: images that are so in the same pixels share them."""

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.space import support


def test_images_above_zero_in_the_same_pixels_are_searched_once(monkeypatch):
    random = np.random.default_rng(3)
    inside = random.random((24, 40)) > 0.7
    images = [np.where(inside, random.uniform(0.1, 1.0, inside.shape), 0.0).astype(np.float32) for _ in range(3)]
    images.append(np.where(random.random(inside.shape) > 0.5, 1.0, 0.0).astype(np.float32))
    searched, honest = [], support.vectors_to_support

    def counted(launcher, image, size):
        searched.append(image)
        return honest(launcher, image, size)

    monkeypatch.setattr(support, "vectors_to_support", counted)
    launcher = Launcher(resolve_device("cpu"))
    made = support.images_for_kernels(launcher, images, (10.0, 6.0))
    assert len(searched) == 2
    found = made.to_support.numpy().reshape(4, -1, 2)
    for image, vectors in zip(images, found, strict=True):
        assert vectors.tobytes() == honest(launcher, image, (10.0, 6.0)).numpy().tobytes()
        assert not vectors[image.ravel() > 0.0].any() and vectors[image.ravel() == 0.0].any(axis=1).all()
    # What the images hold stays their own.
    assert made.pixel.numpy().tobytes() == np.concatenate([image.ravel() for image in images]).tobytes()


def test_depths_are_distances_from_the_nearest_empty_pixel():
    """Pixels are wider than high; what is beyond the image is not empty."""
    row, column = np.indices((24, 40))
    image = np.where(np.hypot(row - 9.0, column - 14.0) < 4.0, 0.0, 0.5).astype(np.float32)
    image[20, 33] = 0.0
    launcher = Launcher(resolve_device("cpu"))
    depth = support.depth_in_support(launcher, image, (20.0, 6.0))
    center = np.stack([column * 0.5, row * 0.25], axis=2)
    way = center[:, :, None] - center[image == 0.0]
    np.testing.assert_allclose(depth, np.hypot(way[..., 0], way[..., 1]).min(axis=2), rtol=1e-5)
    assert np.isinf(support.depth_in_support(launcher, np.ones((3, 5), np.float32), (5.0, 3.0))).all()


@pytest.mark.parametrize("share", [0.003, 0.05, 0.6])
def test_ways_lead_to_the_nearest_pixel(share):
    """Also where pixels are far from square, and whole columns and rows are empty."""
    random = np.random.default_rng(7)
    launcher = Launcher(resolve_device("cpu"))
    for height, width, size in ((31, 40, (4.0, 3.1)), (40, 23, (23.0, 4.0)), (1, 50, (5.0, 9.0)), (37, 1, (2.0, 1.0))):
        image = (random.random((height, width)) < share).astype(np.float32)
        image[random.integers(height), random.integers(width)] = 0.3
        row, column = np.indices(image.shape)
        center = np.stack([(column + 0.5) * size[0] / width, -(row + 0.5) * size[1] / height], axis=-1).reshape(-1, 2)
        inside = center[image.ravel() > 0.0]
        way = support.vectors_to_support(launcher, image, size).numpy()
        reached = np.linalg.norm((center + way)[:, None] - inside, axis=2).min(axis=1)
        assert reached.max() < 1e-5 * max(size), "they lead into the support"
        nearest = np.linalg.norm(center[:, None] - inside, axis=2).min(axis=1)
        np.testing.assert_allclose(np.linalg.norm(way, axis=1), nearest, rtol=1e-5, atol=1e-6)
    assert not support.vectors_to_support(launcher, np.zeros((5, 7), np.float32), (7.0, 5.0)).numpy().any()
