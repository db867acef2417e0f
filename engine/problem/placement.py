"""The result of a run: where every body is, and the report on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .body_footprints import footprints_of
from .body_kind import radius_of
from .settings import settle

if TYPE_CHECKING:
    from .problem import Problem
    from .report import Report

__all__ = ["Placement"]


@dataclass(frozen=True, eq=False)
class Placement:
    """Bodies in class, then size order; every count exactly as asked.

    Attributes:
        problem: What was asked for.
        position: Body positions [m], shape ``[n, 2]``, float64, inside the domain; ``[n, 3]`` on a surface.
        class_index: Index into ``problem.classes``, shape ``[n]``, int32.
        size_index: Index into the class's sizes, shape ``[n]``, int32.
        angle: How the body's outline is turned [rad], counter-clockwise, -pi to pi, shape ``[n]``, float64. Of a line without one it
            is the direction of the axis from x, within half a turn; 0 for other bodies without outlines.
        length: Length of a line body's axis [m], from its first to its last charge, shape ``[n]``, float64; 0 for dots.
        width: Thickness of a line body [m], a capsule around its axis, shape ``[n]``, float64; 0 for dots.
        report: What was reached; None before it is measured.
        bends: None where no line may bend. Otherwise the places of the charges along every body [m], shape
            ``[n, charges, 2]``, on a surface ``[n, charges, 3]``; NaN for bodies that do not bend, and beyond the charges of those
            that have fewer.
        id: Identity of every body, shape ``[n]``, int64: a body keeps it from one edit to the next, and a fixed one brings its own.
        fixed: Whether a body was fixed, shape ``[n]``, bool; of every size those come last.
        variant: Which of the outlines of its size every body has, shape ``[n]``, int32; 0 where there are none.
        scale: Factor on that outline, shape ``[n]``, float64; 1 where there is none.
        normal: On a surface, where it looks to at every body, of length 1, shape ``[n, 3]``, float64; None in a rectangle, as what
            follows.
        tangent: Direction along the surface, at a right angle to the normal, of length 1, shape ``[n, 3]``: that of a line's axis; of
            a dot the one nearest to x, or to y where the surface looks along x, by a cosine above 0.9.
        mesh: Mesh of the surface that every body is on, shape ``[n]``, int32.
        triangle: Triangle of that mesh, shape ``[n]``, int32.
        barycentric: Weights of that triangle's corners, shape ``[n, 3]``, float64.
    """

    problem: Problem
    position: np.ndarray
    class_index: np.ndarray
    size_index: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    width: np.ndarray
    report: Report | None = None
    bends: np.ndarray | None = None
    id: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    fixed: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    variant: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    scale: np.ndarray = field(default_factory=lambda: np.zeros(0))
    normal: np.ndarray | None = None
    tangent: np.ndarray | None = None
    mesh: np.ndarray | None = None
    triangle: np.ndarray | None = None
    barycentric: np.ndarray | None = None

    def __post_init__(self) -> None:
        count = len(self.position)
        if not len(self.id):
            settle(self, id=np.arange(count, dtype=np.int64))
        if not len(self.fixed):
            settle(self, fixed=np.zeros(count, bool))
        if not len(self.variant):
            asked = footprints_of(self.problem)
            settle(self, variant=asked.variant, scale=asked.scale)

    @property
    def class_name(self) -> tuple[str, ...]:
        """Names of the classes, in the order that ``class_index`` counts."""
        return tuple(body_class.name for body_class in self.problem.classes)

    @property
    def area(self) -> np.ndarray:
        """Footprint of every body [m²], shape ``[n]``, float64."""
        return np.array(self.problem.areas_as_outlined(self.problem.shared_areas(), self.variant, self.scale))

    @property
    def radius(self) -> np.ndarray:
        """Radius of every dot's disc, half the thickness of every line's capsule [m], shape ``[n]``, float64."""
        return radius_of(self.width, self.area)
