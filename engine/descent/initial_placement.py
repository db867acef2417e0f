"""Where the bodies start: importance sampling along a Hilbert curve, even from the first step on and exact in number.

Cells visited along a Hilbert curve carry their share of a group's density; bodies stand at even steps of the running sum.
Neighbors on the curve are neighbors in the plane, so no region gets more than its share, unlike independent draws. A pyramid
of sums leads every body from the whole square to its cell, quarter by quarter, so that all of them go at once.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.devices import resolve_device
from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..model.beside_fixed import vacant_cells
from ..model.model import Model
from ..model.spatial_order import order_of_groups
from ..problem.problem import Problem
from ..space.kernels_images import Images
from ..space.part import Part, part_of
from ..space.support import images_for_kernels
from ..space.target_deposit import integrate_boxes
from . import kernels_start

__all__ = ["Pyramids", "body_starts", "first_pose", "initial_placement"]

# Cells per body, and the finest curve (2^12 cells a side): cells smaller than a spacing are what makes the start even.
CELLS_PER_BODY = 8
LARGEST_ORDER = 12
# Golden ratio: group after group starts at another fraction of a step, so that groups interleave along the curve.
GOLDEN = 0.6180339887498949
# From so many bodies on it counts where in memory they lie: a processor has those that are fewer at hand.
MANY_BODIES = 1 << 13


# Sums of a class's density by its number, or by the image that several have, and by the order of the curve.
Pyramids = dict[tuple[int, int], wp.array]


def first_pose(
    launcher: Launcher, model: Model, images: Images, start: int = 0, pyramids: Pyramids | None = None
) -> wp.array:
    """Put every group's bodies where its density asks for them, each group spread by itself.

    Args:
        launcher: Where to run.
        model: What is to be placed; its problem's seed decides on all that is random.
        images: The model's supports on the device.
        start: Number of the start: others than 0 are as random as that one.
        pyramids: Of other starts of this model; gets what is worked out now. None keeps nothing.

    Returns:
        Poses (x, y, 0, 0), ``wp.vec4``, shape ``[body_count]``. Every body stands inside the domain, where its density is above zero.
    """
    device = launcher.device
    problem = model.problem
    count, of_bodies, seed = body_starts(model, launcher, start)
    domain = wp.vec2(*model.size)
    pose = launcher.empty(model.body_count, wp.vec4)
    pyramids = {} if pyramids is None else pyramids
    first = 0
    for k, body_class in enumerate(problem.classes):
        most = int(count[model.groups.class_index == k].max())
        order = min(max(math.ceil(math.log2(math.sqrt(CELLS_PER_BODY * most) + 1.0)), 3), LARGEST_ORDER)
        # What fixed bodies leave of a density is its class's own.
        shared = k if model.has_fixed else id(body_class.density_image), order
        part = None if model.has_fixed else part_of([body_class.density_image])
        if shared not in pyramids:
            pyramids[shared] = _pyramid(launcher, model, k, order, part)
        around = Part() if part is None else part
        where = wp.vec2(*around.origin(model.size)), wp.vec2(*around.extent(model.size))
        launcher.launch(
            kernels_start.place_bodies,
            body_class.body_count,
            [*of_bodies, order, pyramids[shared], *where, images, domain, seed],
            [pose],
            first=first,
            grain=GRAIN_OF_NEIGHBORS,
        )
        first += body_class.body_count
    if model.body_count >= MANY_BODIES:
        pose = _in_rows(launcher, model, pose, of_bodies[1])
    if model.has_fixed:
        values = pose.numpy()
        values[model.fixed, :2] = problem.fixed.position / model.unit
        pose = wp.array(values, dtype=wp.vec4, device=device)
    return pose


def _in_rows(launcher: Launcher, model: Model, pose: wp.array, group: wp.array) -> wp.array:
    """Deal the places of every group out to its bodies again, row after row from below and from left to right in each.

    In this order the field goes through them, so that a step reads and writes memory along a few lines: a tenth less time for
    1,000,000 bodies. Places of fixed bodies stay among these.
    """
    count = model.groups.body_count
    # Those that lie group after group need not be listed.
    bodies = launcher.empty(0, wp.int32)
    if model.has_fixed or model.groups.first_body is None:
        kinds = model.groups.count + int(model.has_fixed)
        given = np.where(model.fixed, kinds - 1, model.body.group).astype(np.int32)
        count, group = np.bincount(given, minlength=kinds), launcher.array(given, wp.int32)
        bodies = launcher.array(_group_after_group(given, kinds), wp.int32)
    source = order_of_groups(launcher, pose, model.size, group, count)
    result = launcher.empty(model.body_count, wp.vec4)
    launcher.launch(kernels_start.take_poses, model.body_count, [pose, source, bodies], [result])
    return result


def _group_after_group(group: np.ndarray, count: int) -> np.ndarray:
    """All bodies in the order of their groups, int32; those of a group keep theirs."""
    if (group[1:] >= group[:-1]).all():
        return np.arange(len(group), dtype=np.int32)
    # NumPy sorts short integers by radix: of 1,000,000 bodies in a few milliseconds.
    return np.argsort(group.astype(np.int16) if count < 1 << 15 else group, kind="stable").astype(np.int32)


def body_starts(model: Model, launcher: Launcher, start: int = 0) -> tuple[np.ndarray, list[wp.array], int]:
    """What is random about a start.

    Returns:
        Bodies of every group; on the device: every body's support, group, number in that group and identity, bodies of every group,
        and at which fraction of a step along the curve each group starts; and the seed of the kernels.
    """
    group = model.body.group
    # Fixed bodies take no part in it.
    count = model.groups.body_count
    if model.has_fixed:
        count = np.bincount(group[~model.fixed], minlength=model.groups.count)
    rng = np.random.default_rng([model.problem.seed, 10, start] if start else model.problem.seed)
    seed = int(rng.integers(1 << 31))
    shift = (rng.random() + GOLDEN * np.arange(model.groups.count)) % 1.0
    of_bodies = [
        launcher.array(model.body.support, wp.int32),
        model.body.group_on(launcher),
        _ranks(launcher, model, count),
        model.body.identities_on(launcher),
        launcher.array(np.maximum(count, 1), wp.int32),
        launcher.array(shift, wp.float64),
    ]
    return count, of_bodies, seed


def initial_placement(problem: Problem) -> np.ndarray:
    """Return where the bodies of ``problem`` start [m], shape ``[body_count, 2]``, float64, in class, then size order."""
    launcher = Launcher(resolve_device("cpu"))
    try:
        model = Model(problem)
        images = images_for_kernels(launcher, model.supports, model.size)
        return first_pose(launcher, model, images).numpy()[:, :2] * np.float64(model.unit)
    finally:
        launcher.close()


def _ranks(launcher: Launcher, model: Model, count: np.ndarray) -> wp.array:
    """Number of every body among those of its group that are not fixed, of which there are so many; 0 for all others; ``wp.int32``."""
    body_group = model.body.group
    if not model.has_fixed and model.groups.first_body is not None:
        begin = launcher.array(model.groups.first_body[:-1].astype(np.int32), wp.int32)
        result = launcher.empty(len(body_group), wp.int32)
        launcher.launch(kernels_start.rank_bodies, len(body_group), [model.body.group_on(launcher), begin], [result])
        return result
    bodies = np.flatnonzero(~model.fixed)
    first = np.concatenate([[0], np.cumsum(count)])
    by_group = bodies[_group_after_group(body_group[bodies], len(count))]
    rank = np.zeros(len(body_group), dtype=np.int32)
    rank[by_group] = np.arange(len(bodies)) - first[body_group[by_group]]
    return launcher.array(rank, wp.int32)


def _pyramid(launcher: Launcher, model: Model, class_index: int, order: int, part: Part | None) -> wp.array:
    """Integrals of a class's density over 4^l cells of the domain, or of a part, for l from 0 to ``order``, less fixed bodies.

    One level lies after the other.
    """
    cells = 1 << order
    share = integrate_boxes(launcher, model.problem.classes[class_index].density_image, (cells, cells), part)
    if model.has_fixed:
        vacant = vacant_cells(model, class_index, share.numpy().astype(np.float64).reshape(cells, cells))
        if vacant is not None:
            share = wp.array(vacant.ravel(), dtype=float, device=launcher.device)
    pyramid = launcher.empty((4 ** (order + 1) - 1) // 3, wp.float64)
    launcher.launch(kernels_start.copy_finest, 4**order, [share, order], [pyramid])
    for end in range(order, 0, -2):
        level = max(end - 2, 0)
        launcher.launch(kernels_start.sum_quarters, 4**level, [level, end - level], [pyramid])
    return pyramid
