"""Steps at a natural border: what was placed there as if more stood beyond stays as it is.

Nothing faces bodies along such a border once those beyond are gone, and steps by the usual forces would draw them into a row. So each
force counts for less the nearer a body is to the border, and for nothing beside it. What is deeper within has neighbors on all sides.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.model import Model
from ..space.density import sample_density
from ..space.mesh_layout import MeshLayout
from ..space.support import depth_in_support

__all__ = ["MOST_STRETCH", "shares_of_forces"]

# Depths within the border, in spacings of the class, at which forces begin to count, and count wholly. Measured with 12 steps after
# those that even out what was cut: the largest number at any distance from the border is 1.4 to 1.8 times even, as without these
# steps, and the smallest spacing .62 to .81; with .6 and 1.2 up to 2.9 and .65 to .93. Forces count wholly around pairs that the cut
# has left too close: of 48 scatters in discs whose radius is 2.5, 5 and 20 % of the side, the smallest spacing of all is .66 instead
# of .16.
HELD = (1.0, 2.0)
# Spacings of rare classes are no wider than this share of the domain.
MOST_OF_DOMAIN = 0.1
# What is near is within so many spacings, but no farther than so many nodes. With a whole spacing the largest number at any distance
# from the border is 2.2 times even.
STIRRED_WITHIN = 0.6
MOST_NODES = 4
# Forces that count for less here and there have no energy, and BFGS may find next to no curvature in them: then it asks for a step as
# long as the limit for all bodies. It is at most so many times as long as the moves that the forces ask for. Measured on six grounds,
# 24 seeds: without it one of 144 had an error of .0057 instead of .0014, and another one once a smallest spacing of .11.
MOST_STRETCH = 10.0
# A share of 0 would divide by 0.
LEAST = 1e-4


def shares_of_forces(
    launcher: Launcher, model: Model, layout: MeshLayout, spacing: np.ndarray, stirred: np.ndarray | None
) -> wp.array:
    """How much of the forces counts at the nodes of a mesh, flat, one group after the other.

    Args:
        launcher: Where to run.
        model: In a rectangle.
        layout: The mesh.
        spacing: Of all bodies at its nodes, in the model's unit, shape ``[node_count]``.
        stirred: Where an edit has set bodies down, or where some stand too close to others, in the model's unit, shape ``[m, 2]``;
            None for nowhere. All forces count there: these bodies are not yet where larger problems would have them.
    """
    rows, columns = layout.shape
    width, height = model.size
    x = (np.arange(columns) - layout.margin) * layout.spacing[0] + layout.origin[0]
    y = (np.arange(rows) - layout.margin) * layout.spacing[1] + layout.origin[1]
    edge = np.minimum(np.minimum(x, width - x)[None], np.minimum(y, height - y)[:, None])
    extent = columns * layout.spacing[0], rows * layout.spacing[1]
    of_class: list[np.ndarray] = []
    wholly = np.zeros((rows, columns), bool)
    if stirred is not None and len(stirred):
        wholly = _near(stirred, spacing.reshape(rows, columns), layout)
    problem = model.problem
    depth_of: dict[int, np.ndarray] = {}
    for c in problem.classes:
        image = c.density_image
        if id(image) not in depth_of:
            depth = edge
            if not (image > 0.0).all():
                nodes = np.stack([along.ravel() for along in np.meshgrid(x, y)], axis=1)
                at_nodes = sample_density(image, nodes, model.size).reshape(layout.shape)
                depth = np.minimum(edge, depth_in_support(launcher, at_nodes, extent))
            depth_of[id(image)] = depth
        rarer = math.sqrt(model.body_count / max(c.body_count, 1))
        own = np.minimum(spacing.reshape(rows, columns) * rarer, MOST_OF_DOMAIN * min(width, height))
        share = np.clip((depth_of[id(image)] / own - HELD[0]) / (HELD[1] - HELD[0]), LEAST, 1.0)
        of_class.append(np.where(wholly, 1.0, share).ravel())
    shares = np.stack([of_class[k] for k in model.groups.class_index]).astype(np.float32)
    return wp.array(shares.ravel(), dtype=float, device=launcher.device)


def _near(position: np.ndarray, spacing: np.ndarray, layout: MeshLayout) -> np.ndarray:
    """Which nodes are about as near to a position as forces count wholly there, shape ``[rows, columns]``."""
    rows, columns = layout.shape
    from_origin = (position - layout.origin) / layout.spacing
    column = np.clip(np.rint(from_origin[:, 0]).astype(int) + layout.margin, 0, columns - 1)
    row = np.clip(np.rint(from_origin[:, 1]).astype(int) + layout.margin, 0, rows - 1)
    result = np.zeros((rows, columns), bool)
    reach = np.rint(STIRRED_WITHIN * spacing[row, column] / min(layout.spacing)).astype(int)
    for y in range(-MOST_NODES, MOST_NODES + 1):
        for x in range(-MOST_NODES, MOST_NODES + 1):
            own = max(abs(x), abs(y)) <= reach
            result[np.clip(row[own] + y, 0, rows - 1), np.clip(column[own] + x, 0, columns - 1)] = True
    return result
