"""The relaxation: how the bodies find their places.

The bodies descend the energy 1/2 sum M[g, h] <rho_g - u_g, K (rho_h - u_h)>. Where the density is low the energy is flat, so
what the forces ask for is measured in the inverse of the local curvature, 2 pi sum_h M[g, h] u_h; and what the last step changed
of it tells of the slow modes (memoryless BFGS; of the optimisers tried the one that needs the fewest evaluations of the forces,
half of those of Nesterov's momentum: `benchmarks/optimizers.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBOURS, Launcher
from ..field.field import Field, FieldTarget
from ..problem.body_charges import charges_of
from ..problem.interaction import group_bodies
from ..problem.placement import Placement
from ..problem.problem import Problem
from ..problem.report import NO_REPORT
from ..space.density import settle_on_full_pixels
from ..space.full_pixels import images_for_kernels
from ..space.survey import survey
from ..space.target_deposit import mix_images
from . import kernels_descent, kernels_direction
from .contact import Contact
from .initial_placement import first_pose
from .line_rules import LineRules, line_widths

__all__ = ["Progress", "Relaxation", "placement_of"]

# No body moves further in a step than this share of the local spacing.
STEP_LIMIT = 0.5
# Curvature and spacing are taken where the density is at least this share of its mean, so that steps stay finite.
SMALLEST_DENSITY = 2e-3
# RMS move over local spacing at which a run has converged: later steps change no figure of the report.
TOLERANCE = 2e-4
# What counts as converged where the steps run out: bodies want to move by less than a hundredth of their spacing.
SETTLED = 5e-3
# Steps on a GPU between two looks at how far bodies still move, where nobody wants to hear of each.
STEPS_UNWATCHED = 10


@dataclass(frozen=True, eq=False)
class Progress:
    """Where a run stands, as its progress callback gets it.

    Attributes:
        step: Steps taken.
        steps: Steps that the run takes at most.
        residual: RMS of the moves that the forces ask for, over the local spacing; falls as the run converges.
    """

    step: int
    steps: int
    residual: float
    _read_position: Callable[[], np.ndarray]

    @property
    def position(self) -> np.ndarray:
        """Current body positions [m], shape ``[n, 2]``, in the placement's order; a copy, made when it is asked for."""
        return self._read_position()


class Relaxation:
    """State of one run, in the solver's units (see :mod:`~esh.engine.field.field`)."""

    def __init__(self, problem: Problem, launcher: Launcher) -> None:
        self.problem = problem
        self.launcher = launcher
        domain = problem.domain
        device = launcher.device
        charges = charges_of(problem)
        self.body_count = problem.body_count
        self.charge_count = len(charges.charge)
        self.unit = math.sqrt(domain.area / self.charge_count)
        self.size = (domain.size[0] / self.unit, domain.size[1] / self.unit)
        self.domain = wp.vec2(*self.size)
        self.groups = group_bodies(problem)
        self.rules = LineRules(problem, self.unit, device)
        class_index, _ = problem.body_indices()

        bodies = kernels_descent.Bodies()
        bodies.class_index = wp.array(class_index, dtype=wp.int32, device=device)
        bodies.group = wp.array(self.groups.body_group, dtype=wp.int32, device=device)
        bodies.line = wp.array(self.rules.body_line, dtype=wp.int32, device=device)
        bodies.first_charge = wp.array(charges.first, dtype=wp.int32, device=device)
        bodies.place = wp.array(charges.place, dtype=float, device=device)
        bodies.charge = wp.array(charges.charge, dtype=float, device=device)
        self.bodies = bodies
        self.has_dots = bool((self.rules.body_line < 0).any())
        self.charge_body = charges.body

        group_charge = np.bincount(
            self.groups.body_group[charges.body], weights=charges.charge, minlength=self.groups.count
        )
        images = [problem.classes[c].density_image for c in self.groups.class_index]
        self.field = Field(
            launcher,
            size=self.size,
            periodic=domain.periodic,
            interaction=self.groups.matrix,
            targets=[FieldTarget(image, charge) for image, charge in zip(images, group_charge, strict=True)],
            spacing=_typical_spacing(problem) / self.unit,
            charge=charges.charge,
            charge_group=self.groups.body_group[charges.body],
        )
        self._prepare_steps()
        self.images = images_for_kernels(launcher, [c.density_image for c in problem.classes], self.size)
        self.pose = first_pose(launcher, problem, self.groups, self.images, self.size)
        if self.rules.kind_count:
            pose = self.pose.numpy()
            pose[:, 2:] = self.rules.first_angle_and_length(pose[:, :2])
            self.pose = wp.array(pose, dtype=wp.vec4, device=device)
        self.move, self.change, self.displacement = (launcher.zeros(self.body_count, wp.vec4) for _ in range(3))
        self.bend = launcher.zeros(self.charge_count, float)
        self.charge_position = launcher.empty(self.charge_count, wp.vec2)
        self.field_at_charge = launcher.zeros(self.charge_count, wp.vec2)
        kinds = kernels_direction.LENGTHS + self.rules.kind_count
        slots = kernels_direction.SLOTS_ON_GPU if device.is_cuda else kernels_direction.SLOTS_ON_CPU
        # Those of no two threads in a line of the cache.
        room = kinds if device.is_cuda else kinds + kernels_direction.SUMS_APART
        self.sums = launcher.zeros((launcher.thread_count, room, slots), wp.int64)
        self.totals = launcher.zeros(kinds, wp.int64)
        # See kernels_direction.decide_direction.
        self.direction = launcher.zeros(4, float)
        self.contact = None
        if problem.avoid_overlap or self.rules.kind_count:
            self.contact = Contact(problem, launcher, self.unit, self.bodies, self.images)
        self._place_charges()
        self.step = launcher.record(self._take_step)

    def _prepare_steps(self) -> None:
        field = self.field
        layout = field.layout
        device = self.launcher.device
        # A group that nothing attracts keeps a finite step.
        least = np.maximum(SMALLEST_DENSITY * field.mean_attraction, 1e-12)
        self.step_length = self.launcher.empty(self.groups.count * layout.node_count, float)
        self.launcher.launch(
            kernels_descent.find_step_lengths,
            self.groups.count * layout.node_count,
            [
                field.attraction,
                layout.node_count,
                1.0 / layout.node_area,
                wp.array(least, dtype=float, device=device),
            ],
            [self.step_length],
        )
        count = np.zeros((1, len(field.images)))
        for c in self.problem.classes:
            count[0, [image is c.density_image for image in field.images].index(True)] += c.body_count
        number = mix_images(self.launcher, field.deposited, count, layout.node_count)
        self.step_limit = self.launcher.empty(layout.node_count, float)
        self.launcher.launch(
            kernels_descent.find_step_limits,
            layout.node_count,
            [
                number,
                1.0 / layout.node_area,
                SMALLEST_DENSITY * self.body_count / self.charge_count,
                STEP_LIMIT,
            ],
            [self.step_limit],
        )

    def run(self, max_steps: int, progress: Callable[[Progress], bool | None] | None) -> tuple[int, bool]:
        """Relax; return the steps taken and whether they converged."""
        unsettled = math.inf
        step = 0
        while step < max_steps:
            # With nobody watching, a GPU need not be asked how it goes after every step.
            watched = progress is not None or not self.launcher.device.is_cuda or self.launcher.profiled or step == 0
            many = 1 if watched else min(STEPS_UNWATCHED, max_steps - step)
            for _ in range(many):
                self.step.play()
            step += many
            with self.launcher.phase("readback"):
                unsettled = float(self.direction.numpy()[3])
            residual = math.sqrt(max(unsettled, 0.0) / self.body_count)
            if progress is not None:
                with self.launcher.phase("progress"):
                    go_on = progress(Progress(step, max_steps, residual, self.position_in_metres))
                if go_on is False:
                    return step, False
            # Before the second step nothing has shown yet whether contact lets bodies move.
            if residual < TOLERANCE and step > 1:
                return step, True
        return max_steps, math.sqrt(max(unsettled, 0.0) / self.body_count) < SETTLED

    def _take_step(self) -> None:
        self.field.evaluate(self.charge_position, self.field_at_charge)
        with self.launcher.phase("update"):
            self._propose()
            self._decide()
            self._move()
        if self.contact is not None:
            with self.launcher.phase("contact"):
                self.contact.push(self.pose, self.bend, self.displacement)
            with self.launcher.phase("update"):
                self._place_charges()

    def _propose(self) -> None:
        """What the forces ask for, and the sums over all bodies that the direction depends on."""
        field = [self.step_length, self.step_limit, self.field.mesh, self.domain, int(self.contact is not None)]
        charges = [self.charge_position, self.field_at_charge, self.bodies]
        moves = [self.move, self.change]
        if self.has_dots:
            self.launcher.launch(
                kernels_descent.propose_dots,
                self.body_count,
                [*charges, *field, self.displacement],
                [*moves, self.sums],
                per_thread=True,
            )
        if self.rules.kind_count:
            self.launcher.launch(
                kernels_descent.propose_lines,
                self.body_count,
                [self.pose, *charges, self.rules.lines, *field, self.displacement],
                [*moves, self.bend, self.sums],
                grain=GRAIN_OF_NEIGHBOURS,
                per_thread=True,
            )

    def _decide(self) -> None:
        kinds, slots = self.totals.shape[0], self.sums.shape[2]
        at_once = min(kernels_direction.SLOTS_AT_ONCE, slots)
        self.launcher.launch(kernels_direction.add_up, kinds * slots // at_once, [at_once], [self.sums, self.totals])
        self.launcher.launch(
            kernels_direction.decide_direction,
            1,
            [self.rules.kind_count, self.rules.line_count, self.rules.pressed],
            [self.totals, self.direction, self.rules.lines.length_factor],
        )

    def _move(self) -> None:
        where = [self.step_limit, self.field.mesh, self.images, self.domain, self.move, self.change]
        if self.has_dots:
            self.launcher.launch(
                kernels_descent.move_dots,
                self.body_count,
                [self.direction, self.bodies, *where],
                [self.pose, self.displacement, self.charge_position],
            )
        if self.rules.kind_count:
            self.launcher.launch(
                kernels_descent.move_lines,
                self.body_count,
                [self.direction, self.bodies, self.rules.lines, *where],
                [self.pose, self.bend, self.displacement],
                grain=GRAIN_OF_NEIGHBOURS,
            )

    def _place_charges(self) -> None:
        """Put the charges of all bodies where these are; those of dots follow at once where there is no contact."""
        self.launcher.launch(
            kernels_descent.place_charges,
            self.body_count,
            [self.pose, self.bodies, self.bend, self.domain, int(self.problem.domain.periodic)],
            [self.charge_position],
        )

    def position_in_metres(self) -> np.ndarray:
        """Body positions [m], shape ``[n, 2]``, float64, inside the domain."""
        position = np.multiply(self.pose.numpy()[:, :2], self.unit, dtype=np.float64)
        return np.minimum(position, self.problem.domain.size, out=position)


def placement_of(problem: Problem, relaxation: Relaxation) -> Placement:
    """The final poses in metres; the report is still to be measured."""
    class_index, size_index = problem.body_indices()
    position = _settled(problem, relaxation.position_in_metres())
    angle, length, width = np.zeros((3, len(position)))
    if relaxation.rules.kind_count:
        pose = relaxation.pose.numpy().astype(np.float64)
        # A line has no front: angles within half a turn.
        turned = np.mod(pose[:, 2] + 0.5 * math.pi, math.pi) - 0.5 * math.pi
        angle = np.where(relaxation.rules.body_line < 0, 0.0, turned)
        length = pose[:, 3] * relaxation.unit
        width = line_widths(problem, length)
    return Placement(
        problem,
        position,
        class_index,
        size_index,
        angle,
        length,
        width,
        NO_REPORT,
        _bends(problem, relaxation, position),
    )


def _bends(problem: Problem, relaxation: Relaxation, position: np.ndarray) -> np.ndarray | None:
    """Places of the charges on bodies that may bend; see :class:`Placement`."""
    bending = [s for c in problem.classes for s in c.sizes if s.line is not None and s.line.straightness is not None]
    if not bending:
        return None
    first = relaxation.bodies.first_charge.numpy()
    body = relaxation.charge_body
    along = 0.5 * relaxation.pose.numpy()[body, 3] * relaxation.bodies.place.numpy()
    across = relaxation.bend.numpy()
    angle = relaxation.pose.numpy()[body, 2]
    offset = np.stack(
        [along * np.cos(angle) - across * np.sin(angle), along * np.sin(angle) + across * np.cos(angle)], axis=1
    )
    bends = np.full((len(position), max(s.line.charges for s in bending if s.line is not None), 2), np.nan)
    may_bend = relaxation.rules.bends[body]
    order = np.arange(len(body)) - first[body]
    bends[body[may_bend], order[may_bend]] = position[body[may_bend]] + offset[may_bend] * relaxation.unit
    return bends


def _settled(problem: Problem, position: np.ndarray) -> np.ndarray:
    """Undo what rounding to float32 did to bodies on the very edge of a full pixel."""
    class_index, _ = problem.body_indices()
    for k, body_class in enumerate(problem.classes):
        if (body_class.density_image > 0.0).all():
            continue
        own = class_index == k
        position[own] = settle_on_full_pixels(body_class.density_image, position[own], problem.domain.size)
    return position


def _typical_spacing(problem: Problem) -> float:
    """Spacing [m] of charges at the number density that the average body sees."""
    number = survey(problem)
    cell_area = problem.domain.area / number.size
    spacing = math.sqrt(cell_area * number.sum() / (number**2).sum())
    return spacing * math.sqrt(problem.body_count / problem.charge_count)
