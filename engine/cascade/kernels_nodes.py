"""Kernels of nodes: weights by which charges, and finer nodes, are deposited on them, and an octave's Gaussian between nodes."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_facets import across
from .kernels_points import Points, side_factor
from .native_lanes import PLANES_CODE

wp.set_module_options({"enable_backward": False})

# Squared distance at which a weight ends, in squared widths.
REACH_SQUARED = wp.constant(10.0)
# Nodes on the other side of a sheet have this factor on their weights at least: they hardly count beside others, and alone are better
# than none.
LEAST_FACTOR = wp.constant(1.0e-4)
# If all nodes lie to one side of a point, weights that are exact for linear functions are large and of both signs. From level to level
# they would amplify every small move, and steps would oscillate. The leverage of a point is its squared distance from the middle of
# the nodes over their variance. Beyond this leverage, weights are exact for linear functions in part only. Measured on Blender's
# Suzanne with 4,096 bodies: without a bound sums of absolute weights are up to 7, forces after 50 steps .02 to .1; with 1 they are up
# to 1.3 and .01, with 0.3 up to 1.1 and .006.
MOST_LEVERAGE = wp.constant(0.3)
# Regularization of the linear fit (ridge), as a share of the sum of the weights: it keeps slopes from following rounding errors.
RIDGE = wp.constant(1.0e-3)
# Numbers of a node in Weights.plane.
NODE_PLANES = 6
# Weights of several nodes at once: see node_weight, which does the same for one.
WEIGHT_CODE = f"""
            const V dx = load(x + j) - position[0];
            const V dy = load(y + j) - position[1];
            const V dz = load(z + j) - position[2];
            const V cosine = load(up_x + j) * normal[0] + load(up_y + j) * normal[1] + load(up_z + j) * normal[2];
            const V u = most(1.0f - (dx * dx + dy * dy + dz * dz) * inverse_reach, (V)0.0f);
            V w = u * u * u * most(0.5f + 0.5f * cosine, (V){LEAST_FACTOR}f);
            w = j + lane < end ? w : (V)0.0f;
"""
Moments = wp.types.vector(6, wp.float32)


@wp.struct
class Row:
    """The linear fit at a point: what corrects its weights when it is deposited, and when a potential is interpolated at it.

    In the basis (1, a, b), with a and b along the surface, the inverse of the matrix of moments has six entries.

    Attributes:
        value: Its first row, with those of a and b turned into a vector in space: x, y, z, and the entry of the constant.
        slope: The other three entries.
        total: Sum of the weights before they are corrected.
    """

    value: wp.vec4
    slope: wp.vec3
    total: wp.float32


@wp.struct
class Weights:
    """Weights by which points are deposited on nodes.

    Attributes:
        nodes: The nodes.
        plane: x of all nodes, then y, z, and x, y and z of their normals.
        start: Where the runs of every home begin in ``near``, shape ``[node_count + 1]``.
        near: For every home the nodes that its points may be deposited on, as runs.
        width: Width of the weights.
    """

    nodes: Points
    plane: wp.array(dtype=float)
    start: wp.array(dtype=wp.int32)
    near: wp.array(dtype=wp.vec2i)
    width: wp.float32


@wp.struct
class Homed:
    """Points and the nodes that are their homes; ``order`` lists them home after home, those of a node from ``start`` on."""

    points: Points
    home: wp.array(dtype=wp.int32)
    order: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)


@wp.func
def node_weight(way: wp.vec3, one: wp.vec3, other: wp.vec3, inverse_reach: float):
    """Weight of a node at the end of ``way``, before correction; ``inverse_reach`` is 1 over the squared distance at which it ends."""
    u = wp.max(1.0 - wp.dot(way, way) * inverse_reach, 0.0)
    return u * u * u * wp.max(side_factor(one, other), LEAST_FACTOR)


@wp.func_native(f"""{PLANES_CODE}
    V m00 = (V)0.0f, m01 = (V)0.0f, m02 = (V)0.0f, m11 = (V)0.0f, m12 = (V)0.0f, m22 = (V)0.0f;
    for (int k = first_run; k < last_run; ++k)
    {{
        const int end = near.data[k][1];
        for (int j = near.data[k][0]; j < end; j += lanes)
        {{
            {WEIGHT_CODE}
            const V a = (dx * along[0] + dy * along[1] + dz * along[2]) * inverse_width;
            const V b = (dx * beside[0] + dy * beside[1] + dz * beside[2]) * inverse_width;
            m00 += w;
            m01 += w * a;
            m02 += w * b;
            m11 += w * a * a;
            m12 += w * a * b;
            m22 += w * b * b;
        }}
    }}
    wp::vec_t<6, float> result;
    result[0] = sum(m00);
    result[1] = sum(m01);
    result[2] = sum(m02);
    result[3] = sum(m11);
    result[4] = sum(m12);
    result[5] = sum(m22);
    return result;
""")
def moments_of(
    position: wp.vec3,
    normal: wp.vec3,
    along: wp.vec3,
    beside: wp.vec3,
    first_run: int,
    last_run: int,
    near: wp.array(dtype=wp.vec2i),
    plane: wp.array(dtype=float),
    count: int,
    inverse_reach: float,
    inverse_width: float,
) -> Moments: ...


@wp.func
def fitted_row(position: wp.vec3, normal: wp.vec3, home: int, weights: Weights):
    """Row of a point: it corrects the weights of the nodes near it so that they are exact for linear functions."""
    along = across(normal)
    beside = wp.cross(normal, along)
    inverse_reach = 1.0 / (REACH_SQUARED * weights.width * weights.width)
    inverse_width = 1.0 / weights.width
    m = moments_of(
        position,
        normal,
        along,
        beside,
        weights.start[home],
        weights.start[home + 1],
        weights.near,
        weights.plane,
        weights.nodes.position.shape[0],
        inverse_reach,
        inverse_width,
    )
    ridge = RIDGE * m[0]
    m11 = m[3] + ridge
    m22 = m[5] + ridge
    c00 = m11 * m22 - m[4] * m[4]
    c01 = m[2] * m[4] - m[1] * m22
    c02 = m[1] * m[4] - m[2] * m11
    scale = 1.0 / wp.max(m[0] * c00 + m[1] * c01 + m[2] * c02, 1.0e-30)
    row = Row()
    row.total = m[0]
    to_space = (scale * c01 * inverse_width) * along + (scale * c02 * inverse_width) * beside
    row.value = wp.vec4(to_space[0], to_space[1], to_space[2], scale * c00)
    row.slope = wp.vec3(
        (m[0] * m22 - m[2] * m[2]) * scale, (m[1] * m[2] - m[0] * m[4]) * scale, (m[0] * m11 - m[1] * m[1]) * scale
    )
    return row


@wp.func
def steadied(row: Row):
    """Row with a bounded leverage; the sum of its weights is 1 as before."""
    leverage = row.total * row.value[3] - 1.0
    if leverage > MOST_LEVERAGE:
        share = MOST_LEVERAGE / leverage
        row.value = share * row.value + wp.vec4(0.0, 0.0, 0.0, (1.0 - share) / row.total)
    return row


@wp.func
def share_of(row: Row, way: wp.vec3, weight: float):
    """Share of a charge that a node gets: its weight, corrected."""
    return weight * (row.value[3] + row.value[0] * way[0] + row.value[1] * way[1] + row.value[2] * way[2])


@wp.kernel
def find_homes(
    first: int,
    home: wp.array(dtype=wp.int32),
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Keys by which points are sorted by their homes."""
    i = first + wp.tid()
    key[i] = home[i]
    order[i] = i


@wp.kernel
def carry_homes(
    first: int,
    source: wp.array(dtype=wp.int32),
    home_before: wp.array(dtype=wp.int32),
    # outputs
    home: wp.array(dtype=wp.int32),
):
    """Copy homes by the number that each tile had before, -1 for new ones."""
    i = first + wp.tid()
    if source[i] >= 0:
        home[i] = home_before[source[i]]


@wp.kernel
def settle(
    first: int,
    tile: wp.array(dtype=wp.int32),
    near: wp.array(dtype=wp.int32),
    place: wp.array(dtype=wp.int32),
    # outputs
    home: wp.array(dtype=wp.int32),
):
    """Write the homes of tiles: the nearest node on the surface, or the first if none is near, by its number among all nodes."""
    i = first + wp.tid()
    home[tile[i]] = place[wp.max(near[i], 0)]


@wp.kernel
def fill_planes(
    first: int,
    nodes: Points,
    # outputs
    plane: wp.array(dtype=float),
):
    """Copy positions and normals into the layout of :attr:`Weights.plane`."""
    i = first + wp.tid()
    count = nodes.position.shape[0]
    for k in range(3):
        plane[k * count + i] = nodes.position[i][k]
        plane[(3 + k) * count + i] = nodes.normal[i][k]


@wp.kernel
def count_shares(
    first: int,
    to_nodes: int,
    fine: Homed,
    weights: Weights,
    # outputs
    count: wp.array(dtype=wp.int32),
):
    """Count the coarser nodes in every finer node's list; or, if ``to_nodes``, the finer nodes in every coarser node's list."""
    i = first + wp.tid()
    inverse_reach = 1.0 / (REACH_SQUARED * weights.width * weights.width)
    found = int(0)
    if to_nodes == 0:
        for k in range(weights.start[fine.home[i]], weights.start[fine.home[i] + 1]):
            for j in range(weights.near[k][0], weights.near[k][1]):
                way = weights.nodes.position[j] - fine.points.position[i]
                if wp.dot(way, way) * inverse_reach < 1.0:
                    found += 1
    else:
        for k in range(weights.start[i], weights.start[i + 1]):
            for s in range(fine.start[weights.near[k][0]], fine.start[weights.near[k][1]]):
                way = weights.nodes.position[i] - fine.points.position[fine.order[s]]
                if wp.dot(way, way) * inverse_reach < 1.0:
                    found += 1
    count[i] = found


@wp.kernel
def list_shares(
    first: int,
    to_nodes: int,
    fine: Homed,
    row: wp.array(dtype=Row),
    weights: Weights,
    entry_start: wp.array(dtype=wp.int32),
    # outputs
    entry: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
):
    """Write the entries that :func:`count_shares` counts, and their values. ``row`` is in the order of the finer nodes."""
    i = first + wp.tid()
    nodes = weights.nodes
    inverse_reach = 1.0 / (REACH_SQUARED * weights.width * weights.width)
    at = entry_start[i]
    if to_nodes == 0:
        for k in range(weights.start[fine.home[i]], weights.start[fine.home[i] + 1]):
            for j in range(weights.near[k][0], weights.near[k][1]):
                way = nodes.position[j] - fine.points.position[i]
                if wp.dot(way, way) * inverse_reach < 1.0:
                    w = node_weight(way, fine.points.normal[i], nodes.normal[j], inverse_reach)
                    entry[at] = j
                    value[at] = share_of(row[i], way, w)
                    at += 1
    else:
        for k in range(weights.start[i], weights.start[i + 1]):
            for s in range(fine.start[weights.near[k][0]], fine.start[weights.near[k][1]]):
                j = fine.order[s]
                way = nodes.position[i] - fine.points.position[j]
                if wp.dot(way, way) * inverse_reach < 1.0:
                    w = node_weight(way, nodes.normal[i], fine.points.normal[j], inverse_reach)
                    entry[at] = j
                    value[at] = share_of(row[j], way, w)
                    at += 1


@wp.kernel
def fit_rows_in_place(
    first: int,
    fine: Homed,
    weights: Weights,
    # outputs
    row: wp.array(dtype=Row),
):
    i = first + wp.tid()
    row[i] = steadied(fitted_row(fine.points.position[i], fine.points.normal[i], fine.home[i], weights))


@wp.kernel
def weigh_octave(
    first: int,
    nodes: Points,
    start: wp.array(dtype=wp.int32),
    near: wp.array(dtype=wp.int32),
    width: float,
    height: float,
    # outputs
    value: wp.array(dtype=float),
):
    """Write an octave's Gaussian between every node and those in its list."""
    i = first + wp.tid()
    scale = -0.5 / (width * width)
    for k in range(start[i], start[i + 1]):
        j = near[k]
        way = nodes.position[j] - nodes.position[i]
        value[k] = height * wp.exp(wp.dot(way, way) * scale) * side_factor(nodes.normal[i], nodes.normal[j])
