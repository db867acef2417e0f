"""Make a wheel for this system out of the one for all, with kernels in it: ``python tools/build_wheel.py WHEEL``.

The wheel that ``python -m build`` makes fits every system, and compiles the kernels at the first run. Beside it comes one for the
system that this runs on, with the kernels that ``tools/build_kernels.py`` compiles ahead. Pip takes it where it fits.
"""

from __future__ import annotations

import argparse
import base64
import csv
import hashlib
import io
import platform
import sys
import tempfile
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import build_kernels
from build_extension import add_gpus_option
from esh.engine.device.prebuilt_gpu_kernels import GENERATIONS

# Where the kernels lie in the wheel.
KERNELS = "esh/engine/device/prebuilt"


def platform_of_warp() -> str:
    """The platform tag of the Warp that is installed here: kernels run where that does."""
    lines = (distribution("warp-lang").read_text("WHEEL") or "").splitlines()
    tags = [line.removeprefix("Tag: ").split("-")[2] for line in lines if line.startswith("Tag: ")]
    return ".".join(sorted(set(tags)))


def with_kernels(wheel: Path, kernels: Path, system: str) -> Path:
    """Write a wheel with kernels beside one without.

    Args:
        wheel: The wheel for all systems, ``…-py3-none-any.whl``.
        kernels: A folder that :func:`build_kernels.build` has written.
        system: The platform tag of the wheel to be made.

    Returns:
        Its path.
    """
    result = wheel.with_name(wheel.name.removesuffix("any.whl") + f"{system}.whl")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(result, "w", zipfile.ZIP_DEFLATED) as new:
        record = next(name for name in old.namelist() if name.endswith(".dist-info/RECORD"))
        rows = []
        content = {name: old.read(name) for name in old.namelist() if name != record and not name.endswith("/")}
        content |= {f"{KERNELS}/{file.name}": file.read_bytes() for file in sorted(kernels.iterdir())}
        for name, data in content.items():
            if name.endswith(".dist-info/WHEEL"):
                data = _retagged(data.decode(), system).encode()
            new.writestr(name, data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            rows.append([name, f"sha256={digest}", len(data)])
        listed = io.StringIO()
        csv.writer(listed, lineterminator="\n").writerows([*rows, [record, "", ""]])
        new.writestr(record, listed.getvalue())
    return result


def _retagged(text: str, system: str) -> str:
    """What a wheel says of itself, for another platform."""
    kept = [line for line in text.splitlines() if line and not line.startswith(("Tag:", "Root-Is-Purelib:"))]
    tags = [f"Tag: py3-none-{tag}" for tag in system.split(".")]
    return "\n".join([*kept, "Root-Is-Purelib: false", *tags]) + "\n"


def main() -> int:
    """Build as the command line says; return the exit status."""
    parser = argparse.ArgumentParser(description="Make a wheel for this system, with compiled kernels.")
    parser.add_argument("wheel", type=Path, help="the wheel for all systems")
    add_gpus_option(parser)
    arguments = parser.parse_args()
    wheel = arguments.wheel
    if not wheel.name.endswith("-py3-none-any.whl"):
        print(f"{wheel} must be a wheel for all systems, …-py3-none-any.whl", file=sys.stderr)
        return 2
    if not build_kernels.tiers_of_this_machine():
        print(f"kernels are not compiled ahead for {platform.machine()} processors here; {wheel.name} is all there is")
        return 0
    with tempfile.TemporaryDirectory() as temporary:
        kernels = Path(temporary) / "prebuilt"
        gpus = GENERATIONS if arguments.gpus is None else arguments.gpus
        build_kernels.build(kernels, gpus=() if sys.platform == "darwin" else gpus)
        print(with_kernels(wheel, kernels, platform_of_warp()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
