"""Where the time of a warm run goes, by phase and by Python function.

python benchmarks/profile_run.py --device cuda:0 --bodies 1000000
"""

from __future__ import annotations

import argparse
import cProfile
import pstats

from esh.engine.device.profile import Profile
from esh.engine.solve import solve
from problems import problem_of


def main() -> None:
    """Print both, for one and for six groups."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="auto")
    parser.add_argument("--bodies", type=int, default=1_000_000)
    options = parser.parse_args()
    for groups in (1, 6):
        problem = problem_of(options.bodies, groups)
        solve(problem, device=options.device, max_steps=3)
        phases, functions = Profile(), cProfile.Profile()
        solve(problem, device=options.device, profile=phases)
        functions.enable()
        report = solve(problem, device=options.device).report
        functions.disable()
        print(f"{options.bodies:,} bodies, {groups} groups, {report.seconds:.2f} s\n{phases}")
        pstats.Stats(functions).sort_stats("tottime").print_stats(14)


if __name__ == "__main__":
    main()
