"""Bodies brought to where they may be: into the domain, and to where their density is above zero."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..device.marked import numbers_of_marked
from ..model.model import Model
from ..space.density import move_into_support, sample_density
from ..space.support import images_for_kernels
from . import kernels_edit

__all__ = ["in_support", "move_poses_into_support"]


def in_support(model: Model, position: np.ndarray) -> np.ndarray:
    """Bring bodies that are not fixed to where they may be; positions [m], shape ``[body_count, 2]``, are changed in place."""
    for axis, length in enumerate(model.problem.rectangle.size):
        np.clip(position[:, axis], 0.0, length, out=position[:, axis])
    for k, support in enumerate(model.supports):
        if (support > 0.0).all():
            continue
        own = np.flatnonzero((model.body.support == k) & ~model.fixed)
        outside = own[sample_density(support, position[own], model.problem.rectangle.size) <= 0.0]
        if len(outside):
            position[outside] = move_into_support(support, position[outside], model.problem.rectangle.size)
    return position


def move_poses_into_support(launcher: Launcher, model: Model, pose: wp.array) -> None:
    """The same on the device, of poses that are in the domain; only those that are to be moved come to the host."""
    if all((support > 0.0).all() for support in model.supports):
        return
    images = images_for_kernels(launcher, model.supports, model.size, to_support=False)
    marked = launcher.empty(model.body_count, wp.int32)
    of_bodies = [launcher.array(values, wp.int32) for values in (model.body.support, model.body.flags)]
    launcher.launch(
        kernels_edit.mark_outside, model.body_count, [pose, *of_bodies, images, wp.vec2(*model.size)], [marked]
    )
    outside = numbers_of_marked(launcher, marked)
    if not len(outside):
        return
    point = launcher.empty(len(outside), wp.vec2)
    launcher.launch(kernels_edit.read_places, len(outside), [outside, pose, 1.0], [point])
    position = point.numpy() * np.float64(model.unit)
    support = model.body.support[outside.numpy()]
    for k in np.unique(support).tolist():
        own = support == k
        position[own] = move_into_support(model.supports[k], position[own], model.problem.rectangle.size)
    moved = launcher.array((position / model.unit).astype(np.float32), wp.vec2)
    launcher.launch(kernels_edit.put_down, len(outside), [0, outside, moved], [pose])
