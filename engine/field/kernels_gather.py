"""Kernels that copy charges into the order of their cells, with what groups see of them and how they are blurred there."""

from __future__ import annotations

import warp as wp

from ..space.kernels_cells import Counting, SortedCharges, forget_blocks, place_in_order
from ..space.kernels_mesh import Mesh
from .kernels_field import Blurred
from .kernels_splines import deposit

__all__ = ["GATHERED_AT_ONCE", "BlurOfPlaces", "GivenCharges", "gather_charges", "lay_charges"]

wp.set_module_options({"enable_backward": False})

# Charges that an element has on the CPU: what is known of them is read in short loops, one after the other.
GATHERED_AT_ONCE = 64


@wp.struct
class GivenCharges:
    """Charges in the order in which they were given: charge and group of each, and the charge that its blur is of.

    Their positions count from an ``origin`` on, and none is taken to lie outside of a rectangle of ``extent`` from there.
    """

    origin: wp.vec2
    extent: wp.vec2
    charge: wp.array(dtype=float)
    group: wp.array(dtype=wp.int32)
    size: wp.array(dtype=float)


@wp.struct
class BlurOfPlaces:
    """How the blur of a charge differs: by its group's family, by its ``size`` and by its place, or not.

    ``variance`` is that of a mean charge at every node of ``mesh``; a charge has as large a share of it as it is large itself, between
    ``least`` and 1.
    """

    by_family: wp.int32
    family_of_group: wp.array(dtype=wp.int32)
    by_size: wp.int32
    least: wp.float32
    by_place: wp.int32
    mesh: Mesh
    variance: wp.array(dtype=float)


_GATHER = """
    // A GPU's thread has one, whose place in the order may just have been written.
    #if defined(__CUDA_ARCH__)
        const int order[1] = {item};
    #else
        const int* __restrict__ order = charges.order.data + start;
    #endif
    float* __restrict__ x = charges.x.data + start;
    float* __restrict__ y = charges.y.data + start;
    float* __restrict__ charge = charges.charge.data + start;
    int* __restrict__ group = charges.group.data + start;
    const float* __restrict__ from = (const float*)position.data;
    const float origin_x = given.origin[0], origin_y = given.origin[1], width = given.extent[0], height = given.extent[1];
    for (int k = 0; k < count; ++k)
    {
        const float across = from[2 * order[k]] - origin_x, up = from[2 * order[k] + 1] - origin_y;
        x[k] = across < 0.0f ? 0.0f : across > width ? width : across;
        y[k] = up < 0.0f ? 0.0f : up > height ? height : up;
    }
    for (int k = 0; k < count; ++k)
    {
        charge[k] = given.charge.data[order[k]];
        group[k] = given.group.data[order[k]];
    }
    if (charges.by_group == 0)
        for (int g = 0; g < group_count; ++g)
        {
            float* __restrict__ weight = charges.weight.data + (size_t)g * charges.weight_stride + start;
            for (int k = 0; k < count; ++k) weight[k] = interaction.data[g * group_count + group[k]];
        }
    if (places.by_family != 0)
    {
        int* __restrict__ family = blurred.family.data + start;
        for (int k = 0; k < count; ++k) family[k] = places.family_of_group.data[group[k]];
    }
    if (places.by_size == 0) return;
    const float* __restrict__ of_nodes = places.variance.data;
    float* __restrict__ variance = blurred.variance.data + start;
    for (int k = 0; k < count; ++k)
    {
        const float size = given.size.data[order[k]];
        variance[k] = (size < places.least ? places.least : size > 1.0f ? 1.0f : size) * (places.by_place != 0 ? 1.0f : of_nodes[0]);
    }
    if (places.by_place == 0) return;
    // Bilinear between the nodes; a position lies inside the domain, and so on a periodic mesh at most one node beyond the last.
    const int columns = places.mesh.count_x, rows = places.mesh.count_y;
    const float margin = (float)places.mesh.margin;
    for (int k = 0; k < count; ++k)
    {
        const float u = x[k] * places.mesh.inverse_spacing[0] + margin, v = y[k] * places.mesh.inverse_spacing[1] + margin;
        int left = (int)u, low = (int)v;
        const float along = u - (float)left, up = v - (float)low;
        left = left < 0 || left >= columns ? 0 : left;
        low = low < 0 || low >= rows ? 0 : low;
        const int right = left + 1 < columns ? left + 1 : 0;
        const float* __restrict__ lower = of_nodes + (size_t)low * columns;
        const float* __restrict__ upper = of_nodes + (size_t)(low + 1 < rows ? low + 1 : 0) * columns;
        const float below = (1.0f - along) * lower[left] + along * lower[right];
        const float above = (1.0f - along) * upper[left] + along * upper[right];
        variance[k] *= (1.0f - up) * below + up * above;
    }
"""


@wp.func_native(_GATHER)
def gather(
    start: int,
    count: int,
    item: int,
    position: wp.array(dtype=wp.vec2),
    given: GivenCharges,
    interaction: wp.array(dtype=float),
    group_count: int,
    places: BlurOfPlaces,
    charges: SortedCharges,
    blurred: Blurred,
): ...


@wp.kernel
def gather_charges(
    first: int,
    charge_count: int,
    at_once: int,
    position: wp.array(dtype=wp.vec2),
    given: GivenCharges,
    interaction: wp.array(dtype=float),
    group_count: int,
    places: BlurOfPlaces,
    # outputs
    charges: SortedCharges,
    blurred: Blurred,
):
    """Copy charges into the order of their cells, on the CPU; an element has ``at_once`` of them.

    What every group sees of them is written where that is not known by group, and how they are blurred where that differs.
    """
    start = (first + wp.tid()) * at_once
    count = wp.min(at_once, charge_count - start)
    gather(start, count, 0, position, given, interaction, group_count, places, charges, blurred)


@wp.kernel
def lay_charges(
    first: int,
    charge_count: int,
    position: wp.array(dtype=wp.vec2),
    given: GivenCharges,
    interaction: wp.array(dtype=float),
    group_count: int,
    places: BlurOfPlaces,
    mesh: Mesh,
    # outputs
    counting: Counting,
    charges: SortedCharges,
    blurred: Blurred,
    node_charge: wp.array(dtype=wp.int64),
):
    """Put a charge that was counted to its place in the order of the cells, copy it there and deposit it on the mesh; on a GPU."""
    i = first + wp.tid()
    forget_blocks(i, counting)
    if i < charge_count:
        place = place_in_order(i, counting, charges.cell_start)
        charges.order[place] = i
        gather(place, 1, i, position, given, interaction, group_count, places, charges, blurred)
        deposit(wp.vec2(charges.x[place], charges.y[place]), given.charge[i], given.group[i], mesh, node_charge)
