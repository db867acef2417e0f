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
from pathlib import Path

import esh
import warp as wp
from esh.engine.device.prebuilt_kernels import INDEX, TIERS, stem_of

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
    wp.config.log_level = wp.LOG_WARNING
    wp.init()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    # Warp's own flags, but for another processor than this one.
    own = (wp.config.cpu_compiler_flags or "").replace("-march=native", "").strip()
    flags = {tier: f"-target-cpu {tier} {own}".strip() for tier in tiers_of_this_machine()}
    kept = kept / f"warp-{wp.__version__}"
    kept.mkdir(parents=True, exist_ok=True)
    used: set[str] = set()
    for name in kernel_modules():
        importlib.import_module(name)
        module = wp.get_module(name)
        if not module.kernels:
            continue
        for tier_flags in flags.values():
            # The CPU's block has one thread.
            wp.set_module_options({"cpu_compiler_flags": tier_flags, "block_dim": 1}, module)
            module.mark_modified()
            stem = stem_of(module, "esh")
            if not all((kept / f"{stem}{ending}").is_file() for ending in ENDINGS):
                _compile(module, kept / stem)
            for ending in ENDINGS:
                shutil.copyfile(kept / f"{stem}{ending}", folder / f"{stem}{ending}")
            used.add(stem)
    # Of a module that was edited, what it was before.
    modules = {_module_of(stem) for stem in used}
    for file in kept.iterdir():
        if file.suffix in ENDINGS and file.stem not in used and _module_of(file.stem) in modules:
            file.unlink(missing_ok=True)
    (folder / INDEX).write_text(json.dumps({"warp": wp.__version__, "flags": flags}, indent=1) + "\n", encoding="utf-8")
    return len(used)


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
