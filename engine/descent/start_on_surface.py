"""Where the bodies start on a surface: as many on each of its parts as are asked for there, and even from the first step on."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.model import Model
from ..motion import kernels_on_surface
from ..surface.facets import Facets
from .initial_placement import body_starts
from .numbers_of_parts import first_ranks, first_ranks_among_crumbs

__all__ = ["first_spots"]


def first_spots(
    launcher: Launcher,
    model: Model,
    facets: Facets,
    ground: kernels_on_surface.Ground,
    support: wp.array,
    share: np.ndarray,
) -> tuple[wp.array, wp.array]:
    """Put every group's bodies where its density asks for them: on Hilbert curves, and on each part of the surface in whole numbers.

    Args:
        launcher: Where to run.
        model: What is to be placed; its problem's seed decides on all that is random.
        facets: The surface, cut.
        ground: The same, as kernels take it.
        support: Number of every body's support, on the device.
        share: Share of every class's density on every tile, shape ``[class_count, tile_count]``.

    Returns:
        Facets of all bodies, and weights of their second and third corners.
    """
    n = model.body_count
    count, (_, group, rank, identity, _, shift), seed = body_starts(model, launcher)
    facet, weight = launcher.empty(n, wp.int32), launcher.empty(n, wp.vec2)
    running = np.cumsum(share, axis=1)
    first_tile, first_rank = _shared_out_among_parts(model, facets, ground.crumbs, running, count)
    launcher.launch(
        kernels_on_surface.place_on_tiles,
        n,
        [
            group,
            rank,
            identity,
            support,
            shift,
            wp.array(running.ravel(), dtype=wp.float64, device=launcher.device),
            launcher.array(first_tile.astype(np.int32), wp.int32),
            launcher.array(first_rank.ravel(), wp.int32),
            len(first_tile) - 1,
            facets.tile_count,
            facets.count,
            ground.facets,
            seed,
        ],
        [facet, weight],
    )
    return facet, weight


def _shared_out_among_parts(
    model: Model, facets: Facets, crumbs: int, running: np.ndarray, count: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first tile of every part, and at the end of all, and the first body of every group on it.

    Shapes ``[part_count + 1]`` and ``[group_count, part_count + 1]``.

    Args:
        model: What is to be placed.
        facets: The surface, cut.
        crumbs: Label of the parts for a few bodies each; -1 for none.
        running: Sums of the classes' shares over tiles, shape ``[class_count, tile_count]``.
        count: Bodies of every group that are not fixed.
    """

    def starts(number: np.ndarray) -> np.ndarray:
        return np.flatnonzero(np.diff(number, prepend=-1))

    def ends(start: np.ndarray) -> np.ndarray:
        return facets.first_tile[np.append(start, facets.count)]

    def up_to(tiles: np.ndarray) -> np.ndarray:
        return np.where(tiles > 0, running[:, np.maximum(tiles, 1) - 1], 0.0)[model.groups.class_index]

    labels = starts(facets.label)
    of_labels = ends(labels)
    rank = first_ranks(up_to(of_labels[1:]), count)
    if crumbs < 0:
        return of_labels, rank
    k = int(np.flatnonzero(facets.label[labels] == crumbs)[0])
    of_parts = ends(starts(facets.part))
    inner = of_parts[(of_parts >= of_labels[k]) & (of_parts <= of_labels[k + 1])]
    chance = np.random.default_rng([model.problem.seed, 13]).random()
    within = up_to(inner[1:]) - up_to(inner[:1])
    among = first_ranks_among_crumbs(within, rank[:, k + 1] - rank[:, k], chance)
    tile = np.concatenate([of_labels[:k], inner, of_labels[k + 2 :]])
    return tile, np.concatenate([rank[:, :k], rank[:, k : k + 1] + among, rank[:, k + 2 :]], axis=1)
