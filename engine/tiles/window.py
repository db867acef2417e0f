"""One window: the problem of its bodies, where they start, and how they settle between bodies that are pinned."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ..device.launcher import Launcher, launcher_of_process
from ..errors import ProblemError
from ..field.field import FieldTarget
from ..problem.balance import Balance
from ..problem.domain import Domain
from ..problem.interaction import Groups
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.random_numbers import random_shares
from ..problem.size import with_count
from ..solver.body_flags import BodyFlags
from ..solver.descent import Descent
from ..solver.final_placement import angle_within, position_in_meters
from ..solver.initial_placement import first_pose
from ..solver.line_rules import FIRST_LENGTH, LineRules, length_blocks
from ..solver.model import Model
from ..solver.natural_border import SMOOTH_OVER_SPACING, SMOOTH_STEPS, STEPS_WITHIN, NaturalBorder
from ..solver.state import State
from ..space.density import move_into_support, sample_density
from ..space.support import images_for_kernels
from .beyond import Beyond, beyond_of, kept_within
from .bodies import PartBodies
from .demand import Demand
from .density_windows import into_pixels
from .groups import in_turns
from .layout import Box, within
from .looking import looking_bodies, looking_turns
from .part_times import PartTimes
from .plan import Plan
from .window_problem import MARGIN, between_pixels, model_of, pixels_of

__all__ = ["onto_densities", "relax", "spread_rare", "start_bodies"]

# Nearer to a cut than this what is beyond it fades out; in spacings of the window. Free bodies then see nothing of the fading.
TAPER = 4.0
# Where bodies are sparse, the margins leave so much of a window free at least.
MOST_MARGIN = 0.25
# Free bodies that come nearer to a cut than so much of the margin have strayed.
STRAYED = 0.5
# Faded densities stay above zero where they were.
LEAST_FADED = 1e-4
# Steps in which rare bodies are spread.
STEPS_OF_RARE = 100
# Rare dots stay where they were spread while no more than this share of a window's bodies are such; the others make room for them.
MOST_HELD = 0.05
# Outlines that look past the point of their class by more than this [rad], being parted, are turned and parted again, so often.
LOOKS_AWAY, MOST_FACINGS = 0.035, 2
# Positions are rounded to this share of a spacing, less than float32 holds of them in a window: files are smaller.
ROUNDING = 2.0**-18


def spread_rare(plan: Plan, target: np.ndarray, device: str) -> tuple[np.ndarray, np.ndarray]:
    """Spread the rare groups over the whole domain, as if there were no others.

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
        classes.append(PreparedClass(plan.problem.classes[c].name, sizes, target[c][::-1].astype(np.float32)))
    domain = Domain(whole.size, whole.boundary)
    problem = Problem(domain, classes, Balance(size_emphasis=1.0), seed=plan.problem.seed)
    launcher = launcher_of_process(device)
    border = NaturalBorder(launcher, problem) if whole.natural else None
    matrix = tiles.matrix[np.ix_(rare, rare)]
    model = _model_of_sizes(problem, matrix)
    descent = Descent(model if border is None else _model_of_sizes(border.problem, matrix), launcher)
    try:
        for _ in range(STEPS_OF_RARE if len(identity) > 1 else 0):
            descent.step.play()
        position = position_in_meters(descent.model, descent.state, launcher)
        return identity, position if border is None else border.cut(position, model).position
    finally:
        launcher.release(descent.step)


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
    started = _started(plan, box, identity, seed, launcher, vacancy=demand.vacancy, known=place[order])
    return PartBodies.joined([started, fixed])


def _started(
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
    position = _settled(plan, box, model, pose[:, :2] * model.unit, everybody)
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


def relax(
    plan: Plan,
    box: Box,
    bodies: PartBodies,
    length_factor: np.ndarray,
    demand: Demand,
    steps: int,
    part: bool,
    first: bool,
    device: str,
    times: PartTimes,
) -> tuple[PartBodies, np.ndarray]:
    """Let the bodies of a window settle; those near its cuts are pinned.

    Args:
        plan: The plan.
        box: The window.
        bodies: Its bodies.
        length_factor: What made up for the pressure on lines before, of every size; no window has the steps to find it.
        demand: What the whole domain asks of every group.
        steps: Of the descent.
        part: Whether to part footprints at the end.
        first: Whether bodies are where they started.
        device: Where to run.
        times: Gets the seconds of what is done.

    Returns:
        The bodies, and what makes up for the pressure on lines now.
    """
    if len(bodies) < 2:
        return bodies, length_factor
    room = _Room(box, *_margins(plan, box, len(bodies)))
    # Who comes near to a cut on the way stays free.
    free = _is_free(plan, room, bodies)
    if not free.any():
        return bodies, length_factor
    launcher = launcher_of_process(device)
    if plan.problem.rectangle.natural:
        with times.of("set-up"):
            beyond = beyond_of(plan, box, len(bodies), room.margin, launcher)
        if beyond is not None:
            bodies, length_factor = _with_beyond(
                plan, box, bodies, free, length_factor, demand, steps, first, beyond, launcher, times
            )
            smooth = replace(room, smooth=SMOOTH_OVER_SPACING)
            bodies, _ = _settle(plan, smooth, bodies, free, length_factor, demand, SMOOTH_STEPS, False, launcher, times)
            steps = STEPS_WITHIN
    return _settle(plan, room, bodies, free, length_factor, demand, steps, part, launcher, times)


@dataclass(frozen=True)
class _Room:
    """Where bodies settle.

    Attributes:
        box: The window.
        margin: How far from its cuts bodies are pinned [m].
        taper: Over how far from them everything fades [m].
        images: Densities there, where these are others than the plan's.
        smooth: See :class:`.Descent`.
    """

    box: Box
    margin: float
    taper: float
    images: dict[int, np.ndarray] | None = None
    smooth: float | None = None


def _settle(
    plan: Plan,
    room: _Room,
    bodies: PartBodies,
    free: np.ndarray,
    length_factor: np.ndarray,
    demand: Demand,
    steps: int,
    part: bool,
    launcher: Launcher,
    times: PartTimes,
) -> tuple[PartBodies, np.ndarray]:
    """Let the bodies of a window that are ``free`` settle in a room; see :func:`relax`."""
    box, margin, taper = room.box, room.margin, room.taper
    with times.of("set-up"):
        flags = np.where(free, 0, BodyFlags.PINNED).astype(np.int32)
        model = model_of(plan, box, bodies, flags, plan.problem.seed, images=room.images)
        # Charges per area of a footprint, before anything fades.
        scale = model.charge_count / float(model.body.area.sum())
        whole_charge = model.charge.charge
        model.charge = replace(model.charge, charge=whole_charge * _fading(box, bodies, model, taper))
        pose = _poses(box, bodies, model, free)
        present = np.unique(plan.groups.group_of(bodies.identity))
        targets = _targets(plan, box, model, present, demand, scale, taper)
        descent = Descent(
            model,
            launcher,
            pose=pose,
            targets=targets,
            whole_charge=whole_charge,
            smooth=room.smooth,
            begins_short=room.smooth is not None,
        )
        factors = _LengthFactors.of(plan, model, present)
        factors.give(length_factor, descent.state)
        _give_bends(model, bodies, descent)
    try:
        with times.of("steps"):
            _descend(descent, steps)
        state = descent.state
        with times.of("contact"):
            _call_back(descent, box, pose, free, margin)
            looking = free & looking_bodies(plan, bodies.identity) & model.footprints.is_outline
            _face(plan, box, bodies, descent, looking, 0.0)
            if part and descent.contact is not None:
                # What looks like a free place beyond the pinned bodies along a cut is that of somebody whom this window does not hold.
                held = box.inside(margin + 0.5 * plan.longest)
                _part(plan, box, bodies, descent, looking, held)
        with times.of("readback"):
            moved = _moved(bodies, free, model, state)
            position = _settled(plan, box, model, position_in_meters(model, state, launcher), free)
            moved.position[free] = position[free]
            length_factor = factors.taken(state, length_factor)
    finally:
        launcher.release(descent.step)
    return moved, length_factor


def _part(
    plan: Plan,
    box: Box,
    bodies: PartBodies,
    descent: Descent,
    looking: np.ndarray,
    room: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    """Part the footprints of a window, of which those that are ``looking`` are turned meanwhile."""
    contact, state = descent.contact, descent.state
    assert contact is not None
    contact.separate(state.pose, state.turn, state.bend, room=room)
    for _ in range(MOST_FACINGS):
        # Who was parted looks from elsewhere now.
        if not _face(plan, box, bodies, descent, looking, LOOKS_AWAY):
            break
        contact.separate(state.pose, state.turn, state.bend, again=True, room=room)


def _face(plan: Plan, box: Box, bodies: PartBodies, descent: Descent, looking: np.ndarray, past: float) -> bool:
    """Turn outlines of a window that look past the point of their class by more than this [rad]; tell whether there were any."""
    if not looking.any():
        return False
    turn = descent.state.turn.numpy().copy()
    wanted = looking_turns(plan, bodies.at(descent.positions() + box.low), turn)
    away = looking & (np.abs(angle_within(wanted - turn, 2.0 * math.pi)) > past)
    turn[away] = wanted[away]
    descent.state.turn.assign(turn)
    return bool(away.any())


def _is_free(plan: Plan, room: _Room, bodies: PartBodies) -> np.ndarray:
    """Which bodies of a window are not pinned."""
    pinned = (room.box.depth(bodies.position) < room.margin + 0.5 * plan.longest) | _held(plan, bodies.identity)
    return ~(pinned | plan.groups.is_fixed(bodies.identity))


def _with_beyond(
    plan: Plan,
    box: Box,
    bodies: PartBodies,
    free: np.ndarray,
    length_factor: np.ndarray,
    demand: Demand,
    steps: int,
    first: bool,
    beyond: Beyond,
    launcher: Launcher,
    times: PartTimes,
) -> tuple[PartBodies, np.ndarray]:
    """Bodies of a window that settled as if others stood beyond its natural borders, see :mod:`.beyond`; and as :func:`relax`."""
    seed = [plan.problem.seed, 11, *(int(np.floor(x / plan.spacing)) & 0xFFFFFFFF for x in beyond.box.low)]
    identity = beyond.numbers(plan, demand, seed)
    if not len(identity):
        return bodies, length_factor
    with times.of("start"):
        others = _started(
            plan, beyond.box, identity, int(random_shares(np.zeros(1), seed)[0] * 2**31), launcher, beyond.added
        )
    room = _Room(beyond.box, beyond.margin, TAPER / MARGIN * beyond.margin, beyond.images)
    order = np.argsort(np.concatenate([bodies.identity, identity]), kind="stable")
    both = np.concatenate([free, _is_free(plan, room, others)])[order]
    everybody = PartBodies.joined([bodies, others])
    waved = both if first else both & (order >= len(bodies))
    everybody = everybody.at(beyond.sheared(plan, everybody.position, waved))
    settled, length_factor = _settle(plan, room, everybody, both, length_factor, demand, steps, False, launcher, times)
    return kept_within(plan, box, bodies, settled, order, both, beyond), length_factor


def _descend(descent: Descent, steps: int) -> None:
    """Take so many steps; raises ProblemError where they leave the range of float32."""
    for _ in range(steps):
        descent.step.play()
    if math.isnan(descent.direction.residual()):
        raise ProblemError(
            "the forces between the bodies are no longer finite numbers: areas, lengths and `size_emphasis` lie too far apart"
        )


def _poses(box: Box, bodies: PartBodies, model: Model, free: np.ndarray) -> np.ndarray:
    """Where the bodies of a window are, as its solver has them; those that are ``free`` where there is something of their density."""
    pose = np.zeros((len(bodies), 4))
    position = within(bodies.position - box.low, (0.0, 0.0), box.size)
    pose[:, :2] = _in_support(model, position, free) / model.unit
    pose[:, 2], pose[:, 3] = bodies.angle, bodies.length / model.unit
    return pose


def _held(plan: Plan, identity: np.ndarray) -> np.ndarray:
    """Which bodies stay as even as they were spread over the whole domain: rare dots, of which a window sees too few to spread them.

    Lines still have to grow and to turn.
    """
    group = plan.groups.group_of(identity)
    dots = [g for g in plan.rare if plan.groups.sizes[g].line is None]
    held = np.isin(group, dots)
    return held if held.mean() <= MOST_HELD else np.zeros(len(identity), bool)


def _moved(bodies: PartBodies, free: np.ndarray, model: Model, state: State) -> PartBodies:
    """Bodies of which the free ones lie as they have come to lie in a state; where they are is left as it was, in a copy."""
    pose = state.pose.numpy().astype(np.float64)
    angle, length, turn, bend = (values.copy() for values in (bodies.angle, bodies.length, bodies.turn, bodies.bend))
    line = free & (model.body.kind >= 0)
    # Turned by half, what is bent would be bent to the other side, and what has an outline would look the other way.
    sided = model.may_bend | model.footprints.is_outline
    angle[line] = np.where(
        sided[line], angle_within(pose[line, 2], 2.0 * math.pi), angle_within(pose[line, 2], math.pi)
    )
    length[line] = pose[line, 3] * model.unit
    outlined = free & model.footprints.is_outline
    if outlined.any():
        turn[outlined] = angle_within(state.turn.numpy()[outlined].astype(np.float64), 2.0 * math.pi)
    if bend.size:
        charge = np.flatnonzero((free & model.may_bend)[model.charge.body])
        body = model.charge.body[charge]
        bend[body, charge - model.charge.first[body]] = state.bend.numpy()[charge] * model.unit
    return PartBodies(bodies.identity, bodies.position.copy(), angle, length, turn, bend)


def _by_charge(model: Model, bend: np.ndarray) -> np.ndarray:
    """What bodies have for each of their charges, shape ``[n, most]``, for all charges; 0 of those that do not bend."""
    body = model.charge.body
    result = np.zeros(len(body))
    charge = np.flatnonzero(model.may_bend[body])
    result[charge] = bend[body[charge], charge - model.charge.first[body[charge]]]
    return result


def _give_bends(model: Model, bodies: PartBodies, descent: Descent) -> None:
    """Let lines begin as they were bent."""
    if not bodies.bend.any():
        return
    descent.state.bend.assign((_by_charge(model, bodies.bend) / model.unit).astype(np.float32))
    descent.place_charges()


def _call_back(descent: Descent, box: Box, start: np.ndarray, free: np.ndarray, margin: float) -> None:
    """Have free bodies that strayed to where everything fades, along an edge of the domain say, go back: nothing holds them there.

    They go back on their way from their ``start``, so that no two of them meet.
    """
    model, state = descent.model, descent.state
    values = state.pose.numpy().copy()
    came = box.depth(start[:, :2] * model.unit + box.low)
    depth = box.depth(values[:, :2] * model.unit + box.low)
    strayed = free & (depth < STRAYED * margin)
    if not strayed.any():
        return
    share = (came[strayed] - STRAYED * margin) / (came[strayed] - depth[strayed])
    way = values[strayed, :2] - start[strayed, :2]
    values[strayed, :2] = start[strayed, :2] + np.clip(share, 0.0, 1.0)[:, None] * way
    state.pose.assign(values)
    descent.place_charges()


@dataclass(frozen=True)
class _LengthFactors:
    """Where a state has what makes up for the pressure on lines: a factor for every size of lines here, then one for each block.

    Attributes:
        layer: Sizes of lines that are here, in the order of the model's kinds.
        blocks: How many blocks each has.
        pressed: Whether forces change their lengths; else the factors are 1 here.
    """

    layer: np.ndarray
    blocks: list[int]
    pressed: list[bool]

    @classmethod
    def of(cls, plan: Plan, model: Model, present: np.ndarray) -> _LengthFactors:
        """Those of a model that has the groups ``present``."""
        lines = [g for g in present.tolist() if plan.groups.sizes[g].line is not None]
        pressed = [kind.line.stretch_weights[0] > 0.0 for kind in model.kinds]
        blocks = [rows * columns for rows, columns in length_blocks(model)]
        return cls(np.unique(plan.groups.layer[lines]), blocks, pressed)

    def give(self, factor: np.ndarray, state: State) -> None:
        """Let a state begin with the factors of all sizes."""
        if len(self.layer):
            own = np.where(self.pressed, factor[self.layer], 1.0)
            first = np.concatenate([own, np.repeat(own, self.blocks)])
            state.length_factor.assign(first.astype(np.float32))

    def taken(self, state: State, factor: np.ndarray) -> np.ndarray:
        """The factors of all sizes, those that are here as a state has them now."""
        reached = state.length_factor.numpy().astype(np.float64)
        factor = factor.copy()
        ends = len(self.layer) + np.cumsum([0, *self.blocks])
        for k, layer in enumerate(self.layer.tolist()):
            if self.pressed[k]:
                factor[layer] = reached[ends[k] : ends[k + 1]].mean() if self.blocks[k] else reached[k]
        return factor


def onto_densities(plan: Plan, box: Box, bodies: PartBodies) -> PartBodies:
    """Bodies of a box of which none is where its density is 0, however fine its pixels are."""
    position = bodies.position.copy()
    class_index = plan.groups.class_index[plan.groups.group_of(bodies.identity)]
    width, height = plan.layout.size
    for c in np.unique(class_index).tolist():
        own = np.flatnonzero((class_index == c) & ~plan.groups.is_fixed(bodies.identity))
        source = plan.sources[c]
        scale = np.array([source.shape[1] / width, source.shape[0] / height])
        before = np.stack([position[own, 0], height - position[own, 1]], axis=1) * scale
        after = into_pixels(source, box.down, box.across, pixels_of(plan, box), before)
        moved = (after != before).any(axis=1)
        place = after[moved] / scale
        position[own[moved]] = box.confine(np.stack([place[:, 0], height - place[:, 1]], axis=1))
    return bodies.at(position)


def _margins(plan: Plan, box: Box, count: int) -> tuple[float, float]:
    """How far bodies are pinned, and over how far everything fades [m]."""
    spacing = max(plan.fine, math.sqrt(box.size[0] * box.size[1] / count))
    # Only sides that are cuts take anything.
    room = [MOST_MARGIN * box.size[axis] for axis in (0, 1) if box.cut[2 * axis] or box.cut[2 * axis + 1]]
    margin = min([MARGIN * spacing, *room])
    return margin, TAPER / MARGIN * margin


def _fading(box: Box, bodies: PartBodies, model: Model, taper: float) -> np.ndarray:
    """How much every charge counts: less and less towards a cut. Only those of pinned bodies are so near to one."""
    body, axial = model.charge.body, model.charge.axial
    if not axial.any():
        return box.fade(bodies.position[:, 0], bodies.position[:, 1], taper)
    along = 0.5 * bodies.length[body] * axial
    x = bodies.position[body, 0] + along * np.cos(bodies.angle[body])
    y = bodies.position[body, 1] + along * np.sin(bodies.angle[body])
    if bodies.bend.size:
        across = _by_charge(model, bodies.bend)
        x -= across * np.sin(bodies.angle[body])
        y += across * np.cos(bodies.angle[body])
    return box.fade(x, y, taper)


def _targets(
    plan: Plan, box: Box, model: Model, present: np.ndarray, demand: Demand, scale: float, taper: float
) -> list[FieldTarget]:
    """What attracts every group: its share of the whole problem's charge that belongs here, faded as the charges are."""
    names = [c.name for c in plan.problem.classes]
    faded: dict[int, tuple[np.ndarray, np.ndarray, float]] = {}
    result = []
    for g, group in enumerate(present.tolist()):
        c = int(model.groups.class_index[g])
        if c not in faded:
            image = model.problem.classes[c].density_image
            image = image if image.any() else np.ones_like(image)
            # What is even fades all the same.
            rows, columns = image.shape if image.size > 1 else pixels_of(plan, box)
            fade = _fade_of_pixels(box, rows, columns, taper)
            dim = image * np.maximum(fade, LEAST_FADED, dtype=np.float32)
            pixel = box.size[0] * box.size[1] / dim.size
            faded[c] = image, dim, float(dim.sum(dtype=np.float64)) * pixel
        image, dim, held = faded[c]
        whole = demand.totals[names.index(model.problem.classes[c].name)]
        share = held / whole if whole > 0.0 else 0.0
        per_body = scale * float(plan.groups.mean_area[group])
        charge = per_body * float(plan.groups.count[group]) * share * float(demand.level[group])
        more: tuple[FieldTarget, ...] = ()
        if group in demand.excess:
            more = _excess_in(plan, box, demand.excess[group], per_body, taper)
        result.append(FieldTarget(dim, charge, more, class_index=c, whole=image))
    return result


def _fade_of_pixels(box: Box, rows: int, columns: int, taper: float) -> np.ndarray:
    """How much counts at the middles of pixels of a box, row 0 at the top."""
    x = box.low[0] + (np.arange(columns) + 0.5) / columns * box.size[0]
    y = box.high[1] - (np.arange(rows) + 0.5) / rows * box.size[1]
    return box.fade(x[None, :], y[:, None], taper)


def _excess_in(plan: Plan, box: Box, excess: np.ndarray, per_body: float, taper: float) -> tuple[FieldTarget, ...]:
    """What attracts bodies because fixed ones are too many there, of a box; faded as charges are."""
    rows, columns = (max(2, math.ceil(2.0 * side / min(plan.grid.cell))) for side in box.size[::-1])
    image = between_pixels(excess[::-1, :, None], box, plan.problem.rectangle.size, (rows, columns))[..., 0]
    dim = (image * _fade_of_pixels(box, rows, columns, taper)).astype(np.float32)
    # Of cells of the coarse grid in a pixel.
    pixel = box.size[0] * box.size[1] / dim.size / math.prod(plan.grid.cell)
    charge = per_body * float(dim.sum(dtype=np.float64)) * pixel
    return (FieldTarget(dim, charge, whole=image.astype(np.float32)),) if charge > 0.0 else ()


def _in_support(model: Model, local: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Positions from a box's corner [m], of which the chosen ones are brought to where they may be."""
    result = local.copy()
    for k, support in enumerate(model.supports):
        if (support > 0.0).all() or not support.any():
            continue
        own = chosen & (model.body.support == k)
        result[own] = move_into_support(support, result[own], model.problem.rectangle.size)
    return result


def _settled(plan: Plan, box: Box, model: Model, local: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Positions in the domain of bodies of a box: rounded, inside it, and the chosen ones where they may be."""
    grain = 2.0 ** math.floor(math.log2(plan.spacing * ROUNDING))
    rounded = np.empty_like(local)
    for axis in (0, 1):
        rounded[:, axis] = np.rint((local[:, axis] + box.low[axis]) / grain)
    rounded *= grain
    rounded = box.confine(rounded)
    if all((support > 0.0).all() for support in model.supports):
        return rounded
    low = np.array(box.low)
    inside = within(rounded - low, (0.0, 0.0), box.size)
    result = _in_support(model, inside, chosen & (model.body.kind < 0))
    return box.confine(np.where(result == inside, rounded, result + low))
