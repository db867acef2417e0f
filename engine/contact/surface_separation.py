"""Separation on a surface: outlines in the planes that touch it between two bodies."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..geometry.unit_vectors import tangent_frame
from ..model.model import Model
from ..model.state import SurfaceState
from ..model.surface_places import TilePlaces
from ..motion import kernels_descent, kernels_lying, kernels_on_surface
from ..space.cell_sort import CellSort
from ..space.size_levels import levels_of
from ..surface.facets import Facets
from . import (
    kernels_bends,
    kernels_outlines,
    kernels_surface_bends,
    kernels_surface_separation,
    kernels_surface_trials,
)
from .changes_of_place import best_of_lanes, trials_for
from .footprint_tables import footprint_tables
from .outlines_in_space import SKIN, TOLERANCE, ProposedPlaces
from .separation import PLACES_OF_JUMP, Separation
from .surface_contact import SLOTS_PER_BODY
from .surface_obstacles import outlines_among, spots_of_outlines

__all__ = ["SurfaceSeparation"]


class SurfaceSeparation(Separation):
    """Parts the outlines of a model's bodies on a surface.

    Args:
        model: What was placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        ground: The surface, as the descent's kernels take it.
        facets: The surface, cut.
        state: Where the bodies are; they are moved, and turned where they may be.
        share: Share of every class's density on every tile, shape ``[class_count, tile_count]``.
        preferred: Directions that lines prefer, on every tile, kind after kind; as the descent's kernels take them.
    """

    SEES_COPIES = True

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        bodies: kernels_descent.Bodies,
        ground: kernels_on_surface.Ground,
        facets: Facets,
        state: SurfaceState,
        share: np.ndarray,
        preferred: wp.array,
    ) -> None:
        self._share, self._preferred = share, preferred
        self._bodies, self._ground, self._facets, self._state = bodies, ground, facets, state
        n, unit, device = model.body_count, model.unit, launcher.device
        axis = state.axis.numpy().astype(np.float64)
        half = np.linalg.norm(axis, axis=1)
        length = 2.0 * half * unit
        tables = footprint_tables(model.footprints, length, model.widths(length) if model.kinds else np.zeros(n))
        standing = outlines_among(model)
        tables = tables.followed_by(
            standing.shapes, np.zeros((len(standing.shapes), 2)), standing.shape, standing.scale, standing.margin
        )
        is_line = model.body.kind >= 0
        facet, heading = state.facet.numpy(), state.heading.numpy().astype(np.float64)
        # Facets lie along a curve, and bodies on them.
        order = np.argsort(facet, kind="stable")
        super().__init__(model, launcher, tables, order, length, np.where(is_line, heading, 0.0))
        first, second = self._frames()
        along = np.cos(heading)[:, None] * first[facet] + np.sin(heading)[:, None] * second[facet]
        along[is_line] = axis[is_line] / np.maximum(half[is_line], 1e-12)[:, None]
        facet_among, weight_among = spots_of_outlines(launcher, facets, standing)
        # What stands among the bodies comes behind them.
        self._spots_at_home = (
            np.concatenate([facet[order], facet_among]),
            np.concatenate([state.weight.numpy()[order], weight_among]),
        )
        self._along_at_home = along[order], standing.along
        count = n + len(standing)
        reach = tables.reach / unit
        reach[:n] = (reach[:n] + SKIN * np.sqrt(tables.area[:n]) / unit)[order]
        level, level_reach = levels_of(reach)
        crowd = kernels_surface_separation.SurfaceCrowd()
        crowd.facet, crowd.weight = launcher.empty(count, wp.int32), launcher.empty(count, wp.vec2)
        crowd.position, crowd.normal, crowd.along = (launcher.empty(count, wp.vec3) for _ in range(3))
        crowd.heading = launcher.array(
            np.concatenate([heading[order], np.zeros(len(standing))]).astype(np.float32), float
        )
        crowd.frame = wp.array(first.astype(np.float32), dtype=wp.vec3, device=device)
        crowd.outlines, crowd.ground = self._outlines, ground
        crowd.copies, crowd.most_corners = self._corner_count, self._trial_corners
        crowd.meeting = model.meeting(launcher, order, len(standing))
        crowd.level_count = len(level_reach)
        crowd.level = launcher.array(level, wp.int32)
        crowd.level_size = wp.array(np.column_stack([level_reach, 0.5 / level_reach]), dtype=wp.vec2, device=device)
        slots = 1 << max(4, (SLOTS_PER_BODY * count - 1).bit_length())
        self._cell_sort = CellSort(launcher, count, slots)
        crowd.slots = kernels_lying.Slots()
        crowd.slots.order, crowd.slots.start = self._cell_sort.order, self._cell_sort.cell_start
        crowd.slots.sorted_at, crowd.slots.mask = launcher.empty(count, wp.vec3), slots - 1
        self._crowd = crowd
        self._moves = self._first_moves(count)
        self._other_turned = launcher.zeros(1, wp.vec2)
        self._go_home()
        # Seen along their own x axes corners never turn.
        launcher.launch(
            kernels_outlines.turn_corners,
            count,
            [launcher.zeros(count, wp.vec4), self._outlines],
            [self._outlines.corner],
        )

    def _first_moves(self, count: int) -> kernels_surface_separation.SurfaceMoves:
        launcher = self.launcher
        moves = kernels_surface_separation.SurfaceMoves()
        moves.last, moves.turned = launcher.zeros(count, wp.vec4), launcher.zeros(count, float)
        moves.home, moves.built = launcher.empty(count, wp.vec3), launcher.empty(count, wp.vec3)
        moves.moved_far = launcher.zeros(launcher.thread_count, wp.int32)
        return moves

    def _frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions of every facet that headings are counted from, and a quarter turn on, as a placement has them."""
        facets = self._facets
        return tangent_frame(facets.surface.normal[facets.triangle])

    def _places(self) -> Sequence[wp.array]:
        crowd = self._crowd
        return [crowd.facet, crowd.weight, crowd.position, crowd.normal, crowd.along]

    def _go_home(self) -> None:
        crowd, n = self._crowd, len(self._order)
        facet, weight = self._spots_at_home
        position, normal = self._smoothly(facet, weight)
        along, of_standing = self._along_at_home
        along = np.concatenate([_carried(along, self._facets.normal[facet[:n]], normal[:n]), of_standing])
        crowd.facet.assign(facet.astype(np.int32))
        crowd.weight.assign(weight.astype(np.float32))
        crowd.position.assign(position.astype(np.float32))
        crowd.normal.assign(normal.astype(np.float32))
        crowd.along.assign(along.astype(np.float32))
        self._moves.home.assign(crowd.position)

    def _smoothly(self, facet: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where spots are, in units, and where the smooth surface looks to there, shape ``[k, 3]``."""
        full = np.column_stack([1.0 - weight.sum(axis=1), weight]).astype(np.float64)
        position, normal = (
            np.einsum("nk,nkd->nd", full, of[facet]) for of in (self._facets.corner, self._facets.corner_normal)
        )
        return position, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def _begin_list(self) -> None:
        self.launcher.launch(
            kernels_surface_separation.begin_list_on_surface, self._count, [self._crowd], [self._moves]
        )
        self._sort()

    def _sort(self) -> None:
        crowd = self._crowd
        self._cell_sort.sort(kernels_surface_separation.crowd_slots, [crowd])
        crowd.slots.sorted_at.assign(crowd.position)

    def _make_room(self, slots: int) -> None:
        self._other_turned = self.launcher.zeros(slots, wp.vec2)

    def _list_pairs(self, most: int, *, fill: bool) -> None:
        self.launcher.launch(
            kernels_surface_separation.find_pairs_on_surface,
            self._count,
            [self._crowd, most, int(fill)],
            [self._pairs],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _turn_corners(self) -> None:
        # They do not turn.
        return

    def _launch_find(self) -> None:
        self.launcher.launch(
            kernels_surface_separation.find_pushes_on_surface,
            self._count,
            [self._crowd, self._settings],
            [self._pairs, self._other_turned],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _launch_move(self) -> None:
        self.launcher.launch(
            kernels_surface_separation.move_apart_on_surface,
            self._count,
            [self._pairs, self._other_turned, self._bodies, self._state.bend, self._settings],
            [self._crowd, self._moves],
            grain=GRAIN_OF_NEIGHBORS,
            per_thread=True,
        )

    def _measure(self) -> None:
        self.launcher.launch(
            kernels_surface_separation.measure_overlaps_on_surface,
            self._count,
            [self._pairs, TOLERANCE],
            [self._deep, self._touching, self._cost],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _cells(self, size: float) -> np.ndarray:
        cell = np.floor(self._crowd.position.numpy() / max(size, 1e-6)).astype(np.int64)
        return np.unique(cell, axis=0, return_inverse=True)[1].ravel()

    def _trade(self, one: np.ndarray, other: np.ndarray) -> None:
        crowd, moves = self._crowd, self._moves
        both, swapped = np.concatenate([one, other]), np.concatenate([other, one])
        facet, normal, along, last = (
            array.numpy().copy() for array in (crowd.facet, crowd.normal, crowd.along, moves.last)
        )
        heading = self._headings(facet[both], normal[both], along[both])
        for array in (crowd.facet, crowd.weight, crowd.position, crowd.normal, moves.home):
            values = array.numpy().copy()
            values[both] = values[swapped]
            array.assign(values)
        first, second = (frame[facet[swapped]] for frame in self._frames())
        there = np.cos(heading)[:, None] * first + np.sin(heading)[:, None] * second
        along[both] = _carried(there, self._facets.normal[facet[swapped]], normal[swapped])
        last[both] = 0.0
        crowd.along.assign(along)
        moves.last.assign(last)

    def _headings(self, facet: np.ndarray, normal: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Angles of directions at right angles to normals, laid into the planes of facets, from what these count from [rad]."""
        first, second = (frame[facet] for frame in self._frames())
        along = _carried(along, normal, self._facets.normal[facet])
        return np.arctan2((along * second).sum(axis=1), (along * first).sum(axis=1))

    def _propose_swaps(self, stuck: wp.array, inputs: Sequence[Any], outputs: Sequence[wp.array]) -> None:
        self.launcher.launch(
            kernels_surface_trials.propose_swaps_on_surface,
            len(stuck),
            [stuck, *inputs, self._crowd, self._cost],
            outputs,
            grain=8,
        )

    @cached_property
    def _pool(self) -> kernels_surface_trials.Pool:
        """Places that bodies may jump to: as many of a class as any of them tries, drawn from its density."""
        rng = np.random.default_rng([self._model.problem.seed, 12])
        places = TilePlaces(self._facets, rng)
        found = [places.draw(share, PLACES_OF_JUMP) for share in self._share]
        order = [rng.permutation(PLACES_OF_JUMP) for _ in found]
        pool = kernels_surface_trials.Pool()
        pool.facet = self.launcher.array(
            np.concatenate([facet[some] for (facet, _), some in zip(found, order, strict=True)]), wp.int32
        )
        pool.weight = self.launcher.array(
            np.concatenate([weight[some] for (_, weight), some in zip(found, order, strict=True)]), wp.vec2
        )
        pool.start = self.launcher.array(PLACES_OF_JUMP * np.arange(len(found) + 1, dtype=np.int32), wp.int32)
        return pool

    def _propose_places(self, stuck: np.ndarray, candidates: int, seed: int) -> ProposedPlaces:
        launcher, crowd, pool, lanes = self.launcher, self._crowd, self._pool, self._lanes(len(stuck))
        n = lanes * len(stuck)
        places = kernels_surface_trials.SurfacePlaces()
        places.facet, places.weight, places.axis = (launcher.empty(n, kind) for kind in (wp.int32, wp.vec2, wp.vec3))
        places.cost, places.distance = launcher.empty(n, float), launcher.empty(n, float)
        launcher.launch(
            kernels_surface_trials.propose_places_on_surface,
            n,
            [
                trials_for(launcher, stuck, lanes, candidates, seed),
                pool,
                self._bodies,
                self._state.bend,
                self._preferred,
                crowd,
            ],
            [places],
            grain=1,
        )
        cost = places.cost.numpy()
        best = best_of_lanes(cost, places.distance.numpy(), lanes)
        there, cost, axis = places.facet.numpy()[best], cost[best], places.axis.numpy()[best]
        facet, weight = np.maximum(there, 0), places.weight.numpy()[best]
        position, normal = self._smoothly(facet, weight)

        def land(landing: np.ndarray) -> None:
            moved = stuck[landing]
            for array, values in (
                (crowd.facet, facet),
                (crowd.weight, weight),
                (crowd.position, position),
                (crowd.normal, normal),
                (crowd.along, axis),
                (self._moves.home, position),
                (self._moves.last, np.zeros((len(stuck), 4))),
            ):
                changed = array.numpy().copy()
                changed[moved] = values[landing]
                array.assign(changed)

        return ProposedPlaces(position, np.where(there < 0, np.inf, cost), land)

    def _find_costs(self, cost: wp.array) -> None:
        self.launcher.launch(
            kernels_surface_trials.find_costs_on_surface,
            self._count,
            [self._crowd],
            [cost],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _propose_turns(
        self, trials: int, keep: float, seed: int, cost: wp.array, angle: wp.array, gain: wp.array
    ) -> None:
        self.launcher.launch(
            kernels_surface_trials.propose_turns_on_surface,
            self._count,
            [trials, keep, seed, cost, self._crowd],
            [angle, gain],
            grain=8,
        )

    def _accept_turns(self, angle: wp.array, gain: wp.array, turned: wp.array) -> None:
        self.launcher.launch(
            kernels_surface_trials.accept_turns_on_surface,
            self._count,
            [angle, gain],
            [self._crowd, turned],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _write_back(self) -> None:
        state, order, crowd = self._state, self._order, self._crowd
        n = len(order)
        old_facet = state.facet.numpy().copy()
        facet, weight = old_facet.copy(), state.weight.numpy().copy()
        axis, heading = state.axis.numpy().copy(), state.heading.numpy().copy()
        facet[order], weight[order] = crowd.facet.numpy()[:n], crowd.weight.numpy()[:n]
        along, normal = np.empty((n, 3)), np.empty((n, 3))
        along[order], normal[order] = crowd.along.numpy()[:n], crowd.normal.numpy()[:n]
        lines = self._is_line
        laid = _carried(along[lines], normal[lines], self._facets.normal[facet[lines]])
        axis[lines] = np.linalg.norm(axis[lines], axis=1, keepdims=True) * laid
        turned = ~lines & self._model.footprints.free
        heading[turned] = self._headings(facet[turned], normal[turned], along[turned])
        # What is remembered of the way there lies in the planes of now.
        old, new = (self._facets.normal[of] for of in (old_facet, facet))
        for remembered in (state.displacement, state.move):
            remembered.assign(_carried(remembered.numpy(), old, new).astype(np.float32))
        state.facet.assign(facet)
        state.weight.assign(weight)
        state.axis.assign(axis)
        state.heading.assign(heading)
        if self._model.bends_any:
            self._straighten()

    def _straighten(self) -> None:
        """Let lines bend no farther than there is room: they were parted as if they were straight."""
        n, bend = len(self._order), self._state.bend
        widest, room = self.launcher.zeros(self._count, float), self.launcher.zeros(n, float)
        self.launcher.launch(kernels_bends.find_bends, n, [self._outlines, self._bodies, bend], [widest])
        self._sort()
        self.launcher.launch(
            kernels_surface_bends.find_room_on_surface,
            n,
            [self._crowd, widest, float(widest.numpy().max())],
            [room],
            grain=GRAIN_OF_NEIGHBORS,
        )
        self.launcher.launch(kernels_bends.straighten, n, [self._outlines, self._bodies, widest, room], [bend])


def _carried(vector: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Vectors at right angles to normals, turned the shortest way to where the normals are others, shape ``[n, 3]``."""
    turn = (new * vector).sum(axis=1) / np.maximum(1.0 + (old * new).sum(axis=1), 0.05)
    return vector - turn[:, None] * (old + new)
