"""Kernels of the cascade: charges are deposited on nodes and go up the levels, potentials come down, forces act on charges."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_facets import Facets, across, interpolated
from .kernels_near_charges import NearPart, force_of_near_charges
from .kernels_nodes import REACH_SQUARED, WEIGHT_CODE, Homed, Weights, fitted_row, node_weight
from .kernels_points import Points
from .kernels_sorted_charges import (
    OF_CHARGE,
    OF_NORMAL,
    OF_POSITION,
    OF_SLOPE,
    OF_VALUE,
    OF_VARIANCE,
    SortedCharges,
    set_vector,
    vector_of,
)
from .native_lanes import LANES_CODE, PLANES_CODE

wp.set_module_options({"enable_backward": False})


@wp.struct
class NearTarget:
    """The near field of the target.

    Attributes:
        force: Force per unit charge of every image at all corners of tiles, image after image; all of this for every share of the
            variance that charges may be blurred by.
        corner_count: Number of corners.
        column_count: Number of images.
        attraction: Charge of every image that every group sees, group after group.
        share: Which of the shares every group has.
    """

    force: wp.array(dtype=wp.vec3)
    corner_count: wp.int32
    column_count: wp.int32
    attraction: wp.array(dtype=float)
    share: wp.array(dtype=wp.int32)


@wp.func_native(f"""{PLANES_CODE}
    V s0 = (V)0.0f, s1 = (V)0.0f, s2 = (V)0.0f;
    for (int k = first_run; k < last_run; ++k)
    {{
        const int end = near.data[k][1];
        for (int j = near.data[k][0]; j < end; j += lanes)
        {{
            {WEIGHT_CODE}
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
            {WEIGHT_CODE}
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
    """Copy charges into the order of their homes, and find the corrected weights of each: its row."""
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
    """Deposit charges on the nodes. Each node sums what it gets, in a fixed order; the groups of a node lie side by side."""
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
    """Set the variance of every charge's blur: its share of the variance of its place, which is known at the corners of tiles."""
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
    """Variances of the blur of a mean charge at points: a power of the number density around them, between bounds.

    Nodes stand for ``number`` charges on an ``area``. The variance is the ``usual`` one where there is one charge for every square of
    the ``length``.
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
def mix_groups(
    first: int,
    interaction: wp.array(dtype=float),
    group_count: int,
    target: wp.array(dtype=float),
    node_charge: wp.array(dtype=float),
    # outputs
    mixed: wp.array(dtype=float),
):
    """Sources that every group sees at a node: the charges, weighed by the interaction, less the target, which is weighed already."""
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
    """Start the potentials at the nodes with a fixed offset."""
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
    if (k < end)
    {{
        // The next row's entries, or what lies behind the last one, do not count.
        const I in_row = k + lane < end;
        const V factor = in_row ? load(values + k) : (V)0.0f;
        total += factor * get(from, (in_row & numbers(numbers_of + k)) * group_count);
    }}
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
    """Multiply a sparse matrix by a column for every group; the product is added to the result if ``add`` is not 0."""
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
    """Far field at a charge: minus the slope of the potential, by a linear fit to the nodes near it."""
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
    """Force per unit charge at every charge, along the surface: far field, near field of the charges, near field of the target."""
    s = first + wp.tid()
    i = charges.order[s]
    # Bodies move in the plane of their facet, so what points out of it does not count.
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
