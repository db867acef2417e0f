"""Build the extension's zip for one platform, with its wheels: ``python tools/build_extension.py --platform linux-x64``.

1. Download the wheels that the manifest lists for the platform into ``build/wheels`` (kept for the next time).
2. Stage the package with a manifest that names only this platform and these wheels, and with its kernels compiled: those for GPUs
   where the platform has any, and those for the CPU where the platform is this machine's.
3. Let Blender's own builder, found in pip's ``bpy``, check and pack it; Blender itself is not started.

Blender unpacks the wheels whenever the extension is enabled. So they are not compressed in themselves: the zip around them is, which
is unpacked once. Their files stay as they are.

The result is ``dist/esh_scatter-<version>-<platform>.zip``.
"""

from __future__ import annotations

import argparse
import copy
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = "blender_manifest.toml"
PACKAGE_CONTENT = ("__init__.py", "LICENSE", "engine", "esh_scatter")
# Folders within it that stay out, as the manifest says, too: plans are drawn outside of Blender only.
LEFT_OUT = ("engine/drawing/fonts",)

# Platform of the manifest -> how the platform tags of its wheels begin and end.
WHEEL_TAGS = {
    "linux-x64": ("manylinux", "x86_64"),
    "macos-arm64": ("macosx", "arm64"),
    "windows-x64": ("win", "amd64"),
}
# There is no CUDA on these.
WITHOUT_CUDA = ("macos-arm64",)
# What Python calls this machine -> the manifest's platform.
MACHINES = {
    ("Linux", "x86_64"): "linux-x64",
    ("Darwin", "arm64"): "macos-arm64",
    ("Windows", "AMD64"): "windows-x64",
}


class BuildError(Exception):
    """The zip cannot be built; the message says why, in one sentence."""


def current_platform() -> str | None:
    """Return the manifest's name of this machine, or None if the extension is not built for it."""
    return MACHINES.get((platform.system(), platform.machine()))


def is_wheel_for(wheel: str, target: str) -> bool:
    """Whether the wheel, by its file name, is for this platform of the manifest."""
    tag = Path(wheel).stem.split("-")[-1]
    start, end = WHEEL_TAGS[target]
    return tag == "any" or (tag.startswith(start) and tag.endswith(end))


def download_wheel(file_name: str, folder: Path) -> Path:
    """Return the wheel of this name, downloaded with pip's own settings unless the folder has it already.

    Raises:
        BuildError: pip found no such file.
    """
    path = folder / file_name
    if path.is_file():
        return path
    name, version, _, _, tag = Path(file_name).stem.split("-")
    folder.mkdir(parents=True, exist_ok=True)
    # Downloaded beside, then renamed: a download that was cut off is never taken for the wheel.
    with tempfile.TemporaryDirectory(dir=folder) as beside:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
        command += ["--only-binary=:all:", "--dest", beside, f"{name}=={version}"]
        if tag != "any":
            command += ["--platform", tag]
        outcome = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        downloaded = Path(beside) / file_name
        if outcome.returncode or not downloaded.is_file():
            raise BuildError(f"pip could not download {file_name}, which {MANIFEST} lists:\n{outcome.stdout.strip()}")
        os.replace(downloaded, path)
    return path


def repack(source: Path, target: Path, method: int) -> None:
    """Write the files of a zip, which stay as they are, into another one that is compressed by another method."""
    part = target.with_name(target.name + ".part")
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(part, "w", method) as new:
        for entry in old.infolist():
            changed = copy.copy(entry)
            changed.compress_type = method
            with old.open(entry) as read, new.open(changed, "w") as write:
                shutil.copyfileobj(read, write, 1 << 20)
    os.replace(part, target)


def find_blender_builder() -> Path:
    """Return the path of ``blender_ext.py``, the extension builder that every Blender brings.

    Raises:
        BuildError: pip's ``bpy`` is not installed, or has no builder.
    """
    spec = importlib.util.find_spec("bpy")
    for folder in (spec.submodule_search_locations or []) if spec else []:
        for builder in sorted(Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")):
            return builder
    raise BuildError(
        "Blender's builder of extensions was not found: install pip's bpy into this Python, or run `make extension`"
    )


def staged_manifest(text: str, target: str, wheels: list[str]) -> str:
    """Return the manifest's text with the platforms and the wheels replaced by those of one zip."""
    text, platform_count = re.subn(r"(?ms)^platforms = \[.*?\]$", f'platforms = ["{target}"]', text)
    listed = "".join(f'  "{wheel}",\n' for wheel in wheels)
    text, wheel_count = re.subn(r"(?ms)^wheels = \[.*?^\]$", f"wheels = [\n{listed}]", text)
    if platform_count != 1 or wheel_count != 1:
        raise BuildError(
            f"{MANIFEST} must have one list `platforms` on a line, and one list `wheels`, one wheel a line"
        )
    return text


def compile_kernels(folder: Path, target: str, gpus: Sequence[int] | None, tiers: Sequence[str] | None = None) -> None:
    """Put the kernels into the package, compiled.

    Args:
        folder: Where to put them.
        target: The platform; objects for its processors can be made only there, and elsewhere the first run compiles them.
        gpus: Generations of GPUs; None for all.
        tiers: Kinds of processors, see ``build_kernels.py``; None for all.

    Raises:
        BuildError: They do not compile.
    """
    command = [sys.executable, str(ROOT / "tools" / "build_kernels.py"), str(folder)]
    if target != current_platform():
        command.append("--no-cpu")
    if target in WITHOUT_CUDA:
        gpus = ()
    if gpus is not None:
        command += ["--gpus", *map(str, gpus)]
    if tiers is not None:
        command += ["--tiers", *tiers]
    outcome = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if outcome.returncode:
        raise BuildError(f"the kernels could not be compiled:\n{outcome.stdout.strip()}")


def build(
    target: str,
    output_folder: Path,
    wheel_folder: Path,
    gpus: Sequence[int] | None = None,
    tiers: Sequence[str] | None = None,
) -> Path:
    """Build the zip of one platform and return its path.

    Args:
        target: The platform.
        output_folder: Where to put it.
        wheel_folder: Where downloaded wheels are kept.
        gpus: Generations of GPUs to compile kernels for; None for all.
        tiers: Kinds of processors to compile kernels for, see ``build_kernels.py``; None for all.

    Raises:
        BuildError: A wheel is not to be had, or Blender's builder refused the package.
    """
    text = (ROOT / MANIFEST).read_text(encoding="utf-8")
    manifest = tomllib.loads(text)
    wheels = [wheel for wheel in manifest["wheels"] if is_wheel_for(wheel, target)]
    builder = find_blender_builder()
    output_folder.mkdir(parents=True, exist_ok=True)
    zip_path = output_folder / f"{manifest['id']}-{manifest['version']}-{target}.zip"

    with tempfile.TemporaryDirectory(prefix="esh-extension-") as temporary:
        stage, packed = Path(temporary) / "package", Path(temporary) / "packed.zip"
        stage.mkdir()
        (stage / MANIFEST).write_text(staged_manifest(text, target, wheels), encoding="utf-8")
        for name in PACKAGE_CONTENT:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, stage / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy2(source, stage / name)
        compile_kernels(stage / "engine" / "device" / "prebuilt", target, gpus, tiers)
        for name in LEFT_OUT:
            shutil.rmtree(stage / name, ignore_errors=True)
        for wheel in wheels:
            staged = stage / wheel
            staged.parent.mkdir(exist_ok=True)
            repack(download_wheel(staged.name, wheel_folder), staged, zipfile.ZIP_STORED)
        command = [
            sys.executable,
            str(builder),
            "build",
            "--source-dir",
            str(stage),
            "--output-filepath",
            str(packed),
        ]
        outcome = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if outcome.returncode or not (packed).is_file():
            raise BuildError(f"Blender's builder refused the extension:\n{outcome.stdout.strip()}")
        # It leaves wheels as they are.
        repack(packed, zip_path, zipfile.ZIP_DEFLATED)
    return zip_path


def add_gpus_option(parser: argparse.ArgumentParser) -> None:
    """Let a command line say for which generations of GPUs kernels are compiled."""
    parser.add_argument(
        "--gpus",
        type=int,
        nargs="*",
        metavar="N",
        help="compute capabilities of the GPUs to compile kernels for, times ten; default: all; without numbers none",
    )


def main() -> int:
    """Build as the command line says; return the exit status."""
    platforms = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))["platforms"]
    parser = argparse.ArgumentParser(description="Build the extension's zip for one platform.")
    parser.add_argument(
        "--platform", default=current_platform(), help=f"{', '.join(platforms)}; default: this machine's"
    )
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder for the zip")
    parser.add_argument("--wheels", type=Path, default=ROOT / "build" / "wheels", help="folder for downloaded wheels")
    add_gpus_option(parser)
    parser.add_argument(
        "--tiers",
        nargs="+",
        metavar="TIER",
        help="kinds of processors to compile kernels for; native: this machine's; default: all",
    )
    arguments = parser.parse_args()
    if arguments.platform not in platforms:
        got = arguments.platform or f"{platform.system()} on {platform.machine()}, this machine"
        print(f"The platform must be one of {', '.join(platforms)}; got {got}: choose with PLATFORM=…", file=sys.stderr)
        return 2
    try:
        folders = arguments.output.resolve(), arguments.wheels.resolve()
        path = build(arguments.platform, *folders, arguments.gpus, arguments.tiers)
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{path} ({path.stat().st_size / 1e6:.0f} MB): drag it into a Blender window to install it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
