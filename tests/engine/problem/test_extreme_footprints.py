"""Numbers far outside of what can be placed are refused in a sentence; what leans over by more than a right angle is not."""

import math

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.fixed_bodies import FixedBodies
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.slopes import mean_cosine, tilted, tilts

PLANK = Footprint.rectangle(1.0, 0.4)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("room", 1e308),
        ("room", 1e-200),
        ("gap", 1e160),
        ("scale", 1e-320),
        ("scale", 1e300),
        ("scale", [1.0, 1e-30]),
        ("tilt", 1.6),
    ],
)
def test_factors_of_footprints_have_bounds(name, value):
    with pytest.raises(ProblemError, match=f"`{name}`"):
        Footprints(PLANK, **{name: value})


@pytest.mark.parametrize(
    "shape",
    [
        {"disc": np.array(3)},
        {"disc": (1.0, 1.0, 1e308)},
        {"polygon": [(0, 0), (1e308, 0), (0, -1e308)]},
        {"disc": (1.0, 1.0, 1.0), "margin": 1e308},
    ],
)
def test_obstacles_have_bounds(shape):
    with pytest.raises(ProblemError, match="must"):
        Obstacle(**shape)


def test_what_is_no_list_of_classes_is_refused():
    with pytest.raises(ProblemError, match="a name or an index"):
        FixedBodies([[1.0, 1.0]], np.array(3))


@pytest.mark.parametrize("most", [0.3, 1.5, 2.5, math.pi])
def test_what_leans_covers_what_is_seen_of_it(most):
    angle = tilts(most, np.arange(200_000), 1)[:, 0]
    assert mean_cosine(most) == pytest.approx(np.abs(np.cos(angle)).mean(), rel=0.01)


def test_what_is_turned_over_lies_in_the_same_plane():
    level = np.zeros((2, 2))
    lean = np.array([[0.4, 1.0], [0.4 - math.pi, 1.0]])
    upright, over = tilted(level, lean)
    assert upright == pytest.approx(over)
