"""Build a static extension repository: ``python tools/build_repository.py``, into ``dist/repository``.

The folder holds the zips of this version, one for each platform, the list of them that Blender reads (``index.json``) and a page for
browsers (``index.html``). Any web server, or a shared folder, can host it as it is; users add its address in Blender under
Preferences › Get Extensions › Repositories, and get updates from there.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tomllib
from pathlib import Path

from build_extension import MANIFEST, ROOT, BuildError, add_gpus_option, build, find_blender_builder

__all__ = ["generate", "main"]


def generate(folder: Path) -> None:
    """Write the list of the zips in ``folder``, and the page.

    Raises:
        BuildError: Blender's builder refused a zip.
    """
    command = [sys.executable, str(find_blender_builder()), "server-generate", "--repo-dir", str(folder), "--html"]
    outcome = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if outcome.returncode or not (folder / "index.json").is_file():
        raise BuildError(f"Blender's builder refused the repository:\n{outcome.stdout.strip()}")


def main() -> int:
    """Build as the command line says; return the exit status."""
    manifest = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
    platforms = manifest["platforms"]
    parser = argparse.ArgumentParser(description="Build a static extension repository.")
    parser.add_argument(
        "--platform", action="append", choices=platforms, help="may be given several times; default: all platforms"
    )
    parser.add_argument("--output", type=Path, default=ROOT / "dist" / "repository", help="folder of the repository")
    parser.add_argument("--wheels", type=Path, default=ROOT / "build" / "wheels", help="folder for downloaded wheels")
    add_gpus_option(parser)
    arguments = parser.parse_args()
    folder = arguments.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # Zips of other versions would be offered, too.
    for older in folder.glob(f"{manifest['id']}-*.zip"):
        if not older.name.startswith(f"{manifest['id']}-{manifest['version']}-"):
            older.unlink()
    try:
        for platform in arguments.platform or platforms:
            path = folder / f"{manifest['id']}-{manifest['version']}-{platform}.zip"
            # Those that were built on their own systems carry compiled kernels, and are taken as they are.
            if not path.is_file():
                build(platform, folder, arguments.wheels.resolve(), arguments.gpus)
        generate(folder)
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{folder} ({sum(path.stat().st_size for path in folder.glob('*.zip')) / 1e6:.0f} MB)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
