"""Crossings against a count of all pairs, and by what must not change them; differences of angles."""

import numpy as np
import pytest
from esh.engine.problem.domain import Domain
from esh.engine.quality.line_quality import (
    angle_errors,
    crossing_lines,
    crossing_pairs,
)
from hypothesis import given, settings
from hypothesis import strategies as st


def crossings_by_solving(position, angle, length, domain):
    """All pairs, one after the other: where do the two straight lines meet, and is that on both?

    In a periodic domain all copies that long lines could reach are tried.
    """
    reach = np.ceil(np.max(length, initial=0.0) / np.array(domain.size)).astype(int) + 1 if domain.periodic else [0, 0]
    copies = np.stack(np.meshgrid(*(np.arange(-r, r + 1) for r in reach)), axis=-1).reshape(-1, 2) * domain.size
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = set()
    for i in range(len(position)):
        for j in range(i + 1, len(position)):
            across = np.stack([direction[i], -direction[j]], axis=1)
            if abs(np.linalg.det(across)) < 1e-12:
                continue
            along = np.abs(np.linalg.solve(across, (position[j] + copies - position[i]).T))
            if ((along[0] < 0.5 * length[i]) & (along[1] < 0.5 * length[j])).any():
                found.add((i, j))
    return found


def pairs(position, angle, length, domain):
    found = crossing_pairs(np.array(position, float), np.array(angle, float), np.array(length, float), domain)
    assert found.shape[1:] == (2,) and (found[:, 0] < found[:, 1]).all()
    return [tuple(pair) for pair in found.tolist()]


def lines(seed, count, domain, longest):
    rng = np.random.default_rng(seed)
    return rng.random((count, 2)) * domain.size, rng.uniform(-4.0, 4.0, count), rng.uniform(0.0, longest, count)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(0, 14),
    width=st.sampled_from([1.0, 3.0, 10.0]),
    height=st.sampled_from([1.0, 2.5, 10.0]),
    boundary=st.sampled_from(["open", "periodic"]),
    longest=st.sampled_from([0.3, 1.0, 4.0]),
)
def test_crossings_equal_a_count_of_all_pairs(seed, count, width, height, boundary, longest):
    domain = Domain((width, height), boundary)
    given_lines = lines(seed, count, domain, longest)
    assert set(pairs(*given_lines, domain)) == crossings_by_solving(*given_lines, domain)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_a_few_long_lines_among_many_short_ones(boundary):
    domain = Domain((12.0, 9.0), boundary)
    position, angle, length = lines(0, 120, domain, 1.5)
    length[::40] = [31.0, 17.0, 8.0]
    expected = crossings_by_solving(position, angle, length, domain)
    # Some with long lines, some among short ones.
    assert len(expected) > 30 and 10 < sum(i % 40 != 0 and j % 40 != 0 for i, j in expected) < len(expected) - 10
    assert set(pairs(position, angle, length, domain)) == expected


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_pairs_do_not_depend_on_how_many_are_compared_at_once(boundary, monkeypatch):
    domain = Domain((20.0, 10.0), boundary)
    given_lines = lines(1, 300, domain, 3.0)
    whole = pairs(*given_lines, domain)
    assert len(whole) > 100
    for at_once in (1, 17, 1000):
        monkeypatch.setattr("esh.engine.quality.line_quality.PAIRS_AT_ONCE", at_once)
        assert pairs(*given_lines, domain) == whole


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.tuples(st.integers(-7, 7), st.integers(-7, 7)))
def test_moving_everything_around_a_periodic_domain_changes_nothing(seed, steps):
    domain = Domain((8.0, 4.0), "periodic")
    position, angle, length = lines(seed, 30, domain, 3.0)
    moved = np.mod(position + np.array(steps) * [0.7, 0.9], domain.size)
    assert pairs(moved, angle, length, domain) == pairs(position, angle, length, domain)
    # Nor does turning every line end for end.
    assert pairs(position, angle + np.pi, length, domain) == pairs(position, angle, length, domain)


def test_long_lines_cross_copies_that_are_not_the_nearest():
    domain = Domain((10.0, 10.0), "periodic")
    # The second starts 3 to the right and never comes near; its copy 7 to the left is met at the end of the first.
    position, angle, length = [[5.0, 5.0], [9.0, 6.0]], [0.0, 0.5 * np.pi], [13.0, 4.0]
    assert pairs(position, angle, length, domain) == [(0, 1)]
    assert pairs(position, angle, length, Domain((10.0, 10.0))) == [(0, 1)]
    position[1][0] = 0.5
    assert pairs(position, angle, [9.5, 4.0], domain) == [(0, 1)]
    assert pairs(position, angle, [8.5, 4.0], domain) == []
    assert pairs(position, angle, [11.5, 4.0], domain) == [(0, 1)]


def test_a_pair_counts_once_however_often_it_crosses():
    domain = Domain((4.0, 4.0), "periodic")
    # Twice around, it meets the upright line three times.
    assert pairs([[2.0, 2.0], [2.0, 2.1]], [0.0, 0.5 * np.pi], [9.0, 1.0], domain) == [(0, 1)]


def test_a_line_does_not_cross_itself():
    domain = Domain((4.0, 4.0), "periodic")
    assert pairs([[1.0, 1.0], [3.5, 3.5]], [0.4, 0.4], [30.0, 0.0], domain) == []


def test_touching_and_overlaid_lines_do_not_cross():
    domain = Domain((8.0, 8.0))
    # An end on the other's middle; the same end; one on the other; side by side.
    assert pairs([[2.0, 2.0], [2.0, 3.0]], [0.0, 0.5 * np.pi], [2.0, 2.0], domain) == []
    assert pairs([[2.0, 2.0], [4.0, 2.0]], [0.0, 0.0], [2.0, 2.0], domain) == []
    assert pairs([[2.0, 2.0], [2.5, 2.0]], [0.0, 0.0], [2.0, 2.0], domain) == []
    assert pairs([[2.0, 2.0], [2.0, 2.0]], [0.3, 0.3], [2.0, 2.0], domain) == []
    assert pairs([[2.0, 2.0], [2.0, 2.2]], [0.3, 0.3], [4.0, 4.0], domain) == []
    # Pushed through, it crosses.
    assert pairs([[2.0, 2.0], [2.0, 2.999]], [0.0, 0.5 * np.pi], [2.0, 2.0], domain) == [(0, 1)]


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_crossings_on_borders_of_cells_are_found(boundary):
    """Crosses at every whole and half coordinate, where any grid of cells has its borders."""
    domain = Domain((8.0, 8.0), boundary)
    middle = np.stack(np.meshgrid(np.arange(16) * 0.5, np.arange(16) * 0.5), axis=-1).reshape(-1, 2)
    position = np.repeat(middle, 2, axis=0)
    angle = np.tile([0.0, 0.5 * np.pi], len(middle))
    found = pairs(position, angle, np.full(len(position), 0.4), domain)
    assert found == [(2 * i, 2 * i + 1) for i in range(len(middle))]


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_lines_cross_nothing(count):
    domain = Domain((1.0, 1.0), "periodic")
    nothing = (np.zeros((count, 2)), np.zeros(count), np.ones(count))
    assert pairs(*nothing, domain) == []
    assert crossing_lines(*nothing, domain) == 0
    assert pairs(np.zeros((5, 2)), np.arange(5.0), np.zeros(5), domain) == []


def test_a_hash_has_as_many_crossings_as_rows_times_columns():
    domain = Domain((20.0, 20.0))
    rows, columns = 7, 11
    position = np.array(
        [[10.0, 3.0 + i] for i in range(rows)] + [[3.0 + i, 10.0] for i in range(columns)] + [[19.0, 19.0]]
    )
    angle = np.repeat([0.0, 0.5 * np.pi, 1.0], [rows, columns, 1])
    length = np.repeat([18.0, 18.0, 0.5], [rows, columns, 1])
    assert len(crossing_pairs(position, angle, length, domain)) == rows * columns
    assert crossing_lines(position, angle, length, domain) == rows + columns
    # Positions as float32, as the solver has them.
    assert len(crossing_pairs(position.astype(np.float32), angle, length, domain)) == rows * columns


def test_random_lines_cross_as_often_as_buffon_says():
    """Pairs of random segments cross with probability 2 l² / (pi area) in a periodic domain."""
    domain = Domain((100.0, 100.0), "periodic")
    rng = np.random.default_rng(7)
    count, length = 20_000, 2.0
    found = len(
        crossing_pairs(rng.random((count, 2)) * 100.0, rng.uniform(0.0, np.pi, count), np.full(count, length), domain)
    )
    expected = 0.5 * count * (count - 1) * 2.0 * length**2 / (np.pi * domain.area)
    # About five standard deviations of a sum that is nearly Poisson.
    assert found == pytest.approx(expected, abs=5.0 * np.sqrt(expected) + 0.01 * expected)


def test_differences_of_angles_have_no_front():
    degrees = np.degrees(
        angle_errors(
            np.radians([0.0, 0.0, 10.0, 179.0, 350.0, -90.0]), np.radians([180.0, 90.0, 190.0, 1.0, 5.0, 90.0])
        )
    )
    np.testing.assert_allclose(degrees, [0.0, 90.0, 0.0, 2.0, 15.0, 0.0], atol=1e-9)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.integers(-5, 5))
def test_differences_of_angles_are_those_of_the_doubled_vectors(a, b, turns):
    found = float(angle_errors(np.array(a), np.array(b + turns * np.pi)))
    assert 0.0 <= found <= 0.5 * np.pi + 1e-12
    assert np.cos(2.0 * found) == pytest.approx(np.cos(2.0 * (a - b)), abs=1e-9)
