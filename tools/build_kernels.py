"""Compile the engine's CPU kernels ahead of time, for every tier of processors: ``python tools/build_kernels.py FOLDER``.

The extension's zip carries what this writes (see ``engine/device/prebuilt_kernels.py``). Objects can be made only on the system that
they are for.
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
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import esh
import warp as wp
from esh.engine.device.devices import core_count
from esh.engine.device.prebuilt_kernels import INDEX, TIERS, stem_of
from esh.engine.device.quiet_start import start_warp

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


def build(folder: Path, kept: Path = KEPT) -> int:
    """Write objects and their index into a folder, which is emptied first; return how many there are.

    Args:
        folder: Where to put them.
        kept: Where all of them stay for the next time, which then compiles only what has changed.
    """
    start_warp()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    # Warp's own flags, but for another processor than this one.
    own = (wp.config.cpu_compiler_flags or "").replace("-march=native", "").strip()
    flags = {tier: f"-target-cpu {tier} {own}".strip() for tier in tiers_of_this_machine()}
    kept = kept / f"warp-{wp.__version__}"
    kept.mkdir(parents=True, exist_ok=True)
    stems = {name: list(_stems(name, flags.values())) for name in kernel_modules()}
    missing = [name for name, of_tiers in stems.items() if not all(_is_there(kept / stem) for stem in of_tiers)]
    compile_missing = partial(_compile_missing, list(flags.values()), kept)
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
    for file in kept.iterdir():
        if file.suffix in ENDINGS and file.stem not in used and _module_of(file.stem) in modules:
            file.unlink(missing_ok=True)
    (folder / INDEX).write_text(json.dumps({"warp": wp.__version__, "flags": flags}, indent=1) + "\n", encoding="utf-8")
    return len(used)


def _stems(name: str, flags: Iterable[str]) -> Iterator[str]:
    """Names of the files of a module's kernels, for each tier's flags, to which the module is set meanwhile; none without kernels."""
    importlib.import_module(name)
    module = wp.get_module(name)
    for tier_flags in flags if module.kernels else ():
        # The CPU's block has one thread.
        wp.set_module_options({"cpu_compiler_flags": tier_flags, "block_dim": 1}, module)
        module.mark_modified()
        yield stem_of(module, "esh")


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
    parser = argparse.ArgumentParser(description="Compile the engine's CPU kernels ahead of time.")
    parser.add_argument("folder", type=Path, help="where to put them; emptied first")
    folder = parser.parse_args().folder
    count = build(folder)
    size = sum(file.stat().st_size for file in folder.iterdir())
    print(f"{count} modules, {size / 1e6:.1f} MB in {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
