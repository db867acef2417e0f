"""Variations of a recipe: which values of which keys, and which combinations of them."""

from __future__ import annotations

import copy
import itertools
import re
import tomllib
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from ..errors import EshError

__all__ = ["DESIGNS", "Variation", "parse_variation", "scene_parameters", "set_key"]

DESIGNS = ("latin", "grid")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
RANGE = re.compile(rf"\s*({NUMBER})\s*:\s*({NUMBER})\s*(?::\s*(\d+)\s*)?")
NORMAL = re.compile(rf"\s*normal\(\s*({NUMBER})\s*,\s*({NUMBER})\s*\)\s*")
STEP = re.compile(r"(\w+)(?:\[([^\]]+)\])?(?:\.|$)")


@dataclass(frozen=True)
class Variation:
    """The values of one key.

    Attributes:
        key: Its place in the recipe: ``domain.size``, ``class[2].count`` or ``class[pine].size[large].area``.
        kind: ``"range"``, ``"list"`` or ``"normal"``.
        values: The two ends, the list, or mean and standard deviation.
        count: Of a range: how many values a grid has of it; 0 where that was not said.
    """

    key: str
    kind: str
    values: tuple[Any, ...]
    count: int = 0

    def at(self, share: float) -> Any:
        """Return the value below which lies this share (above 0, below 1) of all."""
        if self.kind == "list":
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.kind == "normal":
            value = NormalDist(*map(float, self.values)).inv_cdf(share)
            # As of a range: counts are whole numbers.
            return round(value) if all(isinstance(v, int) for v in self.values) else value
        low, high = self.values
        if isinstance(low, int) and isinstance(high, int):
            return low + min(int(share * (high - low + 1)), high - low)
        return low + share * (high - low)

    def grid(self) -> tuple[Any, ...]:
        """Return all values that a grid has.

        Raises:
            EshError: There is no end of them.
        """
        if self.kind == "list":
            return self.values
        if self.kind == "range" and self.count:
            low, high = self.values
            values = np.linspace(low, high, self.count).tolist()
            return (
                tuple(dict.fromkeys(map(round, values)))
                if all(isinstance(v, int) for v in self.values)
                else tuple(values)
            )
        raise EshError(
            f"--set {self.key}: a grid needs a list or a range with the number of its values, LOW:HIGH:NUMBER; "
            "or choose --design latin"
        )


def parse_variation(text: str) -> Variation:
    """Read ``KEY=LOW:HIGH[:NUMBER]``, ``KEY=A,B,…`` or ``KEY=normal(MEAN, DEVIATION)``.

    Raises:
        EshError: It is none of them.
    """
    key, equals, values = text.partition("=")
    key = key.strip()
    if not equals or not values.strip() or not _steps(key):
        raise EshError(f"--set must be KEY=VALUES, for example class[pine].count=100:200; got {text!r}")
    if match := RANGE.fullmatch(values):
        low, high = (_number(match[group]) for group in (1, 2))
        if not low < high:
            raise EshError(f"--set {key}: a range must go from a smaller to a larger number; got {values!r}")
        count = int(match[3] or 0)
        if match[3] and count < 2:
            raise EshError(f"--set {key}: a range must have at least 2 values; got {values!r}")
        return Variation(key, "range", (low, high), count)
    if match := NORMAL.fullmatch(values):
        mean, deviation = (_number(match[group]) for group in (1, 2))
        if deviation <= 0.0:
            raise EshError(f"--set {key}: a standard deviation must be above 0; got {values!r}")
        return Variation(key, "normal", (mean, deviation))
    return Variation(key, "list", tuple(map(_value, _split(values))))


def scene_parameters(
    variations: Sequence[Variation], seeds: range, design: str
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the seed and the values of every scene.

    Args:
        variations: What varies.
        seeds: One scene for each (Latin hypercube: every value is drawn from as many equal shares as there are scenes, and each share
            is drawn from once), or for each and every combination of values (grid).
        design: ``"latin"`` or ``"grid"``.
    """
    if design == "grid":
        for values in itertools.product(*(variation.grid() for variation in variations)):
            for seed in seeds:
                yield seed, dict(zip((variation.key for variation in variations), values, strict=True))
        return
    count = len(seeds)
    columns = []
    for variation in variations:
        # A stream for each key: another key more leaves the values of the others as they are.
        random = np.random.default_rng([zlib.crc32(variation.key.encode()), count])
        columns.append((random.permutation(count) + random.uniform(1e-9, 1.0 - 1e-9, count)) / count)
    for number, seed in enumerate(seeds):
        yield seed, {v.key: v.at(float(c[number])) for v, c in zip(variations, columns, strict=True)}


def set_key(entries: dict[str, Any], key: str, value: Any) -> None:
    """Set a value of a recipe; tables on the way that are missing are made, but not entries of lists.

    Raises:
        EshError: A part of the key that the recipe has not got.
    """
    *path, (last, chosen) = _steps(key)
    holder: Any = entries
    for name, choice in path:
        if choice is None:
            holder = holder.setdefault(name, {})
            if isinstance(holder, list):
                raise EshError(f"--set {key}: say which {name}, for example {name}[1]")
        else:
            holder = _choose(holder.get(name), name, choice, key)
        if not isinstance(holder, dict):
            raise EshError(f"--set {key}: {name} holds a value, no keys")
    if chosen is None:
        holder[last] = value
    else:
        values = holder.get(last)
        if not isinstance(values, list) or not chosen.isdecimal() or not 1 <= int(chosen) <= len(values):
            raise EshError(f"--set {key}: there is no {last}[{chosen}] in the recipe")
        values[int(chosen) - 1] = value


def varied(entries: dict[str, Any], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a recipe with other values."""
    changed = copy.deepcopy(entries)
    for key, value in parameters.items():
        set_key(changed, key, value)
    return changed


def _choose(tables: Any, name: str, choice: str, key: str) -> dict[str, Any]:
    found = [t for t in tables if isinstance(t, dict)] if isinstance(tables, list) else []
    if choice.isdecimal() and 1 <= int(choice) <= len(found):
        return found[int(choice) - 1]
    for table in found:
        if table.get("name") == choice:
            return table
    known = ", ".join(str(t.get("name", i + 1)) for i, t in enumerate(found)) or "none"
    raise EshError(f"--set {key}: there is no {name}[{choice}] in the recipe; it has {known}")


def _steps(key: str) -> list[tuple[str, str | None]]:
    steps, end = [], 0
    for match in STEP.finditer(key):
        if match.start() != end:
            return []
        steps.append((match[1], match[2]))
        end = match.end()
    return steps if end == len(key) and not key.endswith(".") else []


def _number(text: str) -> int | float:
    return int(text) if re.fullmatch(r"[-+]?\d+", text) else float(text)


def _split(text: str) -> list[str]:
    """Split at commas outside of brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        else:
            depth += (letter in "[{(") - (letter in ")}]")
        if letter == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def _value(text: str) -> Any:
    """Read a value as TOML has it; what is none is a text, such as the name of an image."""
    try:
        entries = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return entries["value"] if len(entries) == 1 else text
