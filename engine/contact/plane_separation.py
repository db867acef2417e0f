"""Separation in a rectangle: outlines as they are seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..model.model import Model
from ..model.spatial_order import spatial_order
from ..model.supports import parted_from_obstacles
from ..motion import kernels_descent
from ..space import kernels_images
from ..space.neighborhood import Neighborhood
from . import kernels_bends, kernels_outlines, kernels_pairs, kernels_separation, kernels_trials
from .changes_of_place import best_of_lanes, trials_for
from .footprint_tables import footprint_tables
from .guidance import Guidance
from .outlines_in_space import SKIN, TOLERANCE, ProposedPlaces
from .separation import MOST_JUMPS, Separation
from .standing_outlines import StandingOutlines, standing_outlines

__all__ = ["PlaneSeparation"]

# A long body that keeps its turn is one of a row where this share of its like around it is parallel to it. Measured on 400 planks:
# with 0.3 two turns at right angles leave 341 pairs at 55 %, and one turn among random ones 465 at 60 %; with 0.6 the first leave 37;
# with 0.85 neither any.
LEAST_PARALLEL = 0.9
# A line that found no room to grow among obstacles is as long as it is to be from here on, if it has less than this share of that.
GROWN = 0.9
# Periods that an image of a body may be away.
MOST_IMAGES = 8


class PlaneSeparation(Separation):
    """Parts the outlines of a model's bodies in a rectangle.

    Args:
        model: What was placed.
        launcher: Where to run.
        bodies: As the descent's kernels take them.
        images: Densities, as the descent's kernels take them.
        pose: Where the bodies are, as the state has it; they are moved.
        turn: How the outlines are turned, of lines from their axes [rad], float, shape ``[n]``; those that may turn are turned.
        bend: As the state has it.
        room: Lower left and upper right corner [m] of where bodies may be put that stay wedged between pinned ones; None: of all the
            domain.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        bodies: kernels_descent.Bodies,
        images: kernels_images.Images,
        pose: wp.array,
        turn: wp.array,
        bend: wp.array,
        room: tuple[Sequence[float], Sequence[float]] | None = None,
    ) -> None:
        self._pose, self._turn, self._bend = pose, turn, bend
        self._bodies, self._images = bodies, images
        n, domain, unit = model.body_count, model.problem.rectangle, model.unit
        self._space = model.space.for_kernels()
        low, high = ((0.0, 0.0), domain.size) if room is None else room
        self._room = wp.vec4(*(float(side) / unit for side in (*low, *high)))
        given = pose.numpy()
        self._given_length = given[:, 3].astype(np.float64) * unit
        length, self._stunted = _grown(model, self._given_length)
        tables = footprint_tables(model.footprints, length, model.widths(length) if model.kinds else np.zeros(n))
        is_line = model.body.kind >= 0
        start_turn = turn.numpy().astype(np.float64)
        angle = np.where(is_line, given[:, 2], start_turn)
        order = spatial_order(launcher, pose, model.space.size)
        # What else keeps its distance from obstacles does so by where bodies may be.
        by_outlines = parted_from_obstacles(model.problem, model.footprints).any() or (
            model.problem.avoid_overlap and bool(model.kinds)
        )
        standing = StandingOutlines([], np.empty((0, 2)))
        if by_outlines:
            standing = standing_outlines(
                model.problem, float(tables.reach.max()), has_edges=bool(model.space.has_edges)
            )
        m = len(standing)
        tables = tables.followed_by(standing.outlines, standing.position, np.arange(m), np.ones(m), np.zeros(m))
        self._length = length
        super().__init__(model, launcher, tables, order, length, np.where(is_line, start_turn, 0.0))
        everything = np.concatenate([order, np.arange(n, n + len(standing))])
        reach = tables.reach / unit
        reach[:n] += SKIN * np.sqrt(tables.area[:n]) / unit
        meeting = model.meeting(launcher, order, len(standing))
        count = len(reach)
        self._near = Neighborhood(launcher, model.space, reach, np.zeros(count), np.ones(count), meeting)
        self._near.footprints.radius.assign(reach[everything].astype(np.float32))
        level = self._near.footprints.level.numpy()[everything]
        self._near.footprints.level.assign(level)
        # Images that are farther than the nearest one matter where two bodies reach over half a period.
        periods = model.space.images_within(float(reach[:n].max() + reach.max()), MOST_IMAGES)
        self._slopes = self._slopes_for_kernels(order, len(standing))
        # Lines that have a direction of their own do not turn away from it.
        led = np.array([isinstance(k.line.direction, str) and k.line.direction == "none" for k in model.kinds] + [True])
        may_turn = (self._outlines.ease.numpy()[:n] > 0.0) & led[model.body.kind[order]]
        self._may_turn = launcher.array(may_turn.astype(np.int32), wp.int32)
        self._make_arrays(given, angle, standing)
        self._crowd = kernels_pairs.Crowd()
        self._crowd.pose, self._crowd.outlines, self._crowd.neighbors = (
            self._crowd_pose,
            self._outlines,
            self._near.for_kernels,
        )
        self._crowd.copies, self._crowd.most_corners = self._corner_count, self._trial_corners
        self._crowd.images, self._crowd.inset = wp.vec2i(*periods), int(domain.inset)
        self._supports = kernels_trials.Supports()
        self._supports.bodies, self._supports.bend, self._supports.images = bodies, bend, images

    def _slopes_for_kernels(self, order: np.ndarray, standing: int) -> kernels_outlines.Slopes | None:
        """Slopes of the planes that outlines lie in; None where all are horizontal, as what stands among them is."""
        footprints, device = self._model.footprints, self.launcher.device
        tilt = footprints.tilts(self._model.body.identity, self._model.problem.seed)
        if not footprints.slopes and tilt is None:
            return None

        def whole(values: Sequence[int] | np.ndarray) -> wp.array:
            return wp.array(np.asarray(values, np.int32), dtype=wp.int32, device=device)

        pixels = [image.reshape(-1, 2) for image in footprints.slopes]
        slopes = kernels_outlines.Slopes()
        slopes.image = whole(np.concatenate([footprints.slope[order], np.full(standing, -1, np.int32)]))
        slopes.start = whole(np.cumsum([0, *(len(image) for image in pixels[:-1])]))
        slopes.rows = whole([image.shape[0] for image in footprints.slopes])
        slopes.columns = whole([image.shape[1] for image in footprints.slopes])
        slopes.pixel = wp.array(np.concatenate([np.zeros((0, 2), np.float32), *pixels]), dtype=wp.vec2, device=device)
        slopes.tilt = wp.zeros(0, dtype=wp.vec3, device=device)
        if tilt is not None:
            angle, direction = tilt[order].T
            level = np.sin(angle)
            axis = np.stack([level * np.cos(direction), level * np.sin(direction), np.cos(angle)], axis=1)
            axis = np.concatenate([axis, np.broadcast_to([0.0, 0.0, 1.0], (standing, 3))])
            slopes.tilt = wp.array(axis, dtype=wp.vec3, device=device)
        return slopes

    def _make_arrays(self, given: np.ndarray, angle: np.ndarray, standing: StandingOutlines) -> None:
        launcher, n = self.launcher, self._count
        values = np.zeros((n, 4), np.float32)
        bodies = len(self._order)
        values[:bodies, :2], values[:bodies, 2] = given[self._order, :2], angle[self._order]
        values[bodies:, :2] = standing.position / self._model.unit
        self._start = values
        self._crowd_pose = wp.array(values, dtype=wp.vec4, device=launcher.device)
        moves = kernels_separation.Moves()
        moves.home, moves.built = wp.clone(self._crowd_pose), wp.clone(self._crowd_pose)
        moves.last = launcher.zeros(n, wp.vec4)
        moves.moved_far = launcher.zeros(launcher.thread_count, wp.int32)
        self._moves = moves

    def _places(self) -> Sequence[wp.array]:
        return [self._crowd_pose]

    def _begin_list(self) -> None:
        self.launcher.launch(
            kernels_pairs.begin_list, self._count, [], [self._crowd, self._moves.built, self._moves.moved_far]
        )
        self._turn_corners()
        self._sort()

    def _sort(self) -> None:
        self._near.sort(self._crowd_pose)

    def _list_pairs(self, most: int, *, fill: bool) -> None:
        inputs = [self._crowd, most, int(fill)]
        self.launcher.launch(kernels_pairs.find_pairs, self._count, inputs, [self._pairs], grain=GRAIN_OF_NEIGHBORS)

    def _turn_corners(self) -> None:
        if self._slopes is not None:
            self.launcher.launch(
                kernels_outlines.find_slopes,
                self._count,
                [self._crowd_pose, self._slopes, self._space],
                [self._outlines.slope],
            )
        self.launcher.launch(
            kernels_outlines.turn_corners, self._count, [self._crowd_pose, self._outlines], [self._outlines.corner]
        )

    def _launch_find(self) -> None:
        self._turn_corners()
        self.launcher.launch(
            kernels_separation.find_pushes,
            self._count,
            [self._crowd, self._in_row, self._settings],
            [self._pairs],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _find_rows(self) -> None:
        for kernel, inputs, output in (
            (kernels_separation.find_parallels, [self._crowd, self._kept], self._pairs),
            (kernels_separation.find_rows, [self._pairs, LEAST_PARALLEL], self._in_row),
        ):
            self.launcher.launch(kernel, self._count, inputs, [output], grain=GRAIN_OF_NEIGHBORS)

    def _launch_move(self) -> None:
        self.launcher.launch(
            kernels_separation.move_apart,
            self._count,
            [self._pairs, self._bodies, self._bend, self._images, self._settings],
            [self._crowd, self._moves],
            grain=GRAIN_OF_NEIGHBORS,
            per_thread=True,
        )

    def _measure(self) -> None:
        self.launcher.launch(
            kernels_separation.measure_overlaps,
            self._count,
            [self._crowd, self._pairs, TOLERANCE],
            [self._deep, self._touching, self._cost],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _go_home(self) -> None:
        self._crowd_pose.assign(self._start)
        self._moves.home.assign(self._start)

    def _lead(self, guidance: Guidance) -> None:
        guidance.lead(self._crowd_pose, self._outlines, self._moves.home)

    def _cells(self, size: float) -> np.ndarray:
        extent = np.array(self._model.size)
        counts = np.maximum(1, (extent / max(size, 1e-30)).clip(max=4096).astype(np.int64))
        cell = np.clip((self._crowd_pose.numpy()[:, :2] / extent * counts).astype(np.int64), 0, counts - 1)
        return cell[:, 1] * counts[0] + cell[:, 0]

    def _trade(self, one: np.ndarray, other: np.ndarray) -> None:
        poses, home, last = (array.numpy().copy() for array in (self._crowd_pose, self._moves.home, self._moves.last))
        both, swapped = np.concatenate([one, other]), np.concatenate([other, one])
        poses[both, :2], home[both, :2] = poses[swapped, :2], home[swapped, :2]
        last[both] = 0.0
        self._crowd_pose.assign(poses)
        self._moves.home.assign(home)
        self._moves.last.assign(last)

    def _propose_swaps(self, stuck: wp.array, inputs: Sequence[Any], outputs: Sequence[wp.array]) -> None:
        self.launcher.launch(
            kernels_trials.propose_swaps, len(stuck), [stuck, *inputs, self._crowd, self._cost], outputs, grain=8
        )

    def _come_in(self) -> None:
        if not len(self._stunted):
            return
        outside = self.launcher.zeros(self._count, wp.int32)
        stuck = np.empty(0, np.int64)
        for number in range(MOST_JUMPS):
            self._rebuild()
            self.launcher.launch(kernels_trials.find_outside, self._count, [self._supports, self._crowd], [outside])
            stuck = np.flatnonzero(outside.numpy())
            if not len(stuck) or not self._jump(stuck, number, kernels_trials.PINNED_COST):
                break
        # Who finds no room at full length stays as short as before, and so can move at least.
        still = stuck[np.isin(self._order[stuck], self._stunted)]
        length = self._outlines.length.numpy().copy()
        length[still] = self._given_length[self._order[still]] / self._model.unit
        self._outlines.length.assign(length)
        self._stunted = np.setdiff1d(self._stunted, self._order[still])

    def _propose_places(self, stuck: np.ndarray, candidates: int, seed: int) -> ProposedPlaces:
        launcher, lanes = self.launcher, self._lanes(len(stuck))
        n = lanes * len(stuck)
        places = kernels_trials.Places()
        places.place, places.cost, places.share = (
            launcher.empty(n, wp.vec3),
            launcher.zeros(n, float),
            launcher.empty(n, float),
        )
        trials = trials_for(launcher, stuck, lanes, candidates, seed)
        launcher.launch(
            kernels_trials.propose_places,
            n,
            [trials, self._room, self._may_turn, self._supports],
            [self._crowd, places],
            grain=1,
        )
        cost = places.cost.numpy()
        best = best_of_lanes(cost, places.share.numpy(), lanes)
        there, cost = places.place.numpy()[best], cost[best]

        def land(landing: np.ndarray) -> None:
            poses, home, last = (
                array.numpy().copy() for array in (self._crowd_pose, self._moves.home, self._moves.last)
            )
            moved = stuck[landing]
            poses[moved, :3] = home[moved, :3] = there[landing]
            last[moved] = 0.0
            self._crowd_pose.assign(poses)
            self._moves.home.assign(home)
            self._moves.last.assign(last)

        return ProposedPlaces(there[:, :2], cost, land)

    def _find_costs(self, cost: wp.array) -> None:
        self.launcher.launch(kernels_trials.find_costs, self._count, [self._crowd], [cost], grain=GRAIN_OF_NEIGHBORS)

    def _propose_turns(
        self, trials: int, keep: float, seed: int, cost: wp.array, angle: wp.array, gain: wp.array
    ) -> None:
        self.launcher.launch(
            kernels_trials.propose_turns,
            self._count,
            [trials, keep, seed, cost],
            [self._crowd, angle, gain],
            grain=8,
        )

    def _accept_turns(self, angle: wp.array, gain: wp.array, turned: wp.array) -> None:
        self.launcher.launch(
            kernels_trials.accept_turns,
            self._count,
            [angle, gain],
            [self._crowd, turned],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _write_back(self) -> None:
        """Put bodies into the state as they are now."""
        crowd_pose = self._crowd_pose.numpy()[: len(self._order)]
        pose, turn = self._pose.numpy().copy(), self._turn.numpy().copy()
        lines, order = self._is_line[self._order], self._order
        pose[order, :2] = self._model.space.wrapped(crowd_pose[:, :2])
        pose[order[lines], 2] = crowd_pose[lines, 2]
        pose[self._stunted, 3] = self._length[self._stunted] / self._model.unit
        dots = ~lines
        turn[order[dots]] = crowd_pose[dots, 2]
        self._pose.assign(pose)
        self._turn.assign(turn)
        if self._model.bends_any:
            self._straighten()

    def _straighten(self) -> None:
        """Let lines bend no farther than there is room: they were parted as if they were straight."""
        launcher, n = self.launcher, len(self._order)
        self._turn_corners()
        widest, room = launcher.zeros(self._count, float), launcher.zeros(n, float)
        launcher.launch(kernels_bends.find_bends, n, [self._outlines, self._bodies, self._bend], [widest])
        # Bodies as they lie in space; those that are bent are looked for as far as they reach.
        reach = (self._outlines.reach.numpy() + widest.numpy()).astype(np.float64)
        meeting = self._near.footprints.meeting
        near = Neighborhood(launcher, self._model.space, reach, np.zeros(self._count), np.ones(self._count), meeting)
        # Cells know only places inside of a periodic domain.
        launcher.launch(
            kernels_pairs.begin_list, self._count, [], [self._crowd, self._moves.built, self._moves.moved_far]
        )
        near.sort(self._crowd_pose)
        crowd = kernels_pairs.Crowd()
        crowd.pose, crowd.outlines, crowd.neighbors = self._crowd_pose, self._outlines, near.for_kernels
        crowd.images, crowd.inset = self._crowd.images, self._crowd.inset
        launcher.launch(kernels_bends.find_room, n, [crowd, widest], [room], grain=GRAIN_OF_NEIGHBORS)
        launcher.launch(kernels_bends.straighten, n, [self._outlines, self._bodies, widest, room], [self._bend])


def _grown(model: Model, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return lengths of axes [m], shape ``[n]``, and the numbers of those that are longer than they were.

    Outlines that lie along axes have the size that they have, however long these have become: one between an obstacle and the border
    would stand in the obstacle, with an axis beside it. From convex obstacles outlines are parted as they are.
    """
    if not model.kinds or all(obstacle.outline is not None for obstacle in model.problem.obstacles):
        return length, np.empty(0, np.int64)
    lines = [kind.line for kind in model.kinds]
    asked = np.array([line.shortest if line.shortest == line.longest else 0.0 for line in lines] + [0.0])
    wanted = np.where(model.footprints.is_outline & ~model.fixed, asked[model.body.kind], 0.0)
    stunted = np.flatnonzero(length < GROWN * wanted)
    result = length.copy()
    result[stunted] = wanted[stunted]
    return result, stunted
