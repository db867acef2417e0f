"""Who is kept along a cut: exchanges that make each stretch of it as dense as its ground asks for."""

import numpy as np
import pytest
from esh.engine.model import even_cut
from esh.engine.model.even_cut import Ground, evened

SIDE, CUT = 40.0, 10.0


def bodies():
    """Bodies a meter apart where the density is, and beyond its end on the left; and those that are kept, of which ten stand there.

    Those above stand .3 m beyond it at the nearest, and those below as far within it: ten of these are not kept.
    """
    x, y = np.meshgrid(np.arange(-0.3, SIDE), np.arange(0.0, SIDE) + 0.5)
    x += np.where(y > 0.5 * SIDE, 0.0, 0.6)
    position = np.stack([x[x < SIDE], y[x < SIDE]], axis=1)
    kept = position[:, 0] > CUT
    beyond, within = (np.flatnonzero(abs(position[:, 0] - CUT - at) < 0.01) for at in (-0.3, 0.3))
    kept[beyond[:10]], kept[within[:10]] = True, False
    return position, np.flatnonzero(kept)


def kept_of(position, kept, part=None, is_alone=True):
    """Who is kept after exchanges; the density ends on the left."""
    density = np.zeros((1, 40), np.float32)
    density[:, int(CUT) :] = 1.0
    return evened(kept, Ground(density, (SIDE, SIDE), 1.0, is_alone), position, position[:, 0] - CUT, part)


def number_above(position, kept):
    return int((position[kept, 1] > 0.5 * SIDE).sum())


def test_both_halves_have_as_many_as_they_ask_for():
    position, first = bodies()
    kept = kept_of(position, first)
    half = len(first) // 2
    assert len(kept) == len(first) == len(set(kept.tolist()))
    assert number_above(position, first) - half == 10
    assert abs(number_above(position, kept) - half) <= 3
    # Who is far from the border stays.
    far = np.abs(position[:, 0] - CUT) > even_cut.NEAR
    assert set(np.flatnonzero(far & (position[:, 0] > CUT))) <= set(kept.tolist())
    assert (position[kept, 0] > CUT - even_cut.NEAR).all()


def test_of_several_groups_fewer_are_exchanged():
    position, first = bodies()
    alone, among_others = (set(kept_of(position, first, is_alone=own).tolist()) for own in (True, False))
    assert 0 < len(among_others - set(first)) < len(alone - set(first))


def test_parts_keep_their_numbers():
    position, first = bodies()
    part = (position[:, 1] > 0.5 * SIDE).astype(np.int64)
    kept = kept_of(position, first, part)
    assert number_above(position, kept) == number_above(position, first)
    assert set(kept.tolist()) != set(first.tolist())


@pytest.mark.parametrize("name", ["MOST_BODIES", "MOST_NODES", "MOST_LOOKS"])
def test_where_that_would_take_long_nobody_is_exchanged(monkeypatch, name):
    monkeypatch.setattr(even_cut, name, 1)
    position, first = bodies()
    np.testing.assert_array_equal(kept_of(position, first), first)
