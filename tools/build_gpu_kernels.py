"""Compile the engine's GPU kernels ahead of time, for every generation of GPUs; ``tools/build_kernels.py`` calls this.

No GPU is needed, and what is made on one system is for all of them (see ``engine/device/prebuilt_gpu_kernels.py``).
"""

from __future__ import annotations

import importlib
import io
import os
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import esh
import warp as wp
from esh.engine.device.devices import core_count
from esh.engine.device.gpu_launches import BLOCK_DIM
from esh.engine.device.prebuilt_gpu_kernels import archive_of, gpu_stem_of
from esh.engine.device.quiet_start import start_warp
from esh.engine.transforms import kernels_fft_gpu
from esh.engine.transforms.convolution import SHORTEST
from esh.engine.transforms.convolution_gpu import LONGEST_ROW

# Files with kernels that only the CPU has, some of them in a language that only its compiler knows.
CPU_ONLY = ("kernels_fft", "kernels_threads")
ENDINGS = (".cubin", ".meta")
# A row's length, or the name of a file with kernels.
Source = int | str


def sources() -> list[Source]:
    """All that there is to compile."""
    root = Path(esh.__file__).parent
    files = [file for file in sorted((root / "engine").rglob("kernels_*.py")) if file.stem not in CPU_ONLY]
    lengths: list[Source] = [1 << power for power in range(SHORTEST.bit_length() - 1, LONGEST_ROW.bit_length())]
    return [".".join(("esh", *file.relative_to(root).with_suffix("").parts)) for file in files] + lengths


def build(folder: Path, generations: Sequence[int], kept: Path) -> int:
    """Write an archive for every generation into a folder; return how many modules each holds.

    Args:
        folder: Where to put them.
        generations: Compute capabilities, times ten.
        kept: Where all modules stay for the next time, which then compiles only what has changed.
    """
    start_warp()
    stems = [stem for source in sources() for stem in _stems(source)]
    for generation in generations:
        own = kept / f"warp-{wp.__version__}" / f"sm{generation}"
        own.mkdir(parents=True, exist_ok=True)
        missing = [s for s in sources() if not all(_is_there(own / stem) for stem in _stems(s))]
        compile_missing = partial(_compile_missing, own, generation)
        if len(missing) > 1:
            # New processes: what Warp has started does not survive a fork.
            with ProcessPoolExecutor(min(core_count(), len(missing)), mp_context=get_context("spawn")) as processes:
                list(processes.map(compile_missing, missing))
        else:
            list(map(compile_missing, missing))
        _pack(folder / archive_of(generation), [own / f"{stem}{ending}" for stem in stems for ending in ENDINGS])
        for file in own.iterdir():
            if file.suffix in ENDINGS and file.stem not in stems:
                file.unlink(missing_ok=True)
    return len(stems)


def _module_of(source: Source) -> tuple[wp.Module, int]:
    """The module that a source is, and the threads that its kernels have in a block."""
    if isinstance(source, int):
        return kernels_fft_gpu.transforms_of(source).forward.module, kernels_fft_gpu.block_of(source)
    importlib.import_module(source)
    return wp.get_module(source), BLOCK_DIM


def _stems(source: Source) -> Iterator[str]:
    """The name of a source's files, if there are kernels in it."""
    module, block_dim = _module_of(source)
    if module.kernels:
        yield gpu_stem_of(module, block_dim)


def _is_there(stem: Path) -> bool:
    return all(stem.with_name(f"{stem.name}{ending}").is_file() for ending in ENDINGS)


def _compile_missing(kept: Path, generation: int, source: Source) -> None:
    """Compile a module for a generation."""
    start_warp()
    module, block_dim = _module_of(source)
    stem = kept / gpu_stem_of(module, block_dim)
    # As it is called, too; nothing but its name says how it was compiled for a CPU.
    wp.set_module_options({"block_dim": block_dim}, module)
    module.mark_modified()
    # Beside, then renamed: one that was cut off is never taken for the whole.
    with tempfile.TemporaryDirectory(dir=kept) as temporary:
        wp.compile_aot_module(module, arch=[generation], module_dir=temporary, use_ptx=False)
        for ending in ENDINGS:
            (made,) = Path(temporary).glob(f"*{ending}")
            os.replace(made, f"{stem}{ending}")


def _pack(archive: Path, files: Sequence[Path]) -> None:
    """Pack files into an archive, the same bytes for the same files."""
    with tarfile.open(archive, "w:xz", preset=9) as packed:
        for file in sorted(files):
            entry = tarfile.TarInfo(file.name)
            entry.size = file.stat().st_size
            packed.addfile(entry, io.BytesIO(file.read_bytes()))
