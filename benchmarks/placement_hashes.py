"""Whether a change of the engine changed any placement: one hash for every recipe.

    python benchmarks/placement_hashes.py > before.txt
    python benchmarks/placement_hashes.py --expect before.txt

The same recipe, seed and device give the same bytes, whatever the number of threads (--threads). Other processors and other versions
of Warp or NumPy may round otherwise, so both runs belong on one machine.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import esh

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (ROOT / "tests" / "recipes", ROOT / "demo_scenes" / "recipes")
ARRAYS = ("position", "angle", "length", "width", "class_index", "size_index", "bends")
DIGITS = 16


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for every recipe; return 1 if one differs from what is expected, or cannot be solved."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "recipe", metavar="RECIPE", type=Path, nargs="*", help="default: all recipes of tests and demos"
    )
    parser.add_argument("--threads", metavar="N", type=int, help="processors to use (default: all that there are)")
    parser.add_argument("--max-steps", metavar="N", type=int, default=100, help="default: 100")
    parser.add_argument("--expect", metavar="FILE", type=Path, help="lines of an earlier run to compare with")
    options = parser.parse_args(arguments)
    expected = None
    if options.expect is not None:
        try:
            expected = read_lines(options.expect)
        except (OSError, ValueError) as error:
            parser.error(f"--expect {options.expect} cannot be used: {error}")
    if options.threads is not None:
        try:
            use_processors(options.threads)
        except ValueError as error:
            parser.error(str(error))

    found = {}
    recipes = options.recipe or [path for folder in FOLDERS for path in sorted(folder.glob("*.toml"))]
    for path in recipes:
        name = name_of(path)
        try:
            line = hash_recipe(path, options.max_steps)
        # Whatever an engine that is being worked on may raise: the other recipes are still worth a look.
        except Exception as error:
            print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
            line = "failed"
        found[name] = line
        print(f"{line} {name}", flush=True)

    wrong = {name: "could not be solved" for name, line in found.items() if line == "failed"}
    if expected is not None:
        # Recipes that were asked for by name are all that there is to compare.
        for name in [*found, *(() if options.recipe else set(expected) - set(found))]:
            if name in wrong:
                continue
            if name not in expected:
                wrong[name] = f"is not in {options.expect}"
            elif name not in found:
                wrong[name] = "is expected, but there is no such recipe"
            elif found[name] != expected[name]:
                wrong[name] = f"differs: expected {expected[name]}, got {found[name]}"
    for name, what in sorted(wrong.items()):
        print(f"{name}: {what}", file=sys.stderr)
    if not wrong and expected is not None:
        print(f"all {len(found)} as expected", file=sys.stderr)
    return 1 if wrong else 0


def use_processors(count: int) -> None:
    """Keep this process, and the threads that it will start, on ``count`` of its processors.

    Before anything is imported that looks at how many there are: NumPy's linear algebra does once, Warp and the engine later.

    Raises:
        ValueError: There are not so many, or the system does not let a process choose.
    """
    if not hasattr(os, "sched_setaffinity"):
        raise ValueError("--threads needs a system that lets a process choose its processors, as Linux does")
    there = sorted(os.sched_getaffinity(0))
    if not 1 <= count <= len(there):
        raise ValueError(
            f"--threads must be a number from 1 to {len(there)}, the processors that there are; got {count}"
        )
    os.sched_setaffinity(0, there[:count])


def hash_recipe(path: Path, max_steps: int = 100) -> str:
    """Solve a recipe on the CPU; return the hash of its placement and the number of its steps, as a line has them."""
    import esh

    placement = esh.solve(esh.read_recipe(path), device="cpu", max_steps=max_steps)
    return f"{hash_placement(placement)} {placement.report.steps:4d}"


def hash_placement(placement: esh.Placement) -> str:
    """First digits of the SHA-256 of all that a placement says of its bodies, and of the steps that it took."""
    import hashlib

    import numpy as np

    digest = hashlib.sha256()
    for name in ARRAYS:
        values = getattr(placement, name)
        if values is not None:
            digest.update(np.ascontiguousarray(values).tobytes())
    digest.update(str(placement.report.steps).encode("ascii"))
    return digest.hexdigest()[:DIGITS]


def name_of(path: Path) -> str:
    """What a line calls a recipe: its place in this checkout, so that those of two checkouts can be compared."""
    place = path.resolve()
    return place.relative_to(ROOT).as_posix() if place.is_relative_to(ROOT) else place.name


def read_lines(path: Path) -> dict[str, str]:
    """Hash and steps by the recipe's name, from the lines of an earlier run.

    Raises:
        OSError: The file cannot be read.
        ValueError: Something in it is no such line.
    """
    result = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        if not line.strip():
            continue
        parts = line.split(maxsplit=2)
        if line.startswith("failed") or len(parts) != 3 or len(parts[0]) != DIGITS or not parts[1].isdigit():
            raise ValueError(f"line {number} is none of a run that went well: {line!r}")
        result[parts[2]] = f"{parts[0]} {int(parts[1]):4d}"
    return result


if __name__ == "__main__":
    sys.exit(main())
