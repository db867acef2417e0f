"""The kernel that sums the near part of the field on the CPU: every pair of neighbors once, for both of them.

What a charge does to another, that one does to it, so that half of the pairs have to be evaluated; and threads must not write to one
charge at once. So charges are handed out in *tiles*, some rows of some cells each: a tile has the pairs of its charges with those to
their right and those in the rows above. Tiles that are far enough apart are done together, the others one lot after the other
(:mod:`.near_tiles`). Lots and tiles are the same for any number of threads, and so are the sums, digit for digit.
"""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import CellGrid, SortedCharges
from ..space.kernels_space import period
from .kernels_field import PAIR_CONSTANTS, ROWS_PER_CUTOFF, Blurred, SortedSums, pair_strength

__all__ = ["LANES", "Lot", "add_pairs"]

wp.set_module_options({"enable_backward": False})

# Neighbors that are taken at once. Arrays of charges are longer by so many, since the last of them may read beyond.
LANES = 8


def _add_ranges(variance: str, weight: str) -> str:
    """C++ that goes through all ranges of neighbors, with the variance of a pair and what the own group sees of a neighbor."""
    return f"""
        for (int range = 0; range < ranges; ++range)
        {{
            const int end = ends[range];
            const float from_x = from_xs[range], from_y = from_ys[range];
            for (int j = begins[range]; j < end; j += L)
            {{
                #pragma clang fp contract(fast)
                const V dx = from_x - *(const V*)(xs + j);
                const V dy = from_y - *(const V*)(ys + j);
                {pair_strength(variance)}
                const I within = (r2 < cutoff2) & (lane < end - j);
                const V seen = within ? {weight} * strength : (V)0.0f;
                const V push_x = seen * dx, push_y = seen * dy;
                const V charge = *(const V*)(qs + j);
                sum_x += charge * push_x;
                sum_y += charge * push_y;
                const V back_x = *(const V*)(to_x + j) - own_charge * push_x;
                const V back_y = *(const V*)(to_y + j) - own_charge * push_y;
                // What lies behind the last may be another thread's.
                if (j + L <= end)
                {{
                    *(V*)(to_x + j) = back_x;
                    *(V*)(to_y + j) = back_y;
                }}
                else
                {{
#if defined(__AVX__)
                    __builtin_ia32_maskstoreps256((M*)(to_x + j), lane < end - j, back_x);
                    __builtin_ia32_maskstoreps256((M*)(to_y + j), lane < end - j, back_y);
#else
                    for (int l = 0; l < end - j; ++l)
                    {{
                        to_x[j + l] = back_x[l];
                        to_y[j + l] = back_y[l];
                    }}
#endif
                }}
            }}
        }}
"""


_OF_ALL = "of_all"
_OF_PAIR = "(own_variance + *(const V*)(vs + j)) * (*(const I*)(fs + j) == own_family ? (V)1.0f : (V)narrower)"
_BY_GROUP = "look_up(of_groups, *(const I*)(groups + j))"
_BY_CHARGE = "*(const V*)(ws + j)"

# Native code because this loop is most of the near field's time. Where the neighbors of a few charges are is found for all of them at
# once; cells of a row are neighbors in memory: those within the cut-off are one range, or two where it reaches round the domain.
_ADD_PAIRS = f"""
#if !defined(__CUDA_ARCH__)
    enum {{ L = {LANES}, ROWS = {ROWS_PER_CUTOFF + 1} }};
    typedef float V __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef int I __attribute__((ext_vector_type({LANES}), aligned(4)));
    typedef float M __attribute__((__vector_size__(32)));
    const I lane = {{{", ".join(map(str, range(LANES)))}}};
    auto whole = [](V v) -> I {{ return __builtin_convertvector(v, I); }};
    auto least = [](V v, float w) -> V {{ return __builtin_elementwise_min(v, (V)w); }};
    auto most = [](V v, float w) -> V {{ return __builtin_elementwise_max(v, (V)w); }};
    auto look_up = [](V table, I index) -> V
    {{
#if defined(__AVX2__)
        return __builtin_ia32_permvarsf256(table, index);
#else
        V found;
        for (int l = 0; l < L; ++l) found[l] = table[index[l] & (L - 1)];
        return found;
#endif
    }};
    {PAIR_CONSTANTS}
    const float* __restrict__ xs = charges.x.data;
    const float* __restrict__ ys = charges.y.data;
    const float* __restrict__ qs = charges.charge.data;
    const float* __restrict__ vs = blurred.variance.data;
    const int* __restrict__ fs = blurred.family.data;
    const int* __restrict__ groups = charges.group.data;
    float* __restrict__ to_x = near.x.data;
    float* __restrict__ to_y = near.y.data;
    const float per_column = grid.inverse_size[0], per_row = grid.inverse_size[1];
    const float height = 1.0f / per_row;
    const int columns = grid.count_x, rows = grid.count_y;
    const float period_x = space_period[0], period_y = space_period[1];
    const bool repeats_x = period_x > 0.0f, repeats_y = period_y > 0.0f;
    const int* __restrict__ own_starts = charges.cell_start.data + (size_t)row * columns;
    const int stop = own_starts[last_column];
    I lefts[ROWS], rights[ROWS];
    for (int start = own_starts[first_column]; start < stop; start += L)
    {{
        const V all_x = *(const V*)(xs + start), all_y = *(const V*)(ys + start);
        for (int k = 0; k < ROWS; ++k)
        {{
            const V beyond = most((float)(row + k) * height - all_y, 0.0f);
            const V beside = __builtin_elementwise_sqrt(most(cutoff2 - beyond * beyond, 0.0f));
            // Rounded down: what is cut off is positive.
            lefts[k] = whole((all_x - beside) * per_column + (float)columns) - columns;
            rights[k] = whole((all_x + beside) * per_column);
        }}
        for (int own = start; own < wp::min(start + L, stop); ++own)
        {{
            const float x = xs[own], y = ys[own], own_variance = vs[own], own_charge = qs[own];
            const int own_family = fs[own];
            const float* __restrict__ ws = charges.weight.data + (size_t)groups[own] * charges.weight_stride;
            int begins[2 * ROWS], ends[2 * ROWS], ranges = 0;
            float from_xs[2 * ROWS], from_ys[2 * ROWS];
            for (int k = 0; k < ROWS; ++k)
            {{
                const bool across = row + k >= rows;
                if (across && !repeats_y) break;
                const int* __restrict__ starts = own_starts + (size_t)k * columns - (across ? (size_t)rows * columns : 0);
                const int left = lefts[k][own - start], right = rights[k][own - start];
                const float from_y = across ? y - period_y : y;
                begins[ranges] = k == 0 ? own + 1 : starts[wp::max(left, 0)];
                ends[ranges] = starts[wp::min(right, columns - 1) + 1];
                from_xs[ranges] = x;
                from_ys[ranges++] = from_y;
                if (repeats_x && right >= columns)
                {{
                    begins[ranges] = starts[0];
                    ends[ranges] = starts[right - columns + 1];
                    from_xs[ranges] = x - period_x;
                    from_ys[ranges++] = from_y;
                }}
                else if (repeats_x && left < 0 && k > 0)
                {{
                    begins[ranges] = starts[left + columns];
                    ends[ranges] = starts[columns];
                    from_xs[ranges] = x + period_x;
                    from_ys[ranges++] = from_y;
                }}
            }}
            V sum_x = (V)0.0f, sum_y = (V)0.0f;
            if (charges.by_group == 0)
            {{
                {_add_ranges(_OF_PAIR, _BY_CHARGE)}
            }}
            else
            {{
                const V of_groups = *(const V*)ws;
                if (blurred.alike != 0)
                {{
                    const V of_all = own_variance + own_variance;
                    {_add_ranges(_OF_ALL, _BY_GROUP)}
                }}
                else
                {{
                    {_add_ranges(_OF_PAIR, _BY_GROUP)}
                }}
            }}
            float total_x = 0.0f, total_y = 0.0f;
            for (int l = 0; l < L; ++l)
            {{
                total_x += sum_x[l];
                total_y += sum_y[l];
            }}
            to_x[own] += total_x;
            to_y[own] += total_y;
        }}
    }}
#endif
"""


@wp.struct
class Lot:
    """Tiles that are done together: of every other band of rows from ``band`` on, ``across`` tiles, every other one from ``tile`` on.

    The grid has ``bands`` of ``tiles`` in all.
    """

    band: wp.int32
    bands: wp.int32
    tile: wp.int32
    tiles: wp.int32
    across: wp.int32


@wp.func_native(_ADD_PAIRS)
def add_pairs_of_cells(
    row: int,
    first_column: int,
    last_column: int,
    charges: SortedCharges,
    blurred: Blurred,
    grid: CellGrid,
    space_period: wp.vec2,
    cutoff: float,
    near: SortedSums,
):
    """Add the near forces of the pairs of a row's charges in these columns, without ``last_column``, to both of each pair."""
    ...


@wp.kernel
def add_pairs(
    first: int,
    lot: Lot,
    charges: SortedCharges,
    blurred: Blurred,
    grid: CellGrid,
    cutoff: float,
    # outputs
    near: SortedSums,
):
    """Add the near forces of all pairs of a tile to the sums of both; an element is a tile of the lot."""
    number = first + wp.tid()
    band = lot.band + 2 * (number / lot.across)
    tile = lot.tile + 2 * (number % lot.across)
    begin = grid.count_x * tile / lot.tiles
    end = grid.count_x * (tile + 1) / lot.tiles
    for row in range(grid.count_y * band / lot.bands, grid.count_y * (band + 1) / lot.bands):
        add_pairs_of_cells(row, begin, end, charges, blurred, grid, period(grid.space), cutoff, near)
