"""What tests of fields share."""

import numpy as np
import pytest


def _variances_of(field):
    """Variance of the field's blur at positions: bilinear between the nodes of its fine mesh."""
    layout = field.fine_layout
    variance = field.blur.variance.numpy().reshape(layout.shape)

    def at(position):
        node = position / layout.spacing + layout.margin
        low = np.floor(node).astype(int)
        u, v = (node - low).T
        (left, bottom), (right, top) = (((low + k) % layout.shape[::-1]).T for k in (0, 1))
        lower = (1.0 - u) * variance[bottom, left] + u * variance[bottom, right]
        upper = (1.0 - u) * variance[top, left] + u * variance[top, right]
        return (1.0 - v) * lower + v * upper

    return at


@pytest.fixture(scope="session")
def variances_of():
    """A function that gives, for a field, a function from positions to the variance of a mean charge's blur there."""
    return _variances_of
