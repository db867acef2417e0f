"""Bodies of a part of the domain, and the files that they wait in between two passes."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import EshError
from .coarse import Patch

__all__ = [
    "PartBodies",
    "read_bodies",
    "read_length_factor",
    "read_patch",
    "write_atomically",
    "write_part",
    "written_atomically",
]


@dataclass(frozen=True, eq=False)
class PartBodies:
    """Some bodies of a huge problem.

    Attributes:
        identity: Their numbers, int64, ascending.
        position: [m], shape ``[n, 2]``, float64.
        angle: Directions of their axes [rad], float64.
        length: Lengths of these [m], float64; 0 for dots.
        turn: Turns of outlines, of lines from their axes [rad], float64; 0 where there are none.
        bend: How far the charges of lines that bend stand beside their axes [m], shape ``[n, charges]``, float64; of the most charges
            that any of the problem's has, none where none bends.
    """

    identity: np.ndarray
    position: np.ndarray
    angle: np.ndarray
    length: np.ndarray
    turn: np.ndarray
    bend: np.ndarray

    def __len__(self) -> int:
        return len(self.identity)

    def chosen(self, which: np.ndarray) -> PartBodies:
        """Some of them: indices, shape ``[k]``, or a truth value for each, shape ``[n]``."""
        return PartBodies(
            self.identity[which],
            self.position[which],
            self.angle[which],
            self.length[which],
            self.turn[which],
            self.bend[which],
        )

    def at(self, position: np.ndarray) -> PartBodies:
        """The same at other places [m], shape ``[n, 2]``."""
        return replace(self, position=position)

    @classmethod
    def none(cls) -> PartBodies:
        """No bodies."""
        return cls(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0)))

    @classmethod
    def joined(cls, parts: list[PartBodies]) -> PartBodies:
        """All of several, by their numbers."""
        parts = [part for part in parts if len(part)]
        if not parts:
            return cls.none()
        identity = np.concatenate([part.identity for part in parts])
        order = np.argsort(identity, kind="stable")
        return cls(
            identity[order],
            np.concatenate([part.position for part in parts])[order],
            np.concatenate([part.angle for part in parts])[order],
            np.concatenate([part.length for part in parts])[order],
            np.concatenate([part.turn for part in parts])[order],
            np.concatenate([part.bend for part in parts])[order],
        )


def write_part(path: Path, bodies: PartBodies, patch: Patch, length_factor: np.ndarray) -> None:
    """Write bodies, how they were counted, and what made up for the pressure on lines of every size, shape ``[layers]``."""
    arrays = {"identity": bodies.identity, "position": bodies.position, "length_factor": length_factor}
    if bodies.length.any():
        arrays |= {"angle": bodies.angle, "length": bodies.length}
    if bodies.turn.any():
        arrays["turn"] = bodies.turn
    if bodies.bend.size:
        arrays["bend"] = bodies.bend
    with written_atomically(path) as file:
        np.savez(file, **arrays, patch=patch.values, corner=np.array([patch.row, patch.column]))


def read_bodies(path: Path) -> PartBodies:
    """Read the bodies that :func:`write_part` wrote."""
    with _opened(path) as stored:
        identity = stored["identity"]
        nothing = np.zeros(len(identity))
        angle, length, turn = (stored[key] if key in stored.files else nothing for key in ("angle", "length", "turn"))
        bend = stored["bend"] if "bend" in stored.files else np.zeros((len(identity), 0))
        return PartBodies(identity, stored["position"], angle, length, turn, bend)


def read_length_factor(path: Path) -> np.ndarray:
    """Read what made up for the pressure on lines of every size, see :func:`write_part`; 1 where there are none."""
    with _opened(path) as stored:
        return stored["length_factor"]


def read_patch(path: Path) -> Patch:
    """Read how bodies were counted."""
    with _opened(path) as stored:
        row, column = stored["corner"].tolist()
        return Patch(row, column, stored["patch"])


def _opened(path: Path) -> np.lib.npyio.NpzFile:
    try:
        opened = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise EshError(f"{path} cannot be read; remove it to have it made again: {error}") from None
    assert isinstance(opened, np.lib.npyio.NpzFile)
    return opened


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file that is there as a whole, or not at all, whenever the process is killed."""
    with written_atomically(path) as file:
        file.write(content)


@contextlib.contextmanager
def written_atomically(path: Path) -> Iterator[BinaryIO]:
    """Yield a file to write to, which is there as a whole once the block ends, or not at all."""
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with beside.open("wb") as file:
            yield file
        os.replace(beside, path)
    except OSError as error:
        raise EshError(f"{path} cannot be written: {(error.strerror or str(error)).lower()}") from None
    finally:
        beside.unlink(missing_ok=True)
