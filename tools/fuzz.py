"""Solve recipes of all kinds, sensible and absurd, and look at what comes of them: ``python tools/fuzz.py --seconds 600 --seed 0``.

Whatever is asked for, the answer must be one sentence and nothing changed, or a placement with exact counts, inside the domain,
finite, on density, and a report that other code confirms. Recipes are solved in a process of their own; one that crashes, hangs or
breaks the promise is printed, with what is needed to solve it again.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
# Seconds that one recipe may take where there is a processor for every thread; kernels that are compiled take more.
LONGEST_CASE = 120.0
MOST_STEPS = 12
# Bodies up to which pairs are counted by brute force.
FEW_BODIES = 600


class Choices(Protocol):
    """Where decisions come from: a seed, or Hypothesis."""

    def pick(self, options: Sequence[Any]) -> Any:
        """Return one of them."""

    def between(self, low: float, high: float) -> float:
        """Return a number, evenly from its logarithm."""


class Seeded:
    """Decisions that follow from a seed."""

    def __init__(self, seed: str) -> None:
        self._random = random.Random(seed)

    def pick(self, options: Sequence[Any]) -> Any:
        """Return one of them."""
        return self._random.choice(options)

    def between(self, low: float, high: float) -> float:
        """Return a number, evenly from its logarithm."""
        return math.exp(self._random.uniform(math.log(low), math.log(high)))


def any_recipe(choose: Choices, folder: Path) -> str:
    """Write a recipe's images into a folder; return its text. About one value in a hundred has no meaning."""
    return as_toml(RecipeMaker(choose, folder).recipe())


class RecipeMaker:
    """Makes one recipe, part by part.

    Args:
        choose: Where decisions come from; the same decisions make the same recipe.
        folder: Where its images go.
    """

    def __init__(self, choose: Choices, folder: Path) -> None:
        self._choose, self._folder = choose, folder
        self._images = 0
        self._size = [1.0, 1.0]
        self._ground = 1.0

    def recipe(self) -> dict[str, Any]:
        """The whole recipe."""
        choose = self._choose
        domain = self._domain()
        recipe: dict[str, Any] = {"version": self._sometimes(1, 2, "1"), "domain": domain}
        if choose.pick([True, False]):
            recipe["seed"] = self._sometimes(int(choose.between(1, 1e9)), 2**63 - 1, -1, 1.5)
        if choose.pick([True, False]):
            recipe["avoid_overlap"] = self._sometimes(choose.pick([True, False]), "yes")
        if choose.pick([True, False, False]):
            recipe["regularity"] = self._sometimes(choose.pick([0.0, 0.25, 1.0]), 1.5, "high")
        class_count = self._few()
        if balance := self._balance(class_count):
            recipe["balance"] = balance
        if choose.pick([False] * 7 + [True]):
            recipe["image"] = self._color_image()
        else:
            recipe["class"] = [self._class(c) for c in range(class_count)]
        return recipe

    def _sometimes(self, value: Any, *others: Any) -> Any:
        """``value``, and now and then one of the others, which have no meaning."""
        return self._choose.pick(others) if others and self._choose.pick(range(120)) == 0 else value

    def _few(self) -> int:
        return self._choose.pick([1, 1, 1, 2, 2, 3, 7])

    def _domain(self) -> dict[str, Any]:
        choose = self._choose
        scale = self._sometimes(choose.pick([1.0, 1.0, 10.0, 1e-3, 1e4]), 1e-9, 1e12)
        aspect = choose.pick([1.0, 1.0, 0.75, 3.0, 40.0, 900.0, 1e4])
        self._size = choose.pick([[scale, scale * aspect], [scale * aspect, scale]])
        self._ground = self._size[0] * self._size[1]
        made: dict[str, Any] = {
            "size": self._sometimes(self._size, [1.0], [0.0, 1.0], "wide", [math.nan, 1.0], [1e13, 1.0])
        }
        if choose.pick([True, False]):
            made["boundary"] = self._sometimes(choose.pick(["open", "mirror", "periodic"]), "torus")
        return made

    def _balance(self, class_count: int) -> dict[str, Any]:
        choose = self._choose
        made: dict[str, Any] = {}
        if choose.pick([True, False]):
            made["class_separation"] = self._sometimes(choose.pick([0.0, 0.3, 1.0]), 2.0, math.nan)
        if choose.pick([True, False]):
            made["size_emphasis"] = self._sometimes(
                choose.pick([1.0, 2.0, 10.0, 1e3, [1.0, 5.0, 5.0]]), 1e300, 0.5, [3.0, 2.0]
            )
        if choose.pick([True, False]):
            made["rare_emphasis"] = self._sometimes(choose.pick([0.0, 0.5, 2.0]), 2.5, "much")
        if choose.pick([False, False, True]):
            made["non_overlap"] = np.eye(class_count).tolist()
        return made

    def _color_image(self) -> dict[str, Any]:
        made = {"file": self._image(), "area": self._ground / self._choose.between(5, 500)}
        if self._choose.pick([True, False]):
            made["model"] = self._choose.pick(["CMY", "CMYK", "CMY-RGB-K", "RGB"])
        return made

    def _image(self) -> str:
        """The name of an image that has been written, or of something else."""
        choose = self._choose
        self._images += 1
        rows, columns = (choose.pick([1, 2, 3, 8, 31, 64]) for _ in range(2))
        name = f"image{self._images}"
        kind = choose.pick(["noise", "noise", "edge", "spot", "ramp", "ramp", "one", "deep", "color", "huge", "alpha"])
        y, x = np.mgrid[0:rows, 0:columns]
        noise = np.random.default_rng(int(choose.between(1, 1e6))).random((rows, columns))
        values = {
            "edge": (x < columns / 2).astype(float),
            "spot": ((x == columns // 2) & (y == rows // 2)).astype(float),
            "ramp": (x + 1.0) / columns,
            "one": np.ones((rows, columns)),
            "huge": noise * 10.0 ** choose.pick([-300, -30, 30, 300]),
        }.get(kind, noise)
        if kind == "huge":
            np.save(self._folder / f"{name}.npy", values)
            return f"{name}.npy"
        save_picture(values, kind, self._folder / f"{name}.png")
        return self._sometimes(f"{name}.png", f"{name}.jpg", "absent.png", "recipe.toml")

    def _class(self, number: int) -> dict[str, Any]:
        choose = self._choose
        made: dict[str, Any] = {
            "name": self._sometimes(f"class {number}", "class 0", "é" * 40),
            "density": self._sometimes(choose.pick([1, 0.5, self._image(), self._image()]), 0, -1, math.inf, 1e300),
        }
        if isinstance(made["density"], str) and choose.pick([False, False, True]):
            made["invert"] = True
        if choose.pick([False] * 4 + [True]):
            made["density_correction"] = True
        if choose.pick([False, False, True]):
            made["clustering"] = self._sometimes(choose.pick([0.0, 0.3, 1.0]), -1, "much")
            made["clump_size"] = self._sometimes(choose.between(0.01, 10.0), -1.0, 1e-9)
        if choose.pick([False] * 4 + [True]):
            made["look_at"] = {
                "point": self._sometimes([choose.pick([-9.0, 0.0, 2.5]), choose.pick([-1.0, 0.5, 9.0]), 0.0], [1.0], 3),
                "spread": self._sometimes(choose.pick([0.0, 0.1, 3.0]), -1.0, math.inf),
                "front": self._sometimes(choose.pick(["x", "-x", "y", "-y"]), "z"),
            }
        if choose.pick([False] * 4 + [True]):
            made["unsharp"] = {
                "amount": self._sometimes(choose.between(0.1, 5), 1e300),
                "radius": self._sometimes(2.0, 1e-9, 1e300),
            }
        sizes = self._few()
        if choose.pick([False, False, True]):
            made["count"] = self._sometimes(
                choose.pick(["cover", int(choose.between(1, 300))]), 0, 2**63 - 1, 10**400, "many"
            )
        made["size"] = [self._one_size(k, sizes if "count" in made else 0) for k in range(sizes)]
        return made

    def _one_size(self, number: int, of_shares: int) -> dict[str, Any]:
        choose = self._choose
        count = int(choose.between(1, choose.pick([3, 40, 400])))
        made: dict[str, Any] = {
            "name": self._sometimes(f"size {number}", "", "a\nb", "=1"),
            "area": self._areas(max(count, 1)),
        }
        if of_shares:
            made["share"] = self._sometimes(1.0 / of_shares, 0.0, 2.0)
        else:
            made["count"] = self._sometimes(count, 0, -1, 2**31, 10**30, 2.5)
        if isinstance(made["area"], list) and choose.pick([True, False]):
            made["distribution"] = self._sometimes(choose.pick(["linear", "uniform"]), "normal", [1.0])
        if choose.pick([False, False, True]):
            made["line"] = self._line()
        return made

    def _areas(self, count: int) -> Any:
        """An area, or a range of them."""
        choose, ground = self._choose, self._ground
        one = self._sometimes(ground / count * choose.between(1e-3, 1.5), ground * 1e3, 1e-18, 0.0, 1e30, ground * 1e-9)
        if choose.pick([False, False, True]):
            ratio = self._sometimes(choose.between(1.0, 30.0), 1e6, 0.5, 1e9)
            return [one, one * ratio]
        return one

    def _line(self) -> dict[str, Any]:
        choose = self._choose
        longest = max(self._size)
        made: dict[str, Any] = {
            "length": self._sometimes(longest * choose.between(1e-3, 0.3), longest, 2 * longest, 0.0)
        }
        if choose.pick([False, False, True]):
            made["length"], made["length_range"] = self._image(), [longest * 0.01, longest * 0.1]
        if choose.pick([True, False]):
            directions = ["density", "none", 0.7, -100.0, self._image()]
            made["direction"] = self._sometimes(choose.pick(directions), "up", 1e39)
            if isinstance(made["direction"], str) and "." in made["direction"]:
                made["direction_kind"] = choose.pick(["angle", "vector"])
        for key, values in {
            "width": [longest * 0.01, longest * 0.1, longest, 1e-9],
            "charges": [2, 3, 5, 8, 64],
            "middle_charge": [1, 6.0, 0.01, self._sometimes(2.0, 1e9)],
            "turn_weights": [[0.4, 0.4], [0.0, 0.0], [1.0, 0.0], self._sometimes([0.4, 0.2], [0.9, 0.9])],
            "stretch_weights": [[0.2, 0.1], [0.0, 1.0], [1.0, 0.0]],
            "straightness": [0.0, 0.3, 1.0],
            "tensor_scales": [[1.0, 3.0], [0.1, 0.1], [1e-9, 50.0], [1e9, 1e9]],
        }.items():
            if choose.pick([False, False, False, True]):
                made[key] = choose.pick(values)
        return made


def save_picture(values: np.ndarray, kind: str, path: Path) -> None:
    """Write numbers 0..1 as a picture of a kind: "deep" has 16 bits, "color" three channels, "alpha" four."""
    from PIL import Image

    gray = np.round(255 * values).astype(np.uint8)
    picture = Image.fromarray(gray)
    if kind == "deep":
        picture = Image.fromarray(gray.astype(np.uint16) * 257)
    elif kind in ("color", "alpha"):
        picture = Image.fromarray(np.stack([gray, gray[::-1], gray[:, ::-1]], axis=2))
        if kind == "alpha":
            picture.putalpha(Image.fromarray(gray.T.copy()).resize(gray.shape[::-1]))
    picture.save(path)


def as_toml(table: dict[str, Any], place: str = "") -> str:
    """Write a recipe as TOML: numbers, texts, lists, tables and lists of tables."""
    lines, below = [], []
    for key, value in table.items():
        if isinstance(value, dict):
            below.append(f"[{place}{key}]\n{as_toml(value, f'{place}{key}.')}")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            below += [f"[[{place}{key}]]\n{as_toml(entry, f'{place}{key}.')}" for entry in value]
        else:
            lines.append(f"{key} = {_value(value)}")
    return "\n".join([*lines, *below]) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\u{ord(c):04x}" for c in value)
        return f'"{escaped}"'
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


def check(text: str, folder: Path) -> str:
    """Solve a recipe; return "refused" or "placed", raise AssertionError where what came of it is neither."""
    import esh

    path = folder / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    before = _contents(folder)
    try:
        placement = esh.solve(esh.read_recipe(path), device="cpu", max_steps=MOST_STEPS)
    except esh.EshError as error:
        sentence = str(error)
        assert sentence and "\n" not in sentence and len(sentence) < 1000, f"not a sentence: {sentence!r}"
        assert _contents(folder) == before, "a file was changed"
        return "refused"
    check_placement(placement)
    esh.write_placement(folder / "made.npz", placement)
    with np.load(folder / "made.npz", allow_pickle=False) as stored:
        assert (stored["position"] == placement.position).all(), "other positions were written"
    (folder / "made.npz").unlink()
    assert _contents(folder) == before, "a file was changed"
    return "placed"


def check_placement(placement: Any) -> None:
    """Raise AssertionError unless a placement is what its problem asks for, and its report is true."""
    problem, report = placement.problem, placement.report
    size = np.array(problem.domain.size)
    position = placement.position
    assert np.isfinite(position).all(), "a position is no number"
    assert (position >= 0.0).all() and (position <= size).all(), "a body lies outside"
    assert not problem.domain.periodic or (position < size).all(), "a body lies on the far edge of a periodic domain"
    for c, body_class in enumerate(problem.classes):
        for s, entry in enumerate(body_class.sizes):
            own = (placement.class_index == c) & (placement.size_index == s)
            counted = report.classes[c].sizes[s]
            assert own.sum() == entry.count == counted.asked == counted.placed, "counts differ"
            areas = placement.area[own]
            low, high = np.min(entry.area), np.max(entry.area)
            assert (areas >= low * (1 - 1e-9)).all() and (areas <= high * (1 + 1e-9)).all(), "an area is another"
            if entry.line is None:
                assert not placement.length[own].any(), "a dot has an axis"
                assert body_class.look_at is not None or not placement.angle[own].any(), "a dot is turned for nothing"
                image = body_class.density_image
                column = np.clip((position[own, 0] / size[0] * image.shape[1]).astype(int), 0, image.shape[1] - 1)
                row = np.clip(((1 - position[own, 1] / size[1]) * image.shape[0]).astype(int), 0, image.shape[0] - 1)
                assert (image[row, column] > 0.0).all(), "a dot lies where there is no density"
            else:
                assert (placement.length[own] > 0.0).all() and (placement.width[own] > 0.0).all(), (
                    "a line has no extent"
                )
        assert 0.0 <= report.classes[c].coverage_error < math.inf, "a coverage error is no number"
    for values in (placement.angle, placement.length, placement.width, placement.area):
        assert np.isfinite(values).all(), "a pose is no number"
    # A line has no front; what looks at a point has.
    most = np.where(placement.width > 0.0, 0.5001, 1.0001) * math.pi
    assert (np.abs(placement.angle) <= most).all(), "a turn is more than it need be"
    assert 0.0 <= report.coverage_error < math.inf and 0.0 < report.covered < math.inf, "the report is no number"
    assert 1 <= report.steps <= MOST_STEPS and report.seconds > 0.0
    if 1 < len(position) <= FEW_BODIES:
        _check_distances(placement)


def _check_distances(placement: Any) -> None:
    """Compare the smallest spacing, and the overlaps of discs, with those of all pairs."""
    problem, report = placement.problem, placement.report
    size = np.array(problem.domain.size)
    i, j = np.triu_indices(len(placement.position), 1)
    way = placement.position[j] - placement.position[i]
    if problem.domain.periodic:
        way -= size * np.rint(way / size)
    distance = np.hypot(*way.T)
    if report.smallest_spacing is None:
        assert distance.min() > 0.0, "two bodies lie on one another, and none are neighbors"
    if not placement.width.any() and not problem.avoid_overlap:
        radius = np.sqrt(placement.area / math.pi)
        touching = radius[i] + radius[j]
        # Of classes that may overlap nothing counts.
        matrix = problem.balance.non_overlap
        if matrix is not None:
            kept = np.asarray(matrix)[placement.class_index[i], placement.class_index[j]] > 0.0
            touching, i, j, distance = touching[kept], i[kept], j[kept], distance[kept]
        # Positions are float32, in units of the spacing.
        rounding = 3e-5 * touching + 1e-6 * size.max()
        most = int((distance < touching + rounding).sum())
        # What counts lies in the other by more than 1e-3 of the narrower one's width.
        counted = touching - 2e-3 * np.minimum(radius[i], radius[j])
        least = int((distance < counted - rounding).sum())
        crowded = np.bincount(np.concatenate([i, j])[np.tile(distance < touching, 2)], minlength=1).max(initial=0) > 190
        # A body that reaches round the domain overlaps copies of itself, which are counted, too.
        around = problem.domain.periodic and 2.0 * radius.max() > size.min()
        assert around or report.overlaps <= most, (
            f"{report.overlaps} overlaps are reported, and there are {most} at most"
        )
        assert crowded or report.overlaps >= least, f"{report.overlaps} overlaps are reported of at least {least}"


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def work(seed: int, first: int, until: float, told: Path) -> int:
    """Solve recipe after recipe until it is time; write what is under way to a file."""
    import faulthandler

    faulthandler.enable()
    count = {"refused": 0, "placed": 0}
    k = first
    while time.time() < until:
        with tempfile.TemporaryDirectory(prefix="esh-fuzz-") as name:
            folder = Path(name)
            text = any_recipe(Seeded(f"{seed}-{k}"), folder)
            told.write_text(f"{k} {count['refused']} {count['placed']}\n{text}", encoding="utf-8")
            count[check(text, folder)] += 1
        k += 1
    told.write_text(f"{k} {count['refused']} {count['placed']}\n", encoding="utf-8")
    return 0


def main(arguments: Sequence[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Solve recipes for a while; return 1 if one broke the promise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="how long (default: 600)")
    parser.add_argument("--seed", type=int, default=0, help="which recipes (default: 0)")
    parser.add_argument("--first", type=int, default=0, help="number of the first recipe (default: 0)")
    parser.add_argument("--only", type=int, help="solve the recipe of this number alone, in this process")
    parser.add_argument("--told", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--until", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.told is not None:
        return work(options.seed, options.first, options.until, options.told)
    if options.only is not None:
        with tempfile.TemporaryDirectory(prefix="esh-fuzz-") as name:
            text = any_recipe(Seeded(f"{options.seed}-{options.only}"), Path(name))
            say(text)
            say(check(text, Path(name)))
        return 0
    return _watch(options, say)


def _watch(options: argparse.Namespace, say: Callable[[str], None]) -> int:
    until = time.time() + options.seconds
    first, broken, refused, placed = options.first, 0, 0, 0
    with tempfile.TemporaryDirectory(prefix="esh-fuzz-told-") as name:
        told = Path(name) / "told"
        while time.time() < until:
            command = [sys.executable, __file__, "--seed", str(options.seed), "--first", str(first)]
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
                f"--seed {options.seed} --only {k}\n"
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
