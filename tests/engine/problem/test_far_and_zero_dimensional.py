"""Values beyond every bound, and arrays without an axis, end in a sentence."""

import numpy as np
import pytest
from esh import FixedBodies, Footprint, Footprints, Obstacle, ProblemError

PLANK = Footprint.rectangle(1.0, 0.4)


@pytest.mark.parametrize("value", [1e308, 1e160])
def test_lengths_beyond_all_that_is_placed_are_refused(value):
    for make in (
        lambda: Footprints(PLANK, gap=value),
        lambda: Footprints(PLANK, room=value),
        lambda: Footprints(PLANK, room=1.0 / value),
        lambda: Obstacle(disc=(0.0, 0.0, 1.0), margin=value),
        lambda: Obstacle(disc=(1.0, 1.0, value)),
        lambda: Obstacle(ball=(-value, 1.0, 1.0, 1.0)),
        lambda: Obstacle(polygon=[(-value, 0.0), (value, 0.0), (0.0, value)]),
    ):
        with pytest.raises(ProblemError, match=r"must (be|lie)"):
            make()
    assert Footprints(PLANK, gap=0.5).gap == 0.5 and Obstacle(disc=(1e6, 0.0, 1.0)).disc[0] == 1e6


def test_arrays_without_an_axis_are_refused():
    nothing = np.array(3), np.array("oak"), np.ma.masked
    for value in nothing:
        with pytest.raises(ProblemError, match=r"`obstacle\.disc` must be x, y"):
            Obstacle(disc=value)
        with pytest.raises(ProblemError, match="must be a name or an index"):
            FixedBodies([[1.0, 1.0]], body_class=value)
    assert list(FixedBodies([[1.0, 1.0]], body_class=np.array(["oak"])).body_class) == ["oak"]
