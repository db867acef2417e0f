"""Classes on a target seen from above: densities as the plan view shows them, counts as the slopes make them, and outlines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...engine.errors import ProblemError
from ...engine.problem.body_class import BodyClass, ClassSettings, PlacingSettings
from ...engine.problem.direction_field import density_directions
from ...engine.problem.footprints import Footprints
from ...engine.problem.line import Line
from ...engine.problem.look_at import LookAt
from ...engine.problem.packing import packable_share, scale_to_fit
from ...engine.problem.prepared_class import PreparedClass, PreparedDensity, count_sizes, prepare_density
from ...engine.problem.scatter_settings import ScatterSettings, Standing
from ...engine.problem.settings import values_of
from ...engine.problem.size import Size, with_count
from ...engine.problem.surface_directions import SLOPE
from ...engine.problem.validation import check_density
from ...engine.solver.memory import check_counts
from ...engine.surface.chart import Chart
from .amount import Amount
from .on_whole_surface import mean_footprint
from .scatter_class import ScatterClass, standing_of
from .sources import (
    DISC_IN_POLYGON,
    EDGE_SCALES,
    SizeShape,
    disc_of_area,
    engine_size,
    variant_footprints,
    variants_of,
    with_any_outline,
)
from .standing import draw

__all__ = ["ClassesFromAbove"]


class _Asked(NamedTuple):
    """A class on its way to the engine.

    Attributes:
        asked: As the engine is asked for it.
        surface: Its density, per area of surface.
        density: The same, per area of the plan view.
        most: What of the ground its bodies can cover, per area of the plan view, where it is to cover as much as that; else None.
    """

    asked: BodyClass
    surface: PreparedDensity
    density: np.ndarray
    most: np.ndarray | None


class ClassesFromAbove:
    """Classes on their way to the engine, which places them in a chart's rectangle.

    Args:
        chart: What they stand on.
        target_name: How sentences name it.
        classes: What is asked.
        shapes: Of their sizes, by class.
        settings: How the scatter is made.
        staying: How many objects of an earlier result stay, by class and size; they are among the counts.
    """

    def __init__(
        self,
        chart: Chart,
        target_name: str,
        classes: Sequence[ScatterClass],
        shapes: Sequence[Sequence[SizeShape]],
        settings: ScatterSettings,
        staying: Mapping[tuple[int, int], int],
    ) -> None:
        self._staying = staying
        self._chart, self._target_name = chart, target_name
        self._classes, self._shapes = classes, shapes
        self._settings = settings
        # Bodies of the sizes before, which number the points.
        self._counted = 0

    def prepare(self, values: Sequence[np.ndarray]) -> list[PreparedClass]:
        """Return what the engine is to place, once.

        Args:
            values: Densities of the classes per area of surface, each of the chart's shape.

        Raises:
            ProblemError: A class has nowhere to be.
        """
        asked = [self._ask(*one) for one in zip(self._classes, self._shapes, values, strict=True)]
        share = _share_of_cover([one for one in asked if one.most is not None])
        counted = [self._count(one, 1.0 if one.most is None else share) for one in asked]
        check_counts(
            [(one.asked.name, size) for one, sizes in zip(asked, counted, strict=True) for size in sizes],
            self._settings.avoid_overlap,
        )
        return [self._prepare_class(number, *pair) for number, pair in enumerate(zip(asked, counted, strict=True))]

    def _ask(self, c: ScatterClass, shapes: Sequence[SizeShape], values: np.ndarray) -> _Asked:
        """Return a class as the engine is asked for it, its density on the surface, and what of it the plan view shows."""
        sizes = [engine_size(size, shape) for size, shape in zip(c.sizes, shapes, strict=True)]
        key = f'`density` of class "{c.name}"'
        # Sharpened and corrected as it is on the surface; only then slopes, which hold more of it, make it larger.
        count = 1 if isinstance(c.count, Amount) else c.count
        asked = BodyClass(c.name, sizes, values, count, **values_of(c, ClassSettings))
        surface = prepare_density(asked)
        if isinstance(c.count, Amount):
            asked = replace(asked, count=_number(self._chart, c.count, asked, surface.image))
        density = surface.image * self._chart.stretch
        if not float(density.mean()) > 0.0:
            raise ProblemError(f"{key} must be above 0 somewhere on {self._target_name}; it is 0 everywhere")
        most = None
        if asked.count == "cover" and self._settings.avoid_overlap:
            standing = standing_of(c, self._settings)
            outlined = [with_any_outline(size, shape) for size, shape in zip(sizes, shapes, strict=True)]
            most = packable_share(outlined, c.room, c.gap) * _ground_for(self._chart, standing, outlined)
            density = np.minimum(density, most)
        return _Asked(asked, surface, density, most)

    def _count(self, one: _Asked, share: float) -> list[Size]:
        """Return the sizes of a class, all with a whole count."""
        area = float(self._chart.size[0]) * float(self._chart.size[1])
        return list(count_sizes(one.asked, share * area * float(one.density.mean())))

    def _prepare_class(self, number: int, one: _Asked, sizes: list[Size]) -> PreparedClass:
        chart, c = self._chart, self._classes[number]
        if self._settings.avoid_overlap:
            sizes = [self._with_outlines((number, s), size) for s, size in enumerate(sizes)]
        # A Line that was given looks at the density as the engine does; ours only at what lies on the surface.
        ours = [i for i, given in enumerate(c.sizes) if not isinstance(given.line, Line)]
        lines = {i: line for i in ours if (line := sizes[i].line) is not None}
        if lines and isinstance(c.direction, str) and c.direction in ("density", SLOPE):
            edges = c.direction == "density"
            direction = _edge_directions(chart, one.surface.image) if edges else _slope_directions(chart)
            for i, line in lines.items():
                sizes[i] = replace(sizes[i], line=replace(line, direction=direction))
        density = check_density(one.density, f'`density` of class "{c.name}"')
        return PreparedClass(
            c.name,
            tuple(sizes),
            density,
            one.surface.notes,
            **{**values_of(c, PlacingSettings), "look_at": self._looking(c)},
        )

    def _looking(self, c: ScatterClass) -> LookAt | None:
        """Return where a class looks, in the chart's rectangle."""
        if c.look_at is None:
            return None
        x, y, z = c.look_at.point
        return replace(c.look_at, point=(x - float(self._chart.origin[0]), y - float(self._chart.origin[1]), z))

    def _with_outlines(self, where: tuple[int, int], size: Size) -> Size:
        """Return a size whose bodies have the outlines of what is placed there, as large and as turned as it will stand.

        Args:
            where: Number of its class, and its own.
            size: With its whole count.
        """
        shape = self._shapes[where[0]][where[1]]
        identity = np.arange(self._counted, self._counted + (size.count or 0))
        self._counted += len(identity)
        if shape.line_given or not len(identity):
            return size
        standing = standing_of(self._classes[where[0]], self._settings)
        long = np.full(len(identity), shape.line is not None)
        factor, turn = draw(standing, identity, long, self._settings.seed)
        slope = self._chart.slope(standing.align_to_normal)
        if not shape.outlines_of_variants:
            return self._with_discs(size, factor, slope, standing.tilt)
        variants = variant_footprints(shape)
        variant = variants_of(identity, len(variants), shape.weights, self._settings.seed)
        if isinstance(shape.area, tuple):
            # What gives each object its area; its jitter comes on top of that.
            area = self._areas(where, size)
            factor = factor * np.sqrt(area / np.array([outline.area for outline in variants])[variant])
        footprint = Footprints(variants, variant=variant, scale=factor, turn=turn, slope=slope, tilt=standing.tilt)
        return replace(size, footprint=footprint)

    def _areas(self, where: tuple[int, int], size: Size) -> np.ndarray:
        """Areas of a size's bodies [m²] as the engine draws them; of those that stay, which come last, nobody asks any."""
        count = size.count or 0
        left = max(count - self._staying.get(where, 0), 0)
        drawn = with_count(size, left).areas([self._settings.seed, 2, *where])
        return np.pad(drawn, (0, count - left), mode="edge") if left else np.full(count, size.mean_area)

    def _with_discs(self, size: Size, factor: np.ndarray, slope: np.ndarray | None, tilt: float) -> Size:
        """Return a size whose bodies are discs that somebody asked for, as large as the objects will be, and leaning as these do.

        Their scales are those of the objects, as where outlines are the objects' own: what is pinned is known by its scale.
        """
        # A level disc keeps off more than one that leans, but where it is mostly flat less than a polygon around one that leans.
        if slope is not None:
            longer = np.sqrt(1.0 + (slope**2).sum(axis=-1))
            if np.average(longer, weights=self._chart.area) < DISC_IN_POLYGON:
                slope = None
        if slope is None and (factor == 1.0).all():
            return size
        disc = disc_of_area(size.mean_area, leans=slope is not None)
        tilt = 0.0 if slope is None else tilt
        return replace(size, footprint=Footprints(disc, scale=factor, turn=0.0, slope=slope, tilt=tilt))


def _share_of_cover(asked: list[_Asked]) -> float:
    """What classes that are to cover the ground, and keep apart on it, can have of what each of them alone could cover."""
    if not asked:
        return 1.0
    return scale_to_fit([one.density / one.most for one in asked if one.most is not None], 1.0)


def _slope_directions(chart: Chart) -> str | np.ndarray:
    """Return where water runs on the surface as a :class:`Line` takes it; what is steep weighs more."""
    normal = chart.points.normal
    downhill = np.stack([chart.continued(normal[:, k]) for k in (0, 1)], axis=-1)
    return downhill if downhill.any() else "none"


def _edge_directions(chart: Chart, density: np.ndarray) -> str | np.ndarray:
    """Return the directions of a density's edges on the surface as a :class:`Line` takes them."""
    if density.min() == density.max():
        return "none"
    cell_width, cell_height = (float(length) for length in chart.cell)
    edges = density_directions(density, *EDGE_SCALES, pixel_size=(cell_width, cell_height))
    weight = np.where(chart.area > 0.0, edges.weight, 0.0)
    if not weight.any():
        return "none"
    weight /= weight.max()
    return weight[..., None] * np.stack([np.cos(edges.angle), np.sin(edges.angle)], axis=-1)


def _number(chart: Chart, amount: Amount, asked: BodyClass, density: np.ndarray) -> int:
    """Return how many bodies an amount is on this surface."""
    area = float((np.minimum(density, 1.0) * chart.area).sum())
    return amount.number(area, mean_footprint(asked), f'class "{asked.name}"')


def _ground_for(chart: Chart, standing: Standing, sizes: Sequence[Size]) -> np.ndarray:
    """Area of ground over its area seen from above that there is for the outlines of sizes, shape as the chart's."""
    if not all(isinstance(size.footprint, Footprints) for size in sizes):
        # Lines that were given lie in the plan.
        return np.ones(chart.shape)
    steep = np.arccos(1.0 / np.maximum(chart.stretch, 1.0))
    return 1.0 / np.cos(standing.align_to_normal * steep)
