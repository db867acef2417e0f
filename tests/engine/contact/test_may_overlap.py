"""Footprints of classes that may lie on each other are not parted, and their overlaps do not count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.cover import cover_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.line import Line
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.solve import solve
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Point, Polygon

# Moss lies on both of the others, which keep apart.
MATRIX = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0]])
KINDS = {
    "discs": dict(area=0.5),
    "outlines": dict(footprint=Footprint.rectangle(0.9, 0.5)),
    "lines": dict(area=0.4, line=Line(0.8, direction=0.3)),
}


def problem_of(kind: str, boundary: str, matrix: np.ndarray | None = MATRIX, count: int = 40) -> Problem:
    classes = [BodyClass(name, [Size("s", count=count, **KINDS[kind])]) for name in ("moss", "fern", "stone")]
    return Problem(Domain((10.0, 8.0), boundary), classes, Balance(non_overlap=matrix), avoid_overlap=True, seed=2)


def shapes_of(placement: Placement, kind: str) -> list[Polygon]:
    result = []
    for position, angle, length, width, radius in zip(
        placement.position, placement.angle, placement.length, placement.width, placement.radius, strict=True
    ):
        shape = Point(0.0, 0.0).buffer(radius)
        if kind == "outlines":
            shape = Polygon([(-0.45, -0.25), (0.45, -0.25), (0.45, 0.25), (-0.45, 0.25)])
        elif kind == "lines":
            shape = LineString([(-0.5 * length, 0.0), (0.5 * length, 0.0)]).buffer(0.5 * width)
        result.append(translate(rotate(shape, angle, origin=(0.0, 0.0), use_radians=True), *position))
    return result


def overlapping(placement: Placement, kind: str) -> np.ndarray:
    """Pairs of classes that overlap, how often, shape [3, 3]."""
    shapes, count = shapes_of(placement, kind), np.zeros((3, 3), int)
    size = placement.problem.domain.size
    ways = (-1.0, 0.0, 1.0) if placement.problem.domain.periodic else (0.0,)
    shifts = [(x * size[0], y * size[1]) for x in ways for y in ways]
    for i, own in enumerate(shapes):
        for j in range(i):
            if any(own.intersection(translate(shapes[j], *shift)).area > 2e-3 for shift in shifts):
                count[tuple(sorted((placement.class_index[i], placement.class_index[j])))] += 1
    return count


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_only_classes_that_may_overlap_do(kind, boundary):
    placement = solve(problem_of(kind, boundary), device="cpu")
    count = overlapping(placement, kind)
    assert count[0, 1] > 5 and count[0, 2] > 5
    assert count[0, 0] == count[1, 1] == count[2, 2] == count[1, 2] == 0
    # What overlaps by intent is no mistake to be reported.
    assert placement.report.overlaps == 0 and placement.report.converged


@pytest.mark.parametrize("kind", list(KINDS))
def test_where_all_keep_apart_the_matrix_changes_nothing(kind):
    placements = [
        solve(problem_of(kind, "open", matrix, 25), device="cpu", max_steps=20) for matrix in (None, np.ones((3, 3)))
    ]
    np.testing.assert_array_equal(placements[0].position, placements[1].position)
    assert overlapping(placements[0], kind).sum() == 0


def test_the_report_counts_only_what_is_to_keep_apart():
    """Too many to fit: what overlaps beside the classes that may is counted, and nothing else."""
    placement = solve(problem_of("discs", "open", count=80), device="cpu", max_steps=20)
    first, second = np.triu_indices(len(placement.position), 1)
    distance = np.linalg.norm(placement.position[first] - placement.position[second], axis=1)
    lying = distance < (2.0 - 2.0 * 1e-3) * placement.radius[0]
    apart = MATRIX[placement.class_index[first], placement.class_index[second]] > 0.0
    assert (lying & ~apart).sum() > 100
    assert placement.report.overlaps == (lying & apart).sum() > 0


def test_the_cover_is_that_of_classes_that_share_the_ground():
    alone, all_apart = (cover_of(problem_of("outlines", "open", matrix)).covered for matrix in (MATRIX, None))
    assert alone == pytest.approx(all_apart * 2.0 / 3.0)
    assert cover_of(problem_of("outlines", "open", MATRIX, 80)).warning is not None
    assert cover_of(problem_of("outlines", "open", MATRIX, 60)).warning is None
    assert cover_of(problem_of("outlines", "open", None, 60)).warning is not None


@pytest.mark.parametrize("kind", ["discs", "outlines"])
def test_classes_may_overlap_on_a_surface_too(kind):
    x, y = (np.array(values) for values in ([0.0, 10.0, 10.0, 0.0], [0.0, 0.0, 8.0, 8.0]))
    square = Surface(SurfaceMesh(np.stack([x, y, 0.0 * x], axis=1), [[0, 1, 2], [0, 2, 3]]))
    given = problem_of(kind, "open")
    problem = Problem(square, given.classes, given.balance, avoid_overlap=True, seed=2)
    # Of twelve seeds one needs more than the 100 steps that are usual to come to rest.
    placement = solve(problem, device="cpu", max_steps=200)
    flat = laid_flat(placement)
    count = overlapping(flat, kind)
    assert count[0, 1] > 5 and count[0, 2] > 5
    assert count[0, 0] == count[1, 1] == count[2, 2] == count[1, 2] == 0
    assert placement.report.overlaps == 0 and placement.report.converged


def laid_flat(placement: Placement) -> Placement:
    """A placement on a flat square as one of the plane."""
    problem = Problem(Domain((10.0, 8.0)), placement.problem.classes, placement.problem.balance, avoid_overlap=True)
    angle = np.arctan2(placement.tangent[:, 1], placement.tangent[:, 0])
    return replace(placement, problem=problem, position=placement.position[:, :2], angle=angle)
