"""solve_tiles(): a huge domain, tile by tile, into a folder that can be continued.

A run goes through stages: clumps, where a class has some, a survey of the densities, the start of every tile, and passes over windows.
Between them stands what only the whole domain knows: how many bodies every tile gets, and the flow of the coarse warp. Every part of a
stage is a file, which is there as a whole or not at all; so a run that is killed goes on where it was, and who makes a part does not
matter.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..device.devices import core_count, gpu_environments, processes_on_gpus, resolve_device
from ..errors import EshError, ProblemError
from ..files.recipe import recipe_densities
from ..files.recipe_writer import write_recipe
from ..problem.given_values import as_path, check_progress, show
from ..problem.problem import Problem
from ..problem.settings import belongs_to
from ..problem.validation import check_count
from ..scenes.ray_pool import RayPool
from ..scenes.run_folder import make_folder, open_run_folder
from ..scenes.worker import Failure, carry_out
from ..scenes.worker_pool import WorkerPool
from .bodies import read_patch, write_atomically, written_atomically
from .coarse import SCALE, solve_flow
from .demand import find_demand, integrals_of_tiles, read_demand, write_demand
from .layout import hilbert_order
from .overlaps import TileOverlaps, read_overlaps
from .part_times import PartTimes
from .plan import Plan, TileRun, choose_tiles, make_plan, read_tiled_recipe
from .stages import (
    CLUMPS,
    COUNTS,
    DEMAND,
    OVERLAPS,
    RARE,
    TARGET,
    clump_blocks,
    flow_folder,
    make_part,
    part_path,
    stage_names,
)
from .start import spread_rare
from .tile_files import TILE_WRITERS, check_tile_ending, tile_name, world_position

__all__ = ["STEPS", "TileState", "solve_tiles"]

PLAN = "tiles.json"
INDEX = "index.json"
# Steps of the descent in the three passes. What is beside the cuts of one pass has the steps of the others only, and where those of
# the first two cross, of the last alone. Measured on 160,000 bodies, means of three seeds, five of one solve: the smallest spacings
# of lines and of dots on a photograph are .647 and .606 with 55, 45 and 45; .664 and .610 with these; .670 and .616 in one solve.
STEPS = (50, 45, 60)
STEPS_INSTEAD = {"max_steps": f"`steps` are those of its passes: solve_tiles(..., steps={STEPS})"}
# Blur of the coarse warp in spacings of a group, or of all bodies, and in cells at least. What is finer only windows settle, but
# not beside their cuts: with 12 spacings errors there at k = 4 are half as large again, with 6 a tenth.
BLUR, BLUR_IN_CELLS = 4.0, 2.0
GOLDEN = 0.6180339887498949
# Fewer parts are made sooner in this process than others are started.
WORTH_PROCESSES = 8
# What a body of a window takes of a GPU's memory [bytes].
GPU_BODY = 2000.0


@dataclass(frozen=True)
class TileState:
    """How far a run in tiles has come.

    Attributes:
        stage: Number of the current stage, from 1.
        stages: Number of stages.
        name: Name of the current stage.
        done: Number of parts of this stage that are finished.
        parts: Number of parts of this stage.
        bodies: Number of bodies of the whole problem.
        tiles: Numbers of columns and rows of tiles.
        finished: Whether the whole run is finished.
        workers: Number of processes; 0 if the calling process does all the work.
        seconds: Seconds that all processes have spent so far, added up, by kind of work. ``"between"`` is work on the whole domain
            between two stages, which all processes wait for.
        notes: Sentences worth the user's attention, as in a :class:`Report`: that the footprints cannot fit, settings that do nothing,
            and, once the run is finished, how many footprints overlap. How even bodies are is not measured.
        overlaps: Pairs of footprints that overlap, as in a :class:`Report`, those of two tiles too. None until the run is finished,
            and where footprints may overlap.
        deepest_overlap: How deep the deepest pair lies in each other [m].
    """

    stage: int
    stages: int
    name: str
    done: int
    parts: int
    bodies: int
    tiles: tuple[int, int]
    finished: bool = False
    workers: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    overlaps: int | None = None
    deepest_overlap: float = 0.0


@belongs_to("problem", named=False, instead=STEPS_INSTEAD)
def solve_tiles(
    problem: Problem | str | Path,
    folder: str | Path,
    *,
    tile: float | None = None,
    seed: int | None = None,
    steps: tuple[int, int, int] = STEPS,
    ending: str = ".parquet",
    device: str = "auto",
    workers: int | None = None,
    ray: str | None = None,
    gpus: float = 0.0,
    progress: Callable[[TileState], None] | None = None,
) -> TileState:
    """Place the bodies of a problem that is larger than a machine's memory, tile by tile.

    It gives the same bytes for any number of processes. A run that was stopped or killed goes on when it is called again. Counts are
    exact, and how even the result is beside that of one solve is measured in the documentation's page on tiles.

    Args:
        problem: A recipe, whose densities are read by window where they are ``.npy`` or GeoTIFF files; or a problem.
        folder: Gets a file for each tile, and ``index.json``, which lists them. It is empty, or holds the same run, which continues.
        tile: Length of a tile [m], at least 30 spacings; with `avoid_overlap` 60, and more for bodies that are larger than that. None
            chooses one from the densities, the rarest group and the largest body.
        seed: Seed used instead of the recipe's.
        steps: Steps of the descent in each of the three passes.
        ending: Format of the tiles: ``".parquet"`` (GeoParquet) or ``".npz"``.
        device: ``"auto"``, ``"cpu"`` or ``"cuda:0"``.
        workers: Processes, of one thread each, which share a GPU; 0 solves in this one, with all threads. None chooses.
        ray: Address of a Ray cluster to solve on, whose machines all see recipe and folder; None solves on this machine.
        gpus: Number of GPUs that each window requests from Ray.
        progress: Called with a :class:`TileState` at the beginning, and after every part.

    Returns:
        The state at the end of the run.

    Raises:
        EshError: A recipe, a value or a folder that cannot be used, or a part that failed.
    """
    if ending not in TILE_WRITERS:
        raise ProblemError(f"`ending` must be {' or '.join(TILE_WRITERS)}; got {show(ending)}")
    check_tile_ending(ending)
    if not isinstance(steps, Sequence) or len(steps) != 3:
        raise ProblemError(f"`steps` must be three numbers, one for each pass; got {show(steps)}")
    checked = tuple(check_count(number, "`steps`") for number in steps)
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 0):
        raise ProblemError(f"`workers` must be a whole number of at least 0, or None; got {show(workers)}")
    on_gpu = resolve_device(device).is_cuda or gpus > 0.0
    check_progress(progress)
    folder = as_path(folder, "`folder`").resolve()
    recipe = _recipe_of(problem, folder)
    scene = read_tiled_recipe(recipe, seed)
    tiles = choose_tiles(scene, tile, on_gpu)
    contents = _digest([recipe, *recipe_densities(recipe)])
    run = TileRun(str(recipe), str(folder), seed, tiles, checked, device, ending, contents)
    _open_folder(run, on_gpu)
    plan = make_plan(run)
    return _Driver(run, plan, workers, ray, gpus, on_gpu, progress).go()


class _Driver:
    """Carries a run out, stage by stage."""

    def __init__(
        self,
        run: TileRun,
        plan: Plan,
        workers: int | None,
        ray: str | None,
        gpus: float,
        on_gpu: bool,
        progress: Callable[[TileState], None] | None,
    ) -> None:
        self._run, self._plan = run, plan
        self._progress = progress
        self._names = stage_names(plan)
        columns, rows = plan.layout.tiles
        self._tiles = columns * rows
        self._ray = ray
        self._gpus = gpus
        self._on_gpu = on_gpu
        if workers is None:
            workers = _processes(run, plan, on_gpu) if self._tiles >= WORTH_PROCESSES else 0
        self._workers = min(workers, self._tiles)
        self._pool: RayPool | WorkerPool | None = None
        self._times = PartTimes()
        self._overlaps: TileOverlaps | None = None
        self._compiled: set[str] = set()

    def go(self) -> TileState:
        """Carry out what is left of the run."""
        run = self._run
        index = Path(run.folder, INDEX)
        if index.is_file():
            self._overlaps = _overlaps_of_index(index)
            return self._state(len(self._names) - 1, self._tiles, self._tiles, finished=True)
        make_folder(run.work)
        try:
            for place, name in enumerate(self._names):
                if self._is_over(name):
                    continue
                with self._times.of("between"):
                    self._before(place, name)
                self._make(place, name)
                with self._times.of("between"):
                    self._after(place, name)
        finally:
            if self._pool is not None:
                self._pool.close()
        if OVERLAPS in self._names:
            parts = (read_overlaps(part_path(run, OVERLAPS, number)) for number in range(self._tiles))
            self._overlaps = sum(parts, TileOverlaps())
        _write_index(run, self._plan, self._overlaps)
        shutil.rmtree(run.work, ignore_errors=True)
        return self._state(len(self._names) - 1, self._tiles, self._tiles, finished=True)

    def _state(self, place: int, done: int, parts: int, finished: bool = False) -> TileState:
        plan = self._plan
        return TileState(
            place + 1,
            len(self._names),
            self._names[place],
            done,
            parts,
            plan.groups.body_count,
            plan.layout.tiles,
            finished,
            self._workers,
            dict(self._times.seconds),
            plan.notes + (() if self._overlaps is None else self._overlaps.notes),
            None if self._overlaps is None else self._overlaps.count,
            0.0 if self._overlaps is None else self._overlaps.deepest,
        )

    def _parts(self, name: str) -> int:
        if name == CLUMPS:
            return len(clump_blocks(self._plan))
        if not name.startswith("pass-"):
            return self._tiles
        columns, rows = self._plan.layout.shape(self._plan.passes[int(name.removeprefix("pass-")) - 1].shift)
        return columns * rows

    def _mark(self, name: str) -> Path:
        return self._run.work / f"{name}.done"

    def _is_over(self, name: str) -> bool:
        return self._mark(name).is_file()

    def _make(self, place: int, name: str) -> None:
        """Make the parts of a stage that are not there."""
        run = self._run
        parts = self._parts(name)
        stage = run.work / name
        stage.mkdir(parents=True, exist_ok=True)
        there = set()
        with os.scandir(stage) as entries:
            for entry in entries:
                if entry.name.endswith(".part"):
                    os.unlink(entry.path)
                else:
                    there.add(int(entry.name.split(".")[0]))
        left = [number for number in range(parts) if number not in there]
        done = parts - len(left)
        self._show(place, done, parts)
        for answer in self._answers(name, [(run, name, number) for number in left]):
            if isinstance(answer, Failure):
                raise ProblemError(f"{name} of the tiles failed: {answer.text}")
            for what, spent in answer.seconds.items():
                self._times.seconds[what] = self._times.seconds.get(what, 0.0) + spent
            done += 1
            self._show(place, done, parts)

    def _answers(self, name: str, calls: list[tuple[Any, ...]]) -> Iterator[Any]:
        if not calls:
            return
        if self._ray is None and self._workers == 0:
            for call in calls:
                yield carry_out(make_part, call)
            return
        if self._pool is None:
            self._pool = (
                RayPool(self._ray, self._gpus, keep=True)
                if self._ray is not None
                else WorkerPool(
                    self._workers,
                    1,
                    keep=True,
                    environments=gpu_environments(self._run.device) if self._on_gpu else (),
                )
            )
        # A stage that needs other kernels than those before has its first part made alone, which compiles them for all.
        kernels = self._kernels_of(name)
        for _, answer in self._pool.map(make_part, calls, first_alone=not kernels <= self._compiled):
            yield answer
        self._compiled |= kernels

    def _kernels_of(self, name: str) -> set[str]:
        """What a stage needs compiled."""
        if not name.startswith("pass-"):
            return {name} if name in {"start", OVERLAPS} else set()
        this = self._plan.passes[int(name.removeprefix("pass-")) - 1]
        return {"pass", "contact"} if this.part else {"pass"}

    def _show(self, place: int, done: int, parts: int) -> None:
        if self._progress is not None:
            self._progress(self._state(place, done, parts))

    def _before(self, place: int, name: str) -> None:
        """Prepare what only the whole domain knows."""
        if name == "start":
            _count_bodies(self._run, self._plan)
        elif name.startswith("pass-"):
            _make_flows(self._run, self._plan, name, self._names[place - 1], self._parts(self._names[place - 1]))

    def _after(self, place: int, name: str) -> None:
        """Note that a stage is over, and let go of what nobody needs any more."""
        run = self._run
        if name == "survey":
            _collect_survey(run, self._plan, self._tiles)
        write_atomically(self._mark(name), b"")
        if place > 0:
            shutil.rmtree(run.work / self._names[place - 1], ignore_errors=True)
        shutil.rmtree(run.work / f"flow-{name}", ignore_errors=True)


def _processes(run: TileRun, plan: Plan, on_gpu: bool) -> int:
    """Processes that a run is best made by: one for each processor; of those that share a GPU no more than it has the memory for.

    On a GPU most of a window's time is spent beside it, in reading, preparing and writing.
    """
    if not on_gpu:
        return core_count()
    return processes_on_gpus(run.device, GPU_BODY * plan.groups.body_count / math.prod(plan.layout.tiles))


def _recipe_of(problem: Problem | str | Path, folder: Path) -> Path:
    """The recipe's file; a problem is written as one."""
    if not isinstance(problem, Problem):
        return as_path(problem, "`problem`").resolve()
    if not isinstance(problem.domain.size, tuple) or len(problem.domain.size) != 2:
        raise ProblemError("`domain` must be a rectangle for tiles; it is a surface")
    recipe = folder / "problem" / "problem.toml"
    make_folder(recipe.parent)
    write_recipe(recipe, problem)
    return recipe


def _open_folder(run: TileRun, on_gpu: bool) -> None:
    """Make the folder, or find that it is of the same run."""
    folder = Path(run.folder)
    plan: dict[str, Any] = {
        "version": 2,
        "recipe": run.contents,
        "seed": run.seed,
        "tiles": list(run.tiles),
        "steps": list(run.steps),
        "ending": run.ending,
        "device": "cuda" if on_gpu else "cpu",
    }
    open_run_folder(folder, PLAN, plan, "run", beside=("problem",))


def _digest(paths: list[Path]) -> str:
    """Hash of some files; of large ones, of their sizes and of some of their parts."""
    total = hashlib.sha256()
    for path in paths:
        try:
            size = path.stat().st_size
            total.update(f"{path.name} {size} ".encode())
            with path.open("rb") as file:
                step = max(1 << 20, size // 64)
                for place in range(0, size, step):
                    file.seek(place)
                    total.update(hashlib.sha256(file.read(1 << 20)).digest())
        except OSError as error:
            raise EshError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}") from None
    return total.hexdigest()


def _collect_survey(run: TileRun, plan: Plan, tiles: int) -> None:
    """Add up what is in the tiles: the target of the coarse grid, and the integrals of densities."""
    classes = len(plan.problem.classes)
    target = np.zeros((classes, *plan.grid.shape))
    integral = np.zeros((classes, tiles))
    for number in range(tiles):
        with np.load(part_path(run, "survey", number), allow_pickle=False) as stored:
            integral[:, number] = stored["integral"]
            row, column = stored["corner"].tolist()
            patch = stored["patch"]
        target[:, row : row + patch.shape[1], column : column + patch.shape[2]] += patch
    totals = integral.sum(axis=1)
    for c, total in enumerate(totals.tolist()):
        if not total > 0.0:
            raise ProblemError(
                f'`density` of class "{plan.problem.classes[c].name}" must be above 0 somewhere; nothing of it is left'
            )
    _save(run.work / "integral.npy", integral)
    _save(run.work / TARGET, target)


def _count_bodies(run: TileRun, plan: Plan) -> None:
    """Say which bodies of every group start in which tile: what is left of a tile's share is carried to the next on the curve."""
    integral = np.load(run.work / "integral.npy")
    order = hilbert_order(*plan.layout.tiles)
    result = np.zeros((2, plan.groups.number, integral.shape[1]), np.int64)
    target = np.load(run.work / TARGET)
    demand = find_demand(plan.groups, plan.grid, target, integral.sum(axis=1))
    write_demand(run.work / DEMAND, demand)
    free_count = plan.groups.free_count
    for g, c in enumerate(plan.groups.class_index.tolist()):
        here = integral[c]
        if g in demand.left:
            # Cells reach beyond what a tile's density is.
            here = np.where(here > 0.0, integrals_of_tiles(demand.left[g], plan.grid, plan.layout), 0.0)
        share = np.cumsum(here[order])
        if not free_count[g]:
            continue
        share /= share[-1]
        if g in plan.rare:
            continue
        phase = (0.5 + GOLDEN * g) % 1.0
        count = int(free_count[g])
        # The curve ends with all of them, whatever rounding says.
        end = np.minimum(np.floor(count * share + phase).astype(np.int64), count)
        end[share >= share[-1]] = count
        result[0, g, order] = np.concatenate([[0], end[:-1]])
        result[1, g, order] = end
    identity, position = spread_rare(plan, target, run.device)
    with written_atomically(run.work / RARE) as file:
        np.savez(file, identity=identity, position=position)
    _save(run.work / COUNTS, result)


def _make_flows(run: TileRun, plan: Plan, stage: str, before: str, parts: int) -> None:
    """Find the flows that warp bodies before a pass."""
    what = plan.passes[int(stage.removeprefix("pass-")) - 1].warp
    if not what or (run.work / f"flow-{stage}" / "done").is_file():
        return
    groups, grid = plan.groups, plan.grid
    target = np.load(run.work / TARGET, mmap_mode="r")
    demand = read_demand(run.work / DEMAND)
    layer_of = groups.layer if what == "sizes" else np.zeros(groups.number, np.int64)
    there = np.zeros((groups.number, *grid.shape), np.int64)
    for number in range(parts):
        read_patch(part_path(run, before, number)).add_to(there)
    for layer in range(int(layer_of.max()) + 1):
        own = np.flatnonzero(layer_of == layer)
        count, wanted = np.zeros(grid.shape), np.zeros(grid.shape)
        # Bodies count as large as they are, as in windows.
        mean = float((groups.mean_area[own] * groups.count[own]).sum() / groups.count[own].sum())
        weight = groups.mean_area / mean
        for g in own.tolist():
            density = np.array(target[groups.class_index[g]])
            wanted += weight[g] * int(groups.count[g]) * float(demand.level[g]) / density.sum() * density
            if g in demand.excess:
                wanted += weight[g] * demand.excess[g]
            count += (weight[g] / SCALE) * there[g]
        spacing = math.sqrt(math.prod(grid.size) / int(groups.count[own].sum()))
        blur = max(BLUR * spacing, BLUR_IN_CELLS * max(grid.cell))
        folder = flow_folder(run, stage, layer)
        folder.mkdir(parents=True, exist_ok=True)
        for name, values in zip(
            ("x", "y", "density"), solve_flow(grid, count, wanted, blur, core_count()), strict=True
        ):
            _save(folder / f"{name}.npy", values)
    write_atomically(run.work / f"flow-{stage}" / "done", b"")


def _overlaps_of_index(index: Path) -> TileOverlaps | None:
    """What overlaps in a run that is finished; None where footprints may overlap, or an older version has not counted."""
    listed = json.loads(index.read_text(encoding="utf-8"))
    if "overlaps" not in listed:
        return None
    return TileOverlaps(2 * int(listed["overlaps"]), float(listed["deepest_overlap"]))


def _save(path: Path, values: np.ndarray) -> None:
    with written_atomically(path) as file:
        np.save(file, values, allow_pickle=False)


def _write_index(run: TileRun, plan: Plan, overlaps: TileOverlaps | None) -> None:
    """List the tiles."""
    counts = np.diff(np.load(run.work / COUNTS), axis=0)[0]
    with np.load(run.work / RARE, allow_pickle=False) as stored:
        rare = len(stored["identity"])
    columns, rows = plan.layout.tiles
    tiles = []
    for number in range(columns * rows):
        box = plan.layout.box((0.0, 0.0), number)
        # As the positions in its file.
        low, high = world_position(plan, np.array([box.low, box.high])).tolist()
        tiles.append(
            {
                "file": tile_name(plan, number, run.ending),
                "column": number % columns,
                "row": number // columns,
                "low": low,
                "high": high,
            }
        )
    listed = {
        "bodies": plan.groups.body_count,
        "counted": int(counts.sum()) + rare + len(plan.groups.fixed_identity),
        "size": list(plan.layout.size),
        "notes": [*plan.notes, *(() if overlaps is None else overlaps.notes)],
        **({} if overlaps is None else {"overlaps": overlaps.count, "deepest_overlap": overlaps.deepest}),
        "classes": [
            {"name": c.name, "sizes": [{"name": s.name, "count": s.count} for s in c.sizes]}
            for c in plan.problem.classes
        ],
        "tiles": tiles,
    }
    write_atomically(Path(run.folder, INDEX), (json.dumps(listed, indent=1) + "\n").encode())
