"""What fixed bodies leave of a surface: which density the others of their class follow, and where new ones start."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..cascade.kernels_points import Points
from ..cascade.points import nearest_of
from ..device.launcher import Launcher
from ..surface.facets import Facets
from .attraction import but_for_chance, water_level
from .beside_fixed import KEEPS_OFF, LEAST_FREE, MOST_BY_CHANCE
from .model import Model
from .surface_places import Spots, cells_of, positions_of, tile_middles

__all__ = ["left_by_fixed"]

# Bodies that are fixed take the place of others in cells of so many spacings of their class. To which cell a place belongs is
# chance, so it is looked at in several lattices, each shifted against the one before. Measured with half of 4,000 bodies on a ball
# fixed: in cells of 2.5 of one lattice, which are too full or too empty by chance, 114 of 2,000 stood between fixed ones; in eight of
# 3.5 it is 9, of 4.5 it is 3.
CELL_OF_FIXED = 4.5
SHIFTS = 8
SHIFT = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
# New bodies do not start nearer to fixed ones of their class than they would stand, but no farther off than so many units.
FARTHEST_KEPT = 3.0


def left_by_fixed(
    launcher: Launcher, model: Model, facets: Facets, share: np.ndarray, spots: Spots
) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of every class's density on every tile as others follow it, and as new bodies start on it.

    Where fixed bodies are more than the density asks for, the density is what they are, so that nobody is pushed away from it; and
    new ones start where they are less.

    Args:
        launcher: Where to run.
        model: The model.
        facets: The surface.
        share: What is asked for, shape ``[class_count, tile_count]``.
        spots: Of the fixed bodies.
    """
    followed, started = share.copy(), share.copy()
    facet_of_tile, middle = tile_middles(facets)
    charge = model.body_charge
    place, _ = positions_of(facets, spots)
    class_of_fixed = model.body.class_index[model.fixed]
    for k in np.unique(class_of_fixed).tolist():
        of_class = model.body.class_index == k
        total = float(charge[of_class].sum())
        own = class_of_fixed == k
        charges = charge[model.fixed][own] / total
        places = (
            np.concatenate([middle, place[own]]),
            np.concatenate([facets.normal[facet_of_tile], facets.normal[spots[0][own]]]),
        )
        size = CELL_OF_FIXED * math.sqrt(facets.area.sum() / int(of_class.sum()))
        cells = _shifted_cells(*places, size, len(middle))
        # By the same cells, so that what reaches over an edge of the density counts on both sides.
        there = share[k] * (_about(cells, bodies=charges) / np.maximum(_about(cells, share[k]), 1e-300))
        there = but_for_chance(there, share[k])
        level = water_level(share[k], there, 1.0, 1.0)
        followed[k] = np.maximum(level * share[k], there)
        followed[k] /= followed[k].sum()
        started[k] = np.maximum(level * share[k] - there, 0.0)
        spacing = np.sqrt(facets.tile_area / np.maximum(int(of_class.sum()) * level * share[k], 1e-12))
        free = _free_of_fixed(launcher, facets, middle, (spots[0][own], place[own]), KEEPS_OFF * spacing)
        if not started[k].any():
            started[k] = share[k]
        started[k] = _beside_fixed(
            started[k], free * started[k], (cells, _shifted_cells(*places, 2.0 * size, len(middle)))
        )
        started[k] = _left_in_parts(
            facets.part[facet_of_tile],
            facets.part[spots[0][own]],
            share[k],
            started[k],
            charges,
        )
    return followed, started


def _free_of_fixed(
    launcher: Launcher, facets: Facets, middle: np.ndarray, fixed: tuple[np.ndarray, np.ndarray], least: np.ndarray
) -> np.ndarray:
    """On which tiles no fixed body stands nearer to the middle than some distance in units, shape ``[tile_count]``.

    ``fixed`` are the facets that these are on, and where.
    """
    reach = min(float(least.max()), FARTHEST_KEPT)

    def points(facet: np.ndarray, place: np.ndarray) -> Points:
        result = Points()
        # The grid of places is made at once.
        result.position = launcher.own_array(place.astype(np.float32), wp.vec3)
        result.normal = launcher.own_array(facets.normal[facet].astype(np.float32), wp.vec3)
        result.label = launcher.own_array(facets.label[facet].astype(np.int32), wp.int32)
        return result

    of_tile = np.repeat(np.arange(facets.count), facets.cuts**2)
    nearest = nearest_of(launcher, points(of_tile, middle), points(*fixed), reach, reach).numpy()
    away = np.linalg.norm(middle - fixed[1][nearest], axis=1)
    return (nearest < 0) | (away >= np.minimum(least, reach))


def _shifted_cells(
    place: np.ndarray, normal: np.ndarray, size: float, tile_count: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Numbers of the cells that tiles are in, and that bodies are in, in several lattices that are shifted against each other.

    Args:
        place: Middles of tiles, and behind them where bodies are.
        normal: Where the surface looks to there.
        size: Of the cells.
        tile_count: How many tiles there are.
    """
    found = []
    for shift in range(SHIFTS):
        key = cells_of(place + (shift * SHIFT % 1.0) * size, normal, size)
        key = np.unique(key, return_inverse=True)[1].ravel()
        found.append((key[:tile_count], key[tile_count:]))
    return found


def _beside_fixed(
    started: np.ndarray, free: np.ndarray, cells: tuple[list[tuple[np.ndarray, np.ndarray]], ...]
) -> np.ndarray:
    """Move the share of tiles that bodies start on to what is free of it, in the smallest cells about them where enough is.

    As :func:`~.beside_fixed.vacant_cells` does in the plane.
    """
    result, rest = np.zeros_like(started), started
    for own, least in [*((own, LEAST_FREE) for own in cells), (cells[0], 0.0)]:
        if least == 0.0 and rest.sum() < MOST_BY_CHANCE * started.sum():
            return result
        found = _about(own, free)
        enough = found > least * _about(own, started)
        # What is left over at each of them is shared out around it.
        result += free * _about(own, np.where(enough, rest / np.maximum(found, 1e-300), 0.0))
        rest = np.where(enough, 0.0, rest)
    return result + rest


def _about(
    cells: list[tuple[np.ndarray, np.ndarray]], tiles: np.ndarray | None = None, *, bodies: np.ndarray | None = None
) -> np.ndarray:
    """Sum of values of ``tiles``, or of ``bodies``, in the cells about every tile, over all lattices, shape ``[tile_count]``."""
    result = np.zeros(len(cells[0][0]))
    for of_tile, of_body in cells:
        count = int(max(of_tile.max(), of_body.max(initial=0))) + 1
        sums = np.bincount(of_tile, tiles, count) if bodies is None else np.bincount(of_body, bodies, count)
        result += sums[of_tile]
    return result


def _left_in_parts(
    of_tile: np.ndarray, of_body: np.ndarray, share: np.ndarray, started: np.ndarray, there: np.ndarray
) -> np.ndarray:
    """Scale the share on which new bodies of a class start so that every part of a surface has what fixed ones leave of it.

    In the cells of a full part there are by chance fewer than are asked for in some, and more in others: who started there could not
    leave it.

    Args:
        of_tile: Part of every tile; none can go from one to another.
        of_body: The same of every fixed body.
        share: What is asked for on every tile.
        started: What fixed bodies leave of it by cells.
        there: Share of every fixed body of all charges.
    """
    count = int(of_tile.max()) + 1
    if count == 1:
        return started
    asked, fixed, left = (
        np.bincount(own, values, count) for own, values in ((of_tile, share), (of_body, there), (of_tile, started))
    )
    is_asked = asked > 0.0
    level = water_level(asked[is_asked], fixed[is_asked], 1.0, 1.0)
    wanted = np.where(is_asked, np.maximum(level * asked - fixed, 0.0), 0.0)
    if not wanted.any():
        return started
    # Where cells leave nothing of a part that is to have more, these stand anywhere in it.
    by_cells = left > 0.0
    result = np.where(by_cells[of_tile], started, share)
    return result * (wanted / np.maximum(np.where(by_cells, left, asked), 1e-300))[of_tile]
