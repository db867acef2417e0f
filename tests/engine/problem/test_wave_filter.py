"""Cosine transforms against SciPy's, and back."""

import numpy as np
import pytest
from esh.engine.problem.wave_filter import from_cosines, to_cosines

fft = pytest.importorskip("scipy.fft")


@pytest.mark.parametrize("shape", [(2, 2), (7, 12), (12, 7), (33, 1), (64, 45)])
def test_cosines_are_those_of_scipy_and_come_back(shape):
    values = np.random.default_rng(0).normal(size=shape)
    spectrum = to_cosines(values)
    np.testing.assert_allclose(spectrum, 0.25 * fft.dctn(values, type=2), atol=1e-12)
    np.testing.assert_allclose(from_cosines(spectrum), values, atol=1e-13)
