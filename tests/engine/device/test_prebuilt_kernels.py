"""Kernels that were compiled ahead of time are those that a launch asks for, and only on processors that can carry them out."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from esh.engine.device import prebuilt_kernels
from esh.engine.device.prebuilt_kernels import INDEX, TIERS
from esh.engine.device.quiet_start import start_warp

ROOT = Path(__file__).resolve().parents[3]

SOLVE = """
import sys
from pathlib import Path
import esh
import warp as wp
from esh.engine.device import prebuilt_kernels
import warp._src.build

prebuilt_kernels.FOLDER = Path(sys.argv[1])
compiled = []
build = warp._src.build.build_cpu
def count(output, source, *args, **settings):
    compiled.append(source)
    return build(output, source, *args, **settings)
warp._src.build.build_cpu = count
from esh.engine.device.threads import ticks
first, second = ticks(), ticks()
assert second > first
print(len(compiled))
"""


@pytest.fixture(autouse=True)
def asked_anew():
    prebuilt_kernels._compiler_flags.cache_clear()
    yield
    prebuilt_kernels._compiler_flags.cache_clear()


def build(folder: Path, kept: Path, before: str = "pass", settings: str = "") -> None:
    """Build one module, the one that every run on the CPU begins with, for all tiers unless settings say for which."""
    script = (
        "import sys; sys.path.insert(0, 'tools'); import build_kernels as b; from pathlib import Path; "
        "b.kernel_modules = lambda: ['esh.engine.device.kernels_threads']; "
        f"{before}; print(b.build(*map(Path, sys.argv[1:]), {settings}))"
    )
    outcome = subprocess.run([sys.executable, "-c", script, folder, kept], capture_output=True, text=True, cwd=ROOT)
    assert outcome.returncode == 0, outcome.stderr[-2000:]


@pytest.fixture(scope="module")
def prebuilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What :func:`build` makes."""
    folder = tmp_path_factory.mktemp("kernels")
    build(folder / "prebuilt", folder / "kept")
    if not json.loads((folder / "prebuilt" / INDEX).read_text())["flags"]:
        pytest.skip("nothing is built ahead of time for this kind of processor")
    return folder / "prebuilt"


def compiled_with(folder: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many modules a new process with an empty cache compiles."""
    monkeypatch.setenv("WARP_CACHE_PATH", str(cache))
    outcome = subprocess.run([sys.executable, "-c", SOLVE, folder], capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr[-2000:]
    return int(outcome.stdout.splitlines()[-1])


def test_what_is_prebuilt_is_not_compiled(prebuilt: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert compiled_with(prebuilt, tmp_path / "with", monkeypatch) == 0
    assert compiled_with(tmp_path / "nothing", tmp_path / "without", monkeypatch) == 1


def test_what_was_built_is_kept_for_the_next_time(prebuilt: Path, tmp_path: Path):
    kept = prebuilt.parent / "kept"
    (version,) = kept.iterdir()
    (old, *_) = [file for file in version.iterdir() if file.suffix == ".o"]
    edited = version / f"{old.stem.rpartition('_')[0]}_0000000.o"
    other = version / "engine.device.kernels_others_0000000.o"
    edited.touch()
    other.touch()
    build(tmp_path / "again", kept, "b.wp.compile_aot_module = None")
    assert {f.name: f.read_bytes() for f in (tmp_path / "again").iterdir()} == {
        f.name: f.read_bytes() for f in prebuilt.iterdir()
    }
    assert not edited.exists() and other.exists()


def test_kernels_for_this_processor_alone_are_those_that_it_would_take_of_all(prebuilt: Path, tmp_path: Path):
    kept = prebuilt.parent / "kept"
    (version,) = kept.iterdir()
    before = {file.name for file in version.iterdir()}
    build(tmp_path / "native", kept, "b.wp.compile_aot_module = None", "tiers=['native']")
    flags, of_all = (json.loads((folder / INDEX).read_text())["flags"] for folder in (tmp_path / "native", prebuilt))
    start_warp()
    tier = prebuilt_kernels.tier_of_this_processor(of_all)
    assert flags == {tier: of_all[tier]}
    (made,) = (tmp_path / "native").glob("*.o")
    assert made.read_bytes() == (prebuilt / made.name).read_bytes()
    assert {file.name for file in version.iterdir()} == before, "those of others are kept, too"


def test_an_edited_kernel_is_compiled(prebuilt: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    edited = tmp_path / "edited"
    edited.mkdir()
    for file in prebuilt.iterdir():
        stem, _, rest = file.name.rpartition("_")
        name = file.name if file.name == INDEX else f"{stem}_0000000.{rest.partition('.')[2]}"
        (edited / name).write_bytes(file.read_bytes())
    assert compiled_with(edited, tmp_path / "cache", monkeypatch) == 1


def write_index(folder: Path, warp: str) -> None:
    (folder / INDEX).write_text(json.dumps({"warp": warp, "flags": {tier: f"for {tier}" for tier in TIERS}}))


def test_the_best_tier_that_the_processor_belongs_to_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    import warp as wp

    write_index(tmp_path, wp.__version__)
    monkeypatch.setattr(prebuilt_kernels, "FOLDER", tmp_path)
    for features, expected in (
        (TIERS["x86-64-v4"] | {"amx-tile"}, "for x86-64-v4"),
        (TIERS["x86-64-v4"] - {"avx512vl"}, "for x86-64-v3"),
        (TIERS["x86-64-v3"] - {"fma"}, "for x86-64-v2"),
        (frozenset({"sse3"}), None),
        (frozenset(), None),
    ):
        monkeypatch.setattr(prebuilt_kernels, "_processor_features", lambda features=features: frozenset(features))
        prebuilt_kernels._compiler_flags.cache_clear()
        assert prebuilt_kernels._compiler_flags() == expected


def test_another_version_of_warp_compiles_for_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_index(tmp_path, "1.18.0")
    monkeypatch.setattr(prebuilt_kernels, "FOLDER", tmp_path)
    assert prebuilt_kernels._compiler_flags() is None
    (tmp_path / INDEX).write_text("{ cut of")
    prebuilt_kernels._compiler_flags.cache_clear()
    assert prebuilt_kernels._compiler_flags() is None


def test_a_wheel_for_this_system_brings_its_kernels(prebuilt: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import build_wheel

    # What is in the wheel for all systems, less what this does not need.
    general = tmp_path / "esh_scatter-0.0.1-py3-none-any.whl"
    about = "esh_scatter-0.0.1.dist-info"
    with zipfile.ZipFile(general, "w") as file:
        for source in [ROOT / "__init__.py", *sorted((ROOT / "engine").rglob("*.py"))]:
            file.write(source, f"esh/{source.relative_to(ROOT).as_posix()}")
        file.writestr(f"{about}/METADATA", "Metadata-Version: 2.1\nName: esh-scatter\nVersion: 0.0.1\n")
        file.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        file.writestr(f"{about}/RECORD", "")
    wheel = build_wheel.with_kernels(general, prebuilt, build_wheel.platform_of_warp())
    assert wheel.name != general.name
    # Pip checks that the tag fits this system, and the hashes of all files.
    place = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-compile"]
    outcome = subprocess.run([*pip, "--target", place, wheel], capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr[-2000:]
    kept = {file.name for file in (place / "esh/engine/device/prebuilt").iterdir()}
    assert kept == {file.name for file in prebuilt.iterdir()}
    with zipfile.ZipFile(wheel) as file:
        listed = {line.split(",")[0] for line in file.read(f"{about}/RECORD").decode().splitlines()}
        assert listed == set(file.namelist())
    monkeypatch.setenv("PYTHONPATH", str(place))
    assert compiled_with(place / "esh/engine/device/prebuilt", tmp_path / "cache", monkeypatch) == 0
