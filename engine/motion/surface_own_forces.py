"""What bodies of a rare group do to each other on a surface, by a cascade as coarse as their own spacing.

To the nodes of the common cascade a charge is not quite where it is, and so it is pushed by itself: by far less than by its neighbors,
but what bodies of a rare group do to each other counts many times as much, so that each push by itself does, too, and their neighbors
are far away. And they see the surface from as far away, see :mod:`~esh.engine.cascade.seen_from_afar`.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..cascade.cascade import Cascade
from ..cascade.points import empty_points
from ..cascade.seen_from_afar import seen_from_afar
from ..device.launcher import Launcher
from ..model.model import Model
from ..model.surface_softness import softness_of
from ..surface import kernels_facets
from ..surface.facets import Facets
from . import kernels_surface_own
from .kernels_on_surface import Charges

__all__ = ["OwnForces", "own_forces"]

# Spacing of a group, in that of all, from which on it is rare, and bodies that it must have at least.
RARE = 2.0
FEWEST = 12
# What is left to the common cascade, over the most that the group and another do to each other.
LEFT_SHARED = 2.0
# Rare groups that are treated so, at most: each takes time.
MOST_GROUPS = 8


class OwnForces:
    """The forces of a group on itself.

    Args:
        model: What is to be placed.
        launcher: Where to run.
        facets: The surface.
        on_device: The same as kernels take it.
        share: Share of every class's density on every tile, shape ``[class_count, tile_count]``.
        group: The group.
        length: Its spacing, in units.
        strength: What its bodies do to each other.
    """

    def __init__(
        self,
        model: Model,
        launcher: Launcher,
        facets: Facets,
        on_device: kernels_facets.Facets,
        share: np.ndarray,
        group: int,
        length: float,
        strength: float,
    ) -> None:
        self._launcher = launcher
        self._facets = seen_from_afar(launcher, facets, on_device, length)
        row = np.flatnonzero(model.body.group[model.charge.body] == group)
        charge = model.charge.charge[row]
        softness = softness_of(model)
        if softness is not None and softness.following is not None:
            softness = softness._replace(following=softness.following._replace(number=(float(len(row)),)))
        self._cascade = Cascade(
            launcher,
            facets,
            self._facets,
            share=share[model.groups.class_index[group]][None],
            attraction=np.array([[strength * float(charge.sum())]]),
            interaction=np.array([[strength]]),
            charge=charge,
            charge_group=np.zeros(len(row), np.int32),
            length=length,
            softness=softness,
        )
        self._row = wp.array(row.astype(np.int32), dtype=wp.int32, device=launcher.device)
        self._own = Charges()
        self._own.points = empty_points(launcher, len(row))
        self._own.facet, self._own.home = (launcher.empty(len(row), wp.int32) for _ in range(2))
        self._own.weight = launcher.empty(len(row), wp.vec2)
        self._own.field = launcher.zeros(len(row), wp.vec3)

    def add(self, charges: Charges) -> None:
        """Add the forces to the field at all charges."""
        own, launch, count = self._own, self._launcher.launch, len(self._row)
        launch(kernels_surface_own.take, count, [self._row, charges, self._cascade.home, self._facets], [own])
        self._cascade.evaluate(own.points, own.facet, own.weight, own.home, own.field)
        launch(kernels_surface_own.add_field, count, [self._row, own], [charges])


def own_forces(
    model: Model, launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets, share: np.ndarray
) -> tuple[list[OwnForces], np.ndarray]:
    """Return the forces of rare groups on themselves, and the interaction that is left to the common cascade."""
    left = np.array(model.interaction, dtype=np.float64)
    # Bodies that stay may lie where their class has no density, and so no nodes.
    if model.groups.count < 2 or model.fixed.any():
        return [], left
    rare = []
    for g in range(model.groups.count):
        of_group = model.body.group == g
        count, own = int(of_group.sum()), share[model.groups.class_index[g]]
        if count < FEWEST or (model.body.kind[of_group] >= 0).any():
            continue
        length = 1.0 / math.sqrt(count * float((own**2 / facets.tile_area).sum()))
        excess = left[g, g] - LEFT_SHARED * float(np.abs(np.delete(left[g], g)).max())
        if length > RARE and excess > 0.5 * left[g, g]:
            rare.append((g, length, excess))
    rare = sorted(rare, key=lambda one: -one[1])[:MOST_GROUPS]
    for g, _, excess in rare:
        left[g, g] -= excess
    # What is left must not draw bodies together.
    if rare and np.linalg.eigvalsh(left)[0] < -1e-6 * left.max():
        return [], np.array(model.interaction, dtype=np.float64)
    return [OwnForces(model, launcher, facets, on_device, share, g, length, excess) for g, length, excess in rare], left
