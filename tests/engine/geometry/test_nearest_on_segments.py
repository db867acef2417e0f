"""The nearest straight piece is the one that a comparison with all of them finds."""

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.geometry.nearest_on_segments import nearest_on_segments
from esh.engine.problem.surface_directions import AlongCurves, along_segments


def distances(segment, position):
    """Of every point to every piece, one after the other, shape ``[n, s]``."""
    away = np.empty((len(position), len(segment)))
    for number, (start, end) in enumerate(segment):
        side = end - start
        share = np.clip((position - start) @ side / max(side @ side, 1e-300), 0.0, 1.0)
        away[:, number] = np.linalg.norm(position - start - share[:, None] * side, axis=1)
    return away


@pytest.mark.parametrize(
    ("points", "pieces", "spread"), [(3000, 300, 1.0), (40, 5000, 0.02), (2000, 60, 50.0), (1, 1, 1.0)]
)
def test_no_piece_is_nearer(points, pieces, spread):
    rng = np.random.default_rng(5)
    middle = rng.uniform(size=(pieces, 1, 3))
    segment = middle + 0.05 * rng.normal(size=(pieces, 2, 3))
    position = 0.5 + spread * rng.normal(size=(points, 3))
    away = distances(segment, position)
    found = away[np.arange(points), nearest_on_segments(segment, position)]
    np.testing.assert_allclose(found, away.min(axis=1), rtol=1e-9, atol=1e-12)


def test_no_points_have_no_pieces():
    assert nearest_on_segments(np.zeros((1, 2, 3)), np.empty((0, 3))).shape == (0,)


def test_directions_are_those_of_pieces_that_have_a_length():
    segment = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]])
    np.testing.assert_allclose(along_segments(segment, np.zeros((2, 3))), [[0.6, 0.8, 0.0]] * 2)


@pytest.mark.parametrize(
    ("curves", "sentence"),
    [
        ([], "must be curves of some length; got none"),
        ([[0.0, 0.0, 1.0]], "must be two or more points"),
        ([[[0.0, 0.0, 1.0]]], "must be two or more points"),
        ([[0.0, 0.0], [1.0, 1.0]], "must be two or more points"),
        ([[1.0, 2.0, 3.0]] * 2, "must be curves of some length; all have none"),
        ([[0.0, 0.0, np.nan], [1.0, 1.0, 1.0]], "must be finite everywhere"),
        ("path", "must be two or more points"),
        (3.0, "must be two or more points"),
    ],
)
def test_curves_that_are_none_are_refused(curves, sentence):
    with pytest.raises(ProblemError, match=sentence):
        AlongCurves(curves)
