"""Ink on paper: areas, places and colours as they are, in pictures of any scale, and as SVG."""

import io
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from esh.engine.errors import EshError
from esh.engine.halftone import ink_coverage, render_halftone, write_halftone_png, write_halftone_svg
from esh.engine.placement import Placement
from esh.engine.problem import BodyClass, Domain, Line, Problem, Size
from esh.engine.report import NO_REPORT
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
        np.full(n, angle), np.full(n, length), np.full(n, width), NO_REPORT, bends,
    )  # fmt: skip


def test_a_disc_has_its_area_and_its_place():
    picture = render_halftone(placement_of([[3.3, 2.1]]), pixels_per_metre=20.0, supersampling=16)
    ink = 1.0 - picture[..., 0]
    assert ink.shape == (120, 200)
    assert ink.sum() / 400.0 == pytest.approx(1.0, rel=0.002)
    rows, columns = np.indices(ink.shape)
    assert (ink * (columns + 0.5)).sum() / ink.sum() / 20.0 == pytest.approx(3.3, abs=0.01)
    assert 6.0 - (ink * (rows + 0.5)).sum() / ink.sum() / 20.0 == pytest.approx(2.1, abs=0.01)


@pytest.mark.parametrize("scale", [1.0, 3.0, 11.5])
def test_mean_grey_is_the_covered_share_at_every_scale(scale):
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
    with pytest.raises(EshError, match="one colour per class, 2; got 1"):
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
