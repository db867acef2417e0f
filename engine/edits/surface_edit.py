"""From one problem on a surface to another: which bodies stay, which go, and where new ones come down.

As in the plane (:mod:`.edit`), what is in surplus where a density fell is taken out, and set down where it rose. Shares of the two
densities are compared tile by tile; who goes, and where somebody comes, is spread evenly (:mod:`.surface_spreading`), in small places
along the curve that tiles are in order of.
"""

from __future__ import annotations

import numpy as np

from ..model.body_flags import BodyFlags
from ..model.carried_over import CarriedOver
from ..model.model import Model
from ..model.surface_places import Spots, TilePlaces, middles_of_strata, spots_of_points, tiles_of, with_first_corner
from ..problem.surface import PointsOnSurface
from ..surface.facets import Facets
from .kernels_edit import FEW, UNCHANGED
from .surface_spreading import SpreadingOnSurface, is_spread, nearest_of

__all__ = ["carry_over_on_surface"]


def carry_over_on_surface(
    old: Model,
    points: PointsOnSurface,
    model: Model,
    facets: Facets,
    share: np.ndarray,
    first_identity: int,
    rng: np.random.Generator,
    spreading: SpreadingOnSurface,
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
        spreading: Spreads points on this surface.

    Returns:
        Who stays and who is new, and where all of them are, by facets; fixed ones, and those that may not be there now, are anywhere.
    """
    edit = _SurfaceEdit(old, points, model, facets, share, rng, spreading)
    for c, body_class in enumerate(model.problem.classes):
        share_before, share_now = edit.shares_of(c)
        for s, size in enumerate(body_class.sizes):
            edit.settle(c, s, size.name, share_before, share_now)
    return edit.result(first_identity), (edit.facet, edit.weight)


class _SurfaceEdit:
    """An edit that is being made: who has come from where so far.

    Args:
        old: The model before it.
        points: Where its bodies are.
        model: The model after it.
        facets: The surface as the new model has it cut.
        share: Share of every class's density on every tile now.
        rng: What is random.
        spreading: Spreads points on this surface.

    Attributes:
        source: Index of the same body in the old model, -1 for a new one, shape ``[n]``.
        facet: Facet of every body, shape ``[n]``.
        weight: Weights of its second and third corner, shape ``[n, 2]``.
    """

    def __init__(
        self,
        old: Model,
        points: PointsOnSurface,
        model: Model,
        facets: Facets,
        share: np.ndarray,
        rng: np.random.Generator,
        spreading: SpreadingOnSurface,
    ) -> None:
        self._spreading = spreading
        self._old, self._points, self._model, self._facets, self._share = old, points, model, facets, share
        n = model.body_count
        self.source = np.full(n, -1, np.int64)
        self.facet, self.weight = np.zeros(n, np.int32), np.full((n, 2), 1.0 / 3.0, np.float32)
        self._old_facet, self._old_weight = spots_of_points(facets, points)
        self._find_fixed()
        # Who is no longer there to be chosen: it acts on others only, was chosen, or is fixed now.
        self._used = (old.body.flags & BodyFlags.GHOST) != 0
        self._used[self.source[self.source >= 0]] = True
        self._places = TilePlaces(facets, rng)
        self._middles = facets.surface.points(*facets.in_triangle(*facets.tiles(np.arange(facets.count))))
        self._tile_of_old = tiles_of(facets, self._old_facet, self._old_weight)
        self._rank_on_curve = np.argsort(np.argsort(self._tile_of_old, kind="stable"), kind="stable")
        self._old_classes = {c.name: index for index, c in enumerate(old.problem.classes)}

    def _find_fixed(self) -> None:
        """Fixed bodies are known by their identities."""
        fixed = np.flatnonzero(self._model.fixed)
        before = self._old.body.identity.tolist() if len(fixed) else []
        index_of = {identity: index for index, identity in enumerate(before)}
        for row in fixed.tolist():
            self.source[row] = index_of.get(int(self._model.body.identity[row]), -1)

    def _old_class(self, c: int) -> int:
        """Index that a class had; -1 where there was none of its name."""
        return self._old_classes.get(self._model.problem.classes[c].name, -1)

    def shares_of(self, c: int) -> tuple[np.ndarray, np.ndarray]:
        """Share of a class's density on every tile before and now, each as it is at the middles of tiles."""
        k, area = self._old_class(c), self._facets.tile_area
        share_before = np.zeros(self._facets.tile_count)
        if k >= 0:
            share_before = self._old.problem.classes[k].density_on(self._middles) * area
            share_before /= max(share_before.sum(), 1e-300)
        share_now = self._model.problem.classes[c].density_on(self._middles) * area
        share_now /= max(share_now.sum(), 1e-300)
        return share_before, share_now

    def settle(self, c: int, s: int, name: str, share_before: np.ndarray, share_now: np.ndarray) -> None:
        """Decide who of a size stays, and put those that are new where more of them are wanted."""
        body, before, k = self._model.body, self._old.body, self._old_class(c)
        old_sizes = {} if k < 0 else {size.name: i for i, size in enumerate(self._old.problem.classes[k].sizes)}
        rows = np.flatnonzero((body.class_index == c) & (body.size_index == s) & ~self._model.fixed)
        of_size = (before.class_index == k) & (before.size_index == old_sizes.get(name, -1))
        pool = np.flatnonzero(of_size & ~self._used)
        self._used[pool] = True
        wanted, there = len(rows) * share_now, len(pool) * share_before
        pool = pool[np.argsort(self._rank_on_curve[pool], kind="stable")]
        staying = self._staying(pool, wanted, there, len(rows))
        seats = rows
        if len(staying) and np.ptp(before.area[staying]) > 0.0:
            # Bodies of a range keep their ranks.
            staying = staying[np.argsort(before.area[staying], kind="stable")]
            chosen = np.floor((np.arange(len(staying)) + 0.5) * len(rows) / len(staying)).astype(int)
            by_area = rows[np.argsort(body.area[rows], kind="stable")]
            seats = np.concatenate([by_area[chosen], np.delete(by_area, chosen)])
        kept, fresh = seats[: len(staying)], seats[len(staying) :]
        self.source[kept] = staying
        self.facet[kept], self.weight[kept] = self._old_facet[staying], self._old_weight[staying]
        gain = np.where(self._share[c] > 0.0, np.maximum(wanted - there, 0.0), 0.0)
        gain[gain < UNCHANGED * wanted] = 0.0
        self.facet[fresh], self.weight[fresh] = self._spread(gain if gain.any() else self._share[c], len(fresh))

    def _spread(self, share: np.ndarray, count: int) -> Spots:
        """So many places that are spread evenly over a share of every tile."""
        spots = self._places.draw(share, count)
        return self._spreading.spread(self._facets, share, spots) if is_spread(self._facets, share, count) else spots

    def _staying(self, pool: np.ndarray, wanted: np.ndarray, there: np.ndarray, seats: int) -> np.ndarray:
        """Return which of some bodies stay: each as likely as its tile is wanted, all spread evenly, and no more than there are seats.

        Args:
            pool: Their numbers, along the curve of tiles.
            wanted: How many bodies are wanted on every tile.
            there: How many were.
            seats: How many may stay.
        """
        tile = self._tile_of_old[pool]
        chance = np.clip(1.0 - wanted / np.maximum(there, 1e-300), 0.0, 1.0)
        chance[chance < UNCHANGED] = 0.0
        surplus, going = len(pool) - seats, float(chance[tile].sum())
        if surplus > going:
            # More have to go than densities say.
            chance += (1.0 - chance) * (surplus - going) / max(len(pool) - going, 1e-300)
        stays = np.ones(len(pool), bool)
        # Where few are left of many it is those that are to be even, elsewhere the gaps.
        are_few = chance > 1.0 - FEW
        for few in (False, True):
            share = np.where(are_few == few, 1.0 - chance if few else chance, 0.0)
            some = np.flatnonzero(are_few[tile] == few)
            count = int(share[tile[some]].sum() + 0.5)
            stays[some] = not few
            stays[some[self._chosen(pool[some], share, there * share, count)]] = few
        staying = np.flatnonzero(stays)
        if len(staying) > seats:
            staying = np.delete(staying, np.linspace(0, len(staying) - 1, len(staying) - seats).astype(int))
        return np.sort(pool[staying])

    def _chosen(self, pool: np.ndarray, chance: np.ndarray, share: np.ndarray, count: int) -> np.ndarray:
        """Choose so many of some bodies, spread evenly; return their indices among these.

        Args:
            pool: Their numbers, along the curve of tiles.
            chance: Of those on every tile.
            share: How many of all are to be chosen on every tile.
            count: How many.
        """
        tile = self._tile_of_old[pool]
        may_be = np.flatnonzero(chance[tile] > 0.0)
        position = self._points.position[pool]
        if count >= len(may_be) or not is_spread(self._facets, share, count):
            return middles_of_strata(position, chance[tile], count)
        spots = self._spreading.spread(self._facets, share, self._places.draw(share, count))
        place = self._facets.surface.points(*self._facets.in_triangle(*with_first_corner(spots))).position
        on_tile = tiles_of(self._facets, *spots)
        return may_be[nearest_of(place, on_tile, position[may_be], tile[may_be])]

    def result(self, first_identity: int) -> CarriedOver:
        """Who has come from where; those that are new have ``first_identity`` and the following ones."""
        gone = np.ones(self._old.body_count, bool)
        gone[self.source[self.source >= 0]] = False
        return CarriedOver(self.source, self.identities(first_identity), gone, self._tile_of_old[gone])

    def identities(self, first: int) -> np.ndarray:
        """Identities of all bodies, int64; those that are new have ``first`` and the following ones."""
        identity = self._model.body.identity.astype(np.int64)
        carried = (self.source >= 0) & ~self._model.fixed
        identity[carried] = self._old.body.identity[self.source[carried]]
        new = (self.source < 0) & ~self._model.fixed
        identity[new] = first + np.arange(int(new.sum()))
        return identity
