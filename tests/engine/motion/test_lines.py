"""Line bodies through the solver: direction, length, crossings, bends, places that they may not reach."""

import math

import numpy as np
import pytest
from esh.engine.drawing.halftone import render_halftone
from esh.engine.problem.body_class import BodyClass, Unsharp
from esh.engine.problem.domain import Domain
from esh.engine.problem.image_filters import gaussian_blur
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.line_quality import angle_errors, crossing_lines
from esh.engine.solve import solve

DOMAIN = Domain((40.0, 30.0))


def lines(line, count=600, domain=DOMAIN, density=1.0, **options):
    problem = Problem(domain, [BodyClass("a", [Size("s", 0.5, count, line=line)], density)])
    return solve(problem, device="cpu", **options)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("angle", [0.0, 1.0, -0.6, 2.8])
def test_a_constant_direction_is_met_and_lengths_are(angle, boundary):
    placement = lines(Line(1.5, direction=angle), domain=Domain((40.0, 30.0), boundary))
    assert np.degrees(angle_errors(placement.angle, angle)).mean() < 8.0
    assert placement.length.mean() == pytest.approx(1.5, rel=0.02)
    assert crossing_lines(placement.position, placement.angle, placement.length, placement.problem.domain) <= 6
    # Width from equal average gray: capsules as large as the footprints, in the mean.
    capsule = placement.length * placement.width + math.pi / 4 * placement.width**2
    assert capsule.mean() == pytest.approx(0.5, rel=0.01)


def test_lines_lie_along_the_edges_of_the_density():
    y, x = np.mgrid[0:60, 0:80]
    stripes = 0.55 + 0.45 * np.sin(0.35 * (x + y))  # down to the right: edges at 45 degrees, counter-clockwise from x
    placement = lines(Line(1.5), density=stripes)
    assert np.degrees(angle_errors(placement.angle, math.pi / 4)).mean() < 10.0


def test_pixels_that_are_not_square_do_not_turn_directions():
    y, x = np.mgrid[0:60, 0:60]
    # On 40 m by 20 m the pixels are twice as wide as high: an edge at 45 degrees on the ground.
    stripes = 0.55 + 0.45 * np.sin(0.3 * (2 * x + y))
    placement = lines(Line(1.5), density=stripes, domain=Domain((40.0, 20.0)))
    assert np.degrees(angle_errors(placement.angle, math.pi / 4)).mean() < 10.0


def test_an_image_of_lengths_is_followed():
    wanted = np.where(np.arange(40)[None] < 20, 1.0, 2.0) * np.ones((30, 1))
    placement = lines(Line(wanted, direction="none"))
    left = placement.position[:, 0] < 18.0
    right = placement.position[:, 0] > 22.0
    assert placement.length[left].mean() == pytest.approx(1.0, rel=0.2)
    assert placement.length[right].mean() == pytest.approx(2.0, rel=0.2)


def test_vectors_lead_where_they_are_and_leave_free_where_they_are_zero():
    flow = np.zeros((30, 40, 2))
    flow[:, :20] = [0.0, 1.0]
    placement = lines(Line(1.2, direction=flow))
    upright = angle_errors(placement.angle, math.pi / 2)
    assert np.degrees(upright[placement.position[:, 0] < 18.0]).mean() < 8.0
    assert np.degrees(upright[placement.position[:, 0] > 22.0]).mean() > 20.0


def test_no_charge_stands_on_an_empty_pixel_or_outside():
    density = np.zeros((30, 40))
    density[5:25, 5:35] = 1.0
    density[12:18, 15:25] = 0.0
    placement = lines(Line(2.0, direction=0.5), count=250, density=density)
    half = 0.5 * placement.length[:, None] * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)
    for places in (placement.position - half, placement.position, placement.position + half):
        column, row = np.floor(places[:, 0]).astype(int), np.floor(30.0 - places[:, 1]).astype(int)
        # Rounding to float32 on a pixel's very edge is no fault.
        near = [density[np.clip(row + a, 0, 29), np.clip(column + b, 0, 39)] for a in (0, 1, -1) for b in (0, 1, -1)]
        assert (density[row, column] > 0).mean() > 0.99
        assert (np.max(near, axis=0) > 0).all()


def test_stiff_lines_are_straight_and_others_bend_a_little():
    y, x = np.mgrid[0:60, 0:80]
    rings = 0.55 + 0.45 * np.sin(0.5 * np.hypot(x - 40, y - 30))
    straight = lines(Line(4.0, charges=5), count=200, density=rings)
    assert straight.bends is None
    bent = lines(Line(4.0, charges=5, straightness=0.02), count=200, density=rings)
    assert bent.bends.shape == (200, 5, 2)
    chord = np.linalg.norm(bent.bends[:, -1] - bent.bends[:, 0], axis=1)
    path = np.linalg.norm(np.diff(bent.bends, axis=1), axis=2).sum(axis=1)
    assert (path >= chord - 1e-6).all()
    assert np.mean(path / chord) > 1.005
    stiffer = lines(Line(4.0, charges=5, straightness=0.9), count=200, density=rings)
    assert np.mean(np.linalg.norm(np.diff(stiffer.bends, axis=1), axis=2).sum(axis=1) / stiffer.length) < np.mean(
        path / bent.length
    )


def test_lines_and_dots_of_one_picture_share_it_and_the_same_seed_gives_the_same_bytes():
    sizes = [Size("line", 0.5, 300, line=Line(1.5)), Size("dot", 0.5, 300)]
    problem = Problem(DOMAIN, [BodyClass("a", sizes)])
    first, second = (solve(problem, device="cpu", max_steps=40) for _ in range(2))
    for name in ("position", "angle", "length", "width"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert (first.length[first.size_index == 1] == 0).all() and (first.width[first.size_index == 1] == 0).all()
    assert first.report.coverage_error < 0.06


@pytest.mark.parametrize("many", [200, 2000])
@pytest.mark.parametrize("charges", [None, 15])
def test_lines_that_are_rare_beside_others_are_as_long_as_was_asked(many, charges):
    """Their own charges, which count for more the rarer they are, stretched them by a fifth to a half."""
    line = Line(2.0, 0.3, width=0.1, charges=charges) if charges else Line(2.0, 0.3, width=0.1)
    classes = [BodyClass("rare", [Size("s", 0.3, 30, line=line)]), BodyClass("many", [Size("d", 0.2, many)])]
    length = solve(Problem(Domain((40.0, 40.0)), classes, seed=2), device="cpu").length[:30]
    assert length.mean() == pytest.approx(2.0, rel=0.05)
    assert (np.abs(length - 2.0) < 0.2).all()


def photograph(side):
    """Darkness of scikit-image's "camera" (CC0), means of blocks."""
    data = pytest.importorskip("skimage.data")
    block = 512 // side
    gray = data.camera()[: side * block, : side * block] / 255.0
    return 1.0 - gray.reshape(side, block, side, block).mean(axis=(1, 3))


def darkness_drawn(placement, side):
    """Share of every pixel of a picture that is covered, shape ``[side, side]``."""
    drawn = 1.0 - render_halftone(placement, pixels_per_metre=4.0)[..., 0]
    return drawn.reshape(side, 4, side, 4).mean(axis=(1, 3))


@pytest.mark.parametrize("length", [2.0, 4.0])
def test_a_hatched_photograph_is_as_dark_as_was_asked(length):
    """Lines that lie on each other cover less than they add up to: of 0.96 there was 0.79 or 0.73."""
    image, count = photograph(102), 5000
    size = Size("line", image.sum() / count, count, line=Line(length))
    placement = solve(Problem(Domain((102.0, 102.0)), [BodyClass("ink", [size], image)]), device="cpu", max_steps=60)
    # At a scale of some lines: single ones are as thick as the pixels.
    drawn, asked = gaussian_blur(darkness_drawn(placement, 102), 1.5), gaussian_blur(image, 1.5)
    assert drawn.mean() == pytest.approx(image.mean(), abs=0.01)
    for tone, least in ((0.96, 0.93), (0.79, 0.77), (0.5, 0.48)):
        near = np.abs(asked - tone) < 0.02
        off = (drawn - asked)[near].mean()
        assert near.sum() > 30 and least - tone <= off < 0.02
    # Widths make up for it; what is placed where, and how, is as it was.
    assert placement.width.max() > 1.3 * placement.width.min()


def test_lines_beside_strong_edges_are_no_halos():
    """Two pixels on the bright side of the strongest edges plain unsharp masking leaves half of the darkness."""
    image, count = photograph(256)[20:120, 60:160], 5000
    gradient = np.array(np.gradient(image))
    steep = np.hypot(*gradient)
    row, column = np.nonzero(steep[3:-3, 3:-3] >= np.quantile(steep, 0.99))
    row, column = row + 3, column + 3
    away = np.round(2.0 * gradient[:, row, column] / steep[row, column]).astype(int)
    bright = (row - away[0], column - away[1])
    off = []
    for overshoot in (0.0, 1.0):
        size = Size("line", image.sum() / count, count, line=Line(2.0))
        body_class = BodyClass("ink", [size], image, unsharp=Unsharp(1.0, 2.0, overshoot))
        placement = solve(Problem(Domain((100.0, 100.0)), [body_class]), device="cpu", max_steps=60)
        off.append((darkness_drawn(placement, 100) - image)[bright].mean())
    assert abs(off[0]) < 0.02 < 0.04 < -off[1]


@pytest.mark.parametrize("area", [1e-18, 1e-6, 0.5, 40.0])
def test_capsules_of_the_mean_length_have_the_area_that_is_asked_for(area):
    """However thin they are: a difference of nearly equal numbers was 0."""
    (width,) = Line(450.0).thickness(np.array([area]), 450.0)
    assert 450.0 * width + 0.25 * np.pi * width**2 == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("thickness", [None, 0.2])
def test_widths_stay_where_lines_do_not_overlap_and_where_they_are_given(thickness):
    sparse = lines(Line(1.5, direction=0.4, width=thickness), count=300)
    assert np.ptp(sparse.width) == 0.0
    crowded = Size("s", 1.6, 600, line=Line(1.5, width=thickness))
    for apart in (False, True):
        problem = Problem(DOMAIN, [BodyClass("a", [crowded])], avoid_overlap=apart)
        width = solve(problem, device="cpu", max_steps=20).width
        assert (np.ptp(width) == 0.0) == (thickness is not None or apart)


def test_every_size_and_class_is_drawn_by_itself():
    """Dots and lines of given widths are as they are; lines beside them make up for what all of a class lack, wherever it wraps."""
    sizes = [
        Size("line", 0.6, 500, line=Line(2.0, 0.3)),
        Size("thick", 0.3, 100, line=Line(1.0, 0.3, width=0.4)),
        Size("dot", 0.5, 300),
        Size("bent", 0.6, 200, line=Line(2.0, "none", straightness=0.2)),
    ]
    density = np.tile(0.4 + 0.35 * np.sin(2.0 * np.pi * np.arange(40) / 40.0), (30, 1))
    domain = Domain((40.0, 30.0), "periodic")
    problem = Problem(domain, [BodyClass("a", sizes, density), BodyClass("b", [Size("dot", 0.5, 100)])])
    placement = solve(problem, device="cpu", max_steps=60)
    of_class = placement.class_index == 0
    drawn = 1.0 - render_halftone(placement, pixels_per_metre=8.0, chosen=of_class)[..., 0]
    asked = density / density.mean() * placement.area[of_class].sum() / domain.area
    columns = drawn.reshape(30, 8, 40, 8).mean(axis=(0, 1, 3))
    assert np.abs(columns - asked.mean(axis=0)).max() < 0.06
    assert drawn.mean() == pytest.approx(asked.mean(), abs=0.01)
    width = [placement.width[of_class & (placement.size_index == k)] for k in range(4)]
    assert np.ptp(width[0]) > 0.0 and np.ptp(width[1]) == 0.0 and (width[2] == 0.0).all() and np.ptp(width[3]) > 0.0


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_lengths_of_an_image_are_met_place_by_place(boundary):
    """In the mean they were; where the density was low, lines were half as long again."""
    y, x = np.mgrid[0:40, 0:40] / 40.0
    wanted, count = 0.6 + 3.0 * y, 2500
    size = Size("s", 0.3, count, line=Line(wanted, "density"))
    body_class = BodyClass("a", [size], np.exp(-3.0 * x) + np.exp(-3.0 * (1.0 - x)) * (boundary == "periodic"))
    placement = solve(Problem(Domain((50.0, 50.0), boundary), [body_class]), device="cpu")
    column, row = (placement.position / 50.0 * 40).astype(int).T
    asked = wanted[39 - row, column]
    # Blocks of some 400 lines' ground.
    block = (placement.position / 50.0 * 2.5).astype(int) @ [1, 3]
    for k in np.unique(block):
        here = block == k
        if here.sum() > 30:
            assert placement.length[here].mean() == pytest.approx(asked[here].mean(), rel=0.1)


def test_one_length_is_met_place_by_place_where_a_density_varies():
    """In the mean it was; short lines were half as long again where there were few, so that light parts were too dark."""
    density = np.tile(np.linspace(0.05, 0.35, 60), (60, 1))
    size = Size("s", density.mean() * 3600.0 / 1200, 1200, line=Line(1.0))
    placement = solve(Problem(Domain((60.0, 60.0)), [BodyClass("a", [size], density)]), device="cpu", max_steps=60)
    column = (placement.position[:, 0] / 15.0).astype(int)
    for k in range(4):
        assert placement.length[column == k].mean() == pytest.approx(1.0, rel=0.1)


def test_widths_make_up_for_what_only_a_small_dark_part_lacks():
    """The picture as a whole lacks next to nothing, so that widths were left as they were, and the spots were too light."""
    y, x = np.mgrid[0:100, 0:100] + 0.5
    spots = sum(np.exp(-0.5 * np.hypot(x - a, y - b) ** 2 / 5.0**2) for a, b in ((25, 30), (70, 60)))
    image, count = 0.35 + 0.6 * spots, 3500
    size = Size("line", image.sum() / count, count, line=Line(2.0, "none"))
    placement = solve(Problem(Domain((100.0, 100.0)), [BodyClass("ink", [size], image)]), device="cpu", max_steps=60)
    drawn, asked = gaussian_blur(darkness_drawn(placement, 100), 1.5), gaussian_blur(image, 1.5)
    dark = asked > 0.75
    assert dark.sum() > 80
    assert drawn[dark].mean() == pytest.approx(asked[dark].mean(), abs=0.02)


def test_lines_that_cover_the_ground_many_times_are_left_as_they_are():
    """They would take long to draw, and are black in any case."""
    size = Size("s", 30.0, 400, line=Line(4.0, "none"))
    placement = solve(Problem(DOMAIN, [BodyClass("a", [size])]), device="cpu", max_steps=5)
    assert np.ptp(placement.width) == 0.0
