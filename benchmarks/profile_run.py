"""Where the time of a warm run goes, by phase and by Python function, on every device of this machine.

    python benchmarks/profile_run.py
    python benchmarks/profile_run.py --device cuda:0 --bodies 1000000 --groups 1 6

Without arguments runs of 10,000 to 1,000,000 bodies, first on the GPU, if there is one, then on the CPU.
"""

from __future__ import annotations

import argparse
import cProfile
import io
import pstats
import statistics
import time

import warp as wp
from esh.engine.device.devices import core_count
from esh.engine.device.profile import Profile
from esh.engine.solve import solve
from problems import problem_of

# Seconds after which a run is not repeated, and runs at most.
ENOUGH = 4.0
MOST_RUNS = 5
# Functions that are shown.
FUNCTIONS = 24


def time_runs(device: str, bodies: int, groups: int) -> None:
    """Print the median of warm runs, the phases of one, and the functions in which Python and NumPy spend the time of another."""
    problem = problem_of(bodies, groups)
    solve(problem, device=device, max_steps=3)
    seconds: list[float] = []
    while len(seconds) < MOST_RUNS and sum(seconds) < ENOUGH:
        start = time.perf_counter()
        solve(problem, device=device)
        seconds.append(time.perf_counter() - start)
    phases, functions = Profile(), cProfile.Profile()
    solve(problem, device=device, profile=phases)
    functions.enable()
    solve(problem, device=device)
    functions.disable()
    spread = f"{min(seconds):.3f} to {max(seconds):.3f}"
    print(
        f"{device}: {bodies:,} bodies, {groups} groups: {statistics.median(seconds):.4f} s ({spread})\n{phases}",
        flush=True,
    )
    text = io.StringIO()
    pstats.Stats(functions, stream=text).sort_stats("tottime").print_stats(FUNCTIONS)
    print("\n".join(line for line in text.getvalue().splitlines() if line.strip()), flush=True)


def main() -> None:
    """Print them for each device and number of bodies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", nargs="+", help="all that there are, without")
    parser.add_argument("--bodies", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--groups", type=int, nargs="+", default=[1])
    options = parser.parse_args()
    wp.config.quiet = True
    devices = options.device or [*(device.alias for device in wp.get_cuda_devices()), "cpu"]
    print(f"{', '.join(devices)}; {core_count()} threads", flush=True)
    for device in devices:
        for bodies in options.bodies:
            for groups in options.groups:
                time_runs(device, bodies, groups)


if __name__ == "__main__":
    main()
