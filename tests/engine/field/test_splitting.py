"""The split of the kernel: its near and far part are one kernel, and its transform is that of its density."""

import numpy as np
import pytest
from esh.engine.field import splitting

CUTOFF = 3.0


def outside(r):
    v = 1.0 - (np.asarray(r) / CUTOFF) ** 2
    return np.polynomial.polynomial.polyval(v, splitting.outside_share())


def test_share_outside_goes_from_all_to_nothing():
    r = np.linspace(0.0, CUTOFF, 301)
    share = outside(r)
    assert share[0] == pytest.approx(1.0, abs=1e-12)
    assert share[-1] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(share) <= 0.0).all()


def test_near_and_far_part_are_the_whole_kernel():
    """The force of the far part's potential, by differences, and that of the near part, N / r, add up to 1 / r."""
    r = np.linspace(0.05, 0.98, 94) * CUTOFF

    def far(at):
        v = 1.0 - (at / CUTOFF) ** 2
        return -np.log(CUTOFF) + 0.5 * np.polynomial.polynomial.polyval(v, splitting.smoothed_potential())

    force = -(far(r + 1e-5) - far(r - 1e-5)) / 2e-5
    np.testing.assert_allclose(force + outside(r) / r, 1.0 / r, rtol=1e-6)
    assert far(CUTOFF) == pytest.approx(-np.log(CUTOFF))


def test_variance_is_that_of_the_spread_charge():
    r = np.linspace(0.0, CUTOFF, 20001)
    middle = 0.5 * (r[1:] + r[:-1])
    variance = 0.5 * (-np.diff(outside(r)) * middle**2).sum()
    assert splitting.split_variance(CUTOFF) == pytest.approx(variance, rel=2e-4)


def test_height_divides_the_transform_to_one():
    """The transform at wave number 0 is I1(beta) / beta, the integral of I0(beta sqrt(1 - t²)) t."""
    t = (np.arange(200_000) + 0.5) / 200_000
    assert splitting.height_of_transform() == pytest.approx(
        (np.i0(splitting.BETA * np.sqrt(1.0 - t**2)) * t).mean(), rel=1e-6
    )
