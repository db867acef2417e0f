"""What a tuned constant of the solver is worth: scenes with other values of it, beside the one that it has.

    python benchmarks/constants.py contact.separation.DAMPING 0.5 0.7
    python benchmarks/constants.py contact.kernels_separation.FULL_CONTACTS 1 4 --scenes planks --bodies 200
    python benchmarks/constants.py motion.kernels_direction.FIRST_SHARE 0.4 1.0 --descent

A constant is named by its room in `engine`, its module and its name. Every value has a process of its own, because kernels take
constants when they are compiled. Scenes are those of `contact.py`, with a few seeds each: of every value, overlaps left over all
scenes, counted by shapely; in how many runs there were none; the mean coverage error at k = 1 after contact; how far bodies
moved, in mean spacings; and the seconds that contact took, over those of the constant as it is. With `--descent` they are dots
and lines that may overlap: mean coverage error, steps until the tolerance, and what the forces would still move bodies, in
thousandths of a spacing.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

ENGINE = "esh.engine"
DESCENT_COLUMNS = ("coverage error", "steps", "left to move")
CONTACT_COLUMNS = ("overlaps left", "runs without", "coverage error", "moved", "seconds over those as it is")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("constant", help="room, module and name, such as contact.separation.DAMPING")
    parser.add_argument("values", nargs="+", help="other values of it, as Python writes them")
    parser.add_argument("--scenes", metavar="WORD", default="", help="only scenes whose names hold this")
    parser.add_argument("--bodies", type=int, default=200, metavar="N")
    parser.add_argument("--seeds", type=int, default=2, metavar="N")
    parser.add_argument("--descent", action="store_true", help="dots and lines without contact")
    parser.add_argument("--value", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    module_name, _, name = options.constant.rpartition(".")
    try:
        module = importlib.import_module(f"{ENGINE}.{module_name}")
        now = getattr(module, name)
    except (ImportError, AttributeError):
        parser.error(f"there is no {options.constant} in {ENGINE}")
    if options.value:
        setattr(module, name, type(now)(json.loads(options.values[0])))
        made = descents if options.descent else total
        print(json.dumps(made(options.scenes, options.bodies, options.seeds)))
        return 0
    columns, row = (DESCENT_COLUMNS, descent_row) if options.descent else (CONTACT_COLUMNS, contact_row)
    print(f"| {options.constant} | {' | '.join(columns)} |")
    print("|---" * (len(columns) + 1) + "|")
    as_it_is: dict[str, float] = {}
    for value in [now, *(json.loads(text) for text in options.values)]:
        found = in_a_process(options, value)
        as_it_is = as_it_is or found
        name = f"{value}{' (as it is)' if value == now else ''}"
        print(f"| {name} | {' | '.join(row(found, as_it_is))} |", flush=True)
    return 0


def descent_row(found: dict[str, float], _as_it_is: dict[str, float]) -> list[str]:
    """The cells of `DESCENT_COLUMNS`."""
    return [f"{found['error']:.4f}", f"{found['steps']:.0f}", f"{found['left']:.2f}"]


def contact_row(found: dict[str, float], as_it_is: dict[str, float]) -> list[str]:
    """The cells of `CONTACT_COLUMNS`."""
    return [
        f"{found['left']:.0f}",
        f"{found['clean']:.0f} of {found['runs']:.0f}",
        f"{found['error']:.4f}",
        f"{found['moved']:.3f}",
        f"{found['seconds'] / as_it_is['seconds']:.2f}",
    ]


def in_a_process(options: argparse.Namespace, value: object) -> dict[str, float]:
    """What comes of all scenes with a value of the constant."""
    command = [sys.executable, str(Path(__file__)), options.constant, json.dumps(value), "--value"]
    command += ["--scenes", options.scenes, "--bodies", str(options.bodies), "--seeds", str(options.seeds)]
    command += ["--descent"] if options.descent else []
    outcome = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(outcome.stdout.splitlines()[-1])


def descents(word: str, bodies: int, seeds: int) -> dict[str, float]:
    """What comes of dots and lines whose names hold a word: means over all runs."""
    import esh
    from esh.engine.quality.measurement import measure
    from esh.engine.solver.solver import Solver

    square, ramp = esh.Domain((100.0, 100.0)), np.linspace(0.2, 1.0, 128)[None, :]
    area = 1e4 / bodies
    line = esh.Line(2.0 * math.sqrt(area), "none", width=0.1 * math.sqrt(area))
    sizes = {
        "dots": [esh.Size("dot", area, bodies)],
        "sizes": [esh.Size("large", 9.0 * area, bodies // 10), esh.Size("small", area, bodies - bodies // 10)],
        "lines": [esh.Size("line", 0.2 * area, bodies, line=line)],
    }
    errors, steps, left = [], [], []
    for name, listed in sizes.items():
        for seed in range(1, seeds + 1) if word in name else ():
            problem = esh.Problem(square, [esh.BodyClass(name, listed, ramp)], seed=seed)
            with Solver(problem, device="cpu") as solver:
                solver.run(100)
                steps.append(int(solver.state.steps[0]))
                left.append(1e3 * solver.descent.direction.residual())
                errors.append(measure(solver.placement(), solver.launcher).coverage_error)
    return {"error": float(np.mean(errors)), "steps": float(np.mean(steps)), "left": float(np.mean(left))}


def total(word: str, bodies: int, seeds: int) -> dict[str, float]:
    """What comes of the scenes whose names hold a word: sums, and means over all runs."""
    from contact import SCENES, outcome

    found = [
        outcome(replace(make(bodies), seed=seed))
        for name, make in SCENES.items()
        if word in name
        for seed in range(1, seeds + 1)
    ]
    return {
        "left": sum(run["left"] for run in found),
        "clean": sum(run["left"] == 0 for run in found),
        "runs": len(found),
        "error": sum(run["error"] for run in found) / len(found),
        "moved": sum(run["moved"] for run in found) / len(found),
        "seconds": sum(run["seconds"] for run in found),
    }


if __name__ == "__main__":
    raise SystemExit(main())
