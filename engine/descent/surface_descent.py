"""The descent on a surface: what a step of the relaxation launches.

The energy, and what decides on the direction of a step, are those of the plane (:mod:`.descent`). Forces, moves and what is
remembered of them lie in the planes that touch the surface where bodies are. Whoever moves is put back onto the surface, at its
nearest point, and what it remembers is turned into the new plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from ..cascade.cascade import Cascade
from ..cascade.points import empty_points
from ..cascade.seen_from_afar import looks_other_from_afar, seen_from_afar
from ..contact import kernels_surface_bends
from ..contact.contact import keeps_apart
from ..contact.surface_contact import SurfaceContact
from ..contact.surface_obstacles import clear_of_outlines, outlines_on_ground, rooms
from ..contact.surface_separation import SurfaceSeparation
from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..geometry.unit_vectors import tangent_frame
from ..heat.heat_mesh import HeatMeshes
from ..model.beside_fixed_on_surface import left_by_fixed
from ..model.cut_by_detail import cut_by_detail
from ..model.model import Model
from ..model.state import StateArrays, SurfaceState
from ..model.surface_correlation import correlation_potential
from ..model.surface_places import (
    balls_of,
    clear_of_balls,
    clearances,
    reach_into_balls,
    spots_of_fixed,
    spots_of_points,
    tiles_of,
)
from ..model.surface_softness import softness_of
from ..motion import kernels_on_surface, kernels_surface_lines
from ..motion.carried_lines import carry_lines, rows_of_carried_lines
from ..motion.direction import ANY_STRETCH, Direction
from ..motion.line_rules import first_length_factors
from ..motion.surface_line_rules import SurfaceLineRules
from ..motion.surface_own_forces import own_forces
from ..problem.placement import Placement
from ..problem.surface import PointsOnSurface, Surface
from ..surface import kernels_facets
from ..surface.facets import Facets
from ..surface.parts import joined_parts
from .descent import SMALLEST_DENSITY, STEP_LIMIT, bodies_for_kernels
from .start_on_surface import first_spots
from .surface_placement import facing_headings, placement_on_surface, points_of
from .surface_target_correction import SurfaceTargetCorrection

__all__ = ["SurfaceDescent"]

# Changes where the bodies of a new descent are.
Start = Callable[["SurfaceDescent"], None]
# Returns the share of every class's density on every tile, shape ``[class_count, tile_count]``, and leaves facets as they are cut.
Shares = Callable[[Facets], np.ndarray]

# Lines of which a charge lies farther from where it was when they were parted, in widths, lie straight.
MOST_MISSED = 0.0005
# Where the last step met next to no curvature, as where bodies cross a crease, BFGS asks for a step that is as long as the limit for
# many of them. It is at most so many times as long as the moves that the forces ask for. Measured with 4,096 bodies on a landscape of
# cubes, six and eight seeds: smallest spacings after 100 steps are 0.76 on average and 0.37 at least without a bound, 0.82 and 0.70
# with 30, 0.84 and 0.82 with 20. In the plane such a step came in one of eight cases, and did no harm; lines and outlines that keep
# apart need steps as long there (with 30 tests of both failed), and are left alone here, too.
MOST_STRETCH = 30.0
# Targets are corrected for so many bodies at least, and charges at most. Many more stand so densely that few folds are narrower than
# their spacing, and a correction would take a tenth of the run; what a handful makes of its target is nothing to go by. Nor are they
# where heat spreads by more polynomials than this: on some meshes full of slivers a correction would take as long as all steps.
CORRECTED = (24, 50_000)
MOST_POLYNOMIALS = 200
# Of several classes all together would be made even at the cost of each, even of those that ignore each other: they would fill the
# holes around large bodies of another class. Measured with 3,000 bodies and 300 of four times their area on a sphere: errors of the
# 3,000 rise from .0497 to .0653, those of all together fall from .0537 to .0486. Large bodies of one class have such holes, too: areas
# of 9 to 1 have errors of .109 without and .113 with corrections, of 4 to 1 on a rock .0075 and .0066.
MOST_UNEQUAL = 5.0
# Borders are the same, but for what is merged at their ends.
SAME_BORDER = 1.001


class SurfaceDescent:
    """Takes steps of a model's state, as :class:`~.descent.Descent` does in the plane.

    Args:
        model: What is to be placed; its domain is a surface.
        launcher: Where to run.
        start: Says where bodies start, by the facets; None puts them on Hilbert curves.
        before: Another descent on the same surface; its nodes, and what the surface is from afar, are taken again if they will do.
        shares: Says which densities are followed; None for those of the model's problem.

    Attributes:
        share: Share of every class's density on every tile, shape ``[class_count, tile_count]``.
        state: Where the bodies are; at first on Hilbert curves.
        facets: The surface, cut.
        cascade: The forces.
        ground: What kernels know of the surface, as bodies see it.
        ground_from_near: The same as outlines lie on it.
        rules: What lines are to do.
        charges: Where the charges are.
        poses: Where the bodies are, as kernels take it.
        motion: What is remembered of their ways.
        step: A whole step, recorded.
        heat: The surface as heat spreads on it, for the report to take again.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        start: Start | None = None,
        before: SurfaceDescent | None = None,
        shares: Shares | None = None,
    ) -> None:
        self.model, self.launcher = model, launcher
        surface = model.problem.domain
        assert isinstance(surface, Surface)
        parts = joined_parts(launcher, surface, model.unit)
        self.facets = Facets(launcher, surface, model.unit, parts.label, parts.open_side, parts.relations, parts.part)
        corner = surface.position[surface.triangle]
        sides = np.linalg.norm(np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1), axis=2)
        self._border, self._continues, self._crumbs = float(sides[parts.open_side].sum()), parts.continues, parts.crumbs
        if shares is None:
            share = cut_by_detail(model, self.facets)
        self.bodies = bodies_for_kernels(model, launcher)
        on_device = self.facets.for_kernels()
        if shares is not None:
            share = shares(self.facets)
        # Contact and lines go by what the surface is from near.
        from_near = on_device
        self._from_afar: kernels_facets.Facets | None = None
        if before is not None and before.model.unit != model.unit:
            before = None
        if not model.kinds and looks_other_from_afar(self.facets):
            seen = None if before is None else before._from_afar
            self._from_afar = on_device = seen_from_afar(launcher, self.facets, on_device, 1.0, seen)
        asked = started = share
        fixed = None
        if model.fixed.any():
            fixed = spots_of_fixed(launcher, model, self.facets)
            share, started = left_by_fixed(launcher, model, self.facets, asked, fixed)
        self.share = share
        self._balls, self._clear = balls_of(model, self.facets), clearances(model)
        started = clear_of_balls(model, self.facets, started, self._balls, self._clear)
        started = clear_of_outlines(model, self.facets, started)
        column = model.groups.class_index
        of_group = np.zeros((model.groups.count, len(share)))
        of_group[np.arange(len(column)), column] = model.group_charge
        self._make_forces(on_device, of_group, before)
        self.ground = self._make_ground(on_device, share, model.interaction @ of_group)
        self.ground_from_near = _with_facets(self.ground, from_near)
        n = model.body_count
        self.charges = _charges(launcher, model.charge_count)
        self.rules = SurfaceLineRules(model, launcher, self.facets)
        self._has_dots = bool((model.body.kind < 0).any())
        self.direction = Direction(launcher, n, self.rules, _most_stretch(model))
        self.state = self._first_state(started)
        if start is not None:
            start(self)
            # Bodies that come along have brought their outlines.
            self.ground.clear.assign(np.column_stack([clearances(model), rooms(model)]).astype(np.float32))
        if fixed is not None:
            rows = np.flatnonzero(model.fixed)
            self._put(rows, fixed)
            self._lay(rows, self.rules.fixed_axes(self.facets.normal[fixed[0]]))
        self.rules.lines.length_factor = self.state.length_factor
        self.poses = _poses(self.state)
        self.motion = _motion(self.state, launcher)
        self.contact: SurfaceContact | None = None
        if keeps_apart(model):
            self.contact = SurfaceContact(model, launcher, self.bodies, self.ground_from_near, self.poses, self.motion)
        self.place_charges()
        self.step = launcher.record(self.take_step)
        self.heat = HeatMeshes(launcher, surface)
        self._correction: SurfaceTargetCorrection | None = None

    def _make_forces(
        self, on_device: kernels_facets.Facets, of_group: np.ndarray, before: SurfaceDescent | None
    ) -> None:
        """Make what acts on the charges, of which there is so much of every class in every group, ``[group_count, class_count]``."""
        model, launcher, share = self.model, self.launcher, self.share
        self._own_forces, interaction = own_forces(model, launcher, self.facets, on_device, share)
        softness = softness_of(model)
        self.cascade = Cascade(
            launcher,
            self.facets,
            on_device,
            share=share,
            attraction=interaction @ of_group,
            interaction=interaction,
            charge=model.charge.charge,
            charge_group=model.body.group[model.charge.body],
            softness=softness,
            before=self._cascade_of(before),
        )
        if before is not None and before.cascade.nodes is self.cascade.nodes:
            # What an edit finds corrected stays so.
            self.cascade.scale_images(before.cascade.scale)
        # What is blurred as its target is has no such bias.
        potential = None
        if softness is None:
            potential = correlation_potential(model, self.cascade.node_share, self.cascade.node_area)
        if potential is not None:
            self.cascade.set_offset(potential)

    def _cascade_of(self, before: SurfaceDescent | None) -> Cascade | None:
        """The cascade of another descent in the same unit, if it sees the surface as this one does."""
        if before is None or (before._from_afar is None) != (self._from_afar is None):
            return None
        return before.cascade

    def take_step(self) -> None:
        """Launch a whole step."""
        charges = self.charges
        self.cascade.evaluate(charges.points, charges.facet, charges.weight, charges.home, charges.field)
        for own in self._own_forces:
            own.add(charges)
        with self.launcher.phase("update"):
            self._propose()
            self.direction.decide(self.state.length_factor)
            self._move()
        if self.contact is not None:
            with self.launcher.phase("contact"):
                self.contact.push()
            with self.launcher.phase("update"):
                self.place_charges()

    @property
    def corrects_targets(self) -> bool:
        """Whether :meth:`correct_targets` is of use, and worth its time."""
        (fewest, most), count = CORRECTED, self.model.body_count
        if count < fewest or self.model.charge_count > most or self._continues:
            return False
        charge = self.model.charge.charge
        if len(self.model.problem.classes) > 1 or charge.max() > MOST_UNEQUAL * charge.min():
            return False
        heat = self.heat.of(count)
        # Where heat ends, or turns to a hidden face, and the surface does not, bodies would leave the seam for that.
        return heat.border <= SAME_BORDER * self._border and heat.polynomials(count) <= MOST_POLYNOMIALS

    def correct_targets(self) -> None:
        """Correct the targets by how dense bodies stand; see :mod:`.surface_target_correction`."""
        model = self.model
        with self.launcher.phase("targets"):
            if self._correction is None:
                heat = self.heat.of(model.body_count)
                self._correction = SurfaceTargetCorrection(
                    model, self.launcher, self.facets, self.share[0], self.cascade, heat
                )
            self._correction.correct(self.charges)

    def separate(self, go_on: Callable[[], bool] | None = None, *, again: bool = False) -> bool:
        """Part all outlines, where the surface can hold them; returns whether none overlap any more.

        Args:
            go_on: Called now and then; returning False ends it.
            again: Whether they were parted before, and have moved little since.
        """
        parting = SurfaceSeparation(
            self.model,
            self.launcher,
            self.bodies,
            self.ground_from_near,
            self.facets,
            self.state,
            self.share,
            self.rules.preferred,
        )
        return parting.run(go_on, again=again)

    def positions(self) -> np.ndarray:
        """Where the bodies are [m], shape ``[body_count, 3]``."""
        return points_of(self.launcher, self.facets, self.state).position

    def facing(self) -> tuple[wp.array, np.ndarray]:
        """How outlines are turned [rad], and how they would look at the points of their classes, both of shape ``[body_count]``."""
        return self.state.heading, facing_headings(self.model, points_of(self.launcher, self.facets, self.state))

    def placement(self) -> Placement:
        """The bodies as they are; the report is empty."""
        charges = self._laid_charges() if self.model.bends_any else None
        return placement_on_surface(self.model, self.launcher, self.facets, self.state, charges)

    def _laid_charges(self) -> np.ndarray:
        """Where all charges are as outlines lie [m], shape ``[charge_count, 3]``.

        Where outlines keep apart, those of lines that cannot lie as they were parted are NaN: these lie straight.
        """
        model = self.model
        position = self.launcher.zeros(model.charge_count, wp.vec3)
        missed = self.launcher.zeros(model.body_count, float)
        self.launcher.launch(
            kernels_surface_bends.lay_bends,
            model.body_count,
            [self.poses, self.bodies, self.ground_from_near],
            [position, missed],
            grain=GRAIN_OF_NEIGHBORS,
        )
        charges = position.numpy().astype(np.float64) * model.unit + self.facets.middle
        if model.problem.avoid_overlap:
            length = 2.0 * np.linalg.norm(self.state.axis.numpy().astype(np.float64), axis=1) * model.unit
            elsewhere = missed.numpy() * model.unit > MOST_MISSED * model.widths(length)
            charges[elsewhere[model.charge.body]] = np.nan
        return charges

    def continue_from(self, state: StateArrays) -> None:
        """Go on from another state of the same problem; its values are copied."""
        own: StateArrays = self.state
        own.assign(state)
        self.place_charges()

    def place_charges(self) -> None:
        """Put the charges of all bodies where these are."""
        n = self.model.body_count
        if self._has_dots:
            self.launcher.launch(
                kernels_on_surface.place_dots, n, [self.poses, self.bodies, self.ground], [self.charges]
            )
        if self.rules.kind_count:
            self.launcher.launch(
                kernels_surface_lines.place_lines,
                n,
                [self.poses, self.bodies, self.ground],
                [self.charges],
                grain=GRAIN_OF_NEIGHBORS,
            )

    def _propose(self) -> None:
        n, rules, in_contact = self.model.body_count, self.rules, int(self.contact is not None)
        if self._has_dots:
            self.launcher.launch(
                kernels_on_surface.propose_dots,
                n,
                [self.charges, self.bodies, self.ground, in_contact],
                [self.motion, self.direction.sums],
                per_thread=True,
            )
        if rules.kind_count:
            self.launcher.launch(
                kernels_surface_lines.propose_lines,
                n,
                [self.poses, self.charges, self.bodies, rules.lines, rules.preferred, self.ground, in_contact],
                [self.motion, self.state.bend, self.direction.sums],
                per_thread=True,
            )

    def _move(self) -> None:
        n = self.model.body_count
        if self._has_dots:
            self.launcher.launch(
                kernels_on_surface.move_dots,
                n,
                [self.direction.factors, self.bodies, self.ground],
                [self.motion, self.poses, self.charges],
                grain=GRAIN_OF_NEIGHBORS,
            )
        if self.rules.kind_count:
            self.launcher.launch(
                kernels_surface_lines.move_lines,
                n,
                [self.direction.factors, self.bodies, self.rules.lines, self.ground],
                [self.motion, self.poses],
                grain=GRAIN_OF_NEIGHBORS,
            )
            if self.contact is None:
                self.place_charges()

    def _make_ground(
        self, on_device: kernels_facets.Facets, share: np.ndarray, attraction: np.ndarray
    ) -> kernels_on_surface.Ground:
        device, cascade, model = self.launcher.device, self.cascade, self.model
        area = np.maximum(cascade.node_area, 1e-12)
        attracting = attraction @ cascade.node_share
        mean = attraction.sum(axis=1) / area.sum()
        # A group that nothing attracts keeps a finite step.
        least = np.maximum(SMALLEST_DENSITY * mean, 1e-12)
        length = 1.0 / (2.0 * math.pi * np.maximum(attracting / area, least[:, None]))
        count = np.array([c.body_count for c in model.problem.classes])
        number = count @ cascade.node_share / area
        limit = STEP_LIMIT / np.sqrt(np.maximum(number, SMALLEST_DENSITY * model.body_count / area.sum()))
        ground = kernels_on_surface.Ground()
        ground.facets = on_device
        ground.tile_count = self.facets.tile_count
        ground.node_count = cascade.node_count
        ground.home = cascade.home
        ground.full = wp.array((share > 0.0).astype(np.uint8).ravel(), dtype=wp.uint8, device=device)
        ground.step_limit = wp.array(limit, dtype=float, device=device)
        ground.step_length = wp.array(length.ravel(), dtype=float, device=device)
        ground.ball_count = len(self._balls)
        ground.balls = wp.array(self._balls.astype(np.float32), dtype=wp.vec4, device=device)
        ground.clear = wp.array(np.column_stack([self._clear, rooms(model)]), dtype=wp.vec2, device=device)
        ground.crumbs = self._crumbs
        ground.outlines = outlines_on_ground(self.launcher, model, self.facets)
        return ground

    def take_over(
        self, source: np.ndarray, spots: tuple[np.ndarray, np.ndarray], old: Model, before: SurfaceState
    ) -> np.ndarray:
        """Put bodies where they were before an edit, as they lay; ``source`` is their number then, -1 for new ones.

        Those that may not be there any more, from where they would not find out, begin as in a run of their own. Returns ``source``
        with -1 for these, too.
        """
        stays = self._may_be_at(spots)
        rows = np.flatnonzero(stays)
        self._put(rows, (spots[0][rows], spots[1][rows]))
        source = np.where(stays, source, -1)
        came = rows_of_carried_lines(old, self.model, source)
        if len(came):
            self._lay(came, before.axis.numpy()[source[came]] * (old.unit / self.model.unit))
        carry_lines(old, before, self.model, self.state, source)
        outlined = np.flatnonzero((source >= 0) & self.model.footprints.is_outline & ~self.model.fixed)
        outlined = outlined[old.footprints.is_outline[source[outlined]]]
        if len(outlined):
            heading = self.state.heading.numpy().copy()
            heading[outlined] = before.heading.numpy()[source[outlined]]
            self.state.heading.assign(heading)
        return source

    def put_some(self, rows: np.ndarray, points: PointsOnSurface) -> None:
        """Put some bodies at points of the surface; those whose class may not be there stay where they are."""
        facet, weight = spots_of_points(self.facets, points)
        class_index = self.model.body.class_index[rows]
        may_be = self.share[class_index, tiles_of(self.facets, facet, weight)] > 0.0
        self._put(rows[may_be], (facet[may_be], weight[may_be]))

    def put_at(self, spots: tuple[np.ndarray, np.ndarray], angle: np.ndarray | None, length: np.ndarray | None) -> None:
        """Put all bodies somewhere, as :meth:`~.solver.Solver.start_at` takes their angles and lengths.

        Those that may not be there any more, from where they would not find out, begin as in a run of their own.
        """
        model = self.model
        facet, weight = spots
        stays = self._may_be_at(spots)
        rows = np.flatnonzero(stays)
        self._put(rows, (facet[rows], weight[rows]))
        if angle is None:
            return
        is_line = model.body.kind >= 0
        lines = np.flatnonzero(is_line & stays)
        if len(lines):
            half = np.linalg.norm(self.state.axis.numpy()[lines], axis=1)
            if length is not None:
                half = np.where(length[lines] > 0.0, 0.5 / model.unit * length[lines], half)
            one, other = tangent_frame(self.facets.normal[facet[lines]])
            turn = angle[lines, None]
            self._lay(lines, half[:, None] * (np.cos(turn) * one + np.sin(turn) * other))
        # A line's angle says how its outline lies.
        outlined = model.footprints.is_outline & ~model.fixed & stays
        heading = self.state.heading.numpy().copy()
        heading[outlined] = np.where(is_line, 0.0, angle)[outlined]
        self.state.heading.assign(heading)

    def _may_be_at(self, spots: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Which bodies may be at spots: their class is asked for there, and they reach into no ball; all that are fixed."""
        model = self.model
        asked = self.share[model.body.class_index, tiles_of(self.facets, *spots)] > 0.0
        return model.fixed | (asked & ~reach_into_balls(self.facets, spots, self._balls, clearances(model)))

    def _lay(self, rows: np.ndarray, axis: np.ndarray) -> None:
        """Give some bodies an axis."""
        axes = self.state.axis.numpy().copy()
        axes[rows] = axis
        self.state.axis.assign(axes)

    def _put(self, rows: np.ndarray, spots: tuple[np.ndarray, np.ndarray]) -> None:
        """Put some bodies somewhere; lines lie there as at the start."""
        facet, weight = self.state.facet.numpy().copy(), self.state.weight.numpy().copy()
        facet[rows], weight[rows] = spots
        self.state.facet.assign(facet)
        self.state.weight.assign(weight)
        lines = rows[self.model.body.kind[rows] >= 0]
        if len(lines):
            # What lay across another facet has no length in this one, and nothing stretches such a line.
            self._lay(lines, self.rules.first_axes(facet, tiles_of(self.facets, facet, weight))[lines])

    def _first_state(self, share: np.ndarray) -> SurfaceState:
        model, launcher, device = self.model, self.launcher, self.launcher.device
        n = model.body_count
        facet, weight = first_spots(launcher, model, self.facets, self.ground, self.bodies.support, share)
        axis = np.zeros((n, 3))
        if self.rules.kind_count:
            axis = self.rules.first_axes(facet.numpy(), tiles_of(self.facets, facet.numpy(), weight.numpy()))
        return SurfaceState(
            facet=facet,
            weight=weight,
            displacement=launcher.zeros(n, wp.vec3),
            move=launcher.zeros(n, wp.vec3),
            axis=wp.array(axis.astype(np.float32), dtype=wp.vec3, device=device),
            bend=launcher.zeros(model.charge_count, float),
            heading=launcher.own_array(model.footprints.turn.astype(np.float32), float),
            turned=launcher.zeros(n, wp.vec2),
            turn=launcher.zeros(n, wp.vec2),
            length_factor=first_length_factors(self.launcher, self.rules.kind_count),
            steps=np.zeros(1, np.int32),
            unit=np.array([model.unit]),
        )


def _charges(launcher: Launcher, count: int) -> kernels_on_surface.Charges:
    """So many charges that are still to be placed."""
    charges = kernels_on_surface.Charges()
    charges.points = empty_points(launcher, count)
    charges.facet, charges.home = launcher.empty(count, wp.int32), launcher.empty(count, wp.int32)
    charges.weight, charges.field = launcher.empty(count, wp.vec2), launcher.zeros(count, wp.vec3)
    return charges


def _poses(state: SurfaceState) -> kernels_on_surface.Poses:
    """Where the bodies of a state are, as kernels take it."""
    poses = kernels_on_surface.Poses()
    poses.facet, poses.weight, poses.axis, poses.bend = state.facet, state.weight, state.axis, state.bend
    return poses


def _motion(state: SurfaceState, launcher: Launcher) -> kernels_on_surface.Motion:
    """What a state remembers, as kernels take it, beside arrays for what the moves and turns changed by."""
    motion = kernels_on_surface.Motion()
    motion.displacement, motion.move = state.displacement, state.move
    motion.turned, motion.turn = state.turned, state.turn
    motion.change = launcher.zeros(len(state.move), wp.vec3)
    motion.turn_change = launcher.zeros(len(state.turn), wp.vec2)
    return motion


def _with_facets(ground: kernels_on_surface.Ground, facets: kernels_facets.Facets) -> kernels_on_surface.Ground:
    """The same of other facets."""
    result = kernels_on_surface.Ground()
    for name in kernels_on_surface.Ground.__annotations__:
        setattr(result, name, getattr(ground, name))
    result.facets = facets
    return result


def _most_stretch(model: Model) -> float:
    """How long steps may be: those of dots are bounded, see :data:`MOST_STRETCH`."""
    return ANY_STRETCH if keeps_apart(model) or model.kinds else MOST_STRETCH
