"""Compile the engine's CPU kernels ahead of time, for every tier of processors: ``python tools/build_kernels.py FOLDER``.

The extension's zip carries what this writes (see ``engine/device/prebuilt_kernels.py``). Objects can be made only on the system that
they are for.
"""

from __future__ import annotations

import argparse
import importlib
import json
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


def build(folder: Path) -> int:
    """Write objects and their index into a folder, which is emptied first; return how many there are."""
    wp.config.log_level = wp.LOG_WARNING
    wp.init()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    # Warp's own flags, but for another processor than this one.
    own = (wp.config.cpu_compiler_flags or "").replace("-march=native", "").strip()
    flags = {tier: f"-target-cpu {tier} {own}".strip() for tier in tiers_of_this_machine()}
    count = 0
    for name in kernel_modules():
        importlib.import_module(name)
        module = wp.get_module(name)
        if not module.kernels:
            continue
        for tier_flags in flags.values():
            # The CPU's block has one thread.
            wp.set_module_options({"cpu_compiler_flags": tier_flags, "block_dim": 1}, module)
            module.mark_modified()
            with tempfile.TemporaryDirectory() as temporary:
                wp.compile_aot_module(module, device="cpu", module_dir=temporary)
                (binary,) = Path(temporary).glob("*.o")
                (meta,) = Path(temporary).glob("*.meta")
                stem = folder / stem_of(module, "esh")
                shutil.copyfile(binary, f"{stem}.o")
                shutil.copyfile(meta, f"{stem}.meta")
            count += 1
    (folder / INDEX).write_text(json.dumps({"warp": wp.__version__, "flags": flags}, indent=1) + "\n", encoding="utf-8")
    return count


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
