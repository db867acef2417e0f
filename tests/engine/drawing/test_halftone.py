"""Ink on paper: areas, places and colors as they are, in pictures of any scale, and as SVG."""

import io
import itertools
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from esh.engine.drawing import halftone
from esh.engine.drawing.halftone import ink_coverage, render_halftone, write_halftone_png, write_halftone_svg
from esh.engine.errors import EshError
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.line import Line
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image


def placement_of(position, boundary="open", area=1.0, line=None, classes=1, angle=0.0, bends=None):
    """Bodies at ``position``, the first of class 0, the second of class 1, and so on."""
    position = np.asarray(position, float)
    each = len(position) // classes
    size = Size("s", area, each, line=line)
    problem = Problem(Domain((10.0, 6.0), boundary), [BodyClass(f"c{k}", [size]) for k in range(classes)])
    n = len(position)
    class_index, size_index = problem.body_indices()
    length, width = (line.length, line.width) if line else (0.0, 0.0)
    return Placement(
        problem, position, class_index, size_index,
        np.full(n, angle), np.full(n, length), np.full(n, width), bends=bends,
    )  # fmt: skip


def depth_of_samples(placement, shape):
    """How deep every sample lies within the nearest stroke [m], above 0 inside: by distances to all of them and their copies."""
    width, height = placement.problem.domain.size
    x, y = np.meshgrid(
        (np.arange(shape[1]) + 0.5) * width / shape[1], height - (np.arange(shape[0]) + 0.5) * height / shape[0]
    )
    depth = np.full(shape, -np.inf)
    copies = range(-4, 5) if placement.problem.domain.periodic else (0,)
    for i in range(len(placement.position)):
        line = placement.width[i] > 0.0
        axis = placement.length[i] * np.array([math.cos(placement.angle[i]), math.sin(placement.angle[i])])
        radius = 0.5 * placement.width[i] if line else math.sqrt(placement.area[i] / math.pi)
        points = [placement.position[i] - 0.5 * axis, placement.position[i] + 0.5 * axis]
        if placement.bends is not None:
            points = list(placement.bends[i])
        for first, second in itertools.pairwise(points):
            for shift in itertools.product(copies, copies):
                a = first + np.array(shift) * [width, height]
                along = second - first
                t = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / max(along @ along, 1e-30), 0.0, 1.0)
                depth = np.maximum(depth, radius - np.hypot(x - a[0] - t * along[0], y - a[1] - t * along[1]))
    return depth


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 6.0)), min_size=1, max_size=4),
    st.sampled_from(["open", "periodic"]),
    st.sampled_from([0.0, 1e-9, 0.3, math.pi / 4, math.pi / 2, math.pi, -2.0]),
    st.sampled_from([None, Line(0.4, width=0.9), Line(9.5, width=0.3), Line(4.0, width=2.5)]),
    st.sampled_from([0.3, 2.7, 7.0]),
)
def test_a_sample_is_ink_just_where_it_lies_in_a_body(position, boundary, angle, line, scale):
    """Also with few pixels, which are then not square, and with bodies that reach over several edges."""
    placement = placement_of(position, boundary, 2.0, line, angle=angle)
    coverage = ink_coverage(placement, pixels_per_metre=scale)[0]
    depth = depth_of_samples(placement, coverage.shape)
    clear = np.abs(depth) > 1e-9
    np.testing.assert_array_equal(coverage[clear], depth[clear] > 0.0)


def test_a_long_body_wraps_around_a_narrow_domain_more_than_once():
    size = Size("s", 1.0, 1, line=Line(10.0, width=0.2))
    problem = Problem(Domain((10.0, 3.0), "periodic"), [BodyClass("c", [size])])
    one = np.zeros(1, dtype=int)
    place = np.array([[5.0, 1.5]])
    args = one, one, np.array([1.2]), np.array([10.0]), np.array([0.2])
    placement = Placement(problem, place, *args)
    coverage = ink_coverage(placement, pixels_per_metre=20.0)[0]
    np.testing.assert_array_equal(coverage, depth_of_samples(placement, coverage.shape) > 0.0)
    assert coverage.sum() / 400.0 == pytest.approx(10.0 * 0.2 + math.pi * 0.01, rel=0.02)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_bent_lines_are_drawn_along_all_their_parts(boundary):
    bends = np.array([[[8.0, 5.0], [9.5, 5.8], [10.5, 6.5], [10.5, 4.0]]])
    placement = placement_of(
        [[9.0, 5.0]], boundary, line=Line(4.0, width=0.3, straightness=0.1, charges=4), bends=bends
    )
    coverage = ink_coverage(placement, pixels_per_metre=15.0)[0]
    np.testing.assert_array_equal(coverage, depth_of_samples(placement, coverage.shape) > 0.0)


@pytest.mark.parametrize("name", ["SAMPLES_AT_ONCE", "SPANS_AT_ONCE"])
def test_drawing_in_parts_changes_nothing(monkeypatch, name):
    rng = np.random.default_rng(3)
    placement = placement_of(rng.random((40, 2)) * [10.0, 6.0], "periodic", 0.5, Line(1.5, width=0.2), 2, angle=1.0)
    colors = [(0.2, 0.5, 1.0), (1.0, 0.3, 0.9)]

    def draw():
        coverage = ink_coverage(placement, pixels_per_metre=9.0)
        return render_halftone(placement, pixels_per_metre=9.0, colors=colors), coverage

    whole = draw()
    monkeypatch.setattr(halftone, name, 1000)
    for one, other in zip(whole, draw(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert 0.0 < whole[1].mean() < 1.0


def test_mean_color_is_that_of_the_inks_and_of_where_they_meet():
    """The samples' own mean, from the coverage at the samples' scale: nothing is lost between inks, pixels and picture."""
    rng = np.random.default_rng(4)
    placement = placement_of(rng.random((30, 2)) * [10.0, 6.0], "periodic", 1.5, classes=3)
    colors = np.array([(0.0, 1.0, 1.0), (0.9, 0.1, 0.6), (0.5, 0.5, 0.5)])
    picture = render_halftone(placement, pixels_per_metre=5.0, colors=colors, supersampling=4)
    coverage = ink_coverage(placement, pixels_per_metre=20.0)
    light = np.where(coverage[..., None], colors[:, None, None], 1.0).prod(axis=0)
    np.testing.assert_allclose(picture, light.reshape(30, 4, 50, 4, 3).mean(axis=(1, 3)), atol=1e-6)


def test_a_disc_has_its_area_and_its_place():
    picture = render_halftone(placement_of([[3.3, 2.1]]), pixels_per_metre=20.0, supersampling=16)
    ink = 1.0 - picture[..., 0]
    assert ink.shape == (120, 200)
    assert ink.sum() / 400.0 == pytest.approx(1.0, rel=0.002)
    rows, columns = np.indices(ink.shape)
    assert (ink * (columns + 0.5)).sum() / ink.sum() / 20.0 == pytest.approx(3.3, abs=0.01)
    assert 6.0 - (ink * (rows + 0.5)).sum() / ink.sum() / 20.0 == pytest.approx(2.1, abs=0.01)


@pytest.mark.parametrize("scale", [1.0, 3.0, 11.5])
def test_mean_gray_is_the_covered_share_at_every_scale(scale):
    rng = np.random.default_rng(0)
    cells = np.stack(np.meshgrid(np.arange(1, 10, 2), np.arange(1, 6, 2)), axis=-1).reshape(-1, 2)
    placement = placement_of(cells + rng.uniform(-0.3, 0.3, cells.shape))
    assert 1.0 - render_halftone(placement, pixels_per_metre=scale, supersampling=16).mean() == pytest.approx(
        15.0 / 60.0, abs=0.005
    )


def test_a_stroke_is_a_capsule_along_its_angle():
    line = Line(4.0, width=0.5)
    placement = placement_of([[5.0, 3.0]], line=line, angle=math.radians(30))
    ink = 1.0 - render_halftone(placement, pixels_per_metre=40.0, supersampling=4)[..., 0]
    assert ink.sum() / 1600.0 == pytest.approx(4.0 * 0.5 + math.pi * 0.25**2, rel=0.005)
    rows, columns = np.nonzero(ink > 0.5)
    slope = np.polyfit(columns, -rows, 1)[0]
    assert math.degrees(math.atan(slope)) == pytest.approx(30.0, abs=0.5)


def test_a_bent_line_follows_its_points():
    line = Line(4.0, width=0.3, straightness=0.1)
    bends = np.array([[[3.0, 3.0], [5.0, 4.0], [7.0, 3.0]]])
    picture = ink_coverage(placement_of([[5.0, 3.5]], line=line, bends=bends), pixels_per_metre=20.0)[0]
    for x, y, inside in ((3.0, 3.0, True), (5.0, 4.0, True), (4.0, 3.5, True), (5.0, 3.0, False)):
        assert picture[int((6.0 - y) * 20), int(x * 20)] == inside


def test_inks_multiply_and_the_same_ink_counts_once():
    colors = [(0.0, 1.0, 1.0), (1.0, 1.0, 0.0)]
    two = placement_of([[5.0, 3.0], [5.0, 3.0]], classes=2)
    picture = render_halftone(two, pixels_per_metre=10.0, colors=colors)
    np.testing.assert_allclose(picture[30, 50], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(picture[2, 2], 1.0)
    same = render_halftone(placement_of([[5.0, 3.0], [5.0, 3.0]]), pixels_per_metre=10.0, colors=[(0.5, 0.5, 0.5)])
    np.testing.assert_allclose(same[30, 50], 0.5)
    with pytest.raises(EshError, match="one color per class, 2; got 1"):
        render_halftone(two, pixels_per_metre=1.0, colors=colors[:1])


def test_periodic_bodies_come_in_again_on_the_other_side():
    position = [[0.1, 0.1]]
    wrapped = render_halftone(placement_of(position, "periodic"), pixels_per_metre=20.0)
    cut = render_halftone(placement_of(position, "open"), pixels_per_metre=20.0)
    assert (1.0 - wrapped[..., 0]).sum() / 400.0 == pytest.approx(1.0, rel=0.01)
    assert (1.0 - cut[..., 0]).sum() / 400.0 < 0.5
    assert wrapped[0, -1, 0] < 0.5


def test_files(tmp_path):
    line = Line(2.0, width=0.25)
    placement = placement_of([[2.0, 2.0], [6.0, 4.0]], line=line, classes=2, angle=0.5)
    write_halftone_png(tmp_path / "h.png", placement, pixels_per_metre=5.0, colors=[(1, 0, 0), (0, 0, 1)])
    assert Image.open(tmp_path / "h.png").size == (50, 30)
    stream = io.BytesIO()
    write_halftone_svg(stream, placement, colors=[(1, 0, 0), (0, 0, 1)])
    root = ElementTree.fromstring(stream.getvalue())
    groups = [child for child in root if child.tag.endswith("g")]
    assert [group.get("fill") for group in groups] == ["#ff0000", "#0000ff"]
    points = groups[0][0].get("points").split()
    first, last = (np.array([float(v) for v in p.split(",")]) for p in points)
    np.testing.assert_allclose((first + last) / 2, [2.0, 4.0], atol=1e-5)
    np.testing.assert_allclose(last - first, [2.0 * math.cos(0.5), -2.0 * math.sin(0.5)], atol=1e-5)
    with pytest.raises(EshError, match="too large; lower the scale"):
        render_halftone(placement, pixels_per_metre=1e5)


def svg_shapes(placement):
    stream = io.BytesIO()
    write_halftone_svg(stream, placement)
    root = ElementTree.fromstring(stream.getvalue())
    return [shape for group in root if group.tag.endswith("g") for shape in group]


def test_svg_repeats_what_reaches_over_the_edges_of_a_periodic_domain():
    position = [[0.1, 0.1], [5.0, 3.0], [9.9, 3.0]]
    assert len(svg_shapes(placement_of(position, "open"))) == 3
    places = {(float(s.get("cx")), float(s.get("cy"))) for s in svg_shapes(placement_of(position, "periodic"))}
    corner = {(x, y) for x in (0.1, 10.1) for y in (5.9, -0.1)}
    assert {(round(x, 6), round(y, 6)) for x, y in places} == corner | {(5.0, 3.0), (9.9, 3.0), (-0.1, 3.0)}
    bends = np.array([[[8.0, 3.0], [9.0, 3.5], [10.5, 3.0]]])
    line = Line(2.5, width=0.3, straightness=0.1)
    first, second = svg_shapes(placement_of([[9.0, 3.0]], "periodic", line=line, bends=bends))
    points = [np.array([p.split(",") for p in shape.get("points").split()], dtype=float) for shape in (first, second)]
    assert sorted(p[0, 0] for p in points) == [-2.0, 8.0]
    np.testing.assert_allclose(np.abs(points[0] - points[1]), [[10.0, 0.0]] * 3, atol=1e-6)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"pixels_per_metre": 0.0}, "`pixels_per_metre` must be a number above 0"),
        ({"pixels_per_metre": math.nan}, "`pixels_per_metre` must be a number above 0"),
        ({"pixels_per_metre": 1e300}, "too large; lower the scale"),
        ({"supersampling": 0}, "`supersampling` must be a whole number of at least 1; got 0"),
        ({"supersampling": 65}, "`supersampling` must be at most 64; got 65"),
        ({"colors": [(0.0, 0.0, 2.0)]}, "each 0..1; got"),
        ({"colors": [(0.0, 0.0)]}, "each 0..1; got"),
        ({"colors": ["red"]}, "each 0..1; got"),
        ({"colors": 3}, "each 0..1; got 3"),
    ],
)
def test_arguments_without_meaning_are_refused_in_a_sentence(given, complaint):
    with pytest.raises(EshError, match=complaint):
        render_halftone(placement_of([[5.0, 3.0]]), **{"pixels_per_metre": 2.0, **given})


def test_coverage_of_an_absurd_scale_is_refused_before_memory_is_asked_for():
    with pytest.raises(EshError, match="too large; lower the scale"):
        ink_coverage(placement_of([[5.0, 3.0]]), pixels_per_metre=1e9)
