"""The facets of a surface, cut finer where densities change fast, and how much of every class is asked for on each tile."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from ..problem.outlines_on_surface import OutlinesOnSurface
from ..problem.prepared_class import PreparedClass
from ..problem.surface import PointsOnSurface
from ..surface.facets import Facets
from .model import Model

__all__ = ["cut_by_detail"]

# Where a density changes within a tile by more than this share of its largest value there, tiles are cut into so many times so many.
DETAIL = 0.3
FINER = 3
SAMPLES_OF_DETAIL = 8
# Tiles whose sides are no longer than this, in units, as those at bends are and those of meshes far finer than bodies stand, are
# fine enough for all but the edge of a density: there they are cut until they are a third as long. All are looked at at fewer points.
# Measured: 4,096 bodies in bands and spots on a ball of 327,680 triangles are as even as without that, in 2.7 s instead of 5 to 8;
# moss on five rocks of 20,480 triangles each takes 9 s instead of 33.
FINE = 0.5
SAMPLES_OF_FINE = 4
# Of more tiles than this, those that lie far from all density are not cut: a facet is looked at at so many points along each side, and
# is far if nothing is seen within so many units. What is smaller than a third of a facet, and lies so far from all else, is not seen.
# Measured on a spot of a unit sphere that 2,000 bodies stand in, .05 wide: a run takes 8 s instead of 41 s.
MANY_TILES = 1_000_000
SAMPLES_OF_FACET = 3
NEAR_DENSITY = 10.4
# Obstacles that reach farther than this, in units, are details; of all others the share of a tile that they take is found from so many
# points along each of its sides. Measured on 600 boxes among as many, which cover 36 %: where tiles are not cut at small ones coverage
# errors are 0.0136, cut in four 0.0089, in nine 0.0097; as details, which takes six times as long as all the rest, 0.0076.
LARGE_OUTLINE = 2.0
SAMPLES_OF_OUTLINES = 2
# What lies so near to it, in units, is cut finer, too: there the near part of the target's force changes fast.
NEAR_DETAIL = 2.9
FINER_NEAR_DETAIL = 2
# Of very many tiles each is looked at at fewer points, so that there are no more than this, but at four at least.
MOST_POINTS = 1 << 25
# Points that are looked at together, where no facet alone has more: a large surface has hundreds of millions.
POINTS_AT_ONCE = 1 << 20


def cut_by_detail(model: Model, facets: Facets) -> np.ndarray:
    """Cut facets finer where densities change fast.

    At obstacles that are small outlines they are cut less fine: there may be as many as bodies, and these are parted from them.

    Returns:
        The share of every class's density on every tile, shape ``[class_count, tile_count]``.

    Raises:
        ProblemError: A class is asked for nowhere on the surface.
    """
    classes, outlines = model.problem.classes, model.problem.outlines_on_surface
    large = outlines.larger_than(LARGE_OUTLINE * model.unit)
    small = outlines.smaller_than(LARGE_OUTLINE * model.unit)
    if len(small):
        of_tile = np.repeat(np.arange(facets.count), facets.cuts**2)
        facets.cut_finer(np.unique(of_tile[_share_beside(facets, small) < 1.0]), FINER_NEAR_DETAIL)
    varying = [k for k, c in enumerate(classes) if c.varies_beside_outlines or len(large)]
    density = np.ones((len(classes), facets.tile_count))
    if varying:
        density = _detailed_densities(facets, classes, varying, large)
    if len(small):
        density = density * _share_beside(facets, small)
    amount = density * facets.tile_area
    total = amount.sum(axis=1, keepdims=True)
    if not (total > 0.0).all():
        name = classes[int(np.argmin(total[:, 0]))].name
        raise ProblemError(
            f'`density` of class "{name}" is above 0 on too small a part of the surface',
            Refusal(Reason.NO_DENSITY, 0, 0, (name, "")),
        )
    return amount / total


def _detailed_densities(
    facets: Facets, classes: Sequence[PreparedClass], varying: list[int], outlines: OutlinesOnSurface
) -> np.ndarray:
    """Cut facets finer where densities change fast, and return densities on tiles, shape ``[class_count, tile_count]``.

    Args:
        facets: The surface, cut.
        classes: All classes.
        varying: Numbers of those whose densities change at all.
        outlines: Obstacles that they end at.
    """
    changing = [classes[k] for k in varying]
    if facets.tile_count > MANY_TILES and len(varying) == len(classes):
        _cut_less_where_empty(facets, changing, outlines)
    whole = np.arange(facets.count)
    looks = [lambda values: values.mean(axis=1), lambda values: values.max(axis=1), lambda values: values.min(axis=1)]
    sampled, highest, lowest = _densities(facets, whole, 2, changing, outlines, looks)
    detailed, at_edge = np.zeros((2, facets.count), bool)
    of_tile = np.repeat(whole, facets.cuts**2)
    for largest, least in zip(highest, lowest, strict=True):
        detailed[of_tile[largest - least > DETAIL * largest]] = True
        # Bodies may stand on all of a tile or on nothing of it.
        at_edge[of_tile[(least <= 0.0) & (largest > 0.0)]] = True
    near = facets.near(detailed, NEAR_DETAIL) & ~detailed
    length = facets.longest / facets.cuts
    short = length <= FINE
    near, fine, detailed = near & ~short, detailed & short, detailed & ~short
    # What is not cut finer is known.
    kept = ~(detailed | near | fine)[of_tile]
    facets.cut_finer(np.flatnonzero(near), FINER_NEAR_DETAIL)
    facets.cut_finer(np.flatnonzero(detailed), FINER)
    edge = np.flatnonzero(fine & at_edge)
    facets.cut_into(edge, np.ceil(FINER * length[edge] / FINE - 1e-6).astype(np.int64) * facets.cuts[edge])
    of_tile = np.repeat(whole, facets.cuts**2)
    density = np.ones((len(classes), facets.tile_count))
    for k, values in zip(varying, sampled, strict=True):
        density[k, ~(detailed | near | fine)[of_tile]] = values[kept]
    for some, inner in ((near, 2), (fine, SAMPLES_OF_FINE), (detailed, SAMPLES_OF_DETAIL)):
        if some.any():
            inner = max(2, min(inner, math.isqrt(MOST_POINTS // int((facets.cuts[some] ** 2).sum()))))
            (found,) = _densities(facets, np.flatnonzero(some), inner, changing, outlines, looks[:1])
            for k, values in zip(varying, found, strict=True):
                density[k, some[of_tile]] = values
    return density


def _cut_less_where_empty(facets: Facets, classes: Sequence[PreparedClass], outlines: OutlinesOnSurface) -> None:
    """Leave facets whole where no density is seen at some points of theirs and of others around."""
    whole = np.arange(facets.count)
    cuts = facets.cuts.copy()
    facets.cut_into(whole, 1)
    seen = np.zeros(facets.count, bool)
    for values in _densities(facets, whole, SAMPLES_OF_FACET, classes, outlines, [lambda values: values.any(axis=1)])[
        0
    ]:
        seen |= values
    some = np.flatnonzero(facets.near(seen, NEAR_DENSITY)) if seen.any() else whole
    facets.cut_into(some, cuts[some])


def _densities(
    facets: Facets,
    facet: np.ndarray,
    inner: int,
    classes: Sequence[PreparedClass],
    outlines: OutlinesOnSurface,
    looks: Sequence[Callable[[np.ndarray], np.ndarray]],
) -> list[list[np.ndarray]]:
    """Look at densities at ``inner²`` points of every tile of some facets: return what each look says of all tiles, for each class.

    A look gets densities of tiles, shape ``[tiles, inner²]``, and returns one value for each.
    """
    found: list[list[list[np.ndarray]]] = [[[] for _ in classes] for _ in looks]
    for some in _blocks(facets, facet, inner):
        points = _points_of_tiles(facets, some, inner)
        for k, body_class in enumerate(classes):
            density = body_class.density_beside_outlines(points)
            if len(outlines):
                density = density * outlines.free(points, body_class.edge)
            for look, parts in zip(looks, found, strict=True):
                parts[k].append(look(density.reshape(-1, inner**2)))
    return [[np.concatenate(blocks) for blocks in parts] for parts in found]


def _share_beside(facets: Facets, outlines: OutlinesOnSurface) -> np.ndarray:
    """Share of every tile that outlines leave, shape ``[tile_count]``."""
    share = []
    for some in _blocks(facets, np.arange(facets.count), SAMPLES_OF_OUTLINES):
        free = outlines.distance(_points_of_tiles(facets, some, SAMPLES_OF_OUTLINES), 0.0) >= 0.0
        share.append(free.reshape(-1, SAMPLES_OF_OUTLINES**2).mean(axis=1))
    return np.concatenate(share)


def _blocks(facets: Facets, facet: np.ndarray, inner: int) -> Iterator[np.ndarray]:
    """Yield facets in their order, as many at once as have not too many points: ``inner²`` on each of their tiles."""
    block = np.cumsum((facets.cuts[facet] * inner) ** 2) // POINTS_AT_ONCE
    yield from np.split(facet, np.flatnonzero(np.diff(block)) + 1)


def _points_of_tiles(facets: Facets, facet: np.ndarray, inner: int) -> PointsOnSurface:
    """``inner²`` points of every tile of some facets."""
    return facets.surface.points(*facets.in_triangle(*facets.tiles(facet, inner)))
