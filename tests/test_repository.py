"""A static repository: added to a Blender, installed from, and updated from."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

if importlib.util.find_spec("bpy") is None:
    pytest.skip("needs Blender as a Python module", allow_module_level=True)

ROOT = Path(__file__).resolve().parent.parent
# What somebody does in Preferences, with the operators behind it.
USE = """
import json, sys, tomllib
from pathlib import Path
import bpy

first, second = sys.argv[1:]
preferences = bpy.context.preferences
preferences.system.use_online_access = True
repository = preferences.extensions.repos.new(name="Studio", module="studio", remote_url=first)
index = list(preferences.extensions.repos).index(repository)

def state():
    manifest = Path(repository.directory) / "esh_scatter" / "blender_manifest.toml"
    return {
        "version": tomllib.loads(manifest.read_text(encoding="utf-8"))["version"],
        "enabled": "bl_ext.studio.esh_scatter" in preferences.addons,
        "operators": "scatter" in dir(bpy.ops.esh),
    }

assert bpy.ops.extensions.repo_sync(repo_index=index) == {"FINISHED"}
assert bpy.ops.extensions.package_install(
    repo_index=index, pkg_id="esh_scatter", enable_on_install=True) == {"FINISHED"}
installed = state()
repository.remote_url = second
assert bpy.ops.extensions.repo_sync(repo_index=index) == {"FINISHED"}
assert bpy.ops.extensions.package_upgrade_all() == {"FINISHED"}
print("ANSWER " + json.dumps([installed, state()]))
"""


@pytest.fixture(scope="module")
def tools():
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        import build_extension
        import build_repository

        yield build_extension, build_repository
    finally:
        sys.path.remove(str(ROOT / "tools"))
        for name in ("build_extension", "build_repository"):
            sys.modules.pop(name, None)


def build_without_wheels(build_extension, folder: Path, version: str) -> None:
    """Build the zip of a version as the real one is built, but small."""
    platform = build_extension.current_platform()
    text = (ROOT / build_extension.MANIFEST).read_text(encoding="utf-8")
    text = build_extension.staged_manifest(text, platform, [])
    text = re.sub(r"(?m)^wheels = \[\s*\]$", "", text)
    text, changed = re.subn(r'(?m)^version = ".*"$', f'version = "{version}"', text)
    assert changed == 1
    with tempfile.TemporaryDirectory() as stage:
        (Path(stage) / build_extension.MANIFEST).write_text(text, encoding="utf-8")
        for name in build_extension.PACKAGE_CONTENT:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, Path(stage) / name)
        command = [sys.executable, build_extension.find_blender_builder(), "build", "--source-dir", stage]
        command += ["--output-filepath", folder / f"esh_scatter-{version}-{platform}.zip"]
        subprocess.run(command, check=True, capture_output=True)


def test_installing_and_updating_from_a_repository(tools, tmp_path):
    build_extension, build_repository = tools
    if build_extension.current_platform() is None:
        pytest.skip("the extension is not built for this machine")
    addresses = []
    for version in ("0.9.0", "0.10.0"):
        folder = tmp_path / version
        folder.mkdir()
        build_without_wheels(build_extension, folder, version)
        build_repository.generate(folder)
        listed = json.loads((folder / "index.json").read_text(encoding="utf-8"))["data"]
        assert [(entry["id"], entry["version"]) for entry in listed] == [("esh_scatter", version)]
        assert f"esh_scatter-{version}" in (folder / "index.html").read_text(encoding="utf-8")
        addresses.append((folder / "index.json").as_uri())
    resources = tmp_path / "blender"
    resources.mkdir()
    outcome = subprocess.run(
        [sys.executable, "-c", USE, *addresses],
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"BLENDER_USER_RESOURCES": str(resources)},
        check=False,
    )
    answers = [line for line in outcome.stdout.splitlines() if line.startswith("ANSWER ")]
    assert outcome.returncode == 0 and answers, outcome.stdout[-2000:] + outcome.stderr[-2000:]
    assert "Exception" not in outcome.stdout + outcome.stderr, outcome.stderr[-2000:]
    assert json.loads(answers[-1].removeprefix("ANSWER ")) == [
        {"version": "0.9.0", "enabled": True, "operators": True},
        {"version": "0.10.0", "enabled": True, "operators": True},
    ]


def test_zips_that_are_there_are_taken_and_those_of_other_versions_are_not(tools, tmp_path, monkeypatch, capsys):
    build_extension, build_repository = tools
    (tmp_path / "esh_scatter-0.0.1-linux-x64.zip").write_bytes(b"old")
    manifest = (ROOT / build_extension.MANIFEST).read_text(encoding="utf-8")
    version = re.search(r'(?m)^version = "(.*)"$', manifest)[1]
    (tmp_path / f"esh_scatter-{version}-windows-x64.zip").write_bytes(b"built elsewhere")
    built = []
    monkeypatch.setattr(build_repository, "build", lambda platform, *_: built.append(platform))
    monkeypatch.setattr(build_repository, "generate", lambda folder: None)
    monkeypatch.setattr("sys.argv", ["build_repository.py", "--output", str(tmp_path)])
    assert build_repository.main() == 0
    assert built == ["linux-x64", "macos-arm64"]
    assert [path.name for path in tmp_path.iterdir()] == [f"esh_scatter-{version}-windows-x64.zip"]
    capsys.readouterr()
    monkeypatch.setattr(build_repository, "build", _refuse(build_extension.BuildError))
    assert build_repository.main() == 1
    assert capsys.readouterr().err == "no wheel\n"


def _refuse(kind):
    def refuse(*_):
        raise kind("no wheel")

    return refuse
