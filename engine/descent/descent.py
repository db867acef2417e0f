"""The descent: what a step of the relaxation launches.

The bodies descend the energy 1/2 sum M[g, h] <rho_g - u_g, K (rho_h - u_h)>. Where the density is low the energy is flat, so
what the forces ask for is measured in the inverse of the local curvature, 2 pi sum_h M[g, h] u_h; and what the last step changed
of it tells of the slow modes (memoryless BFGS; of the optimizers tried the one that needs the fewest evaluations of the forces,
half of those of Nesterov's momentum: `benchmarks/optimizers.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import warp as wp

from ..contact.close_bodies import close_bodies
from ..contact.contact import Contact, keeps_apart
from ..device.launcher import GRAIN, GRAIN_OF_NEIGHBORS, Launcher
from ..device.marked import numbers_up_to
from ..model.looking import facing_turns
from ..model.model import Model
from ..model.numbers_in_parts import with_whole_numbers
from ..model.state import State, StateArrays
from ..motion import kernels_descent, kernels_direction, kernels_dots, kernels_lines
from ..motion.direction import ANY_STRETCH, Direction
from ..motion.forces import SMALLEST_DENSITY, FieldSettings, Forces
from ..motion.held_border import MOST_STRETCH, shares_of_forces
from ..motion.line_rules import FIRST_LENGTH, LineRules
from ..problem.of_bodies import distinct
from ..problem.placement import Placement
from ..space.support import images_for_kernels
from ..space.target_deposit import mix_images
from .final_placement import placement_of, position_in_meters
from .initial_placement import Pyramids, first_pose

__all__ = ["STEP_LIMIT", "Descent", "bodies_for_kernels", "step_along_lines"]

# Most that a body moves in a step, as a share of the local spacing: two neighbors that approach just meet. Measured: with 0.25 and
# 1 coverage errors of dots on a steep density differ by 0.3 %; with 1 those of lines are 5 % larger, and some cross.
STEP_LIMIT = 0.5


class Descent:
    """The descent in the plane: holds the state of a model's bodies, and the recorded kernels of one step.

    Args:
        model: The compiled problem.
        launcher: Runs the kernels.
        pose: Where bodies start, in the model's unit, shape ``[body_count, 4]``; None for the start of :mod:`.initial_placement`.
            Where angle and length are NaN, they are what the rules for lines want at the start of an edit. Of a model without lines
            it may be on the device, ``wp.vec4``, and belongs to the descent then.
        field_settings: How the field differs from the usual one; None if it does not. Where it is smooth, as :mod:`.natural_border`
            wants it, lines that lie across obstacles begin short, as at the start.
        stirred: Places around which forces count in full even beside a natural border, in the model's unit, shape ``[m, 2]``: see
            :mod:`.held_border`.
        whole_numbers: Whether separate parts of the ground get the numbers of bodies that they ask for: see
            :mod:`.numbers_in_parts`.

    Attributes:
        state: The current state. At first bodies lie along a Hilbert curve (see :mod:`.initial_placement`), unless ``pose`` is given.
        field: The field that the forces come from; see :class:`.forces.Forces`.
        step_length: Inverse of the energy's curvature at every node of the field's mesh, flat, one group after the other.
        step_limit: How far a body may move in a step, at every node.
        contact: Keeps footprints apart; None if nothing is to be kept apart.
        at_once: Number of dots that one element of a kernel moves, see :mod:`.kernels_dots`.
        step: The recording of a whole step.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        *,
        pose: np.ndarray | wp.array | None = None,
        field_settings: FieldSettings | None = None,
        stirred: np.ndarray | None = None,
        whole_numbers: bool = True,
    ) -> None:
        self.model = model
        self.launcher = launcher
        settings = field_settings or FieldSettings()
        is_smooth = settings.smooth is not None
        self._begins_short, self._whole_numbers = is_smooth, whole_numbers
        device = launcher.device
        self._space = model.space.for_kernels()
        self.rules = LineRules(model, launcher)
        self.bodies = bodies_for_kernels(model, launcher)
        if is_smooth:
            # Where small charges are blurred less than what attracts them, they are drawn onto a border, and large ones away from it.
            settings = replace(settings, whole_charge=np.broadcast_to(1.0, model.charge_count))
        self.has_dots = bool((distinct(model.body.kind) < 0).any())
        self.at_once = 1 if device.is_cuda else kernels_dots.DOTS_AT_ONCE
        self._forces = Forces(model, launcher, settings)
        self.field = self._forces.field
        self._prepare_step_limits()
        held = model.problem.rectangle.natural and not is_smooth
        self.step_length = self._forces.step_lengths(launcher, self._shares_of_forces(stirred) if held else None)
        # Dots look for the way back into the support only where they start.
        back = pose is None or bool(model.kinds)
        self.images = images_for_kernels(
            launcher, model.supports, model.size, to_support=back, step=step_along_lines(model)
        )
        self.state = self._first_state(pose)
        # Of starts after the first one, which only few bodies have: those of many are large.
        self._pyramids: Pyramids = {}
        n = model.body_count
        self.charge_position = launcher.empty(model.charge_count, wp.vec2)
        self.field_at_charge = launcher.zeros(model.charge_count, wp.vec2)
        self._charges = kernels_descent.Charges()
        self._charges.position, self._charges.field = self.charge_position, self.field_at_charge
        self._steps = kernels_descent.Steps()
        self._steps.length, self._steps.limit, self._steps.mesh = self.step_length, self.step_limit, self.field.mesh
        self._motion = kernels_descent.Motion()
        self._motion.displacement, self._motion.move = self.state.displacement, self.state.move
        self._motion.change = launcher.zeros(n, wp.vec4)
        # Lines and bodies that keep apart need long steps; see :data:`.surface_descent.MOST_STRETCH`.
        bounded = held and not (keeps_apart(model) or model.kinds)
        self.direction = Direction(launcher, n, self.rules, MOST_STRETCH if bounded else ANY_STRETCH)
        blocks = (launcher.thread_count, max(2 * self.rules.block_count, 1))
        self._sums_of_blocks = launcher.zeros(blocks, wp.int64)
        self.contact: Contact | None = None
        if keeps_apart(model):
            self.contact = Contact(model, launcher, self.bodies, self.images)
        self.place_charges()
        self.step = launcher.record(self.take_step)

    @property
    def corrects_targets(self) -> bool:
        """Whether targets can be corrected by how dense bodies stand: there are enough of every group."""
        return self.field.feedback is not None

    def correct_targets(self) -> None:
        """Correct the targets by how dense bodies stand; see :mod:`~esh.engine.field.target_feedback`."""
        with self.launcher.phase("targets"):
            self._forces.correct_targets(self.charge_position)

    def take_over_targets(self, before: Descent) -> None:
        """Begin with targets corrected as those of a descent were that this one goes on from."""
        if self.field.feedback is not None and before.field.feedback is not None:
            self.field.feedback.take_over(before.field.feedback)

    def continue_from(self, state: StateArrays) -> None:
        """Go on from another state of the same problem; its values are copied."""
        own: StateArrays = self.state
        own.assign(state)
        if self.field.feedback is not None:
            self.field.feedback.apply()
        self.place_charges()

    def separate(self, go_on: Callable[[], bool] | None = None, *, again: bool = False) -> bool:
        """Part all outlines, where the space can hold them; returns whether none overlap any more; see :meth:`.Contact.separate`."""
        assert self.contact is not None
        state = self.state
        return self.contact.separate(state.pose, state.turn, state.bend, go_on, again=again, guided=not again)

    def positions(self) -> np.ndarray:
        """Where the bodies are [m], shape ``[body_count, 2]``."""
        return position_in_meters(self.model, self.state, self.launcher)

    @property
    def around(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Origin and extent of a rectangle that holds all bodies: the field's part of the space, or all of it."""
        layout = self.field.layout
        return ((0.0, 0.0), self.model.size) if layout.whole is layout.space else (layout.origin, layout.space.size)

    def close_bodies(self) -> np.ndarray:
        """Which dots stand too close to others, shape ``[body_count]``, bool; see :mod:`.close_bodies`. Lines may lie closely."""
        position = self.positions() / self.model.unit
        where = self.model.space, self.field.mesh, self.step_limit, 1.0 / STEP_LIMIT
        return close_bodies(self.launcher, position, self.model.body_charge, *where) & (self.model.body.kind < 0)

    def facing(self) -> tuple[wp.array, np.ndarray]:
        """How outlines are turned [rad], and how they would look at the points of their classes, both of shape ``[body_count]``."""
        return self.state.turn, facing_turns(self.model, self.positions())

    def placement(self) -> Placement:
        """The bodies as they are; the report is empty."""
        return placement_of(self.model, self.state, self.launcher)

    def restart(self, start: int) -> None:
        """Go back to where bodies start, or to another one of the places where they might have."""
        self.rules.lines.length_factor.fill_(1.0)
        self.state.assign(self._first_state(None, start, self._pyramids))
        self.place_charges()

    def _first_state(
        self, given: np.ndarray | wp.array | None, start: int = 0, pyramids: Pyramids | None = None
    ) -> State:
        model, launcher = self.model, self.launcher
        if given is None:
            pose = first_pose(launcher, model, self.images, start, pyramids)
            if self._whole_numbers:
                pose = with_whole_numbers(launcher, model, pose, start)
            if self.rules.kind_count:
                values = pose.numpy()
                values[:, 2:] = self.rules.first_angle_and_length(values[:, :2])
                values[model.fixed, 2:] = self.rules.fixed_angle_and_length()
                pose = wp.array(values, dtype=wp.vec4, device=launcher.device)
        elif isinstance(given, wp.array):
            pose = given
        else:
            values = given.copy()
            if not self.rules.kind_count:
                values[:, 2:] = 0.0
            elif np.isnan(values[:, 2:]).any():
                first = self.rules.first_angle_and_length(values[:, :2], 1.0)
                values[:, 2:] = np.where(np.isnan(values[:, 2:]), first, values[:, 2:])
            step = step_along_lines(model) if self._begins_short else 0.0
            if step > 0.0:
                # As at any start they grow as long as they are to be where there is room.
                values[self.rules.without_room(values, step), 3] *= FIRST_LENGTH
            values[model.fixed, 2:] = self.rules.fixed_angle_and_length()
            pose = wp.array(values.astype(np.float32, copy=False), dtype=wp.vec4, device=launcher.device)
        n = model.body_count
        return State(
            pose=pose,
            turn=self._first_turns(),
            bend=launcher.zeros(model.charge_count, float),
            displacement=launcher.zeros(n, wp.vec4),
            move=launcher.zeros(n, wp.vec4),
            length_factor=self.rules.lines.length_factor,
            target_factor=self._forces.target_factor,
            steps=np.zeros(1, np.int32),
            unit=np.array([model.unit]),
        )

    def _first_turns(self) -> wp.array:
        turn = self.model.footprints.turn
        if not self.model.footprints.has_outlines:
            return self.launcher.zeros(len(turn), float)
        return wp.array(turn.astype(np.float32), dtype=float, device=self.launcher.device)

    def _prepare_step_limits(self) -> None:
        field = self.field
        layout = field.layout
        count = np.zeros((1, len(field.images)))
        copies = self._forces.images_of_each
        for index, c in enumerate(self.model.problem.classes):
            # Where all bodies of a class are fixed, nothing may follow its density.
            if index in field.image_of_class:
                count[0, field.image_of_class[index]] += copies * c.body_count
        number = mix_images(self.launcher, field.deposited, count, layout.node_count)
        self.step_limit = self.launcher.empty(layout.node_count, float)
        self.launcher.launch(
            kernels_descent.find_step_limits,
            layout.node_count,
            [
                number,
                1.0 / layout.node_area,
                SMALLEST_DENSITY * self.model.body_count / self.model.charge_count,
                STEP_LIMIT,
            ],
            [self.step_limit],
        )

    def _shares_of_forces(self, stirred: np.ndarray | None) -> wp.array:
        """How much of the forces counts, as :mod:`.held_border` says."""
        spacing = self.step_limit.numpy() / STEP_LIMIT
        return shares_of_forces(self.launcher, self.model, self.field.layout, spacing, stirred)

    def take_step(self) -> None:
        """Launch a whole step."""
        self._forces.evaluate(self.charge_position, self.field_at_charge)
        with self.launcher.phase("update"):
            self.propose()
            self.decide()
            self.move()
        if self.contact is not None:
            with self.launcher.phase("contact"):
                self.contact.push(self.state.pose, self.state.bend, self.state.displacement)
            with self.launcher.phase("update"):
                self.place_charges()

    def propose(self) -> None:
        """What the forces ask for, and the sums over all bodies that the direction depends on."""
        where = [self._steps, self._space, int(self.contact is not None)]
        if self.has_dots:
            self.launcher.launch(
                kernels_dots.propose_dots,
                -(-self.model.body_count // self.at_once),
                [self.model.body_count, self.at_once, self._charges, self.bodies, *where],
                [self._motion, self.direction.sums],
                grain=GRAIN // self.at_once,
                per_thread=True,
            )
        if self.rules.kind_count:
            self.launcher.launch(
                kernels_lines.propose_lines,
                self.model.body_count,
                [self.state.pose, self._charges, self.bodies, self.rules.lines, *where],
                [self._motion, self.state.bend, self.direction.sums, self._sums_of_blocks],
                grain=GRAIN_OF_NEIGHBORS,
                per_thread=True,
            )

    def decide(self) -> None:
        """In which direction all of them move; see :func:`.kernels_direction.decide_direction`."""
        self.direction.decide(self.rules.lines.length_factor)
        if self.rules.block_count:
            self.launcher.launch(
                kernels_direction.adapt_blocks,
                self.rules.block_count,
                [self.rules.kind_count],
                [self._sums_of_blocks, self.rules.lines.length_factor],
            )

    def move(self) -> None:
        """Move them."""
        where = [self._steps, self.images, self._space]
        if self.has_dots:
            self.launcher.launch(
                kernels_dots.move_dots,
                -(-self.model.body_count // self.at_once),
                [self.model.body_count, self.at_once, self.direction.factors, self.bodies, *where],
                [self._motion, self.state.pose, self.charge_position],
                grain=GRAIN // self.at_once,
            )
        if self.rules.kind_count:
            self.launcher.launch(
                kernels_lines.move_lines,
                self.model.body_count,
                [self.direction.factors, self.bodies, self.rules.lines, *where],
                [self._motion, self.state.pose, self.state.bend],
                grain=GRAIN_OF_NEIGHBORS,
            )

    def place_charges(self) -> None:
        """Put the charges of all bodies where these are; those of dots follow at once where there is no contact."""
        self.launcher.launch(
            kernels_descent.place_charges,
            self.model.body_count,
            [self.state.pose, self.bodies, self.state.bend, self._space],
            [self.charge_position],
        )


def step_along_lines(model: Model) -> float:
    """How far apart points of lines are that must keep off obstacles: a pixel of what these are drawn in; 0 without obstacles."""
    if not model.problem.obstacles or not model.kinds:
        return 0.0
    extent = np.array(model.size)
    return float(min((extent / image.shape[::-1]).min() for image in model.supports))


def bodies_for_kernels(model: Model, launcher: Launcher) -> kernels_descent.Bodies:
    """The bodies as kernels take them."""
    table, charge = model.body, model.charge
    bodies = kernels_descent.Bodies()
    bodies.support = launcher.array(table.support, wp.int32)
    bodies.group = table.group_on(launcher)
    bodies.kind = launcher.array(table.kind, wp.int32)
    bodies.flags = launcher.array(table.flags, wp.int32)
    bodies.first_charge = _first_charges(model, launcher)
    bodies.axial = launcher.array(charge.axial, float)
    bodies.charge = launcher.array(charge.charge, float)
    return bodies


def _first_charges(model: Model, launcher: Launcher) -> wp.array:
    """Index of the first charge of every body and, at the end, their number, for kernels."""
    if model.charge_count != model.body_count:
        return launcher.array(model.charge.first, wp.int32)
    return numbers_up_to(launcher, model.body_count + 1)
