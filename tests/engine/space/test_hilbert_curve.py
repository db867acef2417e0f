"""Hilbert's curve through cells."""

import numpy as np
from esh.engine.space.hilbert_curve import along_hilbert_curve


def test_the_curve_goes_from_every_cell_to_one_beside_it():
    row, column = np.divmod(np.arange(32 * 32), 32)
    along = along_hilbert_curve(column, row)
    order = np.argsort(along)
    assert set(np.abs(np.diff(row[order])) + np.abs(np.diff(column[order]))) == {1}
    np.testing.assert_array_equal(along[order], np.arange(32 * 32))


def test_one_cell_and_none_have_their_places_too():
    assert along_hilbert_curve(np.array([0]), np.array([0])).tolist() == [0]
    assert along_hilbert_curve(np.zeros(0, int), np.zeros(0, int)).tolist() == []
