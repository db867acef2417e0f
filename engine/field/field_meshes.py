"""Which meshes a field is computed on: one for the charges, a finer one for the targets."""

from __future__ import annotations

from ..errors import ProblemError
from ..space.mesh_layout import MeshLayout, open_mesh, periodic_mesh
from ..space.space import Space
from .blur import BLUR_OVER_SPACING, LOWEST, WIDEST

__all__ = [
    "FEWEST_NODES",
    "FINEST_BLUR_OVER_MESH",
    "SMALLEST_MESH",
    "charge_mesh",
    "cutoff_of",
    "target_mesh",
    "widest_blur",
]

# Cut-off of the split over mesh spacing: wide enough that the forces are wrong by no more than 3e-3 of the local force scale.
CUTOFF_OVER_MESH = 4.9
# The same over the widest blur between two charges: there that differs from points by 2e-3 of the whole.
CUTOFF_OVER_BLUR = 3.5
# Mesh spacing over the spacing of the bodies, for one group of uniform density: there the far and the near part cost about the same.
MESH_OVER_SPACING = 0.72
SMALLEST_MESH = 48
# Periods over the cut-off at least: neighbors on both sides must not meet behind. A long and narrow domain takes a long mesh.
PERIOD_OVER_CUTOFF = 3.0
# The narrowest blur over the spacing of the targets' mesh that carries it without aliases. No target is blurred by less than a share
# of the bodies' spacing, which they cannot resolve.
FINEST_BLUR_OVER_MESH = 1.1
LEAST_BLUR_OVER_SPACING = 0.35
# Where bodies crowd on little of the domain, a mesh that resolves them there would have far more nodes than there are bodies.
NODES_PER_CHARGE = 12
FEWEST_NODES = 2**18
# But where they crowd in a few small spots, it has up to so many. Measured on 20,000 in four discs that are .8 % of the domain: the
# smallest spacing is .85 instead of .22, and a run takes 1.4 times as long.
MUCH_CROWDING, NODES_FOR_SPOTS = 4.0, 2**22
# A Gaussian blur's potential is that of a point to 1e-6 beyond so many of its widths.
REACH_OVER_BLUR = 4.7


def charge_mesh(
    space: Space,
    spacing: float,
    *,
    charge_count: int,
    group_count: int,
    on_gpu: bool,
    blur_over_spacing: float = BLUR_OVER_SPACING,
) -> MeshLayout:
    """Lay the mesh where its cost, which falls with the square of its spacing, meets that of the near part, which rises.

    The far part costs a transform per group and node, the near part a term per pair of neighbors. Where bodies crowd on
    a small part of the domain, nodes are spent on the empty rest; the crowding is 1 for a uniform density.

    Args:
        space: What it lies over.
        spacing: Typical distance of neighboring bodies where they are dense.
        charge_count: Number of charges.
        group_count: Number of groups.
        on_gpu: Whether a GPU transforms it.
        blur_over_spacing: Width of the blur between two charges at that distance, over it: the near part has to reach that far.

    Raises:
        ProblemError: A periodic domain that is too long and narrow for a GPU's transforms.
    """
    crowding = max(1.0, space.area / (charge_count * spacing**2))
    coarsening = (group_count * crowding) ** 0.25
    least = CUTOFF_OVER_BLUR / CUTOFF_OVER_MESH * blur_over_spacing
    wanted = min(max(coarsening * MESH_OVER_SPACING, least) * spacing, max(space.size) / SMALLEST_MESH)
    if not space.periodic:
        return open_mesh(space, wanted, on_gpu=on_gpu)
    most = min(space.size) / (PERIOD_OVER_CUTOFF * CUTOFF_OVER_MESH)
    layout = periodic_mesh(space, min(wanted, most), on_gpu=on_gpu)
    if max(layout.spacing) > 1.001 * most:
        raise ProblemError(
            f"a periodic domain must not be {max(space.size) / min(space.size):,.0f} times longer than wide on this GPU; "
            'use `device` "cpu"'
        )
    return layout


def cutoff_of(layout: MeshLayout, blur: float = 0.0) -> float:
    """Where the split's near part ends, for the charges' mesh, with all of a blur of this width; see :mod:`.splitting`."""
    least = CUTOFF_OVER_MESH * max(layout.spacing)
    if layout.space.periodic:
        blur = min(blur, min(layout.space.size) / (PERIOD_OVER_CUTOFF * CUTOFF_OVER_BLUR))
    return max(least, CUTOFF_OVER_BLUR * blur)


def widest_blur(cutoff: float) -> float:
    """Widest blur between two charges whose near part is all within the cut-off."""
    return cutoff / CUTOFF_OVER_BLUR


def target_mesh(
    space: Space,
    spacing: float,
    *,
    charge_count: int,
    cutoff: float,
    on_gpu: bool,
    blur_over_spacing: float = BLUR_OVER_SPACING,
    uniform: bool = False,
    fewest_nodes: int = FEWEST_NODES,
) -> MeshLayout:
    """Lay a mesh that shows every detail of the targets which bodies can follow; arguments as for :func:`charge_mesh`.

    Where the density is ``uniform``, the blur is nowhere narrower than usual.
    """
    nodes = float(max(NODES_PER_CHARGE * charge_count, fewest_nodes))
    crowding = space.area / (charge_count * spacing**2)
    if crowding > MUCH_CROWDING:
        nodes = max(nodes, min(nodes * crowding / MUCH_CROWDING, NODES_FOR_SPOTS))
    coarsest = (space.area / nodes) ** 0.5
    narrowest = max((1.0 if uniform else LOWEST**0.5) * blur_over_spacing, LEAST_BLUR_OVER_SPACING) * spacing
    wanted = max(narrowest / FINEST_BLUR_OVER_MESH, coarsest)
    if space.periodic:
        return periodic_mesh(space, wanted, on_gpu=on_gpu)
    widest = min(WIDEST**0.5 * blur_over_spacing * spacing, widest_blur(cutoff))
    reach = max(cutoff, REACH_OVER_BLUR * widest)
    return open_mesh(space, wanted, on_gpu=on_gpu, kernel_reach=reach)
