"""What acts on the bodies of a window, and how much of it counts: less and less towards its cuts."""

from __future__ import annotations

import math

import numpy as np

from ..field.field_targets import FieldTarget
from ..model.model import Model
from .bodies import PartBodies
from .demand import Demand
from .layout import Box
from .plan import Plan
from .window_problem import between_pixels, pixels_of

__all__ = ["by_charge", "charges_fading", "faded_targets"]

# Faded densities stay above zero where they were.
LEAST_FADED = 1e-4


def charges_fading(box: Box, bodies: PartBodies, model: Model, taper: float) -> np.ndarray:
    """How much every charge counts, shape ``[charges]``: less and less towards a cut, near which only pinned bodies are.

    Args:
        box: What is cut out.
        bodies: Those in it.
        model: Made of these.
        taper: How wide the margin is in which charges fade [m].
    """
    body, axial = model.charge.body, model.charge.axial
    if not axial.any():
        return box.fade(bodies.position[:, 0], bodies.position[:, 1], taper)
    along = 0.5 * bodies.length[body] * axial
    x = bodies.position[body, 0] + along * np.cos(bodies.angle[body])
    y = bodies.position[body, 1] + along * np.sin(bodies.angle[body])
    if bodies.bend.size:
        across = by_charge(model, bodies.bend)
        x -= across * np.sin(bodies.angle[body])
        y += across * np.cos(bodies.angle[body])
    return box.fade(x, y, taper)


def faded_targets(
    plan: Plan, box: Box, model: Model, present: np.ndarray, demand: Demand, scale: float, taper: float
) -> list[FieldTarget]:
    """What attracts every group: its share of the whole problem's charge that belongs here, faded as the charges are."""
    names = [c.name for c in plan.problem.classes]
    faded: dict[int, tuple[np.ndarray, np.ndarray, float]] = {}
    result = []
    for g, group in enumerate(present.tolist()):
        c = int(model.groups.class_index[g])
        if c not in faded:
            image = model.problem.classes[c].density_image
            image = image if image.any() else np.ones_like(image)
            # What is even fades all the same.
            rows, columns = image.shape if image.size > 1 else pixels_of(plan, box)
            fade = _fade_of_pixels(box, rows, columns, taper)
            dim = image * np.maximum(fade, LEAST_FADED, dtype=np.float32)
            pixel = box.size[0] * box.size[1] / dim.size
            faded[c] = image, dim, float(dim.sum(dtype=np.float64)) * pixel
        image, dim, held = faded[c]
        whole = demand.totals[names.index(model.problem.classes[c].name)]
        share = held / whole if whole > 0.0 else 0.0
        per_body = scale * float(plan.groups.mean_area[group])
        charge = per_body * float(plan.groups.count[group]) * share * float(demand.level[group])
        more: tuple[FieldTarget, ...] = ()
        if group in demand.excess:
            more = _excess_in(plan, box, demand.excess[group], per_body, taper)
        result.append(FieldTarget(dim, charge, more, class_index=c, whole=image))
    return result


def _fade_of_pixels(box: Box, rows: int, columns: int, taper: float) -> np.ndarray:
    """How much counts at the middles of pixels of a box, row 0 at the top."""
    x = box.low[0] + (np.arange(columns) + 0.5) / columns * box.size[0]
    y = box.high[1] - (np.arange(rows) + 0.5) / rows * box.size[1]
    return box.fade(x[None, :], y[:, None], taper)


def _excess_in(plan: Plan, box: Box, excess: np.ndarray, per_body: float, taper: float) -> tuple[FieldTarget, ...]:
    """What attracts bodies because fixed ones are too many there, of a box; faded as charges are."""
    rows, columns = (max(2, math.ceil(2.0 * side / min(plan.grid.cell))) for side in box.size[::-1])
    image = between_pixels(excess[::-1, :, None], box, plan.problem.rectangle.size, (rows, columns))[..., 0]
    dim = (image * _fade_of_pixels(box, rows, columns, taper)).astype(np.float32)
    # Of cells of the coarse grid in a pixel.
    pixel = box.size[0] * box.size[1] / dim.size / math.prod(plan.grid.cell)
    charge = per_body * float(dim.sum(dtype=np.float64)) * pixel
    return (FieldTarget(dim, charge, whole=image.astype(np.float32)),) if charge > 0.0 else ()


def by_charge(model: Model, bend: np.ndarray) -> np.ndarray:
    """What bodies have for each of their charges, shape ``[n, most]``, for all charges; 0 of those that do not bend."""
    body = model.charge.body
    result = np.zeros(len(body))
    charge = np.flatnonzero(model.may_bend[body])
    result[charge] = bend[body[charge], charge - model.charge.first[body[charge]]]
    return result
