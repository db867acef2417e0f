"""CPU kernels that were compiled when the extension's zip was built, so that the first run waits for no compiler.

:mod:`.prebuilt_gpu_kernels` has those for GPUs.

A build puts them into the folder ``prebuilt`` beside this file (``tools/build_kernels.py``), once for every *tier* of processors: a
set of instructions that all processors of a generation have. A source checkout has no such folder, and a kernel that was edited since
has no file in it; Warp then compiles it at its first launch, as ever.
"""

from __future__ import annotations

import json
from collections.abc import Container
from functools import cache
from pathlib import Path
from typing import Any

import warp as wp

__all__ = [
    "FOLDER",
    "INDEX",
    "TIERS",
    "are_prebuilt",
    "load_prebuilt",
    "read_index",
    "set_compiler_flags",
    "stem_of",
    "tier_of_this_processor",
]

FOLDER = Path(__file__).parent / "prebuilt"
INDEX = "index.json"
# What LLVM calls the levels of x86-64 in its own processor names, best first, and the features that each asks for.
_V2 = {"cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"}
_V3 = _V2 | {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}
_V4 = _V3 | {"avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"}
TIERS: dict[str, frozenset[str]] = {
    "x86-64-v4": frozenset(_V4),
    "x86-64-v3": frozenset(_V3),
    "x86-64-v2": frozenset(_V2),
    # The first processor that macOS runs on with this instruction set.
    "apple-m1": frozenset({"neon", "fullfp16", "sha3"}),
}


def are_prebuilt() -> bool:
    """Tell whether there are prebuilt kernels for this processor."""
    return _compiler_flags() is not None


@cache
def load_prebuilt(module: wp.Module) -> bool:
    """Load a module's prebuilt kernels for the CPU, before its first launch there; False where there are none for it."""
    if not set_compiler_flags(module):
        return False
    binary = FOLDER / f"{stem_of(module)}.o"
    if not binary.is_file():
        return False
    module.load(wp.get_device("cpu"), 1, binary_path=binary, meta_path=binary.with_suffix(".meta"))
    return True


def set_compiler_flags(module: wp.Module) -> bool:
    """Set a module to the flags that it is prebuilt with for this processor; False where it is not.

    They are a part of the name that is looked for, and of what Warp knows a module by; one of which nothing is found is compiled with
    them, too.
    """
    flags = _compiler_flags()
    if flags is not None:
        wp.set_module_options({"cpu_compiler_flags": flags}, module)
    return flags is not None


def stem_of(module: wp.Module, block_dim: int = 1) -> str:
    """Name of a module's files: the same in whichever package the engine lies, and another after every edit.

    Args:
        module: The module.
        block_dim: Threads of a block: one on the CPU.
    """
    package = __name__.removesuffix(".engine.device.prebuilt_kernels")
    return str(module.get_module_identifier(block_dim)).removeprefix(f"wp_{package}.")


def read_index() -> dict[str, Any] | None:
    """What the build wrote down of the kernels; None where there are none for this version of Warp."""
    try:
        index = json.loads((FOLDER / INDEX).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return index if index.get("warp") == wp.__version__ else None


@cache
def _compiler_flags() -> str | None:
    """Compiler flags of the best tier that this processor belongs to; None where nothing is prebuilt for it."""
    index = read_index()
    tier = None if index is None else tier_of_this_processor(index["flags"])
    return None if index is None or tier is None else str(index["flags"][tier])


def tier_of_this_processor(tiers: Container[str] = TIERS) -> str | None:
    """The best of some tiers that this processor belongs to; None where it belongs to none of them."""
    features = _processor_features()
    return next((tier for tier, needed in TIERS.items() if tier in tiers and needed <= features), None)


def _processor_features() -> frozenset[str]:
    """What LLVM finds in this processor; nothing where Warp does not tell."""
    from warp._src import context

    try:
        return frozenset(context._get_cpu_feature_set())
    except AttributeError:
        return frozenset()
