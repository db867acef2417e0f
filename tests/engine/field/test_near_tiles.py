"""Tiles of charges that are done together reach no cell in common, and every cell is in one tile."""

import itertools
from collections import Counter

import pytest
from esh.engine.field.kernels_field import COLUMNS_PER_CUTOFF, ROWS_PER_CUTOFF
from esh.engine.field.near_tiles import every_other, lots_of


def tiles_of(lot, rows: int, columns: int):
    """First and last row and column of every tile of a lot, as the kernel finds them."""
    which = lot.for_kernels
    for number in range(lot.count):
        band, tile = which.band + 2 * (number // which.across), which.tile + 2 * (number % which.across)
        yield (
            range(rows * band // which.bands, rows * (band + 1) // which.bands),
            range(columns * tile // which.tiles, columns * (tile + 1) // which.tiles),
        )


def reached(own_rows: range, own_columns: range, rows: int, columns: int, repeats: bool):
    """Cells that a tile writes to: as far as the cut-off and one column more, to the right in its rows, and in those above."""
    aside = COLUMNS_PER_CUTOFF + 1
    for row in range(own_rows.start, own_rows.stop + ROWS_PER_CUTOFF):
        left = own_columns.start if row in own_rows else own_columns.start - aside
        for column in range(left, own_columns.stop + aside):
            if repeats:
                yield row % rows, column % columns
            elif row < rows and 0 <= column < columns:
                yield row, column


# A periodic grid is three cut-offs high and wide at least.
GRIDS = [(6, 12, True), (7, 13, True), (9, 21, True), (11, 57, True), (6, 40, True)]
GRIDS += [(rows, columns, False) for rows, columns in itertools.product((1, 2, 3, 8, 13), (1, 4, 11, 20, 47))]


@pytest.mark.parametrize(("rows", "columns", "repeats"), GRIDS)
def test_tiles_cover_the_grid_and_those_of_a_lot_do_not_meet(rows, columns, repeats):
    own: Counter = Counter()
    lots = lots_of(rows, columns, repeats)
    for lot in lots:
        cells: Counter = Counter()
        for own_rows, own_columns in tiles_of(lot, rows, columns):
            own.update(itertools.product(own_rows, own_columns))
            cells.update(set(reached(own_rows, own_columns, rows, columns, repeats)))
        assert max(cells.values()) == 1
    assert set(own) == set(itertools.product(range(rows), range(columns))) and max(own.values()) == 1


def test_the_last_of_an_odd_number_goes_alone_where_it_would_meet_the_first():
    assert every_other(5, repeats=False) == [(0, 3), (1, 2)]
    assert every_other(5, repeats=True) == [(0, 2), (1, 2), (4, 1)]
    assert every_other(4, repeats=True) == [(0, 2), (1, 2)]
    assert every_other(1, repeats=True) == every_other(1, repeats=False) == [(0, 1)]
