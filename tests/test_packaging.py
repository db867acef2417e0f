"""The files that describe the package agree with each other and with what is there."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from packaging.requirements import Requirement
from packaging.utils import parse_wheel_filename

ROOT = Path(__file__).resolve().parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
MANIFEST_TEXT = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
MANIFEST = tomllib.loads(MANIFEST_TEXT)


@pytest.fixture(scope="module")
def build_extension() -> ModuleType:
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "tools" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def committed_files() -> list[Path]:
    if not shutil.which("git") or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def test_versions_agree():
    version = PYPROJECT["project"]["version"]
    source = (ROOT / "engine" / "version.py").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d[^]]*)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert MANIFEST["version"] == version
    assert re.findall(r'^__version__ = "(.*)"$', source, re.MULTILINE) == [version]
    assert released[0] == version


def test_the_citation_is_of_this_version_and_license():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", text, re.MULTILINE) == [PYPROJECT["project"]["version"]]
    assert re.findall(r"^license: (.*)$", text, re.MULTILINE) == [PYPROJECT["project"]["license"]]
    (date,) = re.findall(r"^date-released: (.*)$", text, re.MULTILINE)
    assert f"## [{PYPROJECT['project']['version']}] - {date}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_licenses_agree():
    assert MANIFEST["license"] == [f"SPDX:{PYPROJECT['project']['license']}"]
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "GNU GENERAL PUBLIC LICENSE" in text and "Version 3, 29 June 2007" in text
    assert "END OF TERMS AND CONDITIONS" in text


def test_every_package_is_listed_for_pip():
    packages = {"esh"}
    for top in ("engine", "esh_scatter"):
        packages |= {
            ".".join(("esh", *path.parent.relative_to(ROOT).parts)) for path in (ROOT / top).rglob("__init__.py")
        }
        for path in (ROOT / top).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), f"{path.parent} is no package: pip would leave it out"
    assert set(PYPROJECT["tool"]["setuptools"]["packages"]) == packages


def test_files_that_are_no_modules_are_shipped_by_pip():
    shipped = {
        path
        for package, patterns in PYPROJECT["tool"]["setuptools"]["package-data"].items()
        for pattern in patterns
        for path in ROOT.joinpath(*package.split(".")[1:]).glob(pattern)
    }
    there = {
        path
        for top in ("engine", "esh_scatter")
        for path in (ROOT / top).rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    }
    assert shipped == there | {ROOT / "py.typed"}


def test_bundled_wheels_satisfy_the_requirements_of_pip():
    required = {r.name: r.specifier for r in map(Requirement, PYPROJECT["project"]["dependencies"])}
    bundled = {
        name: version for name, version, _, _ in (parse_wheel_filename(Path(w).name) for w in MANIFEST["wheels"])
    }
    assert set(bundled) == {"trimesh", "warp-lang"}
    for name, version in bundled.items():
        assert version in required[name]


def test_every_platform_has_one_wheel_of_each_kind(build_extension: ModuleType):
    used = set()
    for platform in MANIFEST["platforms"]:
        wheels = [wheel for wheel in MANIFEST["wheels"] if build_extension.is_wheel_for(wheel, platform)]
        assert sorted(Path(wheel).name.split("-")[0] for wheel in wheels) == ["trimesh", "warp_lang"]
        used.update(wheels)
    assert used == set(MANIFEST["wheels"])
    assert set(build_extension.WHEEL_TAGS) == set(MANIFEST["platforms"])


def test_a_staged_manifest_differs_in_platform_and_wheels_only(build_extension: ModuleType):
    staged = tomllib.loads(build_extension.staged_manifest(MANIFEST_TEXT, "windows-x64", ["./wheels/a.whl"]))
    assert staged == MANIFEST | {"platforms": ["windows-x64"], "wheels": ["./wheels/a.whl"]}


def test_what_is_staged_is_what_the_manifest_lets_in(build_extension: ModuleType):
    allowed = {
        pattern.removeprefix("!/") for pattern in MANIFEST["build"]["paths_exclude_pattern"] if pattern[0] == "!"
    }
    assert allowed == set(build_extension.PACKAGE_CONTENT)
    refused = {
        pattern.strip("/") for pattern in MANIFEST["build"]["paths_exclude_pattern"] if re.match(r"/\w", pattern)
    }
    assert refused == set(build_extension.LEFT_OUT)


def test_an_unknown_platform_is_refused_in_one_sentence(build_extension: ModuleType, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["build_extension.py", "--platform", "amiga"])
    assert build_extension.main() == 2
    message = capsys.readouterr().err
    assert "amiga" in message and all(platform in message for platform in MANIFEST["platforms"])


def test_the_oldest_blender_is_the_one_that_is_tested():
    oldest = ".".join(MANIFEST["blender_version_min"].split(".")[:2])
    assert any(f"bpy=={oldest}.*" in entry for entry in PYPROJECT["project"]["optional-dependencies"]["blender-oldest"])


def test_workflows_run_what_is_there():
    yaml = pytest.importorskip("yaml")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    extras = PYPROJECT["project"]["optional-dependencies"]
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        jobs = yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"]
        commands = "\n".join(step.get("run", "") for job in jobs.values() for step in job["steps"])
        assert commands
        for target in re.findall(r"^make (\w+)", commands, re.MULTILINE):
            assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"{path.name}: make {target}"
        for extra in ",".join(re.findall(r"\.\[([\w,-]+)\]", commands)).split(","):
            assert not extra or extra in extras, f"{path.name}: {extra}"
        for file in re.findall(r"\b(?:tests|tools)/[\w./]+", commands):
            assert (ROOT / file).exists(), f"{path.name}: {file}"
        for system in re.findall(r"PLATFORM=(\S+)", commands):
            assert system in MANIFEST["platforms"]
    # The citation is YAML, too.
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["cff-version"] == "1.2.0"


def test_types_are_checked_everywhere_but_in_kernels():
    exempt = {
        name
        for override in PYPROJECT["tool"]["mypy"]["overrides"]
        if "ignore_missing_imports" not in override
        for name in override["module"]
    }
    kernels = (ROOT / "engine").rglob("kernels_*.py")
    assert exempt == {f"*.{path.parent.name}.{path.stem}" for path in kernels}


def test_nothing_committed_names_a_private_place():
    # Put together here, so that this file passes its own test.
    private = [
        "/" + "work/main",
        "/" + "work/shared",
        ".." + "/shared",
        "/" + "root/",
        "index" + "-url",
        "py" + "pi.org",
        "files.python" + "hosted",
    ]
    for path in committed_files():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found = [word for word in private if word in text] + re.findall(r"(?i)\bissue #?\d+", text)
        assert not found, f"{path.relative_to(ROOT)} names {found}"


def test_nothing_that_is_made_is_committed():
    for path in committed_files():
        # A file that an older version saved cannot be made again, and an artist opens the example without running a script.
        example = ROOT / "demo_scenes" / "example.blend"
        kept = path.parent == ROOT / "tests" / "esh_scatter" / "files" or path == example
        assert kept or path.suffix not in {".pyc", ".whl", ".zip", ".blend"}, path
        assert path.stat().st_size < 3_000_000, f"{path} is too large for the repository"


def test_continuous_integration_names_tests_that_are_there():
    """Where one of several files is missing, pytest runs none of them."""
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    listed = re.search(r"^step threads .*?^\S*# ", script, re.MULTILINE | re.DOTALL)[0]
    named = re.findall(r"tests/[\w./]+(?:\{[\w,]+\}[\w./]*)?", listed)
    paths = [f"{head}{one}{tail}" for head, _, several, tail in map(_parts, named) for one in several.split(",")]
    assert len(paths) >= 14
    assert not [path for path in paths if not (ROOT / path).exists()]


def _parts(name: str) -> tuple[str, str, str, str]:
    """What stands before a list in braces, whether there is one, the list, and what stands behind it."""
    head, brace, rest = name.partition("{")
    several, _, tail = rest.partition("}")
    return head, brace, several, tail
