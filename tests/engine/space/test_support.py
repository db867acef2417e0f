"""Ways to where a density is above zero: images that are so in the same pixels share them."""

import numpy as np
from esh.engine.device.launcher import Launcher, resolve_device
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
