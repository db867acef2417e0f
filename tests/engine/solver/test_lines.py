"""Line bodies through the solver: direction, length, crossings, bends, places that they may not reach."""

import math

import numpy as np
import pytest
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
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
