"""Everything that is worth knowing of a GPU, in one run: quality, speed, profile and the experiments.

    python benchmarks/on_gpu.py --device cuda:0 --output output/gpu
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path


def main() -> None:
    """Run the other scripts, one after the other, and keep what each prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--output", type=Path, default=Path("output/gpu"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    here = Path(__file__).parent
    for name, script, arguments in (
        ("quality-and-speed", "quality_and_speed.py", ["--bodies", "10000", "100000", "1000000"]),
        ("figures", "figures.py", ["--output", str(options.output / "figures")]),
    ):
        command = [sys.executable, str(here / script), "--device", options.device, *arguments]
        with (options.output / f"{name}.txt").open("w") as file:
            subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, check=False)
        print((options.output / f"{name}.txt").read_text()[-6000:], flush=True)


if __name__ == "__main__":
    main()
