"""Values beyond every bound, and arrays without an axis, end in a sentence."""

import numpy as np
import pytest
from esh import FixedBodies, Footprint, Footprints, Obstacle, ProblemError

PLANK = Footprint.rectangle(1.0, 0.4)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("room", 1e308),
        ("room", 1e160),
        ("room", 1e-200),
        ("gap", 1e308),
        ("gap", 1e160),
        ("scale", 1e-320),
        ("scale", 1e300),
        ("scale", [1.0, 1e-30]),
        ("tilt", 1.6),
    ],
)
def test_settings_of_footprints_have_bounds(name, value):
    with pytest.raises(ProblemError, match=rf"`{name}` .*must (be|lie)"):
        Footprints(PLANK, **{name: value})
    assert Footprints(PLANK, gap=0.5).gap == 0.5 and Footprints(PLANK, scale=1e-8).scale == 1e-8


@pytest.mark.parametrize("value", [1e308, 1e160])
def test_obstacles_have_bounds(value):
    for shape in (
        {"disc": (0.0, 0.0, 1.0), "margin": value},
        {"disc": (1.0, 1.0, value)},
        {"ball": (-value, 1.0, 1.0, 1.0)},
        {"polygon": [(-value, 0.0), (value, 0.0), (0.0, value)]},
    ):
        with pytest.raises(ProblemError, match=r"must (be|lie)"):
            Obstacle(**shape)
    assert Obstacle(disc=(1e6, 0.0, 1.0)).disc[0] == 1e6


@pytest.mark.parametrize("value", [np.array(3), np.array("oak"), np.ma.masked])
def test_arrays_without_an_axis_are_refused(value):
    with pytest.raises(ProblemError, match=r"`obstacle\.disc` must be x, y"):
        Obstacle(disc=value)
    with pytest.raises(ProblemError, match="must be a name or an index"):
        FixedBodies([[1.0, 1.0]], body_class=value)
    assert list(FixedBodies([[1.0, 1.0]], body_class=np.array(["oak"])).body_class) == ["oak"]
