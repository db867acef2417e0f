"""Download a Blender from blender.org and unpack it: ``python tools/fetch_blender.py 5.2 FOLDER`` prints its executable.

The version is a release, of which the newest point release is taken, or ``daily``: the newest daily build. For hosted machines.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

RELEASES = "https://download.blender.org/release"
DAILY = "https://builder.blender.org/download/daily/?format=json&v=1"
# System -> ending of its archives, what daily builds call it, and the executable in the archive.
SYSTEMS = {
    "Linux": ("linux-x64.tar.xz", ("linux", "x86_64", "xz"), "blender"),
    "Windows": ("windows-x64.zip", ("windows", "amd64", "zip"), "blender.exe"),
    "Darwin": ("macos-arm64.dmg", ("darwin", "arm64", "dmg"), "Blender.app/Contents/MacOS/Blender"),
}


def newest_release(listing: str, version: str, ending: str) -> str:
    """Return the name of the newest archive of a release in the text of its folder's page."""
    found = re.findall(rf"blender-{re.escape(version)}\.(\d+)-{re.escape(ending)}(?=\")", listing)
    if not found:
        raise SystemExit(f"there is no Blender {version} for {ending}")
    return f"blender-{version}.{max(map(int, found))}-{ending}"


def newest_daily(builds: str, kind: tuple[str, str, str]) -> str:
    """Return the address of the newest daily build of the main branch."""
    system, machine, ending = kind
    fitting = [
        build
        for build in json.loads(builds)
        if (build.get("platform"), build.get("architecture"), build.get("file_extension")) == (system, machine, ending)
        and build.get("release_cycle") in ("alpha", "beta", "candidate")
    ]
    if not fitting:
        raise SystemExit(f"there is no daily build of Blender for {system} {machine}")
    newest = max(fitting, key=lambda build: (tuple(map(int, build["version"].split("."))), build["file_mtime"]))
    return str(newest["url"])


def read(address: str) -> str:
    """Return the text at an address."""
    with urllib.request.urlopen(address) as answer:
        return str(answer.read().decode("utf-8"))


def unpack(archive: Path, folder: Path, executable: str) -> Path:
    """Unpack an archive and return the executable in it."""
    if archive.suffix == ".dmg":
        mount = folder / "mount"
        subprocess.run(["hdiutil", "attach", "-quiet", "-mountpoint", mount, archive], check=True)
        try:
            shutil.copytree(mount / "Blender.app", folder / "Blender.app", symlinks=True)
        finally:
            subprocess.run(["hdiutil", "detach", "-quiet", mount], check=True)
        return folder / executable
    shutil.unpack_archive(archive, folder, **({"filter": "tar"} if archive.suffix == ".xz" else {}))
    (found,) = folder.glob(f"blender-*/{executable}")
    return found


def main() -> int:
    """Download, unpack, and print where the executable is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("version", help='"5.2", or "daily"')
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    ending, kind, executable = SYSTEMS[platform.system()]
    if options.version == "daily":
        address = newest_daily(read(DAILY), kind)
    else:
        folder = f"{RELEASES}/Blender{options.version}/"
        address = folder + newest_release(read(folder), options.version, ending)
    options.folder.mkdir(parents=True, exist_ok=True)
    archive = options.folder / address.rpartition("/")[2]
    print(address, file=sys.stderr)
    urllib.request.urlretrieve(address, archive)
    print(unpack(archive, options.folder.resolve(), executable))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
