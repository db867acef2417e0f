"""Where bodies start: rare ones spread over the whole domain, all others where the densities of their tile ask for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import warp as wp

from ..descent.descent import Descent
from ..descent.initial_placement import first_pose
from ..device.launcher import Launcher, launcher_of_process
from ..edits.carried_descent import go_on_within
from ..model.model import Model
from ..model.natural_border import NaturalBorder
from ..motion.line_rules import FIRST_LENGTH, LineRules
from ..problem.balance import Balance
from ..problem.domain import Domain
from ..problem.interaction import Groups
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.size import with_count
from ..space.density import sample_density
from ..space.support import images_for_kernels
from .bodies import PartBodies
from .demand import Demand
from .groups import in_turns
from .layout import Box
from .looking import looking_turns
from .places_in_box import rounded_places
from .plan import Plan
from .window_problem import model_of

__all__ = ["spread_rare", "start_bodies", "started_bodies"]

# Steps in which rare bodies are spread.
STEPS_OF_RARE = 100


def spread_rare(plan: Plan, target: np.ndarray, device: str) -> tuple[np.ndarray, np.ndarray]:
    """Spread the rare groups over the whole domain, as if there were no others; discs of their areas keep apart if footprints do.

    Args:
        plan: The plan.
        target: Share of every class's density in the cells of the coarse grid, shape ``[classes, rows, columns]``,
            row 0 at the bottom.
        device: Where to run.

    Returns:
        Their numbers, ascending, and their positions [m], shape ``[n, 2]``.
    """
    tiles, whole = plan.groups, plan.problem.rectangle
    rare = np.array(plan.rare, np.int64)
    identity = np.concatenate([np.zeros(0, np.int64), *(np.arange(tiles.first[g], tiles.first[g + 1]) for g in rare)])
    if not len(identity):
        return identity, np.zeros((0, 2))
    classes = []
    for c in np.unique(tiles.class_index[rare]).tolist():
        own = rare[tiles.class_index[rare] == c]
        # Where they stand is all that is asked here, so lines are dots.
        sizes = tuple(replace(with_count(tiles.sizes[g], int(tiles.count[g])), line=None) for g in own.tolist())
        body_class = plan.problem.classes[c]
        image = target[c][::-1].astype(np.float32)
        classes.append(PreparedClass(body_class.name, sizes, image, room=body_class.room, gap=body_class.gap))
    problem = Problem(
        Domain(whole.size, whole.boundary),
        classes,
        _balance_of(plan, np.unique(tiles.class_index[rare])),
        seed=plan.problem.seed,
        avoid_overlap=plan.problem.avoid_overlap,
    )
    launcher = launcher_of_process(device)
    border = NaturalBorder(launcher, problem) if whole.natural else None
    matrix = tiles.matrix[np.ix_(rare, rare)]
    model = _model_of_sizes(problem, matrix)
    descent = Descent(model if border is None else _model_of_sizes(border.problem, matrix), launcher)
    try:
        for _ in range(STEPS_OF_RARE if len(identity) > 1 else 0):
            descent.step.play()
        if border is not None:
            descent = go_on_within(descent, border, model)
        return identity, descent.positions()
    finally:
        launcher.release(descent.step)


def _balance_of(plan: Plan, class_index: np.ndarray) -> Balance:
    """A balance for groups that have their factors, which tells contact which of these classes keep apart."""
    kept = plan.problem.balance.classes_apart
    if kept is None:
        return Balance(size_emphasis=1.0)
    apart = kept[np.ix_(class_index, class_index)].astype(float)
    return Balance(size_emphasis=1.0, class_separation=0.0, non_overlap=apart)


def _model_of_sizes(problem: Problem, matrix: np.ndarray) -> Model:
    """The model of a problem of which every size is a group, with these interaction factors."""
    sizes = [(c, size.count or 0) for c, body_class in enumerate(problem.classes) for size in body_class.sizes]
    group = np.repeat(np.arange(len(sizes)), [count for _, count in sizes]).astype(np.int32)
    return Model(problem, groups=Groups(group, np.array([c for c, _ in sizes]), matrix))


def start_bodies(
    plan: Plan,
    box: Box,
    identity: np.ndarray,
    tile: int,
    device: str,
    rare: tuple[np.ndarray, np.ndarray],
    demand: Demand,
) -> PartBodies:
    """Put bodies of a tile where its density asks for them.

    Args:
        plan: The plan.
        box: The tile.
        identity: Their numbers, without rare ones.
        tile: Number of the tile, from which what is random about it follows.
        device: Where to run.
        rare: Numbers and positions [m] of rare bodies, which are there already.
        demand: What the whole domain asks of every group.
    """
    fixed = _fixed_bodies(plan, plan.groups.fixed_identity[box.holds(plan.groups.fixed.position)])
    identity = np.concatenate([identity, rare[0]])
    order = np.argsort(identity, kind="stable")
    identity = identity[order]
    if not len(identity):
        return fixed
    seed = int(np.random.default_rng([plan.problem.seed, 7, tile]).integers(1 << 31))
    place = np.full((len(identity), 2), np.nan)
    place[len(identity) - len(rare[0]) :] = rare[1]
    launcher = launcher_of_process(device)
    started = started_bodies(plan, box, identity, seed, launcher, vacancy=demand.vacancy, known=place[order])
    return PartBodies.joined([started, fixed])


def started_bodies(
    plan: Plan,
    box: Box,
    identity: np.ndarray,
    seed: int,
    launcher: Launcher,
    images: dict[int, np.ndarray] | None = None,
    *,
    vacancy: dict[int, np.ndarray] | None = None,
    known: np.ndarray | None = None,
) -> PartBodies:
    """Bodies where a box's densities ask for them.

    Args:
        plan: The plan.
        box: The box.
        identity: Their numbers, ascending.
        seed: From it follows what is random.
        launcher: Where to run.
        images: See :func:`.model_of`.
        vacancy: As well.
        known: Where some of them are [m], shape ``[n, 2]``; NaN of all others.
    """
    bodies = _resting(plan, identity)
    model = model_of(plan, box, bodies, np.zeros(len(identity), np.int32), seed, vacancy, images)
    # The ways out of empty pixels take long to find; whoever would need one is brought to the next full pixel below.
    supports = images_for_kernels(launcher, model.supports, model.size, to_support=False)
    supports.to_support = launcher.zeros(int(supports.pixel.shape[0]), wp.vec2)
    pose = first_pose(launcher, model, supports).numpy().astype(np.float64)
    # Areas of a level grow with the numbers, and these along the curve: one end of a tile would hold more than the other.
    for own in _levels_of_ranges(plan, identity):
        pose[own] = pose[own[in_turns(np.arange(len(own)), len(own))]]
    if known is not None:
        pose[:, :2] = np.where(np.isnan(known), pose[:, :2], (known - box.low) / model.unit)
    if model.kinds:
        pose[:, 2:] = LineRules(model, launcher).first_angle_and_length(pose[:, :2], FIRST_LENGTH)
    everybody = np.ones(len(identity), bool)
    position = rounded_places(plan, box, model, pose[:, :2] * model.unit, everybody)
    bodies = replace(bodies, position=position, angle=pose[:, 2], length=pose[:, 3] * model.unit)
    return replace(bodies, turn=looking_turns(plan, bodies, bodies.turn))


def _fixed_bodies(plan: Plan, identity: np.ndarray) -> PartBodies:
    """Fixed bodies of these numbers, as they are given."""
    if not len(identity):
        return PartBodies.none()
    groups = plan.groups
    given = groups.fixed_at(identity)
    angle, length = np.zeros(len(identity)), np.zeros(len(identity))
    group = groups.group_of(identity)
    for g in np.unique(group).tolist():
        line = groups.sizes[g].line
        if line is None:
            continue
        own = np.flatnonzero(group == g)
        asked = np.atleast_2d(np.asarray(line.length, np.float64))
        there = sample_density(asked, given.position[own], plan.layout.size)
        angle[own] = given.angle[own]
        length[own] = np.where(np.isnan(given.length[own]), there, given.length[own])
    return replace(_resting(plan, identity), position=given.position, angle=angle, length=length)


def _resting(plan: Plan, identity: np.ndarray) -> PartBodies:
    """Bodies as they are before they are anywhere: straight, and turned as their outlines start."""
    n = len(identity)
    turn = plan.groups.outlines(identity).turn if plan.groups.outlined else np.zeros(n)
    return PartBodies(identity, np.zeros((n, 2)), np.zeros(n), np.zeros(n), turn, np.zeros((n, plan.bending)))


def _levels_of_ranges(plan: Plan, identity: np.ndarray) -> list[np.ndarray]:
    """Indices of the bodies of every level of a range."""
    group = plan.groups.group_of(identity)
    return [np.flatnonzero(group == g) for g in np.unique(group).tolist() if plan.groups.sizes[g].is_range]
