"""Classes on a target as a whole: their densities are functions of points, and counts follow from its area."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...engine.errors import ProblemError, Reason, Refusal
from ...engine.model.memory import check_counts
from ...engine.problem.body_class import BodyClass, ClassSettings
from ...engine.problem.direction_field import direction_field
from ...engine.problem.line import Line
from ...engine.problem.prepared_class import PreparedClass, prepare, prepare_all
from ...engine.problem.scatter_settings import ScatterSettings
from ...engine.problem.settings import values_of
from ...engine.problem.size import Size
from ...engine.problem.surface import PointsOnSurface
from ...engine.surface.instances import body_rotations, rotate
from ...engine.surface.whole_surface import WholeSurface
from .amount import Amount
from .outlined_sizes import OutlinedSizes
from .scatter_class import ScatterClass, standing_of, turns_freely
from .sources import SizeShape, engine_size, with_any_outline

__all__ = ["class_on_surface", "classes_on_surface", "headings", "mean_footprint"]


def class_on_surface(
    chart: WholeSurface, scatter_class: ScatterClass, sizes: Sequence[Size], values: np.ndarray
) -> BodyClass:
    """Return a class as the engine takes it.

    Args:
        chart: The target.
        scatter_class: What is asked.
        sizes: Its sizes as the engine takes them.
        values: Its density at the points of the chart, shape ``[n]``.

    Raises:
        ProblemError: What is not known on whole surfaces.
    """
    c = scatter_class
    if c.unsharp is not None:
        raise ProblemError(
            f'`unsharp` of class "{c.name}" must be None on a whole surface; densities are sharpened only from above',
            Refusal(Reason.SHARPENED_ON_SURFACE, c.unsharp.amount, 0, (c.name, "")),
        )
    sizes = [size if size.line is None else replace(size, line=_along(chart, size.line)) for size in sizes]
    even = values.min() == values.max()
    density = float(values[0]) if even else chart.density(values)
    if not isinstance(c.count, Amount):
        return BodyClass(c.name, sizes, density, c.count, **values_of(c, ClassSettings))
    asked = BodyClass(c.name, sizes, density, 1, **values_of(c, ClassSettings))
    share = np.minimum(prepare(asked, chart.surface).density_on(chart.surface.sample()), 1.0).mean()
    count = c.count.number(chart.area * float(share), mean_footprint(asked), f'class "{c.name}"')
    return replace(asked, count=count)


def classes_on_surface(
    chart: WholeSurface,
    classes: Sequence[ScatterClass],
    shapes: Sequence[Sequence[SizeShape]],
    values: Sequence[np.ndarray],
    settings: ScatterSettings,
    staying: Mapping[tuple[int, int], int],
) -> list[BodyClass] | list[PreparedClass]:
    """Return what the engine is to place on a target as a whole.

    Args:
        chart: The target.
        classes: What is asked.
        shapes: Of their sizes, by class.
        values: Their densities at the points of the chart, shape ``[n]`` each.
        settings: How the scatter is made.
        staying: How many objects of an earlier result stay, by class and size; they are among the counts.

    Raises:
        ProblemError: What is not known on whole surfaces, or a class that has nowhere to be.
    """
    asked = []
    for c, of_class, density in zip(classes, shapes, values, strict=True):
        jitter = standing_of(c, settings).scale_jitter if settings.avoid_overlap else 0.0
        sizes = [engine_size(size, shape, jitter) for size, shape in zip(c.sizes, of_class, strict=True)]
        asked.append(class_on_surface(chart, c, sizes, density))
    if not settings.avoid_overlap:
        return asked
    # How many bodies cover what they are to cover is a matter of their outlines; and these are chosen once it is known how many.
    asked = [
        replace(
            c,
            sizes=[
                with_any_outline(size, shape, may_turn=turns_freely(scatter_class, settings))
                if shape.outlines_of_variants
                else size
                for size, shape in zip(c.sizes, of_class, strict=True)
            ],
        )
        for c, of_class, scatter_class in zip(asked, shapes, classes, strict=True)
    ]
    counted = prepare_all(asked, chart.surface, apart=True)
    check_counts([(c.name, size) for c in counted for size in c.sizes], settings.avoid_overlap)
    outlined = OutlinedSizes(classes, shapes, settings, staying)
    return [
        replace(c, sizes=tuple(outlined.size((number, s), size, None, 0.0) for s, size in enumerate(c.sizes)))
        for number, c in enumerate(counted)
    ]


def headings(normal: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Return the turns about their own axes that lay the x axes of objects along tangents, if they stand along the normal [rad]."""
    upright = body_rotations(normal, 1.0, np.zeros(len(normal)))
    along, beside = (rotate(upright, np.broadcast_to(axis, normal.shape)) for axis in np.eye(3)[:2])
    return np.arctan2((tangent * beside).sum(axis=1), (tangent * along).sum(axis=1))


def _along(chart: WholeSurface, line: Line) -> Line:
    """Return a line whose direction is known on a surface: those that are seen from above are laid onto it."""
    direction = line.direction
    if isinstance(direction, str) or callable(direction):
        return line
    field = direction_field(direction, np.ones((1, 1), np.float32))
    angle, weight = np.atleast_2d(field.angle), np.atleast_2d(field.weight)

    def vectors(points: PointsOnSurface) -> np.ndarray:
        extent = np.maximum(chart.high[:2] - chart.low[:2], 1e-300)
        u, v = np.clip((points.position[:, :2] - chart.low[:2]) / extent, 0.0, 1.0).T
        row = np.minimum(((1.0 - v) * angle.shape[0]).astype(int), angle.shape[0] - 1)
        column = np.minimum((u * angle.shape[1]).astype(int), angle.shape[1] - 1)
        a, w = angle[row, column], weight[row, column]
        return np.stack([w * np.cos(a), w * np.sin(a), np.zeros(len(a))], axis=1)

    return replace(line, direction=vectors)


def mean_footprint(asked: BodyClass) -> float:
    """Return the mean ground that one body of a class takes [m²]."""
    return 1.0 / sum((size.share or 0.0) / size.mean_area for size in asked.sizes)
