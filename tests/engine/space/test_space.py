"""The space: its host and its kernels agree, and kernels elsewhere ask it instead of looking into it."""

import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.domain import Domain
from esh.engine.space import kernels_space
from esh.engine.space.space import Space

ENGINE = Path(__file__).resolve().parents[3] / "engine"
SIZE = (6.0, 4.0)


@wp.kernel
def ask(
    first: int,
    start: wp.array(dtype=wp.vec2),
    end: wp.array(dtype=wp.vec2),
    space: kernels_space.Space,
    way: wp.array(dtype=wp.vec2),
    inside: wp.array(dtype=wp.vec2),
    period: wp.array(dtype=wp.vec2),
):
    i = first + wp.tid()
    way[i] = kernels_space.difference(start[i], end[i], space)
    inside[i] = kernels_space.wrapped(end[i], space)
    period[i] = kernels_space.period(space)


@wp.kernel
def number(
    first: int,
    count: int,
    space: kernels_space.Space,
    inside: wp.array(dtype=wp.int32),
    across: wp.array(dtype=wp.int32),
    beside: wp.array(dtype=wp.vec2i),
):
    i = first + wp.tid()
    inside[i] = kernels_space.number_inside(i - count, count, space)
    across[i] = kernels_space.number_across(i - count, count, space)
    beside[i] = kernels_space.numbers_beside(i - count, count, space)


@wp.kernel
def interpolate(
    first: int,
    position: wp.array(dtype=wp.vec2),
    values: wp.array(dtype=float),
    start: int,
    rows: int,
    columns: int,
    space: kernels_space.Space,
    result: wp.array(dtype=float),
):
    i = first + wp.tid()
    result[i] = kernels_space.between_cells(position[i], values, start, rows, columns, space)


@pytest.fixture
def launcher():
    launcher = Launcher(resolve_device("cpu"))
    yield launcher
    launcher.close()


@pytest.mark.parametrize("periodic", [False, True])
def test_kernels_and_host_know_the_same_ways(launcher, periodic):
    space = Space(SIZE, periodic)
    rng = np.random.default_rng(0)
    start = (rng.random((500, 2)) * SIZE).astype(np.float32)
    end = ((rng.random((500, 2)) * 2.0 - 0.5) * SIZE).astype(np.float32)
    way, inside, period = (launcher.empty(500, wp.vec2) for _ in range(3))
    given = [wp.array(values, dtype=wp.vec2, device="cpu") for values in (start, end)]
    launcher.launch(ask, 500, [*given, space.for_kernels()], [way, inside, period])
    np.testing.assert_allclose(way.numpy(), space.shortest(end - start), atol=1e-5)
    np.testing.assert_allclose(inside.numpy(), space.wrapped(end), atol=1e-5)
    np.testing.assert_array_equal(period.numpy(), np.broadcast_to(np.float32(SIZE) if periodic else 0.0, (500, 2)))
    if periodic:
        assert (np.abs(way.numpy()) <= np.array(SIZE) / 2.0 + 1e-5).all()
        assert ((inside.numpy() >= 0.0) & (inside.numpy() < SIZE)).all()
    else:
        np.testing.assert_array_equal(way.numpy(), end - start)
        np.testing.assert_array_equal(inside.numpy(), end)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("periodic", [False, True])
def test_cells_beyond_an_end_are_those_of_the_other_side_or_none(launcher, periodic, count):
    n = 3 * count
    inside, across = launcher.empty(n, wp.int32), launcher.empty(n, wp.int32)
    beside = launcher.empty(n, wp.vec2i)
    space = Space(SIZE, periodic)
    launcher.launch(number, n, [count, space.for_kernels()], [inside, across, beside])
    i = np.arange(-count, 2 * count)
    np.testing.assert_array_equal(inside.numpy(), i % count if periodic else np.clip(i, 0, count - 1))
    np.testing.assert_array_equal(across.numpy(), i % count if periodic else i)
    for own, (low, high) in zip(i[count : 2 * count], beside.numpy()[count : 2 * count], strict=True):
        met = [j % count if periodic else j for j in range(low, high + 1)]
        met = [j for j in met if 0 <= j < count]
        assert len(set(met)) == len(met)
        assert set(met) == {(own + d) % count if periodic else own + d for d in (-1, 0, 1)} & set(range(count))


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (5, 1)])
@pytest.mark.parametrize("periodic", [False, True])
def test_values_are_linear_between_the_middles_of_cells(launcher, periodic, shape):
    rng = np.random.default_rng(0)
    values = rng.random(shape).astype(np.float32)
    position = (rng.random((300, 2)) * SIZE).astype(np.float32)
    before = np.full(7, np.nan, np.float32)
    given = [
        wp.array(position, dtype=wp.vec2, device="cpu"),
        wp.array(np.concatenate([before, values.ravel()]), dtype=float, device="cpu"),
    ]
    result = launcher.empty(300, float)
    space = Space(SIZE, periodic).for_kernels()
    launcher.launch(interpolate, 300, [*given, len(before), *shape, space], [result])
    around = np.pad(values, 1, mode="wrap" if periodic else "edge")
    x, y = (position / SIZE * shape[::-1] + 0.5).T
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = x - column, y - row
    below = (1.0 - u) * around[row, column] + u * around[row, column + 1]
    above = (1.0 - u) * around[row + 1, column] + u * around[row + 1, column + 1]
    np.testing.assert_allclose(result.numpy(), (1.0 - v) * below + v * above, atol=1e-5)


def test_a_space_has_the_extent_of_its_domain_and_its_mirror_images_repeat():
    space = Space.of(Domain((30.0, 20.0), "mirror"), 2.0)
    assert space == Space((15.0, 10.0), periodic=False) and space.area == 150.0
    assert space.with_mirror_images() == Space((30.0, 20.0), periodic=True)
    assert Space.of(Domain((30.0, 20.0), "periodic")).periodic
    assert space.has_straight_ways and not space.with_mirror_images().has_straight_ways


def test_images_are_as_many_periods_away_as_they_can_be_near():
    assert Space(SIZE, True).images_within(5.0, 4) == (1, 1)
    assert Space(SIZE, True).images_within(1.0, 4) == (0, 0)
    assert Space(SIZE, True).images_within(1e30, 4) == (4, 4)
    assert Space(SIZE).images_within(1e30, 4) == (0, 0)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_positions_that_are_wrapped_stay_as_precise_and_never_end_on_the_far_edge(kind):
    position = np.array([[-1e-9, 4.0], [6.0, -0.5], [13.0, 9.0], [2.5, 3.5]], kind)
    before = position.copy()
    wrapped = Space(SIZE, True).wrapped(position)
    assert wrapped.dtype == kind and (wrapped >= 0.0).all() and (wrapped < SIZE).all()
    np.testing.assert_allclose(wrapped[1:], [[0.0, 3.5], [1.0, 1.0], [2.5, 3.5]], atol=1e-6)
    np.testing.assert_array_equal(position, before)
    assert Space(SIZE).wrapped(position) is position


def test_what_rounding_left_beyond_the_far_edges_is_inside():
    beyond = [[6.0, 4.0], [6.0000005, 1.0], [2.0, 3.9]]
    np.testing.assert_array_equal(Space(SIZE).inside(np.array(beyond)), [[6.0, 4.0], [6.0, 1.0], [2.0, 3.9]])
    np.testing.assert_array_equal(Space(SIZE, True).inside(np.array(beyond)), [[0.0, 0.0], [0.0, 1.0], [2.0, 3.9]])


def test_images_go_on_beyond_the_edges_as_the_space_does():
    image = np.arange(6.0).reshape(2, 3)
    np.testing.assert_array_equal(Space(SIZE, True).padded(image, 0, 1)[0], [2, 0, 1, 2, 0])
    np.testing.assert_array_equal(Space(SIZE).padded(image, 0, 1)[0], [0, 0, 1, 2, 2])
    np.testing.assert_array_equal(Space(SIZE, True).padded(image, 1, 0)[:, 0], [3, 0, 3, 0])
    np.testing.assert_array_equal(Space(SIZE).padded(image, 1, 0)[:, 0], [0, 0, 3, 3])


def lines_that_ask_how_a_space_ends(paths):
    return [
        f"{path.relative_to(ENGINE)}: {line.strip()}"
        for path in paths
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(r"\b\w+\.periodic\b", line.partition("#")[0])
    ]


def test_only_the_room_space_looks_into_a_space():
    """A second space must not need a change in the kernels of forces or of the descent; what is counted, is so independently."""
    kernels = sorted(ENGINE.rglob("kernels_*.py"))
    independent = "kernels_overlaps.py", "kernels_out_of_place.py"
    asking = [path for path in kernels if path.parent.name != "space" and path.name not in independent]
    assert not lines_that_ask_how_a_space_ends(asking)


def test_the_solver_does_not_ask_how_a_space_ends():
    """But for the estimate of memory, which counts what the report takes of a domain."""
    rooms = ("model", "motion", "contact", "descent", "edits", "solver")
    solver = sorted(path for room in rooms for path in (ENGINE / room).glob("*.py"))
    assert not lines_that_ask_how_a_space_ends([path for path in solver if path.name != "memory.py"])


@pytest.mark.parametrize("page", ["CONTRIBUTING.md"])
def test_the_pages_say_what_a_space_provides(page):
    source = (ENGINE / "space" / "kernels_space.py").read_text(encoding="utf-8")
    provided = set(re.findall(r"^@wp\.func\ndef (\w+)\(.*space: Space\):", source, re.MULTILINE))
    assert len(provided) > 8
    text = (ENGINE.parent / page).read_text(encoding="utf-8")
    assert not [name for name in provided if f"`{name}`" not in text]
