"""Charges in the order of their homes, as the cascade's kernels read them."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Where the numbers of a charge begin in SortedCharges.plane, and how many there are.
OF_POSITION = wp.constant(0)
OF_NORMAL = wp.constant(3)
OF_CHARGE = wp.constant(6)
OF_VALUE = wp.constant(7)
OF_SLOPE = wp.constant(11)
OF_VARIANCE = wp.constant(14)
CHARGE_PLANES = 15


@wp.struct
class SortedCharges:
    """Charges in the order of their homes.

    Attributes:
        group: Group of every charge.
        plane: x of all charges, then y, z, and so on: the normal, the charge, value and slope of its :class:`.kernels_nodes.Row`, and,
            where the blur varies, its variance.
    """

    group: wp.array(dtype=wp.int32)
    plane: wp.array(dtype=float)


@wp.func
def number_of(s: int, plane: int, charges: SortedCharges):
    """One of the numbers of a charge."""
    return charges.plane[plane * charges.group.shape[0] + s]


@wp.func
def vector_of(s: int, plane: int, charges: SortedCharges):
    """Three consecutive numbers of a charge."""
    return wp.vec3(number_of(s, plane, charges), number_of(s, plane + 1, charges), number_of(s, plane + 2, charges))


@wp.func
def set_vector(s: int, plane: int, vector: wp.vec3, charges: SortedCharges):
    count = charges.group.shape[0]
    for k in range(3):
        charges.plane[(plane + k) * count + s] = vector[k]
