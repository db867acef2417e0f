"""A batch: a folder with one folder for every scene, which can be left and continued at any time.

A scene is done when its folder is there: it is made under another name and renamed, so a run that is killed leaves whole scenes only.
"""

from __future__ import annotations

import contextlib
import copy
import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import EshError
from ..files.extras import import_extra
from ..files.placement_files import WRITERS, check_ending, write_files
from ..files.recipe import ParsedRecipe, parse_recipe
from ..files.report_files import strict_json
from .ray_pool import RayPool
from .run_folder import open_run_folder
from .scene import Scene, input_files, read_scene, solved_scene
from .variations import DESIGNS, Variation, parse_variation, scene_parameters
from .worker import Failure, carry_out

__all__ = ["Batch", "BatchState", "run_batch"]

PLAN = "batch.json"
MANIFEST = "manifest.parquet"
# Scenes of which one must be readable: otherwise it is not a value here or there that is wrong, but the recipe or a key.
TRIED = 10
# What the manifest says of every scene, beside its parameters -> type.
COLUMNS = {
    "scene": "int64",
    "seed": "int64",
    "folder": "string",
    "error": "string",
    "bodies": "int64",
    "coverage_error": "float64",
    "smallest_spacing": "float64",
    "overlaps": "int64",
    "covered": "float64",
    "steps": "int64",
    "converged": "bool",
    "device": "string",
    "seconds": "float64",
    "hash": "string",
}


@dataclass(frozen=True)
class Batch:
    """What a batch consists of.

    Attributes:
        recipe: The recipe's file.
        folder: Where the scenes go.
        seeds: See :func:`.scene_parameters`.
        variations: ``KEY=VALUES``, see :func:`.parse_variation`.
        design: ``"latin"`` or ``"grid"``.
        endings: Of the placements' files; the manifest's hash is that of the first.
        max_steps: See :func:`~esh.solve`.
    """

    recipe: Path
    folder: Path
    seeds: range
    variations: Sequence[str] = ()
    design: str = "latin"
    endings: tuple[str, ...] = (".npz",)
    max_steps: int = 100


@dataclass(frozen=True)
class BatchState:
    """How far a batch is.

    Attributes:
        scenes: Number of scenes in the batch.
        done: How many have a folder, those that failed included.
        failed: The scenes that failed, and why.
        made: How many of them this run made.
        mine: How many this run has to make.
    """

    scenes: int
    done: int
    failed: Mapping[int, str]
    made: int
    mine: int


def run_batch(
    batch: Batch,
    *,
    device: str = "auto",
    workers: int | None = None,
    ray: str | None = None,
    gpus: float = 0.0,
    part: tuple[int, int] = (1, 1),
    collect: bool = False,
    retry: bool = False,
    progress: Callable[[BatchState], None] | None = None,
) -> BatchState:
    """Solve the scenes of a batch that are not done yet, and write the manifest once all are.

    Args:
        batch: What to make.
        device: See :func:`~.solve_many.solve_many`; the first scene stands for all.
        workers: See :func:`~.solve_many.solve_many`.
        ray: Address of a Ray cluster to solve on; None solves on this machine.
        gpus: GPUs that a scene asks of Ray.
        part: ``(i, n)``: only every n-th scene, from the i-th (counted from 1), so that several machines share the work. A run without
            it then finds all of them done, and writes the manifest.
        collect: Make no scene, only the manifest.
        retry: Try the scenes again that failed.
        progress: Called at the beginning and after every scene.

    Raises:
        EshError: Nothing can be done: a recipe, a key or an ending that has no meaning, a folder that holds another batch, a library
            that is missing. Scenes that cannot be solved are no such error; they are in what is returned.
    """
    parquet = import_extra("pyarrow.parquet", "batch", "the manifest of a batch")
    recipe, variations = _read(batch)
    scenes = list(_scenes(batch, recipe, variations, device))
    charges = _first_charges(scenes)
    inputs = _inputs(recipe, variations)
    _open_folder(batch, recipe, inputs)

    mine = [] if collect else scenes[part[0] - 1 :: part[1]]
    _remove_remains(batch.folder, mine)
    done, failed = _done_and_failed(batch.folder, retry)
    left = [scene for scene in mine if scene.number not in done]
    made = 0

    def show() -> None:
        if progress is not None:
            progress(BatchState(len(scenes), len(done), failed, made, len(left)))

    show()
    for scene, files in _solve(left, inputs, charges, device, workers, ray, gpus):
        if isinstance(files, Failure):
            report = {"scene": scene.number, "seed": scene.seed, "parameters": dict(scene.parameters)}
            files = {"report.json": strict_json(report | {"error": files.text})}
        error = json.loads(files["report.json"]).get("error")
        _write_scene(scene.folder, files)
        made += 1
        done.add(scene.number)
        if error is not None:
            failed[scene.number] = error
        show()
    if len(done) == len(scenes):
        _write_manifest(batch, scenes, [variation.key for variation in variations], parquet)
    return BatchState(len(scenes), len(done), dict(sorted(failed.items())), made, len(left))


def _read(batch: Batch) -> tuple[ParsedRecipe, list[Variation]]:
    """The recipe of a batch, and what varies; everything else that it says is looked at, too."""
    for ending in batch.endings:
        WRITERS[check_ending(f"placement{ending}", WRITERS, "--as")].check()
    recipe = parse_recipe(batch.recipe)
    variations = [parse_variation(text) for text in batch.variations]
    keys = [variation.key for variation in variations]
    if "seed" in keys or len(set(keys)) < len(keys):
        raise EshError(f"--set must name every key once, and seeds by --seeds; got {', '.join(keys)}")
    if batch.design not in DESIGNS:
        raise EshError(f"--design must be {' or '.join(DESIGNS)}; got {batch.design!r}")
    return recipe, variations


def _done_and_failed(folder: Path, retry: bool) -> tuple[set[int], dict[int, str]]:
    """Scenes that are done, and why some of them failed; with ``retry`` these are removed."""
    done = _done(folder)
    failed = {n: why for n in done if (why := _read_report(folder, n).get("error")) is not None}
    if not retry:
        return done, failed
    for number in failed:
        shutil.rmtree(folder / _name(number))
    return done - failed.keys(), {}


def _scenes(batch: Batch, recipe: ParsedRecipe, variations: list[Variation], device: str) -> Iterator[Scene]:
    # Absolute: who solves a scene may work in another folder.
    source, absolute = recipe.path.resolve().parent, batch.folder.resolve()
    for number, (seed, values) in enumerate(scene_parameters(variations, batch.seeds, batch.design)):
        folder = absolute / _name(number)
        yield Scene(number, seed, values, recipe, source, folder, device, batch.max_steps, batch.endings)


def _name(number: int) -> str:
    return f"{number:06d}"


def _first_charges(scenes: list[Scene]) -> int:
    """Charges of the first scene that can be read; raises what is wrong with the first one if none of the first ones can be."""
    first: EshError | None = None
    for scene in scenes[:TRIED]:
        try:
            return read_scene(scene)[0].charge_count
        except EshError as error:
            first = first or error
    if first is not None:
        raise first
    return 0


def _inputs(recipe: ParsedRecipe, variations: list[Variation]) -> dict[str, bytes]:
    """Return all files that the recipe and its variations name, by their names."""
    folder = recipe.path.parent
    entries = copy.deepcopy(recipe.entries)
    values = [{"value": value} for variation in variations if variation.kind == "list" for value in variation.values]
    names = sorted({table[key] for table, key in input_files([entries, values], folder)})
    try:
        return {name: (folder / name).read_bytes() for name in names}
    except OSError as error:
        raise EshError(f"{error.filename} cannot be read: {(error.strerror or str(error)).lower()}") from None


def _open_folder(batch: Batch, recipe: ParsedRecipe, inputs: Mapping[str, bytes]) -> None:
    """Make the folder, or find that it is of the same batch."""
    plan = {
        "version": 1,
        "recipe": hashlib.sha256(strict_json(recipe.entries)).hexdigest(),
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()},
        "seeds": [batch.seeds.start, batch.seeds.stop],
        "set": list(batch.variations),
        "design": batch.design,
        "as": list(batch.endings),
        "max_steps": batch.max_steps,
    }
    # A file that was not there is one whose scenes failed; they can be tried again once it is.
    open_run_folder(batch.folder, PLAN, plan, "batch", growing="files")


def _done(folder: Path) -> set[int]:
    with os.scandir(folder) as entries:
        return {int(entry.name) for entry in entries if re.fullmatch(r"\d{6,}", entry.name)}


def _remove_remains(folder: Path, mine: list[Scene]) -> None:
    """Remove what runs that were killed have left of these scenes."""
    own = {_name(scene.number) for scene in mine}
    with os.scandir(folder) as entries:
        remains = [
            entry.path for entry in entries if entry.name.startswith(".") and entry.name[1:].split(".")[0] in own
        ]
    for path in remains:
        shutil.rmtree(path, ignore_errors=True)


def _solve(
    scenes: list[Scene],
    inputs: Mapping[str, bytes],
    charges: int,
    device: str,
    workers: int | None,
    ray: str | None,
    gpus: float,
) -> Iterator[tuple[Scene, Any]]:
    if not scenes:
        return
    # Not before: a run that only collects needs no Warp.
    from .solve_many import processes_for, quicker_device
    from .worker_pool import WorkerPool

    if ray is not None:
        cluster = RayPool(ray, gpus)
        shared = cluster.share(dict(inputs))
        for number, answer in cluster.map(solved_scene, ((scene, shared) for scene in scenes)):
            yield scenes[number], answer
        return
    device = quicker_device(device, charges)
    scenes = [replace(scene, device=device) for scene in scenes]
    many = processes_for(workers, device, len(scenes), charges)
    if not many.workers:
        for scene in scenes:
            yield scene, carry_out(solved_scene, (scene,))
        return
    pool = WorkerPool(many.workers, many.threads, environments=many.environments)
    for number, answer in pool.map(solved_scene, ((scene,) for scene in scenes)):
        yield scenes[number], answer


def _write_scene(folder: Path, files: Mapping[str, bytes]) -> None:
    beside = folder.with_name(f".{folder.name}.{secrets.token_hex(4)}.part")
    try:
        beside.mkdir()
        for name, content in files.items():
            (beside / name).write_bytes(content)
        with contextlib.suppress(FileExistsError):  # another run made it meanwhile: the same
            try:
                beside.rename(folder)
            except OSError:
                if not folder.is_dir():
                    raise
    except OSError as error:
        raise EshError(f"{folder} cannot be written: {(error.strerror or str(error)).lower()}") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _read_report(folder: Path, number: int) -> dict[str, Any]:
    path = folder / _name(number) / "report.json"
    try:
        report = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise EshError(f"{path} cannot be read, remove its folder to make the scene again: {error}") from None
    return report if isinstance(report, dict) else {}


def _write_manifest(batch: Batch, scenes: list[Scene], keys: list[str], parquet: Any) -> None:
    """Write a table with a row for every scene."""
    arrow = import_extra("pyarrow", "batch", "the manifest of a batch")
    reports = [_read_report(batch.folder, scene.number) for scene in scenes]
    for report in reports:
        report["folder"] = _name(report["scene"])
    table = {
        name: arrow.array([r.get(name) for r in reports], arrow.type_for_alias(kind)) for name, kind in COLUMNS.items()
    }
    for key in keys:
        values = [report["parameters"].get(key) for report in reports]
        if (
            not all(isinstance(value, (int, float, str)) for value in values)
            or len({type(v) for v in values} - {int}) > 1
        ):
            values = [json.dumps(value) for value in values]
        elif any(isinstance(value, float) for value in values):
            values = [float(value) for value in values]
        elif any(isinstance(value, str) for value in values):
            values = [str(value) for value in values]
        # A key of the recipe that is called as a column of ours keeps its full name.
        table[key if key not in table else f"set {key}"] = arrow.array(values)
    order = ["scene", "seed", *[name for name in table if name not in COLUMNS], *list(COLUMNS)[2:]]
    written = arrow.table({name: table[name] for name in order})
    write_files({batch.folder / MANIFEST: lambda file: parquet.write_table(written, file, compression="zstd")})
