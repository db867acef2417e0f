"""Which tiles of charges may have their pairs summed at once, so that no two threads write to one charge; see :mod:`.kernels_near`."""

from __future__ import annotations

from dataclasses import dataclass

from .kernels_field import COLUMNS_PER_CUTOFF, ROWS_PER_CUTOFF
from .kernels_near import Lot

__all__ = ["TileLot", "every_other", "lots_of"]

# Cells along a tile at least: one that reaches into the next tile must not meet what the one behind that reaches. The distance of the
# cut-off is rounded up to whole cells, and one is for its own rounding.
COLUMNS_PER_TILE = 2 * (COLUMNS_PER_CUTOFF + 1)
# A tile reaches into the rows above only.
ROWS_PER_TILE = ROWS_PER_CUTOFF


@dataclass(frozen=True)
class TileLot:
    """Tiles that are done together.

    Attributes:
        count: How many there are.
        for_kernels: Which.
    """

    count: int
    for_kernels: Lot


def lots_of(rows: int, columns: int, repeats: bool) -> list[TileLot]:
    """Share all tiles of a grid of cells out to lots.

    Args:
        rows: Rows of cells.
        columns: Cells in a row.
        repeats: Whether the grid goes on at its other side.
    """
    bands, tiles = max(1, rows // ROWS_PER_TILE), max(1, columns // COLUMNS_PER_TILE)
    lots = []
    for first_band, band_count in every_other(bands, repeats):
        for first_tile, tile_count in every_other(tiles, repeats):
            lot = Lot()
            lot.band, lot.bands = first_band, bands
            lot.tile, lot.tiles, lot.across = first_tile, tiles, tile_count
            lots.append(TileLot(band_count * tile_count, lot))
    return lots


def every_other(count: int, repeats: bool) -> list[tuple[int, int]]:
    """First and number of the even ones of ``count``, and of the odd ones; the last one alone where it would meet the first."""
    alone = count % 2 if repeats and count > 1 else 0
    shares = [(0, (count - alone + 1) // 2), (1, (count - alone) // 2), (count - 1, alone)]
    return [share for share in shares if share[1] > 0]
