"""Recipes of all kinds, sensible and absurd, for :mod:`fuzz`."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

__all__ = ["Choices", "RecipeMaker", "Seeded", "as_toml"]


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
        recipe: dict[str, Any] = {"version": self._sometimes(1, 2, "1"), **self._place()}
        if choose.pick([True, False]):
            recipe["seed"] = self._sometimes(int(choose.between(1, 1e9)), 2**63 - 1, -1, 1.5)
        if choose.pick([True, False]):
            recipe["avoid_overlap"] = self._sometimes(choose.pick([True, False]), "yes")
        if choose.pick([True, False, False]):
            recipe["regularity"] = self._sometimes(choose.pick([0.0, 0.25, 1.0]), 1.5, "high")
        class_count = self._few()
        if balance := self._balance(class_count):
            recipe["balance"] = balance
        return {**recipe, **self._classes(class_count)}

    def _classes(self, class_count: int) -> dict[str, Any]:
        if self._choose.pick([False] * 7 + [True]):
            return {"image": self._color_image()}
        return {"class": [self._class(c) for c in range(class_count)]}

    def _sometimes(self, value: Any, *others: Any) -> Any:
        """``value``, and now and then one of the others, which have no meaning."""
        return self._choose.pick(others) if others and self._choose.pick(range(120)) == 0 else value

    def _few(self) -> int:
        return self._choose.pick([1, 1, 1, 2, 2, 3, 7])

    def _place(self) -> dict[str, Any]:
        """Where: a domain."""
        choose = self._choose
        scale = self._sometimes(choose.pick([1.0, 1.0, 10.0, 1e-3, 1e4]), 1e-9, 1e12)
        aspect = choose.pick([1.0, 1.0, 0.75, 3.0, 40.0, 900.0, 1e4])
        self._size = choose.pick([[scale, scale * aspect], [scale * aspect, scale]])
        self._ground = self._size[0] * self._size[1]
        made: dict[str, Any] = {
            "size": self._sometimes(self._size, [1.0], [0.0, 1.0], "wide", [math.nan, 1.0], [1e13, 1.0])
        }
        if choose.pick([True, False]):
            made["boundary"] = self._sometimes(choose.pick(["open", "mirror", "periodic", "natural"]), "torus")
        return {"domain": made}

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

    def _density(self) -> Any:
        return self._choose.pick([1, 0.5, self._image(), self._image()])

    def _class(self, number: int) -> dict[str, Any]:
        choose = self._choose
        made: dict[str, Any] = {
            "name": self._sometimes(f"class {number}", "class 0", "é" * 40),
            "density": self._sometimes(self._density(), 0, -1, math.inf, 1e300),
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

    def _direction(self) -> Any:
        return self._choose.pick(["density", "none", 0.7, -100.0, self._image()])

    def _line(self) -> dict[str, Any]:
        choose = self._choose
        longest = max(self._size)
        made: dict[str, Any] = {
            "length": self._sometimes(longest * choose.between(1e-3, 0.3), longest, 2 * longest, 0.0)
        }
        if choose.pick([False, False, True]):
            made["length"], made["length_range"] = self._image(), [longest * 0.01, longest * 0.1]
        if choose.pick([True, False]):
            made["direction"] = self._sometimes(self._direction(), "up", 1e39)
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
