"""Kernels' functions of the near field between charges."""

from __future__ import annotations

import warp as wp

from .kernels_sorted_charges import OF_NORMAL, OF_POSITION, OF_VARIANCE, SortedCharges, number_of, vector_of
from .native_lanes import NEIGHBOR_CODE, PLANES_CODE

wp.set_module_options({"enable_backward": False})

# Terms of the polynomial in NearPart. With the usual blur, distance times force is wrong by .014 with 8, .002 with 10, .0001 with 12.
NEAR_TERMS = 12


@wp.struct
class NearPart:
    """The near field between charges.

    Distance times force is a polynomial of u, the squared distance over the squared cut-off. To this a repulsive core is added, see
    :mod:`esh.engine.field.blur`: its end is not smooth, so the polynomial cannot hold it.

    Attributes:
        start: Where the runs of every home begin in ``near``, shape ``[node_count + 1]``.
        near: For every home the homes whose charges it sees, as runs.
        term: Coefficients of the polynomial, the constant one first.
        cutoff: Distance at which the near field ends.
        interaction: M, flat.
        blurs: Whether every pair has a blur of its own. If so, the polynomial is that of points.
        core: Strength of the core.
        core_end: Where the core ends: a value of u; or, if ``blurs``, of q = r² / (2 variance).
    """

    start: wp.array(dtype=wp.int32)
    near: wp.array(dtype=wp.vec2i)
    term: wp.array(dtype=float)
    cutoff: wp.float32
    interaction: wp.array(dtype=float)
    blurs: wp.int32
    core: wp.float32
    core_end: wp.float32


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
            {NEIGHBOR_CODE}
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
def force_of_near_charges(
    s: int, home: int, charges: SortedCharges, start: wp.array(dtype=wp.int32), near: NearPart, group_count: int
):
    """Near field at charge ``s`` of all charges; those of a home begin at ``start``."""
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
