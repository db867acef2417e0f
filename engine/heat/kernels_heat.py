"""Kernels that let heat spread over a mesh."""

from __future__ import annotations

import warp as wp

from .kernels_cut_mesh import Cut, Stiffness, vertex_within

wp.set_module_options({"enable_backward": False})

# Of a vertex of triangles without an area.
SMALLEST_MASS = wp.constant(wp.float64(1.0e-300))
# Rows of the operator whose entries lie side by side: a CPU takes them at once.
ROWS = 8
ROWS_OF_BLOCK = wp.constant(ROWS)
# Entries of a vertex up to which those of the same column are added up: beyond, looking for them would take too long.
MOST_MERGED = wp.constant(128)


@wp.kernel
def sum_at_vertices(
    first: int,
    cut: Cut,
    stiffness: Stiffness,
    # outputs
    area: wp.array(dtype=wp.float64),
    root: wp.array(dtype=wp.float64),
    rate: wp.array(dtype=wp.float64),
):
    """Area that every vertex stands for, which is its mass, the root of that, and how fast heat leaves it at most."""
    i = first + wp.tid()
    total = wp.float64(0.0)
    leaves = wp.float64(0.0)
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        k = stiffness.order[s] % 3
        triangle = stiffness.order[s] / (3 * cut.small)
        total += stiffness.area[triangle]
        for step in range(2):
            leaves += wp.abs(stiffness.cotangent[triangle][(k + 1 + step) % 3])
    mass = wp.max(total, SMALLEST_MASS)
    area[i] = total
    root[i] = wp.sqrt(mass)
    rate[i] = leaves / mass


@wp.func
def limited(
    triangle: int, begin: int, cut: Cut, stiffness: Stiffness, root: wp.array(dtype=wp.float64), fastest: wp.float64
):
    """Half the cotangents at the corners ``begin`` to ``begin + 2`` of a small triangle, none above what its sides may have."""
    half = stiffness.cotangent[triangle]
    for k in range(3):
        one = vertex_within(begin + (k + 1) % 3, triangle, cut)
        other = vertex_within(begin + (k + 2) % 3, triangle, cut)
        lighter = wp.min(root[one], root[other])
        half[k] = wp.min(half[k], fastest * lighter * lighter)
    for k in range(3):
        if half[k] < wp.float64(0.0):
            # An obtuse angle takes back some of the other two: no more than there is.
            ahead = half[(k + 1) % 3]
            behind = half[(k + 2) % 3]
            half[k] = wp.max(half[k], -ahead * behind / (ahead + behind))
    return half


@wp.kernel
def find_entries(
    first: int,
    cut: Cut,
    stiffness: Stiffness,
    root: wp.array(dtype=wp.float64),
    fastest: wp.float64,
    # outputs
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    entries: wp.array(dtype=wp.int32),
    diagonal: wp.array(dtype=float),
    bound: wp.array(dtype=wp.float64),
):
    """The Laplacian over the roots of both masses, and what no row of it exceeds.

    A row has room for two entries for every corner, those of a vertex side by side; those of the two triangles beside a side are added
    up. Across no side heat spreads faster than ``fastest`` allows: with the masses as they are it still ends where it ought to.
    """
    i = first + wp.tid()
    own = wp.float64(0.0)
    others = wp.float64(0.0)
    begin = 2 * stiffness.start[i]
    end = begin
    merges = 2 * stiffness.start[i + 1] - begin <= MOST_MERGED
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        corner = stiffness.order[s]
        k = corner % 3
        triangle = corner / (3 * cut.small)
        halves = limited(triangle, corner - k, cut, stiffness, root, fastest)
        for step in range(2):
            # The angle that counts for a side lies opposite of it.
            other = vertex_within(corner - k + (k + 1 + step) % 3, triangle, cut)
            half = halves[(k + 2 - step) % 3]
            own += half
            others += wp.abs(half)
            entry = wp.float32(-half / (root[i] * root[other]))
            at = begin
            if not merges:
                at = end
            while at < end and column[at] != other:
                at += 1
            if at == end:
                column[at] = other
                value[at] = entry
                end += 1
            else:
                value[at] = value[at] + entry
    entries[i] = end - begin
    diagonal[i] = wp.float32(own / (root[i] * root[i]))
    bound[i] = (own + others) / (root[i] * root[i])


@wp.kernel
def find_widths(
    first: int,
    entries: wp.array(dtype=wp.int32),
    # outputs
    width: wp.array(dtype=wp.int32),
):
    """The most entries of a row in every block of rows."""
    block = first + wp.tid()
    most = int(0)
    for i in range(block * ROWS_OF_BLOCK, wp.min((block + 1) * ROWS_OF_BLOCK, entries.shape[0])):
        most = wp.max(most, entries[i])
    width[block] = most


@wp.kernel
def lay_side_by_side(
    first: int,
    start: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    entries: wp.array(dtype=wp.int32),
    block_start: wp.array(dtype=wp.int32),
    # outputs
    beside: wp.array(dtype=wp.int32),
    factor: wp.array(dtype=float),
):
    """Lay the first entries of all rows of a block side by side, then the second ones, and so on; shorter rows go on with zeros."""
    i = first + wp.tid()
    block = i / ROWS_OF_BLOCK
    for k in range(block_start[block + 1] - block_start[block]):
        to = ROWS_OF_BLOCK * (block_start[block] + k) + i % ROWS_OF_BLOCK
        if i < entries.shape[0] and k < entries[i]:
            beside[to] = column[2 * start[i] + k]
            factor[to] = value[2 * start[i] + k]
        else:
            beside[to] = i
            factor[to] = 0.0


@wp.kernel
def add_times(
    first: int,
    values: wp.array(dtype=wp.float64),
    factor: wp.float64,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Add so many times some numbers to others."""
    i = first + wp.tid()
    total[i] = total[i] + factor * values[i]


@wp.kernel
def begin_spread(
    first: int,
    charge: wp.array(dtype=wp.float64),
    total: wp.float64,
    target: wp.array(dtype=wp.float64),
    root: wp.array(dtype=wp.float64),
    coefficient: wp.float64,
    # outputs
    now: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """Charges over their total, less the target, over the roots of the masses; and the first term of what becomes of it."""
    i = first + wp.tid()
    start = (charge[i] / total - target[i]) / root[i]
    now[i] = wp.float32(start)
    result[i] = wp.float32(coefficient * start)


@wp.kernel
def halve(
    first: int,
    # outputs
    values: wp.array(dtype=float),
):
    i = first + wp.tid()
    values[i] = 0.5 * values[i]


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
    typedef float V;
    typedef int I;
    const int lanes = 1;
    auto load = [](const float* from) -> V {{ return from[0]; }};
    auto store = [](float* to, V v) {{ to[0] = v; }};
    auto numbers = [](const int* from) -> I {{ return from[0]; }};
    auto get = [](const float* from, I at) -> V {{ return from[at]; }};
#else
    typedef float V __attribute__((ext_vector_type({ROWS}), aligned(4)));
    typedef int I __attribute__((ext_vector_type({ROWS}), aligned(4)));
    const int lanes = {ROWS};
    auto load = [](const float* from) -> V {{ return *(const V*)from; }};
    auto store = [](float* to, V v) {{ *(V*)to = v; }};
    auto numbers = [](const int* from) -> I {{ return *(const I*)from; }};
    auto get = [](const float* from, I at) -> V
    {{
        V v;
        for (int l = 0; l < {ROWS}; ++l) v[l] = from[at[l]];
        return v;
    }};
#endif
    const int row = i * lanes;
    const int block = row / {ROWS};
    const int lane = row - block * {ROWS};
    const int end = {ROWS} * block_start.data[block + 1];
    V total = load(diagonal.data + row) * load(now.data + row);
    for (int k = {ROWS} * block_start.data[block] + lane; k < end; k += {ROWS})
        total += load(factor.data + k) * get(now.data, numbers(beside.data + k));
    // T_{{k+1}} = 2 (1 - scale A) T_k - T_{{k-1}}
    const V next = 2.0f * (load(now.data + row) - scale * total) - load(before.data + row);
    store(before.data + row, next);
    store(result.data + row, load(result.data + row) + coefficient * next);
""")
def next_polynomial(
    i: int,
    block_start: wp.array(dtype=wp.int32),
    beside: wp.array(dtype=wp.int32),
    factor: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    scale: float,
    now: wp.array(dtype=float),
    coefficient: float,
    before: wp.array(dtype=float),
    result: wp.array(dtype=float),
): ...


@wp.kernel
def chebyshev_step(
    first: int,
    block_start: wp.array(dtype=wp.int32),
    beside: wp.array(dtype=wp.int32),
    factor: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    scale: float,
    now: wp.array(dtype=float),
    coefficient: float,
    # outputs
    before: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """The next Chebyshev polynomial of a sparse operator, in the place of the one before the last; add it to the result.

    An element is a block of rows on a CPU, a row on a GPU. Entries lie as :func:`lay_side_by_side` leaves them.
    """
    next_polynomial(first + wp.tid(), block_start, beside, factor, diagonal, scale, now, coefficient, before, result)


@wp.kernel
def read(
    first: int,
    vertex: wp.array(dtype=wp.int32),
    amount: wp.array(dtype=wp.float64),
    smooth: wp.array(dtype=float),
    root: wp.array(dtype=wp.float64),
    factor: wp.float64,
    # outputs
    value: wp.array(dtype=float),
):
    """What is at points of what has spread, as a density, times a factor."""
    i = first + wp.tid()
    total = wp.float64(0.0)
    for k in range(3 * i, 3 * i + 3):
        v = vertex[k]
        total += amount[k] * wp.float64(smooth[v]) / root[v]
    value[i] = float(factor * total)
