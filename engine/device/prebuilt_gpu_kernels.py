"""GPU kernels that were compiled when the extension's zip was built, as :mod:`.prebuilt_kernels` are for the CPU.

There is an archive for each *generation* of GPUs: what is compiled for compute capability 8.0 also runs on 8.6 and 8.9. An archive is
unpacked into the folder of compiled kernels when a GPU of its generation is first used.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tarfile
import tempfile
from functools import cache
from pathlib import Path

import warp as wp

from . import prebuilt_kernels

__all__ = ["GENERATIONS", "archive_of", "are_prebuilt_for_gpus", "digest_of", "gpu_stem_of", "load_prebuilt_on_gpu"]

# Turing, Ampere (and Ada), Hopper, Blackwell for data centers and for all others: all that this version of Warp can compile for.
GENERATIONS = (75, 80, 90, 100, 120)


def are_prebuilt_for_gpus() -> bool:
    """Tell whether there are prebuilt kernels for GPUs."""
    return bool((prebuilt_kernels.read_index() or {}).get("gpus"))


def archive_of(generation: int) -> str:
    """Name of the file with a generation's kernels."""
    return f"gpu-sm{generation}.tar.xz"


def digest_of(archive: Path) -> str:
    """What the index says of an archive that is whole."""
    return hashlib.sha256(archive.read_bytes()).hexdigest()


@cache
def load_prebuilt_on_gpu(module: wp.Module, alias: str, block_dim: int) -> bool:
    """Load a module's prebuilt kernels before its first launch on a GPU; False where there are none for it.

    Args:
        module: The module.
        alias: Name of the GPU, ``"cuda:0"``.
        block_dim: Threads of a block.
    """
    device = wp.get_device(alias)
    found = _unpacked(device.arch)
    if found is None:
        return False
    generation, folder = found
    stem = gpu_stem_of(module, block_dim)
    binary = folder / f"{stem}.cubin"
    if not binary.is_file():
        return False
    # Set later, they would make another module of it, to be compiled anew.
    prebuilt_kernels.set_compiler_flags(module)
    try:
        module.load(
            device, block_dim, binary_path=binary, output_arch=generation, meta_path=binary.with_suffix(".meta")
        )
    except (
        Exception
    ):  # Warp raises nothing more special where a driver cannot read them; it compiles them for that driver then
        return False
    return True


def gpu_stem_of(module: wp.Module, block_dim: int) -> str:
    """Name of a module's files for GPUs: what :func:`.prebuilt_kernels.stem_of` returns, without what only matters to CPUs."""
    flags = module.options["cpu_compiler_flags"]
    wp.set_module_options({"cpu_compiler_flags": ""}, module)
    module.mark_modified()
    try:
        return prebuilt_kernels.stem_of(module, block_dim)
    finally:
        wp.set_module_options({"cpu_compiler_flags": flags}, module)
        module.mark_modified()


@cache
def _unpacked(arch: int) -> tuple[int, Path] | None:
    """The generation that a GPU of a compute capability is of, and the folder of its kernels; None where there are none for it."""
    digests = {int(own): digest for own, digest in (prebuilt_kernels.read_index() or {}).get("gpus", {}).items()}
    fitting = [own for own in digests if own // 10 == arch // 10 and own <= arch]
    if not fitting:
        return None
    generation = max(fitting)
    archive, digest = prebuilt_kernels.FOLDER / archive_of(generation), digests[generation]
    folder = Path(wp.config.kernel_cache_dir) / f"esh-scatter-sm{generation}-{digest[:16]}"
    try:
        if not folder.is_dir() and digest_of(archive) == digest:
            # Beside, then renamed: another process may be doing the same.
            with tempfile.TemporaryDirectory(dir=folder.parent) as beside, tarfile.open(archive) as packed:
                whole = Path(beside) / "kernels"
                packed.extractall(whole, filter="data")
                with contextlib.suppress(OSError):
                    os.rename(whole, folder)
    except (OSError, tarfile.TarError):
        return None
    return (generation, folder) if folder.is_dir() else None
