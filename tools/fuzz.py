"""Solve recipes of all kinds, sensible and absurd, and look at what comes of them: ``python tools/fuzz.py --seconds 600 --seed 0``.

Whatever is asked for, the answer must be one sentence and nothing changed, or a placement with exact counts, inside the domain,
finite, on density, and a report that other code confirms. So it is after edits from one to another. Recipes are solved in a process
of their own; one that crashes, hangs or breaks the promise is printed, with what is needed to solve it again.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from fuzz_checks import check
from fuzz_edits import check_edits
from fuzz_recipes import Choices, RecipeMaker, Seeded, as_toml
from fuzz_surfaces import SurfaceRecipeMaker

# Seconds that one recipe may take where there is a processor for every thread; kernels that are compiled take more.
LONGEST_CASE = 120.0


def any_recipe(choose: Choices, folder: Path) -> str:
    """Write a recipe's images and meshes into a folder; return its text. About one value in a hundred has no meaning."""
    maker = choose.pick([RecipeMaker, RecipeMaker, SurfaceRecipeMaker])
    return as_toml(maker(choose, folder).recipe())


def solve_and_edit(
    text: str, choose: Choices, folder: Path, device: str, begin: Callable[[], object] = lambda: None
) -> str:
    """Look at what comes of a recipe as :func:`check` does; some that can be placed are edited, too.

    ``begin`` is called before every edit, which has as much time as a recipe.
    """
    what = check(text, folder, device)
    if what == "placed" and choose.pick([True, False]):
        check_edits(folder / "recipe.toml", choose, device, begin)
    return what


def work(seed: int, first: int, until: float, told: Path, device: str) -> int:
    """Solve recipe after recipe until it is time; write what is under way to a file."""
    import faulthandler

    faulthandler.enable()
    count = {"refused": 0, "placed": 0}
    k = first
    while time.time() < until:
        with tempfile.TemporaryDirectory(prefix="esh-fuzz-") as name:
            folder = Path(name)
            choose = Seeded(f"{seed}-{k}")
            text = any_recipe(choose, folder)
            told.write_text(f"{k} {count['refused']} {count['placed']}\n{text}", encoding="utf-8")
            count[solve_and_edit(text, choose, folder, device, told.touch)] += 1
        k += 1
    told.write_text(f"{k} {count['refused']} {count['placed']}\n", encoding="utf-8")
    return 0


def main(arguments: Sequence[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Solve recipes for a while; return 1 if one broke the promise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="how long (default: 600)")
    parser.add_argument("--seed", type=int, default=0, help="which recipes (default: 0)")
    parser.add_argument("--first", type=int, default=0, help="number of the first recipe (default: 0)")
    parser.add_argument("--device", default="cpu", help="where to solve them, such as cuda:0 (default: cpu)")
    parser.add_argument("--only", type=int, help="solve the recipe of this number alone, in this process")
    parser.add_argument("--told", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--until", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.told is not None:
        return work(options.seed, options.first, options.until, options.told, options.device)
    if options.only is not None:
        with tempfile.TemporaryDirectory(prefix="esh-fuzz-") as name:
            choose = Seeded(f"{options.seed}-{options.only}")
            text = any_recipe(choose, Path(name))
            say(text)
            say(solve_and_edit(text, choose, Path(name), options.device))
        return 0
    return _watch(options, say)


def _watch(options: argparse.Namespace, say: Callable[[str], None]) -> int:
    until = time.time() + options.seconds
    first, broken, refused, placed = options.first, 0, 0, 0
    with tempfile.TemporaryDirectory(prefix="esh-fuzz-told-") as name:
        told = Path(name) / "told"
        while time.time() < until:
            command = [
                sys.executable,
                __file__,
                "--seed",
                str(options.seed),
                "--first",
                str(first),
                "--device",
                options.device,
            ]
            told.write_text(f"{first} 0 0\n", encoding="utf-8")
            status, hung, end = _run_worker([*command, "--told", str(told), "--until", str(until)], told)
            head, _, text = told.read_text(encoding="utf-8").partition("\n")
            k, more_refused, more_placed = map(int, head.split())
            refused, placed = refused + more_refused, placed + more_placed
            if status == 0:
                break
            broken += 1
            what = f"took more than {LONGEST_CASE:.0f} s" if hung else f"ended with status {status}"
            say(
                f"recipe {k} of seed {options.seed} {what}:\n{end}\n{text}\nonce more: {command[0]} tools/fuzz.py "
                f"--seed {options.seed} --only {k} --device {options.device}\n"
            )
            first = k + 1
    say(f"{refused + placed + broken} recipes: {placed} placed, {refused} refused in a sentence, {broken} broken")
    return 1 if broken else 0


def _run_worker(command: Sequence[str], told: Path) -> tuple[int, bool, str]:
    """Run a process that writes into a file which recipe it is at; return its status, whether it hung, and the end of what it said."""
    hung = False
    with told.with_name("said").open("w+") as said:
        worker = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT)
        while worker.poll() is None:
            time.sleep(0.2)
            # Where others are at work, it takes as much longer as there are more of them.
            crowd = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)) if hasattr(os, "getloadavg") else 1.0
            if time.time() - told.stat().st_mtime > LONGEST_CASE * crowd:
                hung = True
                worker.kill()
                worker.wait()
        said.seek(0)
        return worker.returncode, hung, said.read()[-3000:]


if __name__ == "__main__":
    os.environ.setdefault("ESH_THREADS", "2")
    sys.exit(main())
