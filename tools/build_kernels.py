"""Compile the engine's kernels ahead of time: ``python tools/build_kernels.py FOLDER``.

The extension's zip carries what this writes (see ``engine/device/prebuilt_kernels.py``): the CPU's kernels for every tier of
processors, and those of GPUs for every generation of them. Objects for a CPU can be made only on the system that they are for.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import build_gpu_kernels
import esh
import warp as wp
from esh.engine.device.devices import core_count
from esh.engine.device.prebuilt_gpu_kernels import GENERATIONS, archive_of, digest_of
from esh.engine.device.prebuilt_kernels import INDEX, TIERS, stem_of, tier_of_this_processor
from esh.engine.device.quiet_start import start_warp

# Stands for the tier of the processor that builds.
NATIVE = "native"
# Modules that hold kernels of GPUs only.
GPU_ONLY = ("_gpu",)
# An object, and what Warp knows of it.
ENDINGS = (".o", ".meta")
# Where they stay for the next time.
KEPT = Path(__file__).resolve().parent.parent / "build" / "kernels"


def tiers_of_this_machine() -> list[str]:
    """The tiers whose processors this machine's compiler can build for."""
    if platform.machine().lower() in {"x86_64", "amd64"}:
        return [tier for tier in TIERS if tier.startswith("x86")]
    return ["apple-m1"] if platform.system() == "Darwin" else []


def kernel_modules() -> list[str]:
    """Names of all modules with CPU kernels."""
    root = Path(esh.__file__).parent
    files = sorted((root / "engine").rglob("kernels_*.py"))
    return [
        ".".join(("esh", *file.relative_to(root).with_suffix("").parts))
        for file in files
        if not file.stem.endswith(GPU_ONLY)
    ]


def build(
    folder: Path,
    kept: Path = KEPT,
    gpus: Sequence[int] = (),
    *,
    for_cpu: bool = True,
    tiers: Sequence[str] | None = None,
) -> int:
    """Write objects, archives and their index into a folder, which is emptied first; return how many modules were compiled.

    Args:
        folder: Where to put them.
        kept: Where all of them stay for the next time, which then compiles only what has changed.
        gpus: Generations of GPUs, of :data:`.prebuilt_gpu_kernels.GENERATIONS`.
        for_cpu: Whether the CPU's kernels are wanted, which are for this system.
        tiers: Tiers of processors that the CPU's kernels are for, or :data:`NATIVE`; None for all.
    """
    start_warp()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    known = _compiler_flags() if for_cpu else {}
    wanted = known if tiers is None else {tier_of_this_processor() if tier == NATIVE else tier for tier in tiers}
    flags = {tier: own for tier, own in known.items() if tier in wanted}
    count = _build_for_cpu(folder, kept, list(flags.values()), list(known.values())) if flags else 0
    if gpus:
        count += build_gpu_kernels.build(folder, gpus, kept)
    digests = {str(generation): digest_of(folder / archive_of(generation)) for generation in sorted(gpus)}
    index = {"warp": wp.__version__, "flags": flags, "gpus": digests}
    (folder / INDEX).write_text(json.dumps(index, indent=1) + "\n", encoding="utf-8")
    return count


def _compiler_flags() -> dict[str, str]:
    """What the compiler is told for each tier."""
    # Warp's own flags, but for another processor than this one.
    own = (wp.config.cpu_compiler_flags or "").replace("-march=native", "").strip()
    return {tier: f"-target-cpu {tier} {own}".strip() for tier in tiers_of_this_machine()}


def _build_for_cpu(folder: Path, kept: Path, flags: Sequence[str], known: Sequence[str]) -> int:
    """Write the objects for tiers with these flags into a folder; return how many there are. ``known`` are those of all tiers."""
    kept = kept / f"warp-{wp.__version__}"
    kept.mkdir(parents=True, exist_ok=True)
    stems = {name: list(_stems(name, flags)) for name in kernel_modules()}
    missing = [name for name, of_tiers in stems.items() if not all(_is_there(kept / stem) for stem in of_tiers)]
    compile_missing = partial(_compile_missing, flags, kept)
    if len(missing) > 1:
        # New processes: what Warp has started does not survive a fork.
        with ProcessPoolExecutor(min(core_count(), len(missing)), mp_context=get_context("spawn")) as processes:
            list(processes.map(compile_missing, missing))
    else:
        list(map(compile_missing, missing))
    used = {stem for of_tiers in stems.values() for stem in of_tiers}
    for stem in used:
        for ending in ENDINGS:
            shutil.copyfile(kept / f"{stem}{ending}", folder / f"{stem}{ending}")
    # Of a module that was edited, what it was before.
    modules = {_module_of(stem) for stem in used}
    current = used | {stem for name in stems for stem in _stems(name, known)}
    for file in kept.iterdir():
        if file.suffix in ENDINGS and file.stem not in current and _module_of(file.stem) in modules:
            file.unlink(missing_ok=True)
    return len(used)


def _stems(name: str, flags: Iterable[str]) -> Iterator[str]:
    """Names of the files of a module's kernels, for each tier's flags, to which the module is set meanwhile; none without kernels."""
    importlib.import_module(name)
    module = wp.get_module(name)
    for tier_flags in flags if module.kernels else ():
        # The CPU's block has one thread.
        wp.set_module_options({"cpu_compiler_flags": tier_flags, "block_dim": 1}, module)
        module.mark_modified()
        yield stem_of(module)


def _is_there(stem: Path) -> bool:
    return all(stem.with_name(f"{stem.name}{ending}").is_file() for ending in ENDINGS)


def _compile_missing(flags: Iterable[str], kept: Path, name: str) -> None:
    """Compile a module for the tiers of which there are no files yet."""
    start_warp()
    for stem in _stems(name, flags):
        if not _is_there(kept / stem):
            _compile(wp.get_module(name), kept / stem)


def _module_of(stem: str) -> str:
    """The module whose files have this name, which ends in a hash of its kernels and options."""
    return stem.rpartition("_")[0]


def _compile(module: wp.Module, stem: Path) -> None:
    """Compile a module with the options that it has, into files of this name."""
    # Beside, then renamed: one that was cut off is never taken for the whole, not even by somebody who builds at the same time.
    with tempfile.TemporaryDirectory(dir=stem.parent) as temporary:
        wp.compile_aot_module(module, device="cpu", module_dir=temporary)
        for ending in ENDINGS:
            (made,) = Path(temporary).glob(f"*{ending}")
            os.replace(made, f"{stem}{ending}")


def main() -> int:
    """Build as the command line says; return the exit status."""
    parser = argparse.ArgumentParser(description="Compile the engine's kernels ahead of time.")
    parser.add_argument("folder", type=Path, help="where to put them; emptied first")
    parser.add_argument("--no-cpu", action="store_true", help="leave those for this system's processors out")
    parser.add_argument(
        "--gpus",
        type=int,
        nargs="*",
        choices=GENERATIONS,
        default=GENERATIONS,
        metavar="N",
        help="compute capabilities of the GPUs to compile for, times ten; default: all; without numbers none",
    )
    parser.add_argument(
        "--tiers",
        nargs="+",
        choices=[NATIVE, *TIERS],
        metavar="TIER",
        help=f"kinds of processors to compile for, of {', '.join(TIERS)}; {NATIVE}: the one of this machine; default: all",
    )
    arguments = parser.parse_args()
    count = build(arguments.folder, gpus=arguments.gpus, for_cpu=not arguments.no_cpu, tiers=arguments.tiers)
    size = sum(file.stat().st_size for file in arguments.folder.iterdir())
    print(f"{count} modules, {size / 1e6:.1f} MB in {arguments.folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
