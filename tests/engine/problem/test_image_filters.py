"""Blur and unsharp masking: against SciPy, and by what they must keep."""

import warnings

import numpy as np
import pytest
from esh.engine.problem.image_filters import gaussian_blur, local_range, unsharp_mask
from hypothesis import given, settings
from hypothesis import strategies as st


def noise(height, width, seed=0):
    return np.random.default_rng(seed).random((height, width))


@pytest.mark.parametrize("shape", [(40, 61), (1, 30), (30, 1), (7, 5), (2, 2), (1, 1)])
@pytest.mark.parametrize("sigma", [0.3, 1.0, 2.0, 3.0, 3.2, 9.0, 40.0])
def test_blur_equals_scipys(shape, sigma):
    ndimage = pytest.importorskip("scipy.ndimage")
    image = noise(*shape)
    # Up to 3 pixels the same samples; beyond, what SciPy's sum would be if nothing were cut.
    expected = ndimage.gaussian_filter(image, sigma, mode="reflect", truncate=4.0 if sigma <= 3.0 else 12.0)
    np.testing.assert_allclose(gaussian_blur(image, sigma), expected, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 30), st.integers(1, 30), st.floats(0.05, 200.0), st.integers(0, 1000))
def test_blur_keeps_mean_constants_range_and_mirror_images(height, width, sigma, seed):
    image = noise(height, width, seed)
    blurred = gaussian_blur(image, sigma)
    assert blurred.dtype == np.float64 and blurred.shape == image.shape
    assert blurred.mean() == pytest.approx(image.mean(), abs=1e-12)
    assert image.min() - 1e-12 <= blurred.min() and blurred.max() <= image.max() + 1e-12
    np.testing.assert_allclose(gaussian_blur(np.full((height, width), 0.7), sigma), 0.7, atol=1e-12)
    np.testing.assert_allclose(gaussian_blur(image[::-1], sigma)[::-1], blurred, atol=1e-12)
    np.testing.assert_allclose(gaussian_blur(image[:, ::-1], sigma)[:, ::-1], blurred, atol=1e-12)
    np.testing.assert_allclose(gaussian_blur(image.T, sigma).T, blurred, atol=1e-12)


def test_rows_of_any_number_are_blurred_alike(monkeypatch):
    image = noise(50, 40)
    for sigma in (1.5, 8.0):
        whole = gaussian_blur(image, sigma)
        monkeypatch.setattr("esh.engine.problem.image_filters.BLOCK_BYTES", 8 * 40 * 7)
        np.testing.assert_array_equal(gaussian_blur(image, sigma), whole)
        monkeypatch.undo()


@pytest.mark.parametrize("sigma", [5e-324, 1e-200, 1e-3])
def test_a_blur_narrower_than_a_pixel_changes_nothing(sigma):
    image = noise(12, 9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(gaussian_blur(image, sigma), image)


@pytest.mark.parametrize("sigma", [1e4, 1e300, 1.7e308])
def test_a_blur_wider_than_any_image_is_the_mean(sigma):
    image = noise(12, 9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_allclose(gaussian_blur(image, sigma), image.mean(), rtol=1e-12)


@pytest.mark.parametrize("sigma", [2.0, 10.0])
def test_variances_of_blurs_add_up(sigma):
    image = noise(64, 80)
    twice = gaussian_blur(gaussian_blur(image, sigma), sigma)
    # Cutting at 4 standard deviations leaves some 1e-4 of it.
    np.testing.assert_allclose(twice, gaussian_blur(image, np.sqrt(2.0) * sigma), atol=2e-4)


def test_the_given_image_is_left_alone():
    image = noise(20, 20)
    before = image.copy()
    unsharp_mask(image, 2.0, 1.0)
    np.testing.assert_array_equal(image, before)


def test_an_amount_of_zero_and_a_constant_change_nothing():
    image = noise(20, 31).astype(np.float32)
    np.testing.assert_array_equal(unsharp_mask(image, 0.0, 2.0)[0], image)
    for radius in (0.5, 2.0, 30.0):
        sharpened, clipped = unsharp_mask(np.full((20, 31), 0.3), 5.0, radius)
        np.testing.assert_allclose(sharpened, 0.3, atol=1e-12)
        assert clipped == 0.0


def test_unsharp_masking_overshoots_on_both_sides_of_an_edge():
    step = np.tile(np.where(np.arange(60) < 30, 0.4, 0.6), (10, 1))
    sharpened, clipped = unsharp_mask(step, 1.0, 2.0, 1.0)
    assert clipped == 0.0
    assert sharpened[:, 29].max() < 0.4 < 0.6 < sharpened[:, 30].min()
    # An edge's overshoot is antisymmetric, and the mean stays what it was.
    np.testing.assert_allclose(sharpened + sharpened[:, ::-1], 1.0, atol=1e-12)
    np.testing.assert_allclose(sharpened[:, :15], 0.4, atol=1e-6)


def test_the_share_that_is_clipped_is_counted():
    step = np.tile(np.where(np.arange(60) < 30, 0.0, 1.0), (10, 1))
    sharpened, clipped = unsharp_mask(step, 1.0, 2.0, 1.0)
    unclipped = step + (step - gaussian_blur(step, 2.0))
    assert clipped == np.mean(unclipped < 0.0)
    # The 8 pixels left of the edge: 4 standard deviations.
    assert clipped == 8 / 60
    assert sharpened.min() == 0.0
    np.testing.assert_allclose(sharpened[:, 30:], unclipped[:, 30:])
    assert unsharp_mask(np.zeros((5, 5)), 3.0, 1.0)[1] == 0.0


@pytest.mark.parametrize("shape", [(31, 44), (1, 20), (3, 2), (1, 1)])
@pytest.mark.parametrize("reach", [0, 1, 2, 5, 100])
def test_the_local_range_is_scipys(shape, reach):
    ndimage = pytest.importorskip("scipy.ndimage")
    image = noise(*shape)
    low, high = local_range(image, reach)
    # A window that reaches beyond both borders sees no more than the whole.
    size = 2 * min(reach, max(shape)) + 1
    np.testing.assert_array_equal(low, ndimage.minimum_filter(image, size, mode="nearest"))
    np.testing.assert_array_equal(high, ndimage.maximum_filter(image, size, mode="nearest"))


def test_rough_ground_beside_an_edge_does_not_become_its_halo():
    """At the foot of an edge every pixel has a darker and a brighter one beside it, which is no part of the edge."""
    x = np.arange(80) - 39.5
    image = np.where(x < 0.0, 0.3, 0.9) + 0.1 * noise(200, 80)
    foot = (unsharp_mask(image, 1.5, 2.0)[0] - image)[:, 36:38].mean()
    plain = (unsharp_mask(image, 1.5, 2.0, overshoot=1.0)[0] - image)[:, 36:38].mean()
    assert abs(foot) < 0.005 and plain < -0.05
    # Far from the edge the ground itself is sharpened.
    assert unsharp_mask(image, 1.5, 2.0)[0][:, :20].std() > 1.1 * image[:, :20].std()


def test_sharpening_leaves_no_halos_and_makes_soft_edges_steeper():
    x = np.arange(80) - 39.5
    step = np.tile(np.where(x < 0.0, 0.3, 0.9), (9, 1))
    np.testing.assert_allclose(unsharp_mask(step, 1.0, 2.0)[0], step, atol=1e-12)
    soft = np.tile(0.6 + 0.3 * np.tanh(x / 3.0), (9, 1))
    sharpened, clipped = unsharp_mask(soft, 2.0, 2.0)
    low, high = (soft + 0.45 * (end - soft) for end in local_range(soft, 1))
    assert clipped == 0.0 and (low <= sharpened + 1e-12).all() and (sharpened <= high + 1e-12).all()
    steepest = np.diff(soft[4]).max()
    assert np.diff(sharpened[4]).max() > 1.05 * steepest
    # Half of the overshoot is half of the way to plain unsharp masking.
    plain, half = (unsharp_mask(soft, 2.0, 2.0, share)[0] for share in (1.0, 0.5))
    np.testing.assert_allclose(half, 0.5 * (sharpened + plain), atol=1e-12)
