"""Classes have colors that are told apart, however many there are."""

import numpy as np
import pytest
from esh.engine.drawing.palette import PALETTE, _as_seen, class_colors


@pytest.mark.parametrize("count", [3, 10, 11, 40])
def test_no_two_classes_look_alike(count):
    colors = class_colors(count)
    assert colors[:10] == list(PALETTE)[:count] and len(colors) == count
    seen = _as_seen(np.array(colors))
    unlike = np.linalg.norm(seen[:, None] - seen, axis=2)
    # Those of the palette are 24 apart at least; 2 are just seen side by side.
    assert unlike[np.triu_indices(count, 1)].min() > 24.0
    # On white paper, and beside black rims.
    assert ((seen[:, 0] > 25.0) & (seen[:, 0] < 86.0)).all()


def test_of_very_many_classes_some_share_a_color():
    colors = class_colors(3000)
    assert len(colors) == 3000 and len(set(colors)) > 1000
    assert class_colors(40) == colors[:40]


def test_colors_are_compared_as_they_look():
    expected = [[100.0, 0.0, 0.0], [0.0, 0.0, 0.0], [53.24, 80.09, 67.2], [32.3, 79.19, -107.86]]
    found = _as_seen(np.array([[255, 255, 255], [0, 0, 0], [255, 0, 0], [0, 0, 255]]))
    np.testing.assert_allclose(found, expected, atol=0.1)
