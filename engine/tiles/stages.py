"""What processes do for a run: one call makes one part of one stage, and leaves it in a file. Calls know each other by files only."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .bodies import PartBodies, read_bodies, read_length_factor, write_atomically, write_part, written_atomically
from .clump_blocks import write_block
from .coarse import Patch, cell_sums, displacement
from .demand import read_demand
from .layout import Box
from .overlaps import overlaps_of_tile, write_overlaps
from .part_times import PartTimes
from .plan import Plan, TileRun, make_plan
from .start import start_bodies
from .tile_files import TILE_WRITERS, tile_name
from .window import onto_densities, relax
from .window_problem import density_of_class

__all__ = [
    "CLUMPS",
    "COUNTS",
    "DEMAND",
    "OVERLAPS",
    "RARE",
    "TARGET",
    "PartDone",
    "clump_blocks",
    "flow_folder",
    "make_part",
    "part_path",
    "stage_names",
]

# The first stage, where there are clumps.
CLUMPS = "clumps"
# The last stage, where footprints keep apart.
OVERLAPS = "overlaps"
# Files of the work folder.
COUNTS = "counts.npy"
TARGET = "target.npy"
DEMAND = "demand.npz"
RARE = "rare.npz"
# Farthest that a body is warped, in spacings of all bodies.
FARTHEST, FARTHEST_LATER = 0.9, 0.1


def stage_names(plan: Plan) -> list[str]:
    """Names of the stages, in their order."""
    first = [CLUMPS] if plan.clumped else []
    last = [OVERLAPS] if plan.problem.avoid_overlap else []
    return [*first, "survey", "start", *(f"pass-{number}" for number in range(1, len(plan.passes) + 1)), *last]


def clump_blocks(plan: Plan) -> list[tuple[int, int]]:
    """Return class and number of every block of clumps."""
    return [(c, k) for c, density in plan.clumped.items() for k in range(math.prod(density.clumps.blocks))]


def part_path(run: TileRun, stage: str, number: int) -> Path:
    """The file of a part of a stage."""
    return run.work / stage / f"{number:07d}.npz"


def flow_folder(run: TileRun, stage: str, group: int) -> Path:
    """Where the flow lies that warps a group before a stage."""
    return run.work / f"flow-{stage}" / f"{group:04d}"


@dataclass(frozen=True)
class PartDone:
    """What is told of a part that was made.

    Attributes:
        bodies: How many are in it.
        seconds: See :attr:`.PartTimes.seconds`.
    """

    bodies: int
    seconds: dict[str, float]


def make_part(run: TileRun, stage: str, number: int) -> PartDone:
    """Make a part of a stage."""
    times = PartTimes()
    with times.of("plan"):
        plan = make_plan(run)
    if stage == CLUMPS:
        with times.of(CLUMPS):
            _make_clumps(run, plan, number)
        return PartDone(0, times.seconds)
    if stage == "survey":
        with times.of("survey"):
            _survey(run, plan, number)
        return PartDone(0, times.seconds)
    if stage == "start":
        return PartDone(_start(run, plan, number, times), times.seconds)
    if stage == OVERLAPS:
        with times.of(OVERLAPS):
            _overlaps(run, plan, number)
        return PartDone(0, times.seconds)
    return PartDone(_pass(run, plan, int(stage.removeprefix("pass-")) - 1, number, times), times.seconds)


def _make_clumps(run: TileRun, plan: Plan, number: int) -> None:
    """Make a block of clumps, which everything after reads; the part only says that it is there."""
    c, block = clump_blocks(plan)[number]
    write_block(plan.clumped[c], block)
    write_atomically(part_path(run, CLUMPS, number), b"")


def _survey(run: TileRun, plan: Plan, number: int) -> None:
    """Measure how much of every class's density is in a tile, and in which cells of the coarse grid."""
    box = plan.layout.box((0.0, 0.0), number)
    rows, columns = plan.grid.shape
    integrals, patches = [], []
    corner = (0, 0)
    for c in range(len(plan.problem.classes)):
        image = density_of_class(plan, c, box)
        pixel = box.size[0] * box.size[1] / image.size
        row, part = cell_sums(image[::-1], 0, (box.low[1], box.high[1]), plan.layout.size[1], rows)
        column, part = cell_sums(part, 1, (box.low[0], box.high[0]), plan.layout.size[0], columns)
        corner = (row, column)
        patches.append(part * pixel)
        integrals.append(float(image.sum(dtype=np.float64)) * pixel)
    with written_atomically(part_path(run, "survey", number)) as file:
        np.savez(file, integral=np.array(integrals), patch=np.array(patches), corner=np.array(corner))


def _start(run: TileRun, plan: Plan, number: int, times: PartTimes) -> int:
    """Put the bodies of a tile where they start."""
    begin, end = np.load(run.work / COUNTS, mmap_mode="r")[:, :, number]
    parts = [plan.groups.identities(g, int(a), int(b)) for g, (a, b) in enumerate(zip(begin, end, strict=True))]
    box = plan.layout.box((0.0, 0.0), number)
    with np.load(run.work / RARE, allow_pickle=False) as stored:
        here = box.holds(stored["position"])
        rare, place = stored["identity"][here], stored["position"][here]
    with times.of("start"):
        demand = read_demand(run.work / DEMAND)
        bodies = start_bodies(plan, box, np.concatenate(parts), number, run.device, (rare, place), demand)
    with times.of("parts"):
        _write(run, plan, 0, number, bodies, np.ones(plan.groups.layers))
    return len(bodies)


def _pass(run: TileRun, plan: Plan, place: int, number: int, times: PartTimes) -> int:
    """Let the bodies of a window settle."""
    stage, before = f"pass-{place + 1}", f"pass-{place}" if place else "start"
    this = plan.passes[place]
    box = plan.layout.box(this.shift, number)
    # Whoever stands beyond a cut and reaches over it is seen, too.
    wide = plan.layout.around(box, plan.rim)
    earlier = plan.passes[place - 1].shift if place else (0.0, 0.0)
    parts, own, factors = [], [], []
    # A body may have been warped a little out of the window that it was in.
    with times.of("read"):
        for other in plan.layout.near(earlier, wide, plan.spacing):
            found = read_bodies(part_path(run, before, other))
            here, seen = box.holds(box.framed(found.position)), wide.framed(found.position)
            own.append(found.identity[here])
            parts.append(found.at(seen).chosen(here | wide.holds(seen)))
            factors.append(read_length_factor(part_path(run, before, other)))
        factor = _mean_factor(plan, parts, factors)
        bodies = PartBodies.joined(parts)
    with times.of("warp"):
        bodies = _warped(run, plan, stage, this.warp, wide, bodies)
    demand = read_demand(run.work / DEMAND)
    here = np.isin(bodies.identity, np.concatenate(own), assume_unique=True)
    bodies, factor = relax(
        plan, wide, bodies, here, factor, demand, this.steps, this.part, place == 0, run.device, times
    )
    bodies = _at_home(plan, bodies.chosen(here))
    last = place + 1 == len(plan.passes)
    if last:
        with times.of("tiles"):
            bodies = onto_densities(plan, box, bodies)
            _write_tile(run, plan, number, bodies)
    with times.of("parts"):
        _write(run, plan, place + 1, number, bodies, factor)
    return len(bodies)


def _overlaps(run: TileRun, plan: Plan, number: int) -> None:
    """Count the overlaps of a tile's bodies."""
    before = f"pass-{len(plan.passes)}"
    box = plan.layout.box((0.0, 0.0), number)
    wide = plan.layout.around(box, 2.0 * plan.reach)
    own = read_bodies(part_path(run, before, number)).identity
    parts = []
    for other in plan.layout.near((0.0, 0.0), wide, 0.0):
        found = read_bodies(part_path(run, before, other))
        seen = wide.framed(found.position)
        parts.append(found.at(seen).chosen(wide.holds(seen) | (other == number)))
    bodies = PartBodies.joined(parts)
    here = np.isin(bodies.identity, own, assume_unique=True)
    write_overlaps(part_path(run, OVERLAPS, number), overlaps_of_tile(plan, wide, bodies, here, run.device))


def _at_home(plan: Plan, bodies: PartBodies) -> PartBodies:
    """Bodies of a window inside the domain, of which those that are fixed are where they were given, to the last bit."""
    position = plan.layout.in_domain(bodies.position)
    fixed = plan.groups.is_fixed(bodies.identity)
    if fixed.any():
        position = position.copy()
        position[fixed] = plan.groups.fixed_at(bodies.identity[fixed]).position
    return bodies.at(position)


def _mean_factor(plan: Plan, parts: list[PartBodies], factors: list[np.ndarray]) -> np.ndarray:
    """What made up for the pressure on lines of every size in the windows before, as many of which come from each; 1 at first."""
    count = [
        np.bincount(plan.groups.layer[plan.groups.group_of(p.identity)], minlength=plan.groups.layers) for p in parts
    ]
    weight, factor = np.array(count, float), np.array(factors)
    total = weight.sum(axis=0)
    return np.where(total > 0.0, (weight * factor).sum(axis=0) / np.maximum(total, 1.0), 1.0)


def _write(run: TileRun, plan: Plan, before: int, number: int, bodies: PartBodies, factor: np.ndarray) -> None:
    """Write what the next stage needs, before which so many passes are over: of the last one only where overlaps are counted."""
    groups = plan.groups
    over = before == len(plan.passes)
    if over and not plan.problem.avoid_overlap:
        bodies = bodies.chosen(np.zeros(0, np.int64))
    # Bodies are counted for warps only.
    counted = not over and plan.passes[before].warp != ""
    patch = Patch(0, 0, np.zeros((groups.number, 0, 0), np.int64))
    if counted:
        patch = plan.grid.deposit(bodies.position, groups.group_of(bodies.identity), groups.number)
    stage = f"pass-{before}" if before else "start"
    write_part(part_path(run, stage, number), bodies, patch, factor)


def _write_tile(run: TileRun, plan: Plan, number: int, bodies: PartBodies) -> None:
    with written_atomically(Path(run.folder, tile_name(plan, number, run.ending))) as file:
        TILE_WRITERS[run.ending](file, plan, bodies)


def _warped(run: TileRun, plan: Plan, stage: str, what: str, box: Box, bodies: PartBodies) -> PartBodies:
    """Bodies where the flow has carried them; none leaves its class's density."""
    if not what or not len(bodies):
        return bodies
    moved = np.zeros((len(bodies), 2))
    # Before the first pass everything is free; later ones leave some places as they are, and sizes must not meet there.
    most = FARTHEST if stage == "pass-1" else FARTHEST_LATER
    group = plan.groups.group_of(bodies.identity)
    for g in np.unique(group).tolist():
        own = group == g
        folder = flow_folder(run, stage, int(plan.groups.layer[g]) if what == "sizes" else 0)
        place = plan.layout.in_domain(bodies.position[own])
        moved[own] = displacement(folder, plan.grid, place, most * plan.spacing)
    # The last warp, a small fraction of a spacing, leaves all bodies in their tiles.
    last = stage == stage_names(plan)[-1]
    target = bodies.position + moved
    if last:
        target = box.confine(target)
    elif not plan.layout.periodic:
        target = np.clip(target, 0.0, plan.layout.size)
    allowed = _may_be_at(plan, target, plan.groups.class_index[group], box) & ~plan.groups.is_fixed(bodies.identity)
    return bodies.at(np.where(allowed[:, None], target, bodies.position))


def _may_be_at(plan: Plan, position: np.ndarray, class_index: np.ndarray, box: Box) -> np.ndarray:
    """Whether densities are above zero at positions of bodies of a box; those beyond it stay, so as to need no more of them."""
    result = np.ones(len(position), bool)
    local = position - box.low
    inside = ((local >= 0.0) & (local <= box.size)).all(axis=1)
    for c in np.unique(class_index).tolist():
        image = density_of_class(plan, c, box)
        if (image > 0.0).all():
            continue
        own = np.flatnonzero(class_index == c)
        rows, columns = image.shape
        column = np.clip((local[own, 0] / box.size[0] * columns).astype(np.int64), 0, columns - 1)
        row = np.clip((rows - local[own, 1] / box.size[1] * rows).astype(np.int64), 0, rows - 1)
        result[own] = inside[own] & (image[row, column] > 0.0)
    return result
