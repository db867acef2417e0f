"""The tools of the workflow that tries the zip in Blender itself."""

from __future__ import annotations

import importlib.util
import json
import tarfile
import zipfile
from pathlib import Path

import pytest

PATH = Path(__file__).resolve().parent.parent / "tools" / "fetch_blender.py"


@pytest.fixture(scope="module")
def fetch():
    specification = importlib.util.spec_from_file_location("fetch_blender", PATH)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_newest_point_release_is_taken(fetch):
    listing = "".join(
        f'<a href="{name}">{name}</a>\n'
        for name in (
            "blender-5.2.0-linux-x64.tar.xz",
            "blender-5.2.10-linux-x64.tar.xz",
            "blender-5.2.9-linux-x64.tar.xz",
            "blender-5.2.11-windows-x64.zip",
            "blender-5.2.10.sha256",
        )
    )
    assert fetch.newest_release(listing, "5.2", "linux-x64.tar.xz") == "blender-5.2.10-linux-x64.tar.xz"
    assert fetch.newest_release(listing, "5.2", "windows-x64.zip") == "blender-5.2.11-windows-x64.zip"
    with pytest.raises(SystemExit, match=r"no Blender 4\.5"):
        fetch.newest_release(listing, "4.5", "linux-x64.tar.xz")


def test_the_newest_daily_build_is_one_of_the_coming_version(fetch):
    def build(version, cycle, time, system="linux", ending="xz"):
        machine = {"linux": "x86_64", "windows": "amd64"}[system]
        return {
            "platform": system,
            "architecture": machine,
            "file_extension": ending,
            "release_cycle": cycle,
            "version": version,
            "file_mtime": time,
            "url": f"https://example.org/{version}-{cycle}-{time}-{system}.{ending}",
        }

    builds = [
        build("5.2.3", "candidate", 9),
        build("5.10.0", "alpha", 5),
        build("5.10.0", "alpha", 7),
        build("5.9.0", "beta", 8),
        build("5.11.0", "stable", 8),
        build("5.10.0", "alpha", 9, ending="sha256"),
        build("5.12.0", "alpha", 9, system="windows", ending="zip"),
    ]
    text = json.dumps(builds)
    assert fetch.newest_daily(text, ("linux", "x86_64", "xz")) == "https://example.org/5.10.0-alpha-7-linux.xz"
    with pytest.raises(SystemExit, match="no daily build"):
        fetch.newest_daily(text, ("darwin", "arm64", "dmg"))


def test_archives_are_unpacked_to_their_executables(fetch, tmp_path):
    inside = tmp_path / "made" / "blender-5.2.1-linux-x64"
    inside.mkdir(parents=True)
    (inside / "blender").write_text("#!/bin/sh\n")
    with tarfile.open(tmp_path / "one.tar.xz", "w:xz") as archive:
        archive.add(inside, inside.name)
    (tmp_path / "out").mkdir()
    assert fetch.unpack(tmp_path / "one.tar.xz", tmp_path / "out", "blender").read_text() == "#!/bin/sh\n"
    with zipfile.ZipFile(tmp_path / "two.zip", "w") as archive:
        archive.writestr("blender-5.2.1-windows-x64/blender.exe", "MZ")
    (tmp_path / "other").mkdir()
    assert fetch.unpack(tmp_path / "two.zip", tmp_path / "other", "blender.exe").read_text() == "MZ"
