"""GPU kernels that were compiled ahead of time are those that a launch asks for, and only on GPUs that can carry them out."""

from __future__ import annotations

import json
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
from esh.engine.device import prebuilt_gpu_kernels, prebuilt_kernels
from esh.engine.device.prebuilt_gpu_kernels import GENERATIONS, archive_of
from esh.engine.device.prebuilt_kernels import INDEX

ROOT = Path(__file__).resolve().parents[3]

# The folder, the generation, and what is compiled: everything, or some sources.
BUILD = """
import json, sys
sys.path.insert(0, "tools")
import build_gpu_kernels, build_kernels
from pathlib import Path

folder, generation, sources = Path(sys.argv[1]), int(sys.argv[2]), json.loads(sys.argv[3])
if sources:
    build_gpu_kernels.sources = lambda: sources
print(build_kernels.build(folder / "prebuilt", folder / "kept", [generation], for_cpu=False))
"""

# What a run looks for, in a process that has already asked for the CPU's kernels of the same modules.
NAMES = """
import sys
import warp as wp
from esh.engine.device.prebuilt_gpu_kernels import gpu_stem_of
from esh.engine.space import kernels_cells
from esh.engine.transforms import kernels_fft_gpu

modules = [(wp.get_module(kernels_cells.__name__), 256)]
transforms = kernels_fft_gpu.transforms_of(64)
modules.append((transforms.forward.module, kernels_fft_gpu.block_of(64)))
for module, block_dim in modules:
    wp.set_module_options({"cpu_compiler_flags": "-target-cpu x86-64-v2"}, module)
    before = module.get_module_hash(block_dim)
    print(gpu_stem_of(module, block_dim))
    assert module.get_module_hash(block_dim) == before
"""

# How many modules a run on a GPU compiles, of three sizes of meshes; the folder of the prebuilt ones.
SOLVE = """
import sys
from pathlib import Path
import esh
import warp._src.build
from esh.engine.device import prebuilt_kernels

prebuilt_kernels.FOLDER = Path(sys.argv[1])
compiled = []
build = warp._src.build.build_cuda
def count(source, *args, **settings):
    compiled.append(source)
    return build(source, *args, **settings)
warp._src.build.build_cuda = count
for bodies in (200, 5000, 60000):
    sizes = [esh.Size("s", 1e-4, bodies)]
    esh.solve(esh.Problem(esh.Domain((9.0, 7.0)), [esh.BodyClass("a", sizes)]), device="cuda:0", max_steps=5)
print(len(compiled))
"""


def build(folder: Path, generation: int, sources: list[str | int]) -> Path:
    """Compile sources, or all, for a generation of GPUs; return the folder that a zip would carry."""
    arguments = [sys.executable, "-c", BUILD, str(folder), str(generation), json.dumps(sources)]
    outcome = subprocess.run(arguments, capture_output=True, text=True, cwd=ROOT)
    assert outcome.returncode == 0, outcome.stderr[-2000:]
    return folder / "prebuilt"


@pytest.fixture(scope="module")
def ampere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sources, compiled for compute capability 8.0."""
    return build(tmp_path_factory.mktemp("kernels"), 80, ["esh.engine.space.kernels_cells", 64])


@pytest.fixture
def asked_anew(ampere: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    import warp as wp

    monkeypatch.setattr(prebuilt_kernels, "FOLDER", ampere)
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    prebuilt_gpu_kernels._unpacked.cache_clear()
    yield
    prebuilt_gpu_kernels._unpacked.cache_clear()


def test_a_run_looks_for_what_was_built(ampere: Path):
    outcome = subprocess.run([sys.executable, "-c", NAMES], capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr[-2000:]
    with tarfile.open(ampere / archive_of(80)) as archive:
        built = set(archive.getnames())
    assert built == {f"{stem}{ending}" for stem in outcome.stdout.split() for ending in (".cubin", ".meta")}
    assert len(built) == 4


@pytest.mark.usefixtures("asked_anew")
@pytest.mark.parametrize(("arch", "fits"), [(80, True), (86, True), (89, True), (75, False), (90, False), (120, False)])
def test_an_archive_is_for_gpus_of_its_generation(arch: int, fits: bool):
    found = prebuilt_gpu_kernels._unpacked(arch)
    assert (found is not None) == fits
    if found is not None:
        generation, folder = found
        assert generation == 80 and len(list(folder.iterdir())) == 4


@pytest.mark.usefixtures("asked_anew")
def test_an_archive_is_unpacked_once(tmp_path: Path):
    first = prebuilt_gpu_kernels._unpacked(86)
    assert first is not None
    (kept,) = tmp_path.iterdir()
    (kept / "mark").touch()
    prebuilt_gpu_kernels._unpacked.cache_clear()
    assert prebuilt_gpu_kernels._unpacked(80) == first and (kept / "mark").exists()


@pytest.mark.usefixtures("asked_anew")
@pytest.mark.parametrize("broken", ["cut off", "missing", "of another version", "no index"])
def test_what_cannot_be_read_is_compiled_instead(ampere: Path, tmp_path: Path, monkeypatch, broken: str):
    folder = tmp_path / "broken"
    folder.mkdir()
    for file in ampere.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    archive, index = folder / archive_of(80), folder / INDEX
    if broken == "cut off":
        archive.write_bytes(archive.read_bytes()[:-2000])
    elif broken == "missing":
        archive.unlink()
    elif broken == "of another version":
        index.write_text(json.dumps(json.loads(index.read_text()) | {"warp": "1.0"}))
    else:
        index.write_text("{")
    monkeypatch.setattr(prebuilt_kernels, "FOLDER", folder)
    assert prebuilt_gpu_kernels._unpacked(80) is None
    assert not [path for path in tmp_path.iterdir() if path != folder], "nothing is left half unpacked"


def test_all_kernels_are_compiled_that_a_gpu_may_be_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import build_gpu_kernels

    sources = build_gpu_kernels.sources()
    assert [source for source in sources if isinstance(source, int)] == [64 << k for k in range(9)]
    files = {file.stem for file in (ROOT / "engine").rglob("kernels_*.py")}
    named = {source.rpartition(".")[2] for source in sources if isinstance(source, str)}
    assert files - named == set(build_gpu_kernels.CPU_ONLY)


@pytest.mark.cuda
@pytest.mark.slow
def test_runs_on_a_gpu_compile_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    import warp as wp

    arch = wp.get_device("cuda:0").arch
    generation = max(own for own in GENERATIONS if own // 10 == arch // 10 and own <= arch)
    prebuilt = build(tmp_path, generation, [])
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path / "cache"))
    outcome = subprocess.run([sys.executable, "-c", SOLVE, prebuilt], capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr[-2000:]
    assert outcome.stdout.split()[-1] == "0"
