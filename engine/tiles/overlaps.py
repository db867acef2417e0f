"""Which footprints of a tile overlap others, of its neighbors too: counted on what was placed, with nothing taken from windows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..device.launcher import launcher_of_process
from ..problem.note import Note
from ..quality.notes import note_on_pairs
from ..quality.overlaps import overlaps_of_each
from .bodies import PartBodies, written_atomically
from .layout import Box
from .plan import Plan
from .tile_files import angles_of, bends_of, widths_of
from .window_problem import model_of

__all__ = ["TileOverlaps", "overlaps_of_tile", "read_overlaps", "write_overlaps"]


@dataclass(frozen=True)
class TileOverlaps:
    """What overlaps in tiles.

    Attributes:
        ends: Bodies in pairs that overlap: each pair counts for both of its bodies, each in its own tile.
        deepest: How deep the deepest pair lies in each other [m]: the shortest way that parts it.
    """

    ends: int = 0
    deepest: float = 0.0

    def __add__(self, other: TileOverlaps) -> TileOverlaps:
        return TileOverlaps(self.ends + other.ends, max(self.deepest, other.deepest))

    @property
    def count(self) -> int:
        """Pairs of the whole domain, where these are of all of its tiles."""
        return self.ends // 2

    @property
    def notes(self) -> tuple[Note, ...]:
        """Sentences of a report."""
        return (note_on_pairs(self.count, self.deepest),) if self.count else ()


def overlaps_of_tile(plan: Plan, box: Box, bodies: PartBodies, own: np.ndarray, device: str) -> TileOverlaps:
    """Count the overlaps of a tile's bodies.

    Args:
        plan: The plan.
        box: The tile with what lies around it, as far as two bodies reach.
        bodies: Those in it.
        own: Which of them are the tile's.
        device: Where to count.
    """
    if len(bodies) < 2 or not own.any():
        return TileOverlaps()
    groups = plan.groups
    group = groups.group_of(bodies.identity)
    model = model_of(plan, box, bodies, np.zeros(len(bodies), np.int32), plan.problem.seed)
    footprints, bends = model.footprints, bends_of(plan, bodies)
    each = overlaps_of_each(
        footprints,
        bodies.position - box.low,
        angles_of(plan, bodies, group),
        bodies.length,
        widths_of(plan, bodies, group, groups.areas(bodies.identity)),
        model.problem.rectangle,
        launcher_of_process(device),
        smaller=np.minimum(footprints.room, 1.0),
        fixed=groups.is_fixed(bodies.identity),
        bends=None if bends is None else bends - box.low,
        tilt=footprints.tilts(model.body.identity, plan.problem.seed),
        apart=plan.problem.balance.classes_apart,
        class_index=groups.class_index[group],
    )
    if each is None:
        return TileOverlaps()
    found, depth, _ = each
    return TileOverlaps(int(found[own].sum(dtype=np.int64)), float(depth[own].max()))


def write_overlaps(path: Path, overlaps: TileOverlaps) -> None:
    """Write what overlaps in a tile."""
    with written_atomically(path) as file:
        np.savez(file, ends=np.array(overlaps.ends), deepest=np.array(overlaps.deepest))


def read_overlaps(path: Path) -> TileOverlaps:
    """Read what :func:`write_overlaps` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        return TileOverlaps(int(stored["ends"]), float(stored["deepest"]))
