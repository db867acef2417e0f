"""Inverses and determinants of many small matrices."""

from __future__ import annotations

import numpy as np
from esh.engine.geometry.small_matrices import determinants, inverses


def test_they_are_those_of_numpy():
    matrix = np.random.default_rng(0).normal(size=(50, 3, 3))
    np.testing.assert_allclose(inverses(matrix), np.linalg.inv(matrix), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(determinants(matrix), np.linalg.det(matrix), rtol=1e-9, atol=1e-12)
    assert inverses(matrix[:0]).shape == (0, 3, 3) and determinants(matrix[:0]).shape == (0,)
