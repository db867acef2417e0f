"""The plan: bodies where they are, as large as they are, in the color of their class."""

from __future__ import annotations

import io
import itertools
import math
import time
from dataclasses import replace

import numpy as np
import pytest
from esh import BodyClass, Domain, EshError, Placement, Problem, Report, Size
from esh.engine.drawing import plan as plan_module
from esh.engine.drawing.palette import class_colors
from esh.engine.drawing.plan import GROUND, MARGIN, PLAN_PIXELS, draw_plan
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from PIL import Image

RED, BLUE = (255, 0, 0), (0, 0, 255)
TOP = 40 + MARGIN


def place(domain, classes, position) -> Placement:
    problem = Problem(domain, classes)
    pairs = [(c, s) for c, k in enumerate(classes) for s, size in enumerate(k.sizes) for _ in range(size.count)]
    class_index, size_index = np.array(pairs, np.int32).T
    n = len(pairs)
    report = Report(1, True, 0.1, "cpu", 0.0, None, 0, 0.0, ())
    return Placement(
        problem, np.asarray(position, float), class_index, size_index, np.zeros(n), np.zeros(n), np.zeros(n), report
    )


def plan_of(placement: Placement, **options) -> np.ndarray:
    """The part of the picture that shows the domain, as an array [height, width, 3]."""
    file = io.BytesIO()
    draw_plan(placement, file, **options)
    picture = np.asarray(Image.open(file)).astype(int)
    width, height = placement.problem.domain.size
    scale = PLAN_PIXELS / max(width, height)
    left = (picture.shape[1] - round(width * scale)) // 2
    return picture[TOP : TOP + round(height * scale), left : left + round(width * scale)]


def is_color(plan: np.ndarray, color) -> np.ndarray:
    return (np.abs(plan - np.array(color)) < 90).all(axis=2)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("size", [(40.0, 30.0), (3.0, 6.0)])
def test_bodies_are_where_they_are_and_as_large_as_they_are(boundary, size):
    center = np.array([[0.25 * size[0], 0.75 * size[1]], [0.75 * size[0], 0.25 * size[1]]])
    area = 0.01 * size[0] * size[1]
    classes = [BodyClass("a", [Size("s", area, 1)]), BodyClass("b", [Size("s", area / 2, 1)])]
    plan = plan_of(place(Domain(size, boundary), classes, center), colors=["red", (0.0, 0.0, 1.0)])
    meter = plan.shape[1] / size[0]
    for (x, y), color, body_area in zip(center, (RED, BLUE), (area, area / 2), strict=True):
        row, column = np.nonzero(is_color(plan, color))
        assert abs(column.mean() + 0.5 - x * meter) < 1
        assert abs(row.mean() + 0.5 - (size[1] - y) * meter) < 1
        assert len(row) / meter**2 == pytest.approx(body_area, rel=0.05)
        radius = math.sqrt(body_area / math.pi) * meter
        assert np.hypot(column - column.mean(), row - row.mean()).max() == pytest.approx(radius, abs=2)


def test_a_periodic_plan_can_be_tiled():
    classes = [BodyClass("a", [Size("s", 4.0, 1)])]
    whole = is_color(
        plan_of(place(Domain((10.0, 10.0), "periodic"), classes, [[5.0, 5.0]]), colors=[RED_NAME]), RED
    ).sum()
    plan = is_color(plan_of(place(Domain((10.0, 10.0), "periodic"), classes, [[0.0, 0.0]]), colors=[RED_NAME]), RED)
    half = plan.shape[0] // 2
    for quarter in (plan[:half, :half], plan[:half, half:], plan[half:, :half], plan[half:, half:]):
        assert quarter.sum() == pytest.approx(whole / 4, rel=0.03)


RED_NAME = "#ff0000"


def place_lines(domain, classes, position, angle, length, width, bends=None) -> Placement:
    return replace(
        place(domain, classes, position),
        angle=np.array(angle, float),
        length=np.array(length, float),
        width=np.array(width, float),
        bends=bends,
    )


def distance_to_axis(plan: np.ndarray, meter: float, points: np.ndarray) -> np.ndarray:
    """Distance of every pixel's middle from a polyline [m], in a domain whose lower left corner is the origin."""
    rows, columns = np.indices(plan.shape[:2])
    pixel = np.stack([columns + 0.5, plan.shape[0] - rows - 0.5], axis=-1) / meter
    nearest = np.full(plan.shape[:2], np.inf)
    for start, end in itertools.pairwise(points):
        axis = end - start
        share = np.clip((pixel - start) @ axis / (axis @ axis), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(pixel - start - share[..., None] * axis, axis=-1))
    return nearest


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2, 2.5])
def test_lines_are_capsules_where_they_lie(angle):
    size = Size("s", 1.0, 1, line=Line(3.0))
    placement = place_lines(Domain((8.0, 6.0)), [BodyClass("a", [size])], [[3.0, 3.5]], [angle], [3.0], [0.6])
    plan = plan_of(placement, colors=["red"])
    meter = plan.shape[1] / 8.0
    half = 1.5 * np.array([math.cos(angle), math.sin(angle)])
    distance = distance_to_axis(plan, meter, np.array([[3.0, 3.5] - half, [3.0, 3.5] + half]))
    red = is_color(plan, RED)
    assert red[distance < 0.3 - 2 / meter].all()
    assert not red[distance > 0.3 + 2 / meter].any()


def test_bending_lines_are_polylines_beside_straight_ones():
    bending, straight = Line(3.0, straightness=0.1, charges=4), Line(1.0)
    classes = [BodyClass("a", [Size("s", 1.0, 1, line=bending)]), BodyClass("b", [Size("s", 1.0, 1, line=straight)])]
    way = np.array([[1.0, 1.0], [2.0, 1.0], [2.5, 2.0], [2.0, 3.0]])
    bends = np.full((2, 4, 2), np.nan)
    bends[0] = way
    middle = way.mean(axis=0)
    placement = place_lines(
        Domain((8.0, 6.0)), classes, [middle, [6.0, 3.0]], [0.9, 0.0], [2.2, 1.0], [0.3, 0.5], bends
    )
    plan = plan_of(placement, colors=["red", "blue"])
    meter = plan.shape[1] / 8.0
    for color, points, half_width in ((RED, way, 0.15), (BLUE, np.array([[5.5, 3.0], [6.5, 3.0]]), 0.25)):
        distance = distance_to_axis(plan, meter, points)
        drawn = is_color(plan, color)
        # A rim as dark as a third of a shadow may go uncounted; round joints stand out a pixel at most.
        assert drawn[distance < half_width - 3 / meter].all()
        assert not drawn[distance > half_width + 2 / meter].any()


@pytest.mark.parametrize("middle", [[0.0, 0.0], [9.9, 5.0], [5.0, 0.0], [1.0, 5.0], [8.9, 9.1]])
def test_lines_come_in_again_at_the_opposite_border(middle):
    line = BodyClass("a", [Size("s", 1.0, 1, line=Line(4.0))])
    shapes = [0.7], [4.0], [0.5]
    domain = Domain((10.0, 10.0), "periodic")
    inside = is_color(plan_of(place_lines(domain, [line], [[5.0, 5.0]], *shapes), colors=["red"]), RED)
    moved = is_color(plan_of(place_lines(domain, [line], [middle], *shapes), colors=["red"]), RED)
    meter = inside.shape[0] / 10.0
    shift = round((5.0 - middle[1]) * meter), round((middle[0] - 5.0) * meter)
    # The frame, one pixel along the border, is drawn under the bodies: what differs are pixels at the rim.
    assert (np.roll(inside, shift, axis=(0, 1)) != moved).sum() < 0.04 * inside.sum()


def test_every_body_of_a_range_is_as_large_as_it_is():
    areas = np.array([0.5, 1.0, 2.0, 4.0])
    size = Size("any", (0.5, 4.0), 4, distribution=areas)
    center = np.array([[2.0, 4.0], [6.0, 4.0], [10.0, 4.0], [14.0, 4.0]])
    plan = is_color(plan_of(place(Domain((16.0, 8.0)), [BodyClass("a", [size])], center), colors=["red"]), RED)
    meter = plan.shape[1] / 16.0
    quarters = np.split(plan, 4, axis=1)
    for quarter, area in zip(quarters, areas, strict=True):
        assert quarter.sum() / meter**2 == pytest.approx(area, rel=0.05)


def test_small_bodies_lie_on_top_of_large_ones():
    classes = [BodyClass("a", [Size("small", 1.0, 1)]), BodyClass("b", [Size("large", 20.0, 1)])]
    plan = plan_of(place(Domain((10.0, 10.0)), classes, [[5.0, 5.0], [5.0, 5.0]]), colors=["red", "blue"])
    assert is_color(plan, RED).sum() / 160**2 == pytest.approx(1.0, rel=0.1)


def test_a_background_shows_faintly_with_its_top_up():
    classes = [BodyClass("a", [Size("s", 0.01, 1)])]
    background = np.zeros((2, 4))
    background[0] = 1.0
    plan = plan_of(place(Domain((8.0, 4.0)), classes, [[0.1, 0.1]]), background=background)
    assert (np.abs(plan[100, 800] - np.array(GROUND)) < 12).all()
    assert (plan[-100, 800] < 200).all()


def test_a_hundred_thousand_bodies_take_seconds(tmp_path):
    n = 50_000
    classes = [BodyClass("a", [Size("s", 0.01, n)]), BodyClass("b", [Size("s", 0.02, n)])]
    placement = place(Domain((100.0, 100.0)), classes, np.random.default_rng(0).random((2 * n, 2)) * 100)
    start = time.perf_counter()
    draw_plan(placement, tmp_path / "plan.png")
    assert time.perf_counter() - start < 30
    assert (tmp_path / "plan.png").stat().st_size > 10_000


@pytest.mark.parametrize("size", [(3e5, 1e2), (1e-2, 30.0), (1e-6, 1e-6)])
def test_any_domain_and_any_footprint_can_be_drawn(size, tmp_path):
    names = ["a" * 200, "Bärlauch", "木", "x"]
    # The smallest and the largest that a problem takes.
    square = min(size) ** 2
    areas = [2e-6 * square, square, 199.0 * square]
    sizes = [Size(f"{'size' * 20} {index}", area, 1) for index, area in enumerate(areas)]
    many = [Size(str(index), square, 1) for index in range(30)]
    classes = [BodyClass(names[0], sizes), BodyClass(names[1], many), BodyClass(names[2], [Size("s", square, 1)])]
    placement = place(Domain(size, "periodic"), classes, np.random.default_rng(0).random((34, 2)) * size)
    draw_plan(placement, tmp_path / "plan.png")
    with Image.open(tmp_path / "plan.png") as picture:
        assert max(picture.size) < 4000


def glyph(text: str) -> bytes:
    return bytes(plan_module._font(22, text).getmask(text))


def test_letters_beyond_ascii_are_drawn_as_letters():
    unknown = glyph("\ue000")
    for letter in "äñšŁΩЖא":
        assert glyph(letter) != unknown
    assert (plan_module.FONT.parent / "LICENSE_DEJAVU").is_file()


def test_a_plan_needs_no_font_of_ours(tmp_path, monkeypatch):
    monkeypatch.setattr(plan_module, "FONT", tmp_path / "absent.ttf")
    placement = place(Domain((1.0, 1.0)), [BodyClass("Bärlauch", [Size("groß", 0.1, 1)])], [[0.5, 0.5]])
    draw_plan(placement, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 1000


def test_a_plan_that_cannot_be_written(tmp_path):
    placement = place(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.1, 1)])], [[0.5, 0.5]])
    with pytest.raises(EshError, match=r"plan\.png cannot be written: there is no folder"):
        draw_plan(placement, tmp_path / "absent" / "plan.png")


def test_colors_and_backgrounds_without_meaning():
    placement = place(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.1, 1)])], [[0.5, 0.5]])
    with pytest.raises(EshError, match="`colors` must hold one color per class, 1; got 0"):
        draw_plan(placement, io.BytesIO(), colors=[])
    for color in ("no color", (1.0, 0.0), None, 3, ("a", "b", "c")):
        with pytest.raises(EshError, match="a color is a name, a hex code or three numbers"):
            draw_plan(placement, io.BytesIO(), colors=[color])
    for background in (np.ones(3), np.ones((2, 2, 4)), np.ones((0, 2)), np.array([["a"]])):
        with pytest.raises(EshError, match="`background` must have shape"):
            draw_plan(placement, io.BytesIO(), background=background)


def test_outlines_are_drawn_as_they_lie(tmp_path):
    """A plank at an angle: ground beside it, its color along it as far as its ends."""
    size = Size("s", count=1, footprint=Footprint.rectangle(8.0, 1.0))
    problem = Problem(Domain((10.0, 10.0)), [BodyClass("a", [size])])
    zero, angle = np.zeros(1), np.array([0.5])
    placement = Placement(problem, np.array([[5.0, 5.0]]), *problem.body_indices(), angle, zero, zero)
    draw_plan(placement, tmp_path / "plan.png", colors=["#ff0000"])
    with Image.open(tmp_path / "plan.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    left, top, scale = (picture.width - 1600) // 2, 40 + 56, 160.0

    def red(along, across):
        x = 5.0 + along * np.cos(0.5) - across * np.sin(0.5)
        y = 5.0 + along * np.sin(0.5) + across * np.cos(0.5)
        return pixels[round(top + (10.0 - y) * scale), round(left + x * scale)].tolist() == [255, 0, 0]

    for along, across, seen in [(0, 0, 1), (3.9, 0.4, 1), (-3.9, -0.4, 1), (4.1, 0, 0), (0, 0.6, 0), (0, 1.4, 0)]:
        assert red(along, across) == bool(seen), (along, across)


def test_outlines_that_lean_are_drawn_as_they_are_seen_from_above():
    """A plank along x on ground that rises by 45 degrees along x is shorter by the cosine of that."""
    slope = np.zeros((4, 4, 2))
    slope[..., 0] = 1.0
    flat, leaning = (Footprints([Footprint.rectangle(4.0, 1.0)], turn=0.0, slope=s) for s in (None, slope))
    ends = []
    for footprint in (flat, leaning):
        problem = Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", count=1, footprint=footprint)])])
        zero = np.zeros(1)
        placement = Placement(problem, np.array([[5.0, 5.0]]), *problem.body_indices(), zero, zero, zero)
        row, column = np.nonzero(is_color(plan_of(placement, colors=["red"]), RED))
        ends.append((np.ptp(column) / 160.0, np.ptp(row) / 160.0))
    np.testing.assert_allclose(ends, [(4.0, 1.0), (4.0 * math.sqrt(0.5), 1.0)], atol=0.02)


def test_what_reaches_far_over_the_border_is_not_cut():
    zero, size = np.zeros(1), Size("s", count=1, footprint=Footprint.rectangle(8.0, 1.0))
    problem = Problem(Domain((10.0, 10.0)), [BodyClass("a", [size])])
    placement = Placement(problem, np.array([[9.0, 5.0]]), *problem.body_indices(), zero, zero, zero)
    file = io.BytesIO()
    draw_plan(placement, file, colors=["red"])
    picture = np.asarray(Image.open(file)).astype(int)
    _, column = np.nonzero(is_color(picture[:-200], RED))
    assert np.ptp(column) / 160.0 == pytest.approx(8.0, abs=0.02)


def test_the_eleventh_class_has_a_color_of_its_own():
    """It had that of the first."""
    classes = [BodyClass(str(number), [Size("s", 0.5, 1)]) for number in range(12)]
    center = [[1.0 + 2.0 * (number % 4), 1.0 + 3.0 * (number // 4)] for number in range(12)]
    plan = plan_of(place(Domain((8.0, 8.0)), classes, center))
    inside = plan[plan.shape[0] // 40 :]
    for color in class_colors(12):
        assert (np.abs(inside.astype(int) - np.array(color)).max(axis=2) <= 2).any()
