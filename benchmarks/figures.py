"""Recompute the paper's experiments: a picture of each, and one table of what was measured.

    python benchmarks/figures.py --output output/figures [--device cuda:0] [--only 4 12]

The paper is Schmaltz, Gwosdek and Weickert 2012.
Every row has a goal and says whether it is met; the reference in brackets is a direct float64 sum of the same problem (300 steps of
0.7 of the inverse curvature, which reach what 1,000 of the paper's do). Coverage errors are at k = 1 unless the row says otherwise.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from pathlib import Path

import figures_of_color
import figures_of_lines
import figures_of_sizes
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from experiment_run import Run


def main() -> int:
    """Run the chosen experiments; the exit status says whether all goals are met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("output/figures"))
    parser.add_argument("--device", default="auto")
    parser.add_argument("--only", nargs="*", help="numbers of figures")
    options = parser.parse_args()
    device = resolve_device(options.device)
    options.output.mkdir(parents=True, exist_ok=True)
    run = Run(options.output, device.alias, Launcher(device))
    experiments = {**figures_of_sizes.EXPERIMENTS, **figures_of_color.EXPERIMENTS, **figures_of_lines.EXPERIMENTS}
    start = time.perf_counter()
    for number in sorted(experiments, key=int):
        if not options.only or number in options.only:
            experiments[number](run)
    lines = ["| figure | what | measured | goal | met |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in run.rows]
    seconds = time.perf_counter() - start
    lines += ["", f"{device.name} ({device.alias}), {platform.machine()}, {seconds:.0f} s in all."]
    (options.output / "figures.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    missed = [row for row in run.rows if row[4] == "NO"]
    print(f"{len(run.rows)} rows in {seconds:.0f} s, {len(missed)} goals missed; see {options.output / 'figures.md'}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
