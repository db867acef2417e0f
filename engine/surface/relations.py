"""Which parts of a surface stand on one another: bodies on the one see those on the other, and nothing follows for third ones."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["CRUMBS", "Relations"]

# Parts of a smaller area, in square spacings, hold too few bodies to be a surface of their own.
CRUMBS = 8.0


@dataclass(frozen=True, eq=False)
class Relations:
    """Pairs of parts of which one stands on the other.

    Attributes:
        pair: Their labels, the smaller one first, shape ``[p, 2]``; every pair is there once.
        area: Of the smaller part of each, in square units, shape ``[p]``.
        place: Places along the lines where they do, in units from the middle of the surface, shape ``[m, 3]``.
    """

    pair: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    area: np.ndarray = field(default_factory=lambda: np.zeros(0))
    place: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def __len__(self) -> int:
        return len(self.pair)

    def behind(self, numbers: np.ndarray, label_count: int, length: float = 0.0) -> tuple[np.ndarray, int]:
        """Return numbers, int32, and behind them the relations as kernels take them; and where these begin, 0 for none.

        Args:
            numbers: One or more, shape ``[n]``.
            label_count: Number of labels.
            length: Spacing of those who look, in units: to them a part is nothing that holds only a few of them.
        """
        pair = self.pair[self.area >= CRUMBS * length**2]
        if not len(pair):
            return numbers.astype(np.int32), 0
        both = np.concatenate([pair, pair[:, ::-1]])
        both = both[np.lexsort((both[:, 1], both[:, 0]))]
        start = np.searchsorted(both[:, 0], np.arange(label_count + 1))
        start += len(numbers) + len(start)
        return np.concatenate([numbers, start, both[:, 1]]).astype(np.int32), len(numbers)
