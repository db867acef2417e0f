"""Kinds of bodies answer the same questions, and their answers agree with each other."""

import inspect

import numpy as np
import pytest
from esh.engine.problem.body_kind import DOT, BodyKind, Dot
from esh.engine.problem.line import Line
from esh.engine.problem.size import Size

AREA = np.array([0.5, 1.0, 3.0])
KINDS = [DOT, Line(2.0), Line(2.0, width=0.5, charges=4), Line(np.array([[1.0, 3.0]]), middle_charge=2.0)]


@pytest.mark.parametrize("cls", [Dot, Line])
def test_every_kind_has_every_member(cls):
    wanted = [name for name in vars(BodyKind) if not name.startswith("_")]
    assert len(wanted) > 8
    for name in wanted:
        assert hasattr(cls, name) or name in cls.__dataclass_fields__, f"{cls.__name__} has no {name}"
        if inspect.isfunction(asked := getattr(BodyKind, name)):
            assert list(inspect.signature(asked).parameters) == list(inspect.signature(getattr(cls, name)).parameters)


@pytest.mark.parametrize("kind", KINDS)
def test_the_answers_of_a_kind_agree(kind):
    place, share = kind.charge_places(), kind.charge_shares()
    assert len(place) == len(share) == kind.charges
    assert share.sum() == pytest.approx(1.0) and np.allclose(place, -place[::-1])
    thickness = kind.thickness(AREA, kind.mean_length)
    if not kind.has_axis:
        assert kind.longest == kind.mean_length == 0.0 and not thickness.any()
        np.testing.assert_allclose(np.pi * kind.reach_across(AREA) ** 2, AREA)
        return
    np.testing.assert_allclose(kind.reach_across(AREA), thickness / 2.0)
    covered = kind.mean_length * thickness + np.pi * thickness**2 / 4.0
    # A line without a width of its own covers its area; one with a width says what it covers.
    np.testing.assert_allclose(covered, [kind.ground(area) for area in AREA])
    assert kind.extent(1.0) >= kind.longest >= kind.mean_length
    assert kind.narrowest(1.0) == (kind.width or 0.0)


def test_a_size_says_of_which_kind_its_bodies_are():
    line = Line(1.0)
    assert Size("s", 1.0, 3).kind is DOT
    assert Size("s", 1.0, 3, line=line).kind is line
