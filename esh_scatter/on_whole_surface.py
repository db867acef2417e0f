"""Classes on a target as a whole: their densities are functions of points, and counts follow from its area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..engine.errors import ProblemError
from ..engine.problem.body_class import BodyClass, ClassSettings
from ..engine.problem.prepared_class import prepare
from ..engine.problem.settings import values_of
from ..engine.problem.size import Size
from ..engine.surface.whole_surface import WholeSurface
from .amount import Amount

if TYPE_CHECKING:
    from .api import ScatterClass

__all__ = ["class_on_surface", "mean_footprint"]


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
            f'`unsharp` of class "{c.name}" must be None on a whole surface; densities are sharpened only from above'
        )
    even = values.min() == values.max()
    density = float(values[0]) if even else chart.density(values)
    if not isinstance(c.count, Amount):
        return BodyClass(c.name, sizes, density, c.count, **values_of(c, ClassSettings))
    asked = BodyClass(c.name, sizes, density, 1, **values_of(c, ClassSettings))
    share = np.minimum(prepare(asked, chart.surface).density_on(chart.surface.sample()), 1.0).mean()
    count = c.count.number(chart.area * float(share), mean_footprint(asked), f'class "{c.name}"')
    return replace(asked, count=count)


def mean_footprint(asked: BodyClass) -> float:
    """Return the mean ground that one body of a class takes [m²]."""
    return 1.0 / sum((size.share or 0.0) / size.mean_area for size in asked.sizes)
