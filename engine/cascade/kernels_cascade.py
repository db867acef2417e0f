"""Kernels of the octave cascade: between charges and nodes, between the levels of nodes, and between near charges."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_facets import Facets, interpolated
from .kernels_points import Points, side_factor
from .native_lanes import LANES_CODE, PLANES_CODE

wp.set_module_options({"enable_backward": False})

# A weight reaches as far as this many squared widths.
REACH_SQUARED = wp.constant(10.0)
# Nodes of the other side of a sheet count, but hardly: alone they are better than nothing.
LEAST_FACTOR = wp.constant(1.0e-4)
# Where all nodes lie to one side, weights that are exact for linear functions are large and of both signs: from level to level they
# make more of every small move, and steps swing. How far off the middle of the nodes a point lies, squared, over how far these are
# spread, from which on weights are exact for linear functions in part only. Measured on Blender's Suzanne with 4,096 bodies: without
# a bound sums of weights' sizes are up to 7, forces after 50 steps .02 to .1; with 1 they are up to 1.3 and .01, with 0.3 up to 1.1
# and .006.
MOST_LEVERAGE = wp.constant(0.3)
# What keeps the fit of a slope from following rounding, as a share of the weights.
RIDGE = wp.constant(1.0e-3)


@wp.struct
class Row:
    """How a charge is shared out, and a potential read at it.

    The first row of the inverse of its moments, turned into space; the other entries of the inverse; and the sum of the weights before
    they are corrected.
    """

    value: wp.vec4
    slope: wp.vec3
    total: wp.float32


@wp.struct
class Weights:
    """Nodes, the runs of nodes near each of them (``near`` from ``start`` on), and the width of the weights that share points out.

    ``plane`` has x, y and z of all nodes, one after the other, then those of their normals.
    """

    nodes: Points
    plane: wp.array(dtype=float)
    start: wp.array(dtype=wp.int32)
    near: wp.array(dtype=wp.vec2i)
    width: wp.float32


@wp.struct
class Homed:
    """Points and the nodes that are their homes; ``order`` has them home after home, those of a node from ``start`` on."""

    points: Points
    home: wp.array(dtype=wp.int32)
    order: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)


@wp.struct
class SortedCharges:
    """Charges home after home: their group, and their numbers, each of all charges after the one before.

    These are x, y and z, those of the normal, the charge, how it is shared out (value and slope of :class:`Row`), and the variance
    that it is blurred by, where that differs.
    """

    group: wp.array(dtype=wp.int32)
    plane: wp.array(dtype=float)


@wp.struct
class NearPart:
    """What is summed over pairs: the runs of homes near each home (``near`` from ``start`` on), the force, and M, flat.

    Distance times force is a polynomial of the square of the distance over that of ``cutoff``, where it ends: by ``term``. A ``core``
    (see :mod:`esh.engine.field.blur`) adds to it, of which no polynomial knows the end: this square over that of ``cutoff``. Where
    ``blurs``, the polynomial is the one of points, and the blur of every pair adds to it; the core ends at this q then.
    """

    start: wp.array(dtype=wp.int32)
    near: wp.array(dtype=wp.vec2i)
    term: wp.array(dtype=float)
    cutoff: wp.float32
    interaction: wp.array(dtype=float)
    blurs: wp.int32
    core: wp.float32
    core_end: wp.float32


@wp.struct
class NearTarget:
    """The near part of the target's force at corners of tiles, image after image, and the charge of each that every group sees.

    Where small charges are blurred less there is a force for each of a few shares, one after the other, and every group has the number
    of its own, ``share``.
    """

    force: wp.array(dtype=wp.vec3)
    corner_count: wp.int32
    column_count: wp.int32
    attraction: wp.array(dtype=float)
    share: wp.array(dtype=wp.int32)


@wp.func
def across(normal: wp.vec3):
    """A direction at a right angle to a normal."""
    away = wp.vec3(-normal[2], 0.0, normal[0])
    if wp.abs(normal[0]) < 0.6:
        away = wp.vec3(0.0, -normal[2], normal[1])
    return wp.normalize(away)


@wp.func
def node_weight(way: wp.vec3, one: wp.vec3, other: wp.vec3, inverse_reach: float):
    """Weight of a node that is ``way`` off; ``inverse_reach`` is 1 over the squared distance at which it ends."""
    u = wp.max(1.0 - wp.dot(way, way) * inverse_reach, 0.0)
    return u * u * u * wp.max(side_factor(one, other), LEAST_FACTOR)


# Where the numbers of a charge begin (SortedCharges), and how many there are; and how many of a node (Weights).
OF_POSITION = wp.constant(0)
OF_NORMAL = wp.constant(3)
OF_CHARGE = wp.constant(6)
OF_VALUE = wp.constant(7)
OF_SLOPE = wp.constant(11)
OF_VARIANCE = wp.constant(14)
CHARGE_PLANES = 15
NODE_PLANES = 6
# Terms of the polynomial in NearPart. What is blurred usually is wrong by .014 with 8, by .002 with 10, by .0001 with 12.
NEAR_TERMS = 12
# The weight of a node: see node_weight, which says the same for one.
_WEIGHT = f"""
            const V dx = load(x + j) - position[0];
            const V dy = load(y + j) - position[1];
            const V dz = load(z + j) - position[2];
            const V cosine = load(up_x + j) * normal[0] + load(up_y + j) * normal[1] + load(up_z + j) * normal[2];
            const V u = most(1.0f - (dx * dx + dy * dy + dz * dz) * inverse_reach, (V)0.0f);
            V w = u * u * u * most(0.5f + 0.5f * cosine, (V){LEAST_FACTOR}f);
            w = j + lane < end ? w : (V)0.0f;
"""
Moments = wp.types.vector(6, wp.float32)


@wp.func_native(f"""{PLANES_CODE}
    V m00 = (V)0.0f, m01 = (V)0.0f, m02 = (V)0.0f, m11 = (V)0.0f, m12 = (V)0.0f, m22 = (V)0.0f;
    for (int k = first_run; k < last_run; ++k)
    {{
        const int end = near.data[k][1];
        for (int j = near.data[k][0]; j < end; j += lanes)
        {{
            {_WEIGHT}
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


@wp.func_native(f"""{PLANES_CODE}
    V s0 = (V)0.0f, s1 = (V)0.0f, s2 = (V)0.0f;
    for (int k = first_run; k < last_run; ++k)
    {{
        const int end = near.data[k][1];
        for (int j = near.data[k][0]; j < end; j += lanes)
        {{
            {_WEIGHT}
            const V f = w * (group_count == 1 ? load(potential.data + j) : get(potential.data, (j + lane) * group_count + group));
            s0 += f;
            s1 += f * ((dx * along[0] + dy * along[1] + dz * along[2]) * inverse_width);
            s2 += f * ((dx * beside[0] + dy * beside[1] + dz * beside[2]) * inverse_width);
        }}
    }}
    return wp::vec3(sum(s0), sum(s1), sum(s2));
""")
def potential_of(
    position: wp.vec3,
    normal: wp.vec3,
    along: wp.vec3,
    beside: wp.vec3,
    first_run: int,
    last_run: int,
    near: wp.array(dtype=wp.vec2i),
    plane: wp.array(dtype=float),
    count: int,
    potential: wp.array(dtype=float),
    group_count: int,
    group: int,
    inverse_reach: float,
    inverse_width: float,
) -> wp.vec3: ...


@wp.func_native(f"""{PLANES_CODE}
    const float* charge = up_z + count;
    const float* value_x = charge + count;
    const float* value_y = value_x + count;
    const float* value_z = value_y + count;
    const float* value = value_z + count;
    float* to = node_charge.data + node * group_count;
    V alone = (V)0.0f;
    for (int k = first_run; k < last_run; ++k)
    {{
        const int end = charge_start.data[near.data[k][1]];
        for (int j = charge_start.data[near.data[k][0]]; j < end; j += lanes)
        {{
            {_WEIGHT}
            // The way leads from the charge to the node.
            const V of_unit = load(value + j) - load(value_x + j) * dx - load(value_y + j) * dy - load(value_z + j) * dz;
            const V share = w * of_unit * load(charge + j);
            if (group_count == 1)
            {{
                alone += share;
                continue;
            }}
#if defined(__CUDA_ARCH__)
            to[charge_group.data[j]] += share;
#else
            for (int l = 0; l < lanes && j + l < end; ++l) to[charge_group.data[j + l]] += share[l];
#endif
        }}
    }}
    if (group_count == 1) to[0] = sum(alone);
""")
def gather_at_node(
    node: int,
    position: wp.vec3,
    normal: wp.vec3,
    first_run: int,
    last_run: int,
    near: wp.array(dtype=wp.vec2i),
    charge_start: wp.array(dtype=wp.int32),
    charge_group: wp.array(dtype=wp.int32),
    plane: wp.array(dtype=float),
    count: int,
    inverse_reach: float,
    group_count: int,
    node_charge: wp.array(dtype=float),
): ...


@wp.func_native(f"""{PLANES_CODE}
    const float* charge = up_z + count;
    const float* variance = x + {OF_VARIANCE} * count;
    const float* factor = interaction.data + group * group_count;
    const float per_core_end = 1.0f / core_end;
    V to_x = (V)0.0f, to_y = (V)0.0f, to_z = (V)0.0f;
    for (int k = first_run; k < last_run; ++k)
    {{
        const int end = charge_start.data[near.data[k][1]];
        for (int j = charge_start.data[near.data[k][0]]; j < end; j += lanes)
        {{
            const V dx = position[0] - load(x + j);
            const V dy = position[1] - load(y + j);
            const V dz = position[2] - load(z + j);
            const V square = dx * dx + dy * dy + dz * dz;
            const V cosine = load(up_x + j) * normal[0] + load(up_y + j) * normal[1] + load(up_z + j) * normal[2];
            V amount = load(charge + j) * (0.5f + 0.5f * cosine);
            if (group_count > 1)
            {{
#if defined(__CUDA_ARCH__)
                amount *= factor[charge_group.data[j]];
#else
                for (int l = 0; l < lanes && j + l < end; ++l) amount[l] *= factor[charge_group.data[j + l]];
#endif
            }}
            else amount *= factor[0];
            const V at = square * inverse_cutoff;
            V force = (V)term.data[{NEAR_TERMS} - 1];
            for (int t = {NEAR_TERMS} - 2; t >= 0; --t) force = force * at + term.data[t];
            if (blurs)
            {{
                const V q = 0.5f * square / (load(variance + j) + own_variance);
                const V core_left = most(1.0f - q * per_core_end, (V)0.0f);
                force += core * core_left * core_left - fading(q);
            }}
            else if (core > 0.0f)
            {{
                const V core_left = most(1.0f - at * per_core_end, (V)0.0f);
                force += core * core_left * core_left;
            }}
            // A charge is at no distance from itself, and so its term vanishes.
            V strength = amount * force / (square + 1e-12f);
            strength = ((at < 1.0f) & (j + lane < end)) ? strength : (V)0.0f;
            to_x += strength * dx;
            to_y += strength * dy;
            to_z += strength * dz;
        }}
    }}
    return wp::vec3(sum(to_x), sum(to_y), sum(to_z));
""")
def sum_near(
    position: wp.vec3,
    normal: wp.vec3,
    group: int,
    first_run: int,
    last_run: int,
    near: wp.array(dtype=wp.vec2i),
    charge_start: wp.array(dtype=wp.int32),
    charge_group: wp.array(dtype=wp.int32),
    plane: wp.array(dtype=float),
    count: int,
    inverse_cutoff: float,
    term: wp.array(dtype=float),
    interaction: wp.array(dtype=float),
    group_count: int,
    blurs: int,
    own_variance: float,
    core: float,
    core_end: float,
) -> wp.vec3: ...


@wp.func
def number_of(s: int, plane: int, charges: SortedCharges):
    """One of the numbers of a charge."""
    return charges.plane[plane * charges.group.shape[0] + s]


@wp.func
def vector_of(s: int, plane: int, charges: SortedCharges):
    """Three of the numbers of a charge, from one of them on."""
    return wp.vec3(number_of(s, plane, charges), number_of(s, plane + 1, charges), number_of(s, plane + 2, charges))


@wp.func
def set_vector(s: int, plane: int, vector: wp.vec3, charges: SortedCharges):
    count = charges.group.shape[0]
    for k in range(3):
        charges.plane[(plane + k) * count + s] = vector[k]


@wp.func
def fitted_row(position: wp.vec3, normal: wp.vec3, home: int, weights: Weights):
    """The row of a charge: weights of the nodes near it are corrected so that they are exact for linear functions."""
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
    """A row with bounded weights, whose sum is 1 as before."""
    leverage = row.total * row.value[3] - 1.0
    if leverage > MOST_LEVERAGE:
        share = MOST_LEVERAGE / leverage
        row.value = share * row.value + wp.vec4(0.0, 0.0, 0.0, (1.0 - share) / row.total)
    return row


@wp.func
def share_of(row: Row, way: wp.vec3, weight: float):
    """Share of a charge that a node gets."""
    return weight * (row.value[3] + row.value[0] * way[0] + row.value[1] * way[1] + row.value[2] * way[2])


@wp.kernel
def find_homes(
    first: int,
    home: wp.array(dtype=wp.int32),
    # outputs
    key: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
):
    """Sort charges by the nodes that are their homes."""
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
    """Homes of what was there before, by the number that each had, -1 for others."""
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
    """Give tiles their homes: what is near to each, or the first where nothing is, by its place among all nodes."""
    i = first + wp.tid()
    home[tile[i]] = place[wp.max(near[i], 0)]


@wp.kernel
def fill_planes(
    first: int,
    nodes: Points,
    # outputs
    plane: wp.array(dtype=float),
):
    """Write what :class:`Weights` has of its nodes once more."""
    i = first + wp.tid()
    count = nodes.position.shape[0]
    for k in range(3):
        plane[k * count + i] = nodes.position[i][k]
        plane[(3 + k) * count + i] = nodes.normal[i][k]


@wp.kernel
def fit_rows(
    first: int,
    charges: Homed,
    charge: wp.array(dtype=float),
    charge_group: wp.array(dtype=wp.int32),
    weights: Weights,
    # outputs
    sorted_charges: SortedCharges,
):
    """Copy charges into the order of their homes, and find their rows."""
    s = first + wp.tid()
    i = charges.order[s]
    position = charges.points.position[i]
    normal = charges.points.normal[i]
    own = fitted_row(position, normal, charges.home[i], weights)
    count = sorted_charges.group.shape[0]
    sorted_charges.group[s] = charge_group[i]
    set_vector(s, OF_POSITION, position, sorted_charges)
    set_vector(s, OF_NORMAL, normal, sorted_charges)
    sorted_charges.plane[OF_CHARGE * count + s] = charge[i]
    set_vector(s, OF_VALUE, wp.vec3(own.value[0], own.value[1], own.value[2]), sorted_charges)
    sorted_charges.plane[(OF_VALUE + 3) * count + s] = own.value[3]
    set_vector(s, OF_SLOPE, own.slope, sorted_charges)


@wp.kernel
def deposit(
    first: int,
    sorted_charges: SortedCharges,
    charge_start: wp.array(dtype=wp.int32),
    weights: Weights,
    group_count: int,
    # outputs
    node_charge: wp.array(dtype=float),
):
    """Share charges out among the nodes; a node adds up what it gets, always in one order. Groups of a node lie side by side."""
    j = first + wp.tid()
    for g in range(group_count):
        node_charge[j * group_count + g] = 0.0
    gather_at_node(
        j,
        weights.nodes.position[j],
        weights.nodes.normal[j],
        weights.start[j],
        weights.start[j + 1],
        weights.near,
        charge_start,
        sorted_charges.group,
        sorted_charges.plane,
        sorted_charges.group.shape[0],
        1.0 / (REACH_SQUARED * weights.width * weights.width),
        group_count,
        node_charge,
    )


@wp.kernel
def blur_charges(
    first: int,
    order: wp.array(dtype=wp.int32),
    share: wp.array(dtype=float),
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    variance: wp.array(dtype=float),
    facets: Facets,
    # outputs
    sorted_charges: SortedCharges,
):
    """Blur charges by their share of the variance of their place, which is known at the corners of tiles."""
    s = first + wp.tid()
    i = order[s]
    count = sorted_charges.group.shape[0]
    of_place = interpolated(facet[i], weight[i], variance, 0, facets)
    sorted_charges.plane[OF_VARIANCE * count + s] = share[i] * of_place


@wp.kernel
def follow_density(
    first: int,
    points: Points,
    home: wp.array(dtype=wp.int32),
    weights: Weights,
    number: wp.array(dtype=float),
    area: wp.array(dtype=float),
    length: float,
    usual: float,
    exponent: float,
    lowest: float,
    highest: float,
    # outputs
    variance: wp.array(dtype=float),
):
    """Variances of the blur of mean charges: a power of the number density near points, between bounds.

    ``number`` and ``area`` are charges and area that nodes stand for; where there is one charge for every square of the ``length``, it
    is the ``usual`` one.
    """
    i = first + wp.tid()
    nodes = weights.nodes
    inverse_reach = 1.0 / (REACH_SQUARED * weights.width * weights.width)
    charges = float(0.0)
    ground = float(0.0)
    for k in range(weights.start[home[i]], weights.start[home[i] + 1]):
        for j in range(weights.near[k][0], weights.near[k][1]):
            w = node_weight(nodes.position[j] - points.position[i], points.normal[i], nodes.normal[j], inverse_reach)
            charges += w * number[j]
            ground += w * area[j]
    result = highest
    if ground > 0.0 and charges > 0.0:
        result = wp.clamp(usual * wp.pow(charges * length * length / ground, -exponent), lowest, highest)
    variance[i] = result


@wp.kernel
def count_shares(
    first: int,
    to_nodes: int,
    fine: Homed,
    weights: Weights,
    # outputs
    count: wp.array(dtype=wp.int32),
):
    """Count the coarser nodes that each finer one is shared out among; or, ``to_nodes``, the finer ones that a coarser one gets of."""
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
    """List what :func:`count_shares` counts, and the shares. Rows are in the order of the points themselves."""
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
    """An octave's Gaussian between nodes, for the lists of all of them."""
    i = first + wp.tid()
    scale = -0.5 / (width * width)
    for k in range(start[i], start[i + 1]):
        j = near[k]
        way = nodes.position[j] - nodes.position[i]
        value[k] = height * wp.exp(wp.dot(way, way) * scale) * side_factor(nodes.normal[i], nodes.normal[j])


@wp.kernel
def mix_groups(
    first: int,
    interaction: wp.array(dtype=float),
    group_count: int,
    target: wp.array(dtype=float),
    node_charge: wp.array(dtype=float),
    # outputs
    mixed: wp.array(dtype=float),
):
    """What every group sees at a node: the charges less the target, weighed by the interaction; the target is weighed already."""
    i = first + wp.tid()
    base = (i / group_count) * group_count
    g = i - base
    total = -target[i]
    for h in range(group_count):
        total += interaction[g * group_count + h] * node_charge[base + h]
    mixed[i] = total


@wp.kernel
def begin_with(
    first: int,
    offset: wp.array(dtype=float),
    # outputs
    potential: wp.array(dtype=float),
):
    """The potential at the nodes before that of any charge is added."""
    i = first + wp.tid()
    potential[i] = offset[i]


@wp.func_native(f"""{LANES_CODE}
    const float* values = value.data;
    const int* numbers_of = entry.data;
    const float* from = column.data + group;
    V total = (V)0.0f;
    int k = begin;
    for (; k + lanes <= end; k += lanes) total += load(values + k) * get(from, numbers(numbers_of + k) * group_count);
#if !defined(__CUDA_ARCH__)
    for (int l = 0; k + l < end; ++l) total[l] += values[k + l] * from[numbers_of[k + l] * group_count];
#endif
    return sum(total);
""")
def row_times_column(
    begin: int,
    end: int,
    entry: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    column: wp.array(dtype=float),
    group_count: int,
    group: int,
) -> float: ...


@wp.kernel
def multiply(
    first: int,
    start: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    value: wp.array(dtype=float),
    column: wp.array(dtype=float),
    group_count: int,
    add: int,
    # outputs
    result: wp.array(dtype=float),
):
    """A sparse matrix times columns of all groups; added to what is there where ``add``."""
    i = first + wp.tid()
    row = i / group_count
    g = i - row * group_count
    total = row_times_column(start[row], start[row + 1], entry, value, column, group_count, g)
    if add != 0:
        total += result[i]
    result[i] = total


@wp.func
def force_of_nodes(
    s: int, home: int, charges: SortedCharges, weights: Weights, potential: wp.array(dtype=float), group_count: int
):
    """What leads down the potential's slope, fitted to the nodes near a charge."""
    normal = vector_of(s, OF_NORMAL, charges)
    along = across(normal)
    beside = wp.cross(normal, along)
    inverse_reach = 1.0 / (REACH_SQUARED * weights.width * weights.width)
    inverse_width = 1.0 / weights.width
    fitted = potential_of(
        vector_of(s, OF_POSITION, charges),
        normal,
        along,
        beside,
        weights.start[home],
        weights.start[home + 1],
        weights.near,
        weights.plane,
        weights.nodes.position.shape[0],
        potential,
        group_count,
        charges.group[s],
        inverse_reach,
        inverse_width,
    )
    s0 = fitted[0]
    s1 = fitted[1]
    s2 = fitted[2]
    to_space = vector_of(s, OF_VALUE, charges)
    slope = vector_of(s, OF_SLOPE, charges)
    slope_along = wp.dot(to_space, along) * s0 + (slope[0] * s1 + slope[1] * s2) * inverse_width
    slope_beside = wp.dot(to_space, beside) * s0 + (slope[1] * s1 + slope[2] * s2) * inverse_width
    return -slope_along * along - slope_beside * beside


@wp.func
def force_of_near_charges(
    s: int, home: int, charges: SortedCharges, start: wp.array(dtype=wp.int32), near: NearPart, group_count: int
):
    """What the charges of the homes near that of a charge do; those of a home begin at ``start``."""
    return sum_near(
        vector_of(s, OF_POSITION, charges),
        vector_of(s, OF_NORMAL, charges),
        charges.group[s],
        near.start[home],
        near.start[home + 1],
        near.near,
        start,
        charges.group,
        charges.plane,
        charges.group.shape[0],
        1.0 / (near.cutoff * near.cutoff),
        near.term,
        near.interaction,
        group_count,
        near.blurs,
        number_of(s, OF_VARIANCE, charges),
        near.core,
        near.core_end,
    )


@wp.kernel
def evaluate(
    first: int,
    charges: Homed,
    sorted_charges: SortedCharges,
    weights: Weights,
    potential: wp.array(dtype=float),
    group_count: int,
    near: NearPart,
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    facets: Facets,
    target: NearTarget,
    # outputs
    field: wp.array(dtype=wp.vec3),
):
    """The force per unit charge at every charge, along the surface."""
    s = first + wp.tid()
    i = charges.order[s]
    # Bodies move in the plane of their facet.
    normal = facets.normal[facet[i]]
    group = sorted_charges.group[s]
    home = charges.home[i]
    force = force_of_nodes(s, home, sorted_charges, weights, potential, group_count)
    force += force_of_near_charges(s, home, sorted_charges, charges.start, near, group_count)
    start = target.share[group] * target.column_count * target.corner_count
    for c in range(target.column_count):
        amount = target.attraction[group * target.column_count + c]
        if amount != 0.0:
            force -= amount * interpolated(facet[i], weight[i], target.force, start + c * target.corner_count, facets)
    field[i] = force - wp.dot(force, normal) * normal
