"""Kernels that let heat spread over a mesh."""

from __future__ import annotations

import warp as wp

from .kernels_cut_mesh import Cut, Stiffness, vertex_at

wp.set_module_options({"enable_backward": False})

# Of a vertex of triangles without an area.
SMALLEST_MASS = wp.constant(wp.float64(1.0e-300))


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
        triangle = stiffness.order[s] / 3 / cut.small
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
        lighter = wp.min(root[vertex_at(begin + (k + 1) % 3, cut)], root[vertex_at(begin + (k + 2) % 3, cut)])
        half[k] = wp.min(half[k], fastest * lighter * lighter)
    for k in range(3):
        if half[k] < wp.float64(0.0):
            # An obtuse angle takes back some of the other two: no more than there is.
            one = half[(k + 1) % 3]
            other = half[(k + 2) % 3]
            half[k] = wp.max(half[k], -one * other / (one + other))
    return half


@wp.kernel
def fill_operator(
    first: int,
    cut: Cut,
    stiffness: Stiffness,
    root: wp.array(dtype=wp.float64),
    fastest: wp.float64,
    # outputs
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    bound: wp.array(dtype=wp.float64),
):
    """The Laplacian over the roots of both masses, and what no row of it exceeds.

    Beside the diagonal there are two entries for every corner, those of a vertex side by side. Across no side heat spreads faster than
    ``fastest`` allows: with the masses as they are it still ends where it ought to.
    """
    i = first + wp.tid()
    own = wp.float64(0.0)
    others = wp.float64(0.0)
    for s in range(stiffness.start[i], stiffness.start[i + 1]):
        corner = stiffness.order[s]
        k = corner % 3
        halves = limited(corner / 3 / cut.small, corner - k, cut, stiffness, root, fastest)
        for step in range(2):
            # The angle that counts for a side lies opposite of it.
            other = vertex_at(corner - k + (k + 1 + step) % 3, cut)
            half = halves[(k + 2 - step) % 3]
            own += half
            others += wp.abs(half)
            column[2 * s + step] = other
            value[2 * s + step] = wp.float32(-half / (root[i] * root[other]))
    diagonal[i] = wp.float32(own / (root[i] * root[i]))
    bound[i] = (own + others) / (root[i] * root[i])


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


@wp.kernel
def chebyshev_step(
    first: int,
    start: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    diagonal: wp.array(dtype=float),
    scale: float,
    now: wp.array(dtype=float),
    factor: float,
    # outputs
    before: wp.array(dtype=float),
    result: wp.array(dtype=float),
):
    """The next Chebyshev polynomial of a sparse operator, in the place of the one before the last; add it to the result.

    ``start`` counts pairs of entries.
    """
    i = first + wp.tid()
    total = diagonal[i] * now[i]
    for k in range(2 * start[i], 2 * start[i + 1]):
        total += value[k] * now[column[k]]
    # T_{k+1} = 2 (1 - scale A) T_k - T_{k-1}
    new = 2.0 * (now[i] - scale * total) - before[i]
    before[i] = new
    result[i] = result[i] + factor * new


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
