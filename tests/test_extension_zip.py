"""The zip as users get it: built, installed into a Blender that has nothing else, used from a script, and removed.

The environment in which it runs holds ``bpy`` with what ``bpy`` itself requires, and no more: neither the package ``esh``
nor anything that only pip's installation of it brings along. It is made of links into the environment of the tests.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import re
import subprocess
import sys
import tomllib
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from esh.engine.device.prebuilt_kernels import INDEX, TIERS
from packaging.requirements import Requirement

if importlib.util.find_spec("bpy") is None:
    pytest.skip("needs Blender as a Python module", allow_module_level=True)

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent
MODULE = "bl_ext.user_default.esh_scatter"

ENABLE = """
import json, os, sys
from importlib.util import find_spec
import bpy
import addon_utils

def state():
    return {
        "types": sorted(name for name in dir(bpy.types) if name.startswith(("ESH_", "Esh", "esh_"))),
        "operators": sorted(dir(bpy.ops.esh)),
        "properties": {
            cls.__name__: sorted(cls.bl_rna.properties.keys())
            for cls in (bpy.types.Scene, bpy.types.Object, bpy.types.Collection, bpy.types.WindowManager)
        },
        "handlers": {name: len(getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers)
                     if isinstance(getattr(bpy.app.handlers, name), list)},
        "keymaps": sum(len(keymap.keymap_items) for keymap in bpy.context.window_manager.keyconfigs.addon.keymaps)
        if bpy.context.window_manager.keyconfigs.addon else 0,
    }

def answer(**values):
    print("ANSWER " + json.dumps(values))
"""


def required_distributions(name: str) -> set[str]:
    """Return the names of a distribution and of everything that it requires, in turn."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        distribution = importlib.metadata.distribution(waiting.pop())
        key = distribution.metadata["Name"]
        if key in found:
            continue
        found.add(key)
        for requirement in map(Requirement, distribution.requires or []):
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                waiting.append(requirement.name)
    return found


@pytest.fixture(scope="module")
def zip_path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip of this machine's platform, built as `make extension` builds it.

    Compressing takes most of its time: where no test that looks at the zip itself is run, it is left out.
    """
    folder = tmp_path_factory.mktemp("dist")
    here = [item for item in request.session.items if item.path == request.path]
    compressed = any(item.get_closest_marker("once") for item in here)
    stored = "repack = b.repack; b.repack = lambda old, new, method: repack(old, new, b.zipfile.ZIP_STORED); "
    script = (
        "import sys; sys.path.insert(0, 'tools'); import build_extension as b; "
        f"{'' if compressed else stored}sys.exit(b.main())"
    )
    # Without kernels for GPUs and for other processors: tests/engine/device/test_prebuilt_gpu_kernels.py and test_prebuilt_kernels.py
    # compile some.
    command = [sys.executable, "-c", script, "--gpus", "--tiers", "native", "--output", folder]
    outcome = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert outcome.returncode == 0, outcome.stderr
    (path,) = folder.glob("*.zip")
    return path


@pytest.fixture(scope="module")
def bare_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python that has bpy and what bpy requires, and nothing else."""
    folder = tmp_path_factory.mktemp("bare")
    venv.EnvBuilder(with_pip=False, symlinks=True).create(folder)
    (target,) = folder.glob("lib/python*/site-packages")
    for name in required_distributions("bpy"):
        distribution = importlib.metadata.distribution(name)
        tops = {file.parts[0] for file in distribution.files or [] if file.parts[0] not in {"..", "__pycache__"}}
        for top in tops:
            (target / top).symlink_to(distribution.locate_file(top))
    return folder / "bin" / "python"


@pytest.fixture(scope="module")
def run_in_blender(bare_python: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict]:
    """Run a script in a new process of the bare Blender; all of them share one folder of settings and extensions."""
    folder = tmp_path_factory.mktemp("blender")
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["BLENDER_USER_RESOURCES"] = str(folder)
    # What Blender 4.5 takes relative paths from.
    environment["PWD"] = str(folder)

    def run(script: str) -> dict:
        command = [bare_python, "-c", ENABLE + script]
        outcome = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=folder, timeout=600)
        answers = [line for line in outcome.stdout.splitlines() if line.startswith("ANSWER ")]
        assert outcome.returncode == 0 and answers, outcome.stdout[-3000:] + outcome.stderr[-3000:]
        return json.loads(answers[-1].removeprefix("ANSWER "))

    return run


@pytest.fixture(scope="module")
def installed(zip_path: Path, run_in_blender: Callable[[str], dict]) -> dict:
    """Install the zip as a user does, once; what the process that did it saw."""
    return run_in_blender(
        f"""
before = state()
outcome = bpy.ops.extensions.package_install_files(
    filepath={str(zip_path)!r}, repo="user_default", enable_on_install=True, overwrite=True)
answer(outcome=list(outcome), before=before, after=state(), loaded={MODULE!r} in sys.modules,
       enabled={MODULE!r} in bpy.context.preferences.addons, warp="warp" in sys.modules,
       warnings=addon_utils._extensions_warnings_get())
"""
    )


@pytest.mark.once
def test_the_zip_holds_the_package_and_its_wheels_only(zip_path: Path):
    with zipfile.ZipFile(zip_path) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    sources = {
        path.relative_to(ROOT).as_posix()
        for folder in ("engine", "esh_scatter")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and not {"__pycache__", "fonts"} & set(path.parts)
    }
    wheels = {wheel.removeprefix("./") for wheel in manifest["wheels"]}
    prebuilt = {name for name in names if name.startswith("engine/device/prebuilt/")}
    assert {Path(name).suffix for name in prebuilt} == {".o", ".meta", ".json"}
    assert names - prebuilt == {"blender_manifest.toml", "__init__.py", "LICENSE", *sources, *wheels}
    assert [len(manifest["platforms"]), len(wheels)] == [1, 2]
    assert zip_path.name == f"esh_scatter-{manifest['version']}-{manifest['platforms'][0]}.zip"


@pytest.mark.once
def test_wheels_are_compressed_once_and_their_files_are_as_they_were(zip_path: Path, tmp_path: Path):
    """Blender unpacks them whenever the extension is enabled; of a compressed Warp that takes more than a second."""
    with zipfile.ZipFile(zip_path) as archive:
        wheels = [name for name in archive.namelist() if name.endswith(".whl")]
        assert all(archive.getinfo(name).compress_type == zipfile.ZIP_DEFLATED for name in wheels)
        for name in wheels:
            kept = ROOT / "build" / "wheels" / Path(name).name
            with zipfile.ZipFile(archive.extract(name, tmp_path)) as wheel, zipfile.ZipFile(kept) as published:
                assert {entry.compress_type for entry in wheel.infolist()} == {zipfile.ZIP_STORED}
                files = [
                    [(one.filename, one.CRC, one.file_size) for one in zip_.infolist()] for zip_ in (wheel, published)
                ]
                assert files[0] == files[1]
                assert wheel.testzip() is None


@pytest.mark.once
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the page has the sizes of the zip for Linux")
def test_the_page_says_how_large_the_zip_is_and_what_is_in_it(zip_path: Path):
    page = (ROOT / "docs" / "distribution.md").read_text(encoding="utf-8")
    (whole,) = re.findall(r"The zip for Linux takes ([\d.]+) MB", page)
    ((trimesh, own, kernels),) = re.findall(
        r"`trimesh` takes ([\d.]+) MB, the extension itself ([\d.]+) MB, and its compiled CPU kernels ([\d.]+) MB", page
    )
    sizes = dict.fromkeys(("trimesh", "warp", "kernels", "own"), 0)
    with zipfile.ZipFile(zip_path) as archive:
        for entry in archive.infolist():
            name = entry.filename
            kinds = {"trimesh": "/trimesh-", "warp": "/warp_lang-", "kernels": "/prebuilt/"}
            kind = next((kind for kind, part in kinds.items() if part in name), "own")
            sizes[kind] += entry.compress_size
        index = json.loads(archive.read(f"engine/device/prebuilt/{INDEX}"))
    # This zip was built for one of the three kinds of processors, and without kernels for GPUs.
    others = (sum(tier.startswith("x86") for tier in TIERS) / len(index["flags"]) - 1.0) * sizes["kernels"]
    sizes["kernels"] += others
    (of_generation,) = re.findall(r"Those for GPUs take ([\d.]+) MB for each of five\s+generations", page)
    said = {"trimesh": trimesh, "kernels": kernels, "own": own}
    for kind, megabytes in said.items():
        assert sizes[kind] / 1e6 == pytest.approx(float(megabytes), rel=0.25), kind
    size = (zip_path.stat().st_size + others) / 1e6 + 5 * float(of_generation)
    assert size == pytest.approx(float(whole), rel=0.02)


def test_blenders_own_check_accepts_the_zip(zip_path: Path):
    spec = importlib.util.find_spec("bpy")
    (builder,) = Path(spec.submodule_search_locations[0]).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    outcome = subprocess.run([sys.executable, builder, "validate", zip_path], capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stdout


def test_installing_registers_without_starting_warp(installed: dict):
    assert installed["outcome"] == ["FINISHED"]
    assert installed["loaded"] and installed["enabled"]
    assert not installed["warp"]
    assert not installed["before"]["types"] and not installed["before"]["operators"]
    assert any(name.startswith("ESH_PT_") for name in installed["after"]["types"])
    assert "scatter" in installed["after"]["operators"]
    before, after = installed["before"]["handlers"], installed["after"]["handlers"]
    # What older versions saved is brought up to date when it is opened or appended, presets that are dropped are noticed as they are
    # appended, and painted images are packed before a file is saved; nothing else is called.
    added = {name: count - before[name] for name, count in after.items() if count != before[name]}
    assert added == {"load_post": 1, "blend_import_post": 2, "save_pre": 1}


def test_installing_breaks_no_policy_of_blender(installed: dict):
    assert installed["warnings"] == {}


def test_the_installed_extension_scatters_with_its_own_wheels(installed: dict, run_in_blender: Callable[[str], dict]):
    seen = run_in_blender(
        f"""
addon_utils.enable({MODULE!r})
from bl_ext.user_default import esh_scatter as esh

bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=10)
ground = bpy.context.object
bpy.ops.mesh.primitive_cone_add(radius1=0.1, depth=0.5)
tree = bpy.context.object
classes = [
    esh.ScatterClass(
        "pine", [esh.ScatterSize("large", 20, tree, 0.5), esh.ScatterSize("small", 60, tree, 0.1)], density=1.0),
    esh.ScatterClass("beech", [esh.ScatterSize("only", 30, tree, 0.2)], density=1.0),
]
result = esh.scatter(ground, classes, seed=3, device="cpu", max_steps=20)
scattered = result.object.evaluated_get(bpy.context.evaluated_depsgraph_get())
heights = [vertex.co.z for vertex in result.object.data.vertices]
instances = sum(1 for entry in bpy.context.evaluated_depsgraph_get().object_instances if entry.is_instance)
import trimesh, warp
addon_utils._is_first_reset()
answer(points=len(heights), height=max(map(abs, heights)), instances=instances,
       placed=[size.placed for entry in result.report.classes for size in entry.sizes],
       absent=[name for name in ("PIL", "matplotlib", "rich", "scipy", "esh") if find_spec(name)],
       wheels=[os.path.realpath(module.__file__) for module in (trimesh, warp)],
       folder=os.path.realpath(os.environ["BLENDER_USER_RESOURCES"]), warnings=addon_utils._extensions_warnings_get())
"""
    )
    assert seen["absent"] == []
    assert all(path.startswith(seen["folder"]) for path in seen["wheels"])
    assert seen["placed"] == [20, 60, 30]
    assert seen["points"] == seen["instances"] == 110
    assert seen["height"] < 1e-5
    assert seen["warnings"] == {}


@pytest.mark.once
def test_the_first_run_of_the_extension_waits_for_no_compiler(
    installed: dict, run_in_blender: Callable[[str], dict], tmp_path: Path
):
    seen = run_in_blender(
        f"""
os.environ["WARP_CACHE_PATH"] = {str(tmp_path)!r}
addon_utils.enable({MODULE!r})
from bl_ext.user_default import esh_scatter as esh
import warp._src.build

def refuse(output, source, *args, **settings):
    raise RuntimeError("compiles " + source)

warp._src.build.build_cpu = refuse
bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=10)
ground = bpy.context.object
bpy.ops.mesh.primitive_cone_add(radius1=0.1, depth=0.5)
tree = bpy.context.object
bpy.ops.mesh.primitive_cube_add(size=0.1)
log = bpy.context.object
log.scale = (4, 1, 1)
classes = [
    esh.ScatterClass("pine", [esh.ScatterSize("all", 40, tree, 0.1)], density=esh.ImageDensity(
        bpy.data.images.new("density", 16, 16))),
    esh.ScatterClass("log", [esh.ScatterSize("all", 20, log)], density=1.0),
]
bpy.data.images["density"].generated_type = "COLOR_GRID"
result = esh.scatter(ground, classes, device="cpu", max_steps=5, avoid_overlap=True)
answer(placed=[size.placed for entry in result.report.classes for size in entry.sizes])
"""
    )
    assert seen["placed"] == [40, 20]


def test_the_first_script_of_the_documents_runs_in_the_installed_extension(
    installed: dict, run_in_blender: Callable[[str], dict]
):
    page = (ROOT / "docs" / "scripts.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    # The first script. One line differs: the comment beside it says what it is here.
    script = next(block for block in blocks if "bpy" in block)
    script, lines = re.subn(r"(?m)^import esh  # .*: (from bl_ext\..* import esh_scatter as esh)$", r"\1", script)
    assert lines == 1
    seen = run_in_blender(
        f"""
addon_utils.enable({MODULE!r})
{script}
answer(placed=[size.placed for entry in result.report.classes for size in entry.sizes], module=esh.__name__,
       absent=find_spec("esh") is None, saved=os.path.getsize("scattered.blend"),
       missing=[name for name in esh.__all__
                if getattr(esh, name, None) is None])
"""
    )
    assert seen["placed"] == [150, 300]
    assert seen["module"] == MODULE and seen["absent"]
    assert seen["saved"] > 10_000
    assert seen["missing"] == []


def test_disabling_leaves_nothing_and_enabling_again_works(
    installed: dict, run_in_blender: Callable[[str], dict], slowness: Callable[[], float]
):
    seen = run_in_blender(
        f"""
before = state()
addon_utils.enable({MODULE!r})
enabled = state()
addon_utils.disable({MODULE!r})
disabled = state()
addon_utils.enable({MODULE!r})
again, took = state(), []
import time
for switch in (addon_utils.disable, addon_utils.enable):
    start = time.process_time()
    # Blender unpacks all wheels when an extension is enabled, which is not this one's time.
    switch({MODULE!r}, refresh_handled=True)
    took.append(time.process_time() - start)
answer(before=before, enabled=enabled, disabled=disabled, again=again, took=took)
"""
    )
    # Both took seconds once.
    assert max(seen["took"]) < 0.25 * slowness()
    assert seen["disabled"] == seen["before"] != seen["enabled"]
    assert seen["again"] == seen["enabled"]
