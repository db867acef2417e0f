"""The result of a run: where every body is, and the report on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .body_footprints import footprints_of

if TYPE_CHECKING:
    from .problem import Problem
    from .report import Report

__all__ = ["Placement"]


@dataclass(frozen=True, eq=False)
class Placement:
    """Bodies in class, then size order; every count exactly as asked.

    Attributes:
        problem: What was asked for.
        position: Body positions [m], shape ``[n, 2]``, float64, inside the domain.
        class_index: Index into ``problem.classes``, shape ``[n]``, int32.
        size_index: Index into the class's sizes, shape ``[n]``, int32.
        angle: How the body's outline is turned [rad], counter-clockwise, -pi to pi, shape ``[n]``, float64. Of a line without one it
            is the direction of the axis from x, within half a turn; 0 for other bodies without outlines.
        length: Length of a line body's axis [m], from its first to its last charge, shape ``[n]``, float64; 0 for dots.
        width: Thickness of a line body [m], a capsule around its axis, shape ``[n]``, float64; 0 for dots.
        report: What was reached.
        bends: None where no line may bend. Otherwise the places of the charges along every body [m], shape
            ``[n, charges, 2]``; NaN for bodies that do not bend, and beyond the charges of those that have fewer.
    """

    problem: Problem
    position: np.ndarray
    class_index: np.ndarray
    size_index: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    width: np.ndarray
    report: Report
    bends: np.ndarray | None = None

    @property
    def class_name(self) -> tuple[str, ...]:
        """Names of the classes, in the order that ``class_index`` counts."""
        return tuple(body_class.name for body_class in self.problem.classes)

    @property
    def area(self) -> np.ndarray:
        """Footprint of every body [m²], shape ``[n]``, float64."""
        return self.problem.body_areas()

    @property
    def variant(self) -> np.ndarray:
        """Which of the outlines of its size every body has, shape ``[n]``, int32; 0 where there are none."""
        return footprints_of(self.problem).variant

    @property
    def scale(self) -> np.ndarray:
        """Factor on the outline of every body, shape ``[n]``, float64; 1 where there is none."""
        return footprints_of(self.problem).scale
