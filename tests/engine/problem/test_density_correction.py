"""The gray-value correction against discs that are laid out and counted."""

import math

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.density_correction import correct_density, tone_map


def covered_by_honeycomb(density):
    """Share of the plane that unit discs in a honeycomb of this density (summed area per area) cover, by sampling."""
    spacing = math.sqrt(2.0 * math.pi / (math.sqrt(3.0) * density))
    # A fundamental cell, its corners being centers; every point of it is nearest to one of the four.
    u, v = np.meshgrid((np.arange(1500) + 0.5) / 1500, (np.arange(1500) + 0.5) / 1500)
    x, y = spacing * (u + 0.5 * v), spacing * v * math.sqrt(3.0) / 2.0
    inside = np.zeros(u.shape, dtype=bool)
    for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):
        inside |= (x - spacing * (a + 0.5 * b)) ** 2 + (y - spacing * b * math.sqrt(3.0) / 2.0) ** 2 <= 1.0
    return inside.mean()


def test_both_ends():
    touching = 1.0 - math.pi / (2.0 * math.sqrt(3.0))
    assert tone_map(np.array([0.0]))[0] == pytest.approx(1.0 - 2.0 * math.pi / (3.0 * math.sqrt(3.0)), abs=1e-9)
    assert tone_map(np.array([touching]))[0] == pytest.approx(touching, abs=1e-9)
    bright = np.linspace(touching, 1.0, 20)
    np.testing.assert_allclose(tone_map(bright), bright, atol=1e-12)


def test_solves_equation_5_as_printed():
    """From c to the gray value by the paper's own formula, and back through T to c: to 1e-9."""
    c = np.cos(np.geomspace(1e-5, math.pi / 6.0, 200)[::-1])
    c = np.concatenate([c, np.cos(math.pi / 6.0 - np.geomspace(1e-3, math.pi / 6.0, 200))])
    density = math.pi / (2.0 * math.sqrt(3.0) * c**2)
    covered = density * (1.0 - 6.0 / math.pi * (np.arctan(np.sqrt(1.0 / c**2 - 1.0)) - c * np.sqrt(1.0 - c**2)))
    np.testing.assert_allclose(tone_map(1.0 - covered), 1.0 - density, rtol=0.0, atol=1e-9)


def test_one_number_is_mapped_like_an_image():
    assert float(tone_map(0.01)) == tone_map(np.array([[0.01]]))[0, 0]
    assert float(correct_density(1.0)) == pytest.approx(2.0 * math.pi / (3.0 * math.sqrt(3.0)), abs=1e-9)


@pytest.mark.parametrize("gray", [0.0, 0.01, 0.03, 0.06, 0.09, 0.3])
def test_discs_of_the_corrected_density_cover_what_was_asked(gray):
    density = correct_density(np.array([1.0 - gray]))[0]
    assert covered_by_honeycomb(density) == pytest.approx(1.0 - gray, abs=2e-4)
    if 0.0 < gray < 0.09:
        assert abs(covered_by_honeycomb(1.0 - gray) - (1.0 - gray)) > 1e-3


def test_is_monotone_and_keeps_shapes():
    density = np.linspace(0.0, 1.0, 300).reshape(20, 15)
    corrected = correct_density(density)
    assert corrected.shape == density.shape
    assert (np.diff(corrected.ravel()) > 0).all()


@pytest.mark.parametrize("bad", [-0.1, 1.1, np.nan])
def test_what_is_no_share_is_refused(bad):
    with pytest.raises(ProblemError, match="`tint` must be a covered share between 0 and 1"):
        correct_density(np.array([0.5, bad]), "`tint`")
