"""Having a GPU's kernels before they are launched: prebuilt ones, or all of them compiled at once, on all processors."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import warp as wp

from .devices import core_count
from .prebuilt_gpu_kernels import CPU_ONLY, load_prebuilt_on_gpu

__all__ = ["imported_gpu_modules", "prepare_gpu_kernels"]


@cache
def prepare_gpu_kernels(module: wp.Module, alias: str, block_dim: int) -> None:
    """Load or compile a module for a GPU, before its first launch there.

    Where one has to be compiled, others have to be, too: a run needs some thirty, which take a second or two each. They are compiled
    side by side.

    Args:
        module: The module.
        alias: Name of the GPU, ``"cuda:0"``.
        block_dim: Threads of a block.
    """
    if load_prebuilt_on_gpu(module, alias, block_dim):
        return
    if not (Path(wp.config.kernel_cache_dir) / module.get_module_identifier(block_dim)).is_dir():
        _compile_all(alias, block_dim)


@cache
def _compile_all(alias: str, block_dim: int) -> None:
    """Compile all modules with kernels for GPUs that have been imported; those that are compiled already are only loaded."""
    wp.force_load(alias, imported_gpu_modules(), block_dim, max_workers=core_count())


def imported_gpu_modules() -> list[wp.Module]:
    """Modules of this package with kernels for GPUs; without transforms, whose blocks have other sizes."""
    package = __name__.partition(".engine.")[0]
    names = [name for name in sys.modules if name.startswith(f"{package}.engine.")]
    files = [name for name in names if name.rpartition(".")[2].startswith("kernels_")]
    modules = [wp.get_module(name) for name in sorted(files) if name.rpartition(".")[2] not in CPU_ONLY]
    return [module for module in modules if module.kernels]
