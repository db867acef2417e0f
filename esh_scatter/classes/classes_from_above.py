"""Classes on a target seen from above: densities as the plan view shows them, counts as the slopes make them, and outlines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...engine.errors import ProblemError
from ...engine.model.memory import check_counts
from ...engine.problem.body_class import BodyClass, ClassSettings, PlacingSettings
from ...engine.problem.direction_field import density_directions
from ...engine.problem.footprints import Footprints
from ...engine.problem.line import Line
from ...engine.problem.look_at import LookAt
from ...engine.problem.packing import packable_share, scale_to_fit
from ...engine.problem.prepared_class import PreparedClass, PreparedDensity, count_sizes, prepare_density
from ...engine.problem.scatter_settings import ScatterSettings, Standing
from ...engine.problem.settings import values_of
from ...engine.problem.size import Size
from ...engine.problem.surface_directions import SLOPE
from ...engine.problem.validation import check_density
from ...engine.surface.chart import Chart
from .amount import Amount
from .on_whole_surface import mean_footprint
from .outlined_sizes import OutlinedSizes
from .scatter_class import ScatterClass, standing_of, turns_freely
from .sources import EDGE_SCALES, SizeShape, engine_size, with_any_outline

__all__ = ["ClassesFromAbove", "directions_from_above"]


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
        self._outlined = OutlinedSizes(classes, shapes, settings, staying)
        self._chart, self._target_name = chart, target_name
        self._classes, self._shapes = classes, shapes
        self._settings = settings

    def prepare(self, values: Sequence[np.ndarray]) -> list[PreparedClass]:
        """Return what the engine is to place, once.

        Args:
            values: Densities of the classes per area of surface, each of the chart's shape.

        Raises:
            ProblemError: A class has nowhere to be.
        """
        asked = [self._ask(*one) for one in zip(self._classes, self._shapes, values, strict=True)]
        share = _share_of_cover([one for one in asked if one.most is not None])
        wanted = [self._area_of(one.density) * (1.0 if one.most is None else share) for one in asked]
        counted = [list(count_sizes(one.asked, area)) for one, area in zip(asked, wanted, strict=True)]
        for k, left in self._left_beside_counted(asked, counted, wanted, share):
            counted[k] = list(count_sizes(asked[k].asked, left))
        check_counts(
            [(one.asked.name, size) for one, sizes in zip(asked, counted, strict=True) for size in sizes],
            self._settings.avoid_overlap,
        )
        return [self._prepare_class(number, *pair) for number, pair in enumerate(zip(asked, counted, strict=True))]

    def _ask(self, c: ScatterClass, shapes: Sequence[SizeShape], values: np.ndarray) -> _Asked:
        """Return a class as the engine is asked for it, its density on the surface, and what of it the plan view shows."""
        jitter = standing_of(c, self._settings).scale_jitter if self._settings.avoid_overlap else 0.0
        sizes = [engine_size(size, shape, jitter) for size, shape in zip(c.sizes, shapes, strict=True)]
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
            free = turns_freely(c, self._settings)
            outlined = [with_any_outline(*pair, may_turn=free) for pair in zip(sizes, shapes, strict=True)]
            most = packable_share(outlined, c.room, c.gap) * _ground_for(self._chart, standing, outlined)
            density = np.minimum(density, most)
        return _Asked(asked, surface, density, most)

    def _area_of(self, density: np.ndarray) -> float:
        """Area that a density per area of the plan view covers [m²]."""
        return float(self._chart.size[0]) * float(self._chart.size[1]) * float(density.mean())

    def _left_beside_counted(
        self, asked: list[_Asked], counted: list[list[Size]], wanted: list[float], share: float
    ) -> Iterator[tuple[int, float]]:
        """Which classes cannot cover what they want, as those whose counts are given leave less that fits, and how much that is [m²].

        What these take is shared by those that are to cover the ground beside them, as they want it.

        Raises:
            ProblemError: Less than half a body is left.
        """
        covers = [k for k, one in enumerate(asked) if one.most is not None]
        apart = self._settings.non_overlap
        taken = dict.fromkeys(covers, 0.0)
        for i, sizes in enumerate(counted):
            makers = [k for k in covers if i not in covers and (apart is None or apart[i][k] > 0.0)]
            area = sum((size.count or 0) * size.mean_area for size in sizes)
            for k in makers:
                taken[k] += area * wanted[k] / sum(wanted[maker] for maker in makers)
        for k in covers:
            one, most = asked[k], asked[k].most
            assert most is not None
            left = share * self._area_of(np.where(one.density > 0.0, most, 0.0)) - taken[k]
            if taken[k] == 0.0 or left >= wanted[k]:
                continue
            if left < 0.5 * min(size.mean_area for size in one.asked.sizes):
                raise ProblemError(
                    f'{self._target_name} has no room for class "{one.asked.name}" beside the counts of the others; lower '
                    "these, or give it a count of its own"
                )
            yield k, left

    def _prepare_class(self, number: int, one: _Asked, sizes: list[Size]) -> PreparedClass:
        chart, c = self._chart, self._classes[number]
        if self._settings.avoid_overlap:
            standing = standing_of(c, self._settings)
            slope = chart.slope(standing.align_to_normal)
            leaning = None if slope is None else (slope, chart.area)
            sizes = [self._outlined.size((number, s), size, leaning, standing.tilt) for s, size in enumerate(sizes)]
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


def _share_of_cover(asked: list[_Asked]) -> float:
    """What classes that are to cover the ground, and keep apart on it, can have of what each of them alone could cover."""
    if not asked:
        return 1.0
    return scale_to_fit([one.density / one.most for one in asked if one.most is not None], 1.0)


def _slope_directions(chart: Chart) -> str | np.ndarray:
    """Return where water runs on the surface as a :class:`Line` takes it; what is steep weighs more."""
    return directions_from_above(chart, chart.points.normal)


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


def directions_from_above(chart: Chart, vectors: np.ndarray) -> str | np.ndarray:
    """Return vectors along the surface at the chart's points, shape ``[n, 3]``, as a :class:`Line` takes them."""
    field = np.stack([chart.continued(vectors[:, k]) for k in (0, 1)], axis=-1)
    return field if field.any() else "none"


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
