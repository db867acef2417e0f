"""From one problem on a surface to another: which bodies stay, which go, and where new ones come down.

As in the plane (:mod:`.edit`), what is in surplus where a density fell is taken out, and set down where it rose. Shares of the two
densities are compared tile by tile; who goes, and where somebody comes, is spread evenly along the curve that tiles are in order of.
"""

from __future__ import annotations

import numpy as np

from ..problem.surface import PointsOnSurface, Surface
from ..surface.facets import Facets
from .body_flags import BodyFlags
from .carried_over import CarriedOver
from .edit import UNCHANGED
from .model import Model
from .surface_places import Spots, TilePlaces, spots_of_points, tiles_of

__all__ = ["carry_over_on_surface"]


def carry_over_on_surface(
    old: Model,
    points: PointsOnSurface,
    model: Model,
    facets: Facets,
    share: np.ndarray,
    first_identity: int,
    rng: np.random.Generator,
) -> tuple[CarriedOver, Spots]:
    """Bring the bodies of one model over to another on the same surface.

    Args:
        old: The model before the edit.
        points: Where its bodies are.
        model: The model after it.
        facets: The surface as the new model has it cut.
        share: Share of every class's density on every tile now, shape ``[class_count, tile_count]``.
        first_identity: Identity of the first body that is new; later ones follow.
        rng: What is random.

    Returns:
        Who stays and who is new, and where all of them are, by facets; fixed ones are anywhere.
    """
    body, before = model.body, old.body
    source = np.full(model.body_count, -1, np.int64)
    facet, weight = np.zeros(model.body_count, np.int32), np.full((model.body_count, 2), 1.0 / 3.0, np.float32)
    old_facet, old_weight = spots_of_points(facets, points)
    used = (before.flags & BodyFlags.GHOST) != 0
    fixed = np.flatnonzero(model.fixed)
    index_of = {identity: index for index, identity in enumerate(before.identity.tolist())} if len(fixed) else {}
    for row in fixed.tolist():
        source[row] = index_of.get(int(body.identity[row]), -1)
    used[source[fixed][source[fixed] >= 0]] = True
    taken = used.copy()

    tile_area, places = facets.tile_area, TilePlaces(facets, rng)
    middles = facets.surface.points(*facets.in_triangle(*facets.tiles(np.arange(facets.count))))
    tile_of_old = tiles_of(facets, old_facet, old_weight)
    rank_on_curve = np.argsort(np.argsort(tile_of_old, kind="stable"), kind="stable")
    old_classes = {c.name: index for index, c in enumerate(old.problem.classes)}
    for c, body_class in enumerate(model.problem.classes):
        k = old_classes.get(body_class.name, -1)
        share_before = np.zeros(facets.tile_count)
        if k >= 0:
            share_before = old.problem.classes[k].density_on(middles) * tile_area
            share_before /= max(share_before.sum(), 1e-300)
        # Compared as both are at the middles of tiles.
        share_now = body_class.density_on(middles) * tile_area
        share_now /= max(share_now.sum(), 1e-300)
        old_sizes = {} if k < 0 else {s.name: i for i, s in enumerate(old.problem.classes[k].sizes)}
        for s, size in enumerate(body_class.sizes):
            rows = np.flatnonzero((body.class_index == c) & (body.size_index == s) & ~model.fixed)
            of_size = (before.class_index == k) & (before.size_index == old_sizes.get(size.name, -1))
            pool = np.flatnonzero(of_size & ~used)
            used[pool] = True
            wanted, there = len(rows) * share_now, len(pool) * share_before
            staying = _staying(pool, tile_of_old, rank_on_curve, wanted, there, len(rows))
            seats = rows
            if len(staying) and np.ptp(before.area[staying]) > 0.0:
                # Bodies of a range keep their ranks.
                staying = staying[np.argsort(before.area[staying], kind="stable")]
                chosen = np.floor((np.arange(len(staying)) + 0.5) * len(rows) / len(staying)).astype(int)
                by_area = rows[np.argsort(body.area[rows], kind="stable")]
                seats = np.concatenate([by_area[chosen], np.delete(by_area, chosen)])
            kept, fresh = seats[: len(staying)], seats[len(staying) :]
            source[kept] = staying
            facet[kept], weight[kept] = old_facet[staying], old_weight[staying]
            gain = np.where(share[c] > 0.0, np.maximum(wanted - there, 0.0), 0.0)
            gain[gain < UNCHANGED * wanted] = 0.0
            facet[fresh], weight[fresh] = places.draw(gain if gain.any() else share[c], len(fresh))
    gone = ~taken
    gone[source[source >= 0]] = False
    identity = body.identity.astype(np.int64)
    carried = (source >= 0) & ~model.fixed
    identity[carried] = before.identity[source[carried]]
    new = (source < 0) & ~model.fixed
    identity[new] = first_identity + np.arange(int(new.sum()))
    # Where the density is 0 now nobody stays.
    own_share = share[body.class_index, tiles_of(facets, facet, weight)]
    for row in np.flatnonzero((own_share <= 0.0) & ~model.fixed).tolist():
        (facet[row],), (weight[row],) = places.draw(share[body.class_index[row]], 1)
    position = points.position
    assert isinstance(model.problem.domain, Surface)
    return CarriedOver(np.zeros((model.body_count, 3)), source, identity, position[gone]), (facet, weight)


def _staying(
    pool: np.ndarray, tile: np.ndarray, curve: np.ndarray, wanted: np.ndarray, there: np.ndarray, most: int
) -> np.ndarray:
    """Return which of some bodies stay: each as likely as its tile is wanted, and no more than there are seats."""
    if not len(pool):
        return pool
    order = pool[np.argsort(curve[pool], kind="stable")]
    going = np.clip(1.0 - wanted[tile[order]] / np.maximum(there[tile[order]], 1e-300), 0.0, 1.0)
    going[going < UNCHANGED] = 0.0
    surplus = len(order) - most
    if surplus > going.sum():
        # More have to go than densities say.
        left = 1.0 - going
        going += left * (surplus - going.sum()) / max(left.sum(), 1e-300)
    running = np.cumsum(going)
    goes = np.floor(running + 0.5) > np.floor(np.concatenate([[0.0], running[:-1]]) + 0.5)
    staying = order[~goes]
    if len(staying) > most:
        staying = np.delete(staying, np.linspace(0, len(staying) - 1, len(staying) - most).astype(int))
    return np.sort(staying)
