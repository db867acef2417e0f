"""What the lines of a problem on a surface are to do: :mod:`.line_rules`, with directions along the surface."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..geometry.small_matrices import inverses
from ..geometry.unit_vectors import tangent_frame
from ..model.model import LineKind, Model
from ..model.surface_places import cells_of
from ..problem.surface_directions import SLOPE, direction_at, down_the_slope
from ..surface.facets import Facets
from .line_rules import FIRST_LENGTH, first_length_factors, numbers_for_kernels, pressed_of, weights_of

__all__ = ["SurfaceLineRules"]

# Edges of a density are looked at in cells of about so many spacings, each with those around it.
CELL_OF_EDGES = 2.5
# Points along the sides of tiles at which it is asked for.
POINTS_OF_TILE = 3
# Places whose spread along an axis is below this share of all of it have none along that.
FLATTEST = 1e-3
# Gradients over the density below this share of the steepest are no edge.
FAINTEST_EDGE = 1e-3


class SurfaceLineRules:
    """Rules for the kernels; every size with a line is one kind.

    Args:
        model: What is to be placed.
        launcher: Where the arrays are to be.
        facets: The surface.

    Attributes:
        kind_count: Number of kinds.
        lines: The rules as kernels take them; directions are in :attr:`preferred`.
        preferred: Preferred direction times its weight on every tile, kind after kind, ``wp.vec3``.
        line_count: Number of bodies of every kind, on the device.
        pressed: 1 for kinds whose length the forces change, on the device.
    """

    def __init__(self, model: Model, launcher: Launcher, facets: Facets) -> None:
        device = launcher.device
        rules = [kind.line for kind in model.kinds]
        self.kind_count = len(rules)
        self._model, self._facets = model, facets
        self._direction = [_on_tiles(kind, facets) for kind in model.kinds]

        whole = np.arange(max(self.kind_count, 1), dtype=np.int32)
        lines = weights_of(rules, launcher)
        lines.length_factor = first_length_factors(launcher, len(rules))
        lines.length = numbers_for_kernels(launcher, [line.longest / model.unit for line in rules])
        lines.length_start = wp.array(whole, dtype=wp.int32, device=device)
        lines.length_height = wp.array(np.ones_like(whole), dtype=wp.int32, device=device)
        lines.length_width = wp.array(np.ones_like(whole), dtype=wp.int32, device=device)
        self.lines = lines
        stacked = np.concatenate(self._direction) if rules else np.zeros((1, 3))
        self.preferred = wp.array(stacked.astype(np.float32), dtype=wp.vec3, device=device)
        count = np.bincount(model.body.kind + 1, minlength=self.kind_count + 1)[1:]
        self.line_count = numbers_for_kernels(launcher, count)
        self.pressed = pressed_of(rules, launcher)

    def first_axes(self, facet: np.ndarray, tile: np.ndarray) -> np.ndarray:
        """Half the axis of every body at the start, in units, shape ``[n, 3]``: short, along the preferred direction or any."""
        model = self._model
        axis = np.zeros((len(facet), 3))
        rng = np.random.default_rng([model.problem.seed, 3])
        for number, kind in enumerate(model.kinds):
            own = np.flatnonzero(model.body.kind == number)
            normal = self._facets.normal[facet[own]]
            one, other = tangent_frame(normal)
            angle = rng.uniform(0.0, math.pi, len(own))[:, None]
            along = np.cos(angle) * one + np.sin(angle) * other
            preferred = self._direction[number][tile[own]]
            led = np.linalg.norm(preferred, axis=1) > 0.0
            along[led] = preferred[led] / np.linalg.norm(preferred[led], axis=1, keepdims=True)
            axis[own] = 0.5 * FIRST_LENGTH * kind.line.longest / model.unit * along
        return axis

    def fixed_axes(self, normal: np.ndarray) -> np.ndarray:
        """Half the axes of fixed bodies, in units, shape ``[fixed bodies, 3]``; 0 for dots."""
        model, table = self._model, self._model.problem.fixed
        kinds = model.body.kind[model.fixed]
        one, other = tangent_frame(normal)
        along = np.cos(table.angle)[:, None] * one + np.sin(table.angle)[:, None] * other
        asked = np.array([line.line.longest for line in model.kinds] + [0.0])[kinds]
        length = np.where(np.isnan(table.length), asked, table.length)
        return np.where(kinds[:, None] >= 0, 0.5 / model.unit * length[:, None] * along, 0.0)


def _on_tiles(kind: LineKind, facets: Facets) -> np.ndarray:
    """Preferred direction times its weight on every tile, shape ``[tile_count, 3]``."""
    direction, key = kind.line.direction, f'`line.direction` of class "{kind.body_class.name}"'
    facet, weight = facets.tiles(np.arange(facets.count))
    if isinstance(direction, str) and direction == "none":
        return np.zeros((len(facet), 3))
    if isinstance(direction, str) and direction == "density":
        return _along_edges(kind, facets)
    points = facets.surface.points(*facets.in_triangle(facet, weight))
    given = down_the_slope if isinstance(direction, str) and direction == SLOPE else direction
    assert callable(given)
    return direction_at(given, points, key)


def _along_edges(kind: LineKind, facets: Facets) -> np.ndarray:
    """Directions along the edges of a class's density: across the gradients in and around a cell of the surface."""
    if not kind.body_class.varies_on_surface:
        return np.zeros((facets.tile_count, 3))
    facet, weight = facets.tiles(np.arange(facets.count), POINTS_OF_TILE)
    value = kind.body_class.density_on(facets.surface.points(*facets.in_triangle(facet, weight)))
    place = np.einsum("nk,nkd->nd", weight, facets.corner[facet])
    normal = facets.normal[facet[:: POINTS_OF_TILE**2]]
    moments = _moments(value.reshape(len(normal), -1), place.reshape(len(normal), -1, 3), facets.tile_area)
    within = _gradients(moments)
    steep = facets.tile_area[:, None] * (within[:, :, None] * within[:, None, :]).reshape(-1, 9)
    middle = moments[:, 1:4] / moments[:, :1]
    # Every tile sees its own cell, and that of grids that are moved by half a cell along every axis.
    total = np.zeros((len(normal), 3, 3))
    for shift in range(8):
        moved = middle + 0.5 * CELL_OF_EDGES * np.array([shift & 1, shift >> 1 & 1, shift >> 2 & 1])
        cell = np.unique(cells_of(moved, normal, CELL_OF_EDGES), return_inverse=True)[1].ravel()
        # An edge that runs between tiles lies in none of them.
        of_cells = _summed(moments, cell)
        between = _gradients(of_cells)
        tensor = (_summed(steep, cell) / _summed(facets.tile_area[:, None], cell)).reshape(-1, 3, 3)
        total += (tensor + between[:, :, None] * between[:, None, :])[cell] / 8.0
    strength, vector = np.linalg.eigh(total)
    along = np.cross(normal, vector[:, :, 2])
    length = np.linalg.norm(along, axis=1, keepdims=True)
    steepest = strength[:, 2].max()
    if not steepest > 0.0:
        return np.zeros((facets.tile_count, 3))
    share = np.sqrt(np.clip(strength[:, 2] / steepest, 0.0, 1.0))
    # How much steeper it is across than along.
    coherent = (strength[:, 2] - strength[:, 1]) / np.maximum(strength[:, 2] + strength[:, 1], 1e-300)
    share = np.where(share > math.sqrt(FAINTEST_EDGE), share * coherent, 0.0)
    return along / np.maximum(length, 1e-12) * share[:, None]


def _moments(value: np.ndarray, place: np.ndarray, area: np.ndarray) -> np.ndarray:
    """What gradients follow from, of values ``[tiles, points]`` at places ``[tiles, points, 3]``: sums that can be added up.

    The area, place, value, place times place and place times value of every tile, shape ``[tiles, 17]``.
    """
    count = value.shape[1]
    sums = [
        np.full((len(value), 1), float(count)),
        place.sum(axis=1),
        value.sum(axis=1, keepdims=True),
        np.einsum("npi,npj->nij", place, place).reshape(-1, 9),
        np.einsum("npi,np->ni", place, value),
    ]
    return np.concatenate(sums, axis=1) * (area / count)[:, None]


def _gradients(moments: np.ndarray) -> np.ndarray:
    """Gradients of the planes that fit values best, shape ``[n, 3]``; see :func:`_moments`."""
    mean = moments / np.maximum(moments[:, :1], 1e-300)
    place, value = mean[:, 1:4], mean[:, 4]
    spread = mean[:, 5:14].reshape(-1, 3, 3) - place[:, :, None] * place[:, None, :]
    slope = mean[:, 14:] - place * value[:, None]
    # Places lie in a plane, or nearly so: across that there is neither.
    scale = np.trace(spread, axis1=1, axis2=2) + 1e-300
    back = inverses(spread / scale[:, None, None] + FLATTEST * np.eye(3))
    return np.einsum("nij,nj->ni", back, slope) / scale[:, None]


def _summed(values: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """Sums of rows over cells, which are numbered without gaps."""
    count = int(cell.max()) + 1
    return np.stack([np.bincount(cell, column, count) for column in values.T], axis=1)
