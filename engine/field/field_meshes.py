"""Which meshes a field is computed on: one for the charges, a finer one for the targets."""

from __future__ import annotations

from ..errors import ProblemError
from ..space.mesh_layout import MeshLayout, open_mesh, periodic_mesh
from ..space.space import Space
from .kernels_field import CUTOFF_OVER_SPLIT

__all__ = ["BLUR_OVER_MESH", "BLUR_OVER_SPACING", "FEWEST_NODES", "charge_mesh", "split_of", "target_mesh"]

# Split width over mesh spacing; with the cut-off it gives a force error of 1e-3 to 3e-3 of the local force scale.
SPLIT_OVER_MESH = 2.0
# Mesh spacing over the spacing of the bodies, for one group of uniform density: there the far and the near part cost about the same.
MESH_OVER_SPACING = 0.72
SMALLEST_MESH = 48
# Periods over the cut-off at least: neighbours on both sides must not meet behind. A long and narrow domain takes a long mesh.
PERIOD_OVER_CUTOFF = 3.0
# The target is smoothed by this share of the bodies' spacing, which they cannot resolve: coverage errors at half, one and
# two spacings all have their minimum near 0.37. On a coarse mesh it is widened to what the mesh carries without aliases.
BLUR_OVER_SPACING = 0.37
BLUR_OVER_MESH = 1.1
# Where bodies crowd on little of the domain, a mesh that resolves them there would have far more nodes than there are bodies.
NODES_PER_CHARGE = 12
FEWEST_NODES = 2**18
# The correction's kernel has fallen to 1e-5 of its height here.
REACH_OVER_SPLIT = 4.7


def charge_mesh(space: Space, spacing: float, *, charge_count: int, group_count: int, on_gpu: bool) -> MeshLayout:
    """Lay the mesh where its cost, which falls with the square of its spacing, meets that of the near part, which rises.

    The far part costs a transform per group and node, the near part a term per pair of neighbours. Where bodies crowd on
    a small part of the domain, nodes are spent on the empty rest; the crowding is 1 for a uniform density.

    Args:
        space: What it lies over.
        spacing: Typical distance of neighbouring bodies where they are dense.
        charge_count: Number of charges.
        group_count: Number of groups.
        on_gpu: Whether a GPU transforms it.

    Raises:
        ProblemError: A periodic domain that is too long and narrow for a GPU's transforms.
    """
    crowding = max(1.0, space.area / (charge_count * spacing**2))
    coarsening = (group_count * crowding) ** 0.25
    wanted = min(coarsening * spacing * MESH_OVER_SPACING, max(space.size) / SMALLEST_MESH)
    if not space.periodic:
        return open_mesh(space, wanted, on_gpu=on_gpu)
    most = min(space.size) / (PERIOD_OVER_CUTOFF * CUTOFF_OVER_SPLIT * SPLIT_OVER_MESH)
    layout = periodic_mesh(space, min(wanted, most), on_gpu=on_gpu)
    if max(layout.spacing) > 1.001 * most:
        raise ProblemError(
            f"a periodic domain must not be {max(space.size) / min(space.size):,.0f} times longer than wide on this GPU; "
            'use `device` "cpu"'
        )
    return layout


def split_of(layout: MeshLayout) -> float:
    """Standard deviation of the Gaussian that splits the kernel, for the charges' mesh."""
    return SPLIT_OVER_MESH * max(layout.spacing)


def target_mesh(
    space: Space,
    spacing: float,
    *,
    charge_count: int,
    split: float,
    on_gpu: bool,
    fewest_nodes: int = FEWEST_NODES,
) -> MeshLayout:
    """Lay a mesh that shows every detail of the targets which bodies can follow; arguments as for :func:`charge_mesh`."""
    coarsest = (space.area / max(NODES_PER_CHARGE * charge_count, fewest_nodes)) ** 0.5
    wanted = max(BLUR_OVER_SPACING / BLUR_OVER_MESH * spacing, coarsest)
    if space.periodic:
        return periodic_mesh(space, wanted, on_gpu=on_gpu)
    return open_mesh(space, wanted, on_gpu=on_gpu, kernel_reach=REACH_OVER_SPLIT * split)
