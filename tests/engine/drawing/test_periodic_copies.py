"""The copies that a periodic domain shows: those that can be seen, each once, and no others."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from esh import BodyClass, Domain, Placement, Problem, Report, Size
from esh.engine.drawing.periodic_copies import copies_of_bodies, copies_within
from esh.engine.problem.line import Line

SIZE = (4.0, 3.0)


@pytest.mark.parametrize("largest", [0.3, 9.0])
def test_all_boxes_that_can_be_seen_and_no_others(largest):
    rng = np.random.default_rng(2)
    low = rng.random((40, 2)) * SIZE - largest * rng.random((40, 2))
    high = low + largest * rng.random((40, 2)) + 1e-3
    found = {
        (i, *np.round(shift / SIZE).astype(int).tolist())
        for shift, seen in copies_within(low, high, SIZE)
        for i in np.flatnonzero(seen).tolist()
    }
    expected = set()
    for i, x, y in itertools.product(range(40), range(-5, 6), range(-5, 6)):
        shift = np.array([x, y]) * SIZE
        if ((high[i] + shift > 0.0) & (low[i] + shift < SIZE)).all():
            expected.add((i, x, y))
    assert found == expected
    assert any(x or y for _, x, y in expected)


def lines(boundary: str, bends: np.ndarray | None = None) -> Placement:
    """A dot in the middle, and a line of length 2 that reaches over the right edge."""
    classes = [BodyClass("dot", [Size("s", 0.01, 1)]), BodyClass("line", [Size("s", 0.2, 1, line=Line(2.0))])]
    one = np.array([0, 1], np.int32)
    return Placement(
        Problem(Domain(SIZE, boundary), classes),
        np.array([[2.0, 1.5], [3.5, 1.5]]),
        one,
        np.zeros(2, np.int32),
        np.zeros(2),
        np.array([0.0, 2.0]),
        np.array([0.0, 0.1]),
        Report(1, True, 0.1, "cpu", 0.0, None, 0, 0.0, ()),
        bends,
    )


def test_bodies_come_in_again_where_they_reach_over_an_edge():
    seen = {tuple(np.round(shift, 9).tolist()): seen.tolist() for shift, seen in copies_of_bodies(lines("periodic"))}
    assert seen[0.0, 0.0] == [True, True]
    assert seen[-4.0, 0.0] == [False, True]
    assert not any(any(which) for shift, which in seen.items() if shift not in ((0.0, 0.0), (-4.0, 0.0)))


def test_where_a_line_bends_its_bend_counts():
    bent = np.full((2, 3, 2), np.nan)
    bent[1] = [[3.5, 1.5], [3.6, 2.5], [3.7, 3.2]]
    seen = {tuple(np.round(s, 9).tolist()): k.tolist() for s, k in copies_of_bodies(lines("periodic", bent))}
    assert seen[0.0, -3.0] == [False, True] and not seen.get((-4.0, 0.0), [False, False])[1]


def test_in_an_open_domain_every_body_is_there_once():
    ((shift, seen),) = copies_of_bodies(lines("open"))
    assert shift.tolist() == [0.0, 0.0] and seen.all()


def test_radius_of_discs_and_of_capsules():
    np.testing.assert_allclose(lines("open").radius, [np.sqrt(0.01 / np.pi), 0.05])


@pytest.mark.parametrize(("area", "length"), [(1800.0, 0.5), (0.2, 1e6), (0.2, 1e300)])
def test_bodies_far_larger_than_the_domain_take_no_time(area, length):
    """There would be a copy for each of the domains that a disc covers; one covers all that is to be seen."""
    classes = [BodyClass("dot", [Size("s", area, 1)]), BodyClass("line", [Size("s", 0.2, 1)])]
    given = lines("periodic")
    placement = replace(given, problem=Problem(Domain(SIZE, "periodic"), classes), length=np.array([0.0, length]))
    found = copies_of_bodies(placement)
    assert 1 < len(found) < 5000
    assert next(seen for shift, seen in found if not shift.any()).all()
