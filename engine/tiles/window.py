"""One window: how its bodies settle between those that are pinned."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..descent.descent import Descent
from ..descent.final_placement import position_in_meters
from ..device.launcher import Launcher, launcher_of_process
from ..errors import ProblemError
from ..model.body_flags import BodyFlags
from ..model.looking import LOOKS_AWAY, angle_within
from ..model.model import Model
from ..model.natural_border import SMOOTH_OVER_SPACING, SMOOTH_STEPS, STEPS_WITHIN
from ..model.state import State
from ..motion.forces import FieldSettings
from ..motion.line_rules import length_blocks
from ..problem.random_numbers import random_shares
from .beyond import Beyond, beyond_of, kept_within
from .bodies import PartBodies
from .demand import Demand
from .density_windows import into_pixels
from .fading import by_charge, charges_fading, faded_targets
from .layout import Box, within
from .looking import looking_bodies, looking_turns
from .part_times import PartTimes
from .places_in_box import rounded_places, within_support
from .plan import Plan
from .reach import reaches
from .start import started_bodies
from .window_problem import MARGIN, model_of, pixels_of

__all__ = ["onto_densities", "relax"]

# Nearer to a cut than this what is beyond it fades out; in spacings of the window. Free bodies then see nothing of the fading.
TAPER = 4.0
# Where bodies are sparse, the margins leave so much of a window free at least.
MOST_MARGIN = 0.25
# Free bodies that come nearer to a cut than so much of the margin have strayed.
STRAYED = 0.5
# Rare dots stay where they were spread while no more than this share of a window's bodies are such; the others make room for them.
MOST_HELD = 0.05
# Targets are corrected after these shares of a window's steps, as those of one solve are.
CORRECTED_AFTER = (0.3, 0.5, 0.7, 0.85, 0.93)
# Outlines that look past the point of their class, being parted, are turned and parted again, so often.
MOST_FACINGS = 2


def relax(
    plan: Plan,
    box: Box,
    bodies: PartBodies,
    own: np.ndarray,
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
        box: The window, with what lies around it: see :attr:`.Plan.rim`.
        bodies: Its bodies, and those around it.
        own: Which of them are its own: all others are pinned.
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
    free = own & _is_free(plan, room, bodies)
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
        taper: Over how far from its sides everything fades [m], where these are cuts or lie around such.
        images: Densities there, where these are others than the plan's.
        smooth: See :class:`.FieldSettings`.
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
    far = _across(plan, bodies.identity)
    with times.of("set-up"):
        flags = np.where(free, 0, BodyFlags.PINNED).astype(np.int32)
        model = model_of(plan, box, bodies, flags, plan.problem.seed, images=room.images)
        # Charges per area of a footprint, before anything fades.
        scale = model.charge_count / float(model.body.area.sum())
        whole_charge = model.charge.charge
        model.charge = replace(model.charge, charge=whole_charge * charges_fading(box, bodies, model, taper))
        pose = _poses(box, bodies, model, free)
        present = np.unique(plan.groups.group_of(bodies.identity))
        targets = faded_targets(plan, box, model, present, demand, scale, taper)
        descent = Descent(
            model,
            launcher,
            pose=pose,
            field_settings=FieldSettings(
                targets=targets,
                whole_charge=whole_charge,
                smooth=room.smooth,
                corrected=plan.among_large and room.smooth is None,
            ),
        )
        factors = _LengthFactors.of(plan, model, present)
        factors.give(length_factor, descent.state)
        _give_bends(model, bodies, descent)
    try:
        with times.of("steps"):
            _descend(descent, steps, _corrections(plan, descent, steps))
        state = descent.state
        with times.of("contact"):
            _call_back(descent, box, pose, free, np.maximum(STRAYED * margin, far))
            looking = free & looking_bodies(plan, bodies.identity) & model.footprints.is_outline
            _face(plan, box, bodies, descent, looking, 0.0)
            if part and descent.contact is not None:
                # What looks like a free place beyond the pinned bodies along a cut is that of somebody whom this window does not hold.
                held = box.inside(margin + float(_aside(plan, margin, far[free]).max()))
                _part(plan, box, bodies, descent, looking, held)
        with times.of("readback"):
            moved = _moved(bodies, free, model, state)
            position = rounded_places(plan, box, model, position_in_meters(model, state, launcher), free)
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
    least = room.margin + _aside(plan, room.margin, _across(plan, bodies.identity))
    fixed = plan.groups.is_fixed(bodies.identity)
    held = _held(plan, bodies.identity)
    if held.any() and plan.problem.avoid_overlap:
        held[_in_each_other(plan, bodies, held, fixed)] = False
    return ~((room.box.depth(bodies.position) < least) | held | fixed)


def _across(plan: Plan, identity: np.ndarray) -> np.ndarray:
    """How far bodies reach over a cut that they stand on [m], shape ``[n]``; 0 where none reaches far."""
    return reaches(plan.problem, plan.groups, identity) if plan.rim else np.zeros(len(identity))


def _aside(plan: Plan, margin: float, far: np.ndarray) -> np.ndarray:
    """How much farther from cuts than others bodies are pinned [m], shape ``[n]``, so that they do not come to reach over these.

    Args:
        plan: The plan.
        margin: How far from cuts all are pinned [m]; what is free comes no nearer to them than a share of that.
        far: How far bodies reach [m], shape ``[n]``.
    """
    return 0.5 * plan.longest + np.maximum(far - STRAYED * margin, 0.0)


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
        others = started_bodies(
            plan, beyond.box, identity, int(random_shares(np.zeros(1), seed)[0] * 2**31), launcher, beyond.added
        )
    room = _Room(beyond.box, beyond.margin, _taper(beyond.box, beyond.margin), beyond.images)
    order = np.argsort(np.concatenate([bodies.identity, identity]), kind="stable")
    both = np.concatenate([free, _is_free(plan, room, others)])[order]
    everybody = PartBodies.joined([bodies, others])
    waved = both if first else both & (order >= len(bodies))
    everybody = everybody.at(beyond.sheared(plan, everybody.position, waved))
    settled, length_factor = _settle(plan, room, everybody, both, length_factor, demand, steps, False, launcher, times)
    return kept_within(plan, box, bodies, settled, order, both, beyond), length_factor


def _corrections(plan: Plan, descent: Descent, steps: int) -> list[int]:
    """Before which steps the targets of a window are corrected, in their order."""
    if not (plan.among_large and descent.corrects_targets):
        return []
    return [round(share * steps) for share in CORRECTED_AFTER]


def _descend(descent: Descent, steps: int, corrections: list[int]) -> None:
    """Take so many steps, and correct targets before some; raises ProblemError where bodies leave the range of float32."""
    for step in range(steps):
        for _ in range(corrections.count(step)):
            descent.correct_targets()
        descent.step.play()
    if math.isnan(descent.direction.residual()):
        raise ProblemError(
            "the forces between the bodies are no longer finite numbers: areas, lengths and `size_emphasis` lie too far apart"
        )


def _poses(box: Box, bodies: PartBodies, model: Model, free: np.ndarray) -> np.ndarray:
    """Where the bodies of a window are, as its solver has them; those that are ``free`` where there is something of their density."""
    pose = np.zeros((len(bodies), 4))
    position = within(bodies.position - box.low, (0.0, 0.0), box.size)
    pose[:, :2] = within_support(model, position, free) / model.unit
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


def _in_each_other(plan: Plan, bodies: PartBodies, held: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Numbers of ``held`` bodies that may overlap each other, or ``fixed`` ones: somebody has to give way, so they are not held."""
    there = np.flatnonzero(held | fixed)
    # From left to right: whoever is near is one of the next.
    there = there[np.argsort(bodies.position[there, 0], kind="stable")]
    place, may_go = bodies.position[there], held[there]
    far = reaches(plan.problem, plan.groups, bodies.identity[there])
    result, widest = np.zeros(len(there), bool), 2.0 * float(far.max())
    for after in range(1, len(there)):
        way = place[after:] - place[:-after]
        if not (way[:, 0] < widest).any():
            break
        meet = np.hypot(way[:, 0], way[:, 1]) < far[after:] + far[:-after]
        result[after:] |= meet
        result[:-after] |= meet
    return there[result & may_go]


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


def _give_bends(model: Model, bodies: PartBodies, descent: Descent) -> None:
    """Let lines begin as they were bent."""
    if not bodies.bend.any():
        return
    descent.state.bend.assign((by_charge(model, bodies.bend) / model.unit).astype(np.float32))
    descent.place_charges()


def _call_back(descent: Descent, box: Box, start: np.ndarray, free: np.ndarray, least: np.ndarray) -> None:
    """Have free bodies that strayed to where everything fades, along an edge of the domain say, go back: nothing holds them there.

    They go back on their way from their ``start``, so that no two of them meet, as far as to the ``least`` distance from cuts of each
    [m], shape ``[n]``.
    """
    model, state = descent.model, descent.state
    values = state.pose.numpy().copy()
    came = box.depth(start[:, :2] * model.unit + box.low)
    depth = box.depth(values[:, :2] * model.unit + box.low)
    strayed = free & (depth < least)
    if not strayed.any():
        return
    share = (came[strayed] - least[strayed]) / (came[strayed] - depth[strayed])
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
    room = [
        MOST_MARGIN * (box.size[axis] - sum(box.rim[2 * axis : 2 * axis + 2]))
        for axis in (0, 1)
        if box.cut[2 * axis] or box.cut[2 * axis + 1]
    ]
    margin = min([MARGIN * spacing, *room])
    return margin, _taper(box, margin)


def _taper(box: Box, margin: float) -> float:
    """Over how far from a window's sides everything fades [m]."""
    return TAPER / MARGIN * (margin + min((rim for rim, cut in zip(box.rim, box.cut, strict=True) if cut), default=0.0))
