"""Kernels of the target's near field: forces of its sources at the corners of tiles."""

from __future__ import annotations

import warp as wp

from .kernels_points import PointGrid, Points, cell_around, cell_at, slot_of
from .native_lanes import NEIGHBOR_CODE, PLANES_CODE

wp.set_module_options({"enable_backward": False})


@wp.struct
class NearTable:
    """Tables of distance times force of a unit charge of the target, over the squared distance.

    Attributes:
        force: Two tables, one after the other: for images that vary, and for uniform ones.
        kind: Which of the two every image has.
        size: Entries of a table.
        scale: Entries per unit of squared distance.
        cutoff: Distance at which the near field ends.
        blurs: Whether the tables are those of points, and every pair subtracts what its own blur takes from that.
    """

    force: wp.array(dtype=float)
    kind: wp.array(dtype=wp.int32)
    size: wp.int32
    scale: wp.float32
    cutoff: wp.float32
    blurs: wp.int32


@wp.struct
class Sources:
    """Sources of the target, in the order of their cells.

    Attributes:
        grid: The cells, as large as the cut-off.
        label: Part of the surface that each source is on.
        plane: x of all sources, then y, z, x, y and z of their normals, their charges image after image, and, where the blur varies,
            its variance.
    """

    grid: PointGrid
    label: wp.array(dtype=wp.int32)
    plane: wp.array(dtype=float)


@wp.func_native(f"""{PLANES_CODE}
    const float* charge = up_z + (column + 1) * count;
    const float* variance = up_z + (column_count + 1) * count;
    const float* entries = table.data + table_first;
    const int last = table_size - 2;
    const float beyond = (float)(last + 1);
    // Labels that the own one has to do with, and whether another one is among them: it is looked for where there are fewer.
    const int* related_start = related.data + relations;
    const bool is_related = relations > 0 && related_start[label] < related_start[label + 1];
    auto is_among = [&](int number, int of) -> bool
    {{
        int low = related_start[of], high = related_start[of + 1];
        const int behind = high;
        while (low < high)
        {{
            const int middle = (low + high) / 2;
            if (related.data[middle] < number) low = middle + 1;
            else high = middle;
        }}
        return low < behind && related.data[low] == number;
    }};
    auto count_of = [&](int of) -> int {{ return related_start[of + 1] - related_start[of]; }};
    auto sees = [&](int other) -> bool
    {{
        return other == label || (count_of(other) < count_of(label) ? is_among(label, other) : is_among(other, label));
    }};
    V to_x = (V)0.0f, to_y = (V)0.0f, to_z = (V)0.0f;
    for (int j = begin; j < end; j += lanes)
    {{
        {NEIGHBOR_CODE}
        // Cells share slots: what lies far away, and is not seen, would be beyond all whole numbers.
        const V all = square * table_scale;
        const V at = all < beyond ? all : (V)beyond;
        I cell = whole(at);
        cell = cell > last ? (I)last : cell;
        const V low = get(entries, cell);
        V force = low + (at - real(cell)) * (get(entries, cell + 1) - low);
        if (blurs) force -= fading(0.5f * square / (load(variance + j) + own_variance));
        V strength = load(charge + j) * (0.5f + 0.5f * cosine) * force / most(square, (V)1e-12f);
        auto seen = (square < square_cutoff) & (numbers(labels.data + j) == label) & (j + lane < end);
        if (is_related)
        {{
#if defined(__CUDA_ARCH__)
            seen = square < square_cutoff && sees(labels.data[j]);
#else
            for (int l = 0; l < lanes && j + l < end; ++l)
                if (square[l] < square_cutoff && sees(labels.data[j + l])) seen[l] = -1;
#endif
        }}
        strength = seen ? strength : (V)0.0f;
        to_x += strength * dx;
        to_y += strength * dy;
        to_z += strength * dz;
    }}
    return wp::vec3(sum(to_x), sum(to_y), sum(to_z));
""")
def pull_of_sources(
    position: wp.vec3,
    normal: wp.vec3,
    label: int,
    related: wp.array(dtype=wp.int32),
    relations: int,
    begin: int,
    end: int,
    labels: wp.array(dtype=wp.int32),
    plane: wp.array(dtype=float),
    count: int,
    column: int,
    column_count: int,
    square_cutoff: float,
    table: wp.array(dtype=float),
    table_first: int,
    table_size: int,
    table_scale: float,
    blurs: int,
    own_variance: float,
) -> wp.vec3: ...


Slots = wp.types.vector(27, wp.int32)


@wp.kernel
def sort_sources(
    first: int,
    points: Points,
    column: wp.array(dtype=float),
    column_count: int,
    # outputs
    sources: Sources,
):
    """Bring points and their columns, their charges and what else there is, into the order of their cells."""
    s = first + wp.tid()
    count = points.position.shape[0]
    i = sources.grid.order[s]
    sources.label[s] = points.label[i]
    for k in range(3):
        sources.plane[k * count + s] = points.position[i][k]
        sources.plane[(3 + k) * count + s] = points.normal[i][k]
    for c in range(column_count):
        sources.plane[(6 + c) * count + s] = column[c * count + i]


@wp.kernel
def sum_near_target(
    first: int,
    corners: Points,
    sources: Sources,
    related: wp.array(dtype=wp.int32),
    relations: int,
    column_count: int,
    source_count: int,
    table: NearTable,
    variance: wp.array(dtype=float),
    share: float,
    force_start: int,
    # outputs
    force: wp.array(dtype=wp.vec3),
):
    """Sum the near field of every image at the corners of tiles.

    Where the blur varies, it acts on charges that are blurred by a ``share`` of the ``variance`` of their place.
    """
    i = first + wp.tid()
    own_variance = float(0.0)
    if table.blurs != 0:
        own_variance = share * variance[i]
    grid = sources.grid
    cell = cell_at(corners.position[i], grid.inverse_size)
    slots = Slots()
    for number in range(27):
        slots[number] = slot_of(cell_around(cell, number), grid.mask)
    for c in range(column_count):
        total = wp.vec3(0.0, 0.0, 0.0)
        for number in range(27):
            # Cells may share a slot of the hash table, so each slot is visited only once. What is far away does not count.
            slot = slots[number]
            known = int(0)
            for before in range(number):
                known += int(slots[before] == slot)
            if known == 0 and grid.start[slot] < grid.start[slot + 1]:
                total += pull_of_sources(
                    corners.position[i],
                    corners.normal[i],
                    corners.label[i],
                    related,
                    relations,
                    grid.start[slot],
                    grid.start[slot + 1],
                    sources.label,
                    sources.plane,
                    source_count,
                    c,
                    column_count,
                    table.cutoff * table.cutoff,
                    table.force,
                    table.kind[c] * table.size,
                    table.size,
                    table.scale,
                    table.blurs,
                    own_variance,
                )
        force[force_start + c * corners.position.shape[0] + i] = total


@wp.kernel
def carry_forces(
    first: int,
    source: wp.array(dtype=wp.int32),
    force_before: wp.array(dtype=wp.vec3),
    factor: wp.array(dtype=float),
    # outputs
    force: wp.array(dtype=wp.vec3),
):
    """Copy forces at corners by the number that each had before, -1 for new ones; those of every image times its factor."""
    i = first + wp.tid()
    if source[i] >= 0:
        count, count_before = source.shape[0], force_before.shape[0] / factor.shape[0]
        for c in range(factor.shape[0]):
            force[c * count + i] = factor[c] * force_before[c * count_before + source[i]]


@wp.kernel
def carry_numbers(
    first: int,
    source: wp.array(dtype=wp.int32),
    values_before: wp.array(dtype=float),
    # outputs
    values: wp.array(dtype=float),
):
    """Copy values by the number that each had before, -1 for new ones."""
    i = first + wp.tid()
    if source[i] >= 0:
        values[i] = values_before[source[i]]


@wp.kernel
def put_numbers(
    first: int,
    index: wp.array(dtype=wp.int32),
    which: wp.array(dtype=wp.int32),
    few: wp.array(dtype=float),
    # outputs
    values: wp.array(dtype=float),
):
    """Write to the points of an index the values of the distinct points that they are like."""
    i = first + wp.tid()
    values[index[i]] = few[which[i]]


@wp.kernel
def put_forces(
    first: int,
    index: wp.array(dtype=wp.int32),
    which: wp.array(dtype=wp.int32),
    columns: int,
    few: wp.array(dtype=wp.vec3),
    # outputs
    force: wp.array(dtype=wp.vec3),
):
    """Write to the points of an index the forces of the distinct points that they are like, column after column."""
    i = first + wp.tid()
    count, count_few = force.shape[0] / columns, few.shape[0] / columns
    for c in range(columns):
        force[c * count + index[i]] = few[c * count_few + which[i]]
