"""Kernels that say where bodies in contact are to go so that they stay even."""

from __future__ import annotations

import warp as wp

from ..motion.kernels_descent import Bodies, Charges, Steps, first_step, limited
from ..space.kernels_mesh import nearest_node
from ..space.kernels_space import Space, confine
from .kernels_outlines import Outlines

wp.set_module_options({"enable_backward": False})


@wp.kernel
def take_poses(
    first: int,
    crowd_pose: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    space: Space,
    # outputs
    pose: wp.array(dtype=wp.vec4),
):
    """Poses in the model's order, of outlines in theirs."""
    i = first + wp.tid()
    at = confine(wp.vec2(crowd_pose[i][0], crowd_pose[i][1]), space)
    pose[outlines.body[i]] = wp.vec4(at[0], at[1], crowd_pose[i][2], outlines.length[i])


@wp.kernel
def find_homes(
    first: int,
    crowd_pose: wp.array(dtype=wp.vec4),
    outlines: Outlines,
    charges: Charges,
    bodies: Bodies,
    steps: Steps,
    farthest: float,
    space: Space,
    # outputs
    home: wp.array(dtype=wp.vec4),
):
    """Where the forces would have every body, at most so far from where it is."""
    i = first + wp.tid()
    body = outlines.body[i]
    begin = bodies.first_charge[body]
    end = bodies.first_charge[body + 1]
    own = crowd_pose[i]
    p = confine(wp.vec2(own[0], own[1]), space)
    force = wp.vec2(0.0, 0.0)
    total = float(0.0)
    for j in range(begin, end):
        force += bodies.charge[j] * charges.field[j]
        total += bodies.charge[j]
    length = steps.length[first_step(bodies.group[body], steps) + nearest_node(p, steps.mesh)]
    way = limited(force * (length / total), farthest)
    q = confine(p + way, space)
    home[i] = wp.vec4(q[0], q[1], own[2], 0.0)
