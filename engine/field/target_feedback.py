"""Targets that are changed until bodies, seen over some spacings, are as dense as was asked for.

Where forces balance, bodies are nearly as dense as their target, not quite: they push each other out of where they are crowded. How
dense they stand is measured during the run, blurred over some spacings, and what lacks is asked for in addition, as an integral
controller does. It is blurred with what mirrors at the borders would show: a lattice whose first row is half a spacing from the border
is as dense as it should be, which a Gaussian that ends there would not tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from ..device.launcher import GRAIN, Launcher
from ..space.kernels_mesh import Mesh
from ..space.mesh_layout import MeshLayout
from ..space.target_deposit import deposit_images, mix_images
from . import kernels_feedback
from .kernels_splines import MIXED_AT_ONCE, mix_groups

__all__ = ["TargetFeedback", "feedback_widths"]

# Width of the Gaussian, in spacings of the bodies of a group: with 2 what it sees are single bodies; with 4 errors at 2 spacings are
# larger by a fifth. And over the shorter side of the domain at most, and over the width of the group of which there are most.
WIDTH, MOST_OF_SIDE, MOST_OF_NARROWEST = 2.6, 0.15, 4.0
# Nodes along the narrowest, and how many widths each reaches: beyond there is 4e-5 of its peak, of which lattices leave nothing.
NODES_ALONG, REACH = 2.0, 4.5
# By how much more or less is asked for at most, as a share.
MOST = 0.2
# Where bodies are denser or sparser than asked for by more than the second share they cannot follow their density, as around a crowd
# of fixed ones, and nothing is changed; all of it up to the first.
FOLLOWED, NOT_FOLLOWED = 0.05, 0.1
# Where the density is less than this share of its mean the Gaussian sees single bodies, and nothing is changed; all of it from twice
# as much.
SPARSE = 0.02
# Nodes beyond a border, for splines of charges at it; nodes that are summed at once; and those of a row that are written at once.
MARGIN, BLOCK, BLOCK_OF_ROW = 3, 512, 64


def feedback_widths(counts: np.ndarray, size: Sequence[float]) -> np.ndarray:
    """Widths of the Gaussians over which densities of groups are compared; 0 where bodies are too few to compare any.

    Args:
        counts: Bodies of every group, shape ``[group_count]``.
        size: Width and height of the rectangle that they are in; the result is in the same unit.
    """
    width = WIDTH * np.sqrt(size[0] * size[1] / np.maximum(counts, 1))
    most = min(MOST_OF_SIDE * min(size), MOST_OF_NARROWEST * float(width.min(initial=math.inf)))
    return np.where((counts > 0) & (width <= most), width, 0.0)


class TargetFeedback:
    """Changes the targets on a field's mesh.

    Args:
        launcher: Where to run.
        layout: The mesh of the field.
        images: The images of the targets.
        attracting: Charge of each image that attracts every group, shape ``[group_count, image_count]``.
        interaction: Factors between groups, shape ``[group_count, group_count]``, on the device.
        attraction: What attracts groups, charge per node, flat, one group after the other; it is changed in place.
        width: Of the Gaussian of every group, in the solver's unit, shape ``[group_count]``; 0 where its targets stay as they are.

    Attributes:
        layout: A coarse mesh, on which densities are compared.
        factor: By how much more is asked for than was given, as a share, at its nodes in the domain, one group after the other.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        layout: MeshLayout,
        images: Sequence[np.ndarray],
        attracting: np.ndarray,
        interaction: wp.array,
        attraction: wp.array,
        width: np.ndarray,
    ) -> None:
        self._launcher, self._of_field = launcher, layout
        self._images, self._attracting, self._interaction = images, attracting, interaction
        self._attraction = attraction
        self._repeats = layout.space.periodic
        self._groups = len(attracting)
        across, up = layout.space.size
        self._intervals = [
            max(4, math.ceil(NODES_ALONG * length / width[width > 0.0].min())) for length in (across, up)
        ]
        step = across / self._intervals[0], up / self._intervals[1]
        self._margin = 0 if self._repeats else MARGIN
        # Of columns and rows: those that charges are laid on, and those within the domain.
        given, self._nodes = (
            [many + (0 if self._repeats else 1 + 2 * margin) for many in self._intervals]
            for margin in (self._margin, 0)
        )
        shape = (given[1], given[0])
        self.layout = replace(layout, shape=shape, padded=shape, spacing=step, margin=self._margin)
        self._weights = [self._weights_of(width / step[0]), self._weights_of(width / step[1])]
        coarse = kernels_feedback.Coarse()
        coarse.factor = self.factor = launcher.zeros(self._groups * self._nodes[0] * self._nodes[1], float)
        coarse.count_x, coarse.count_y = self._nodes
        coarse.inverse_spacing = wp.vec2(1.0 / step[0], 1.0 / step[1])
        coarse.size, coarse.repeats = wp.vec2(across, up), int(self._repeats)
        self._coarse = coarse
        # What is asked for, once it is changed; and on the coarse mesh, with room for what there is, once that is measured.
        self._asked: wp.array | None = None
        self._target: wp.array | None = None

    def take_over(self, before: TargetFeedback) -> None:
        """Begin with what another field's targets were changed by, where bodies are nearly the same as before."""
        if before._asked is None or before._groups != self._groups or before._repeats != self._repeats:
            return
        nodes = self.layout.for_kernels()
        nodes.count_x, nodes.count_y = self._nodes
        nodes.margin = 0
        self._read_factors(before._coarse, nodes, self.factor)
        self._change_targets()

    def apply(self) -> None:
        """Have the targets follow the factors, which somebody else has set."""
        if self._asked is not None or self.factor.numpy().any():
            self._change_targets()

    def correct(self, deposit: Callable[[MeshLayout, wp.array], None]) -> None:
        """Ask for less where charges are denser than they should be, and for more where they are not as dense.

        Args:
            deposit: Adds the charges of every group to the nodes of a mesh.
        """
        nodes = self.layout.node_count
        if self._target is None:
            self._prepare_to_measure()
        deposit(self.layout, self._node_charge)
        at_once = 1 if self._launcher.device.is_cuda else MIXED_AT_ONCE
        self._launcher.launch(
            mix_groups,
            -(-nodes // at_once),
            [self._interaction, self._target, self._groups, nodes, at_once],
            [self._node_charge, self._surplus],
            grain=max(1, GRAIN * 8 // (at_once * self._groups**2)),
        )
        limits = [SPARSE, FOLLOWED, NOT_FOLLOWED, MOST]
        self._launcher.launch(
            kernels_feedback.change_factors,
            len(self._density),
            [
                self._blurred(self._surplus),
                self._density,
                self._mean,
                self._ground,
                self._nodes[0] * self._nodes[1],
                *limits,
            ],
            [self.factor],
        )
        self._change_targets()

    def _prepare_to_measure(self) -> None:
        launcher, nodes = self._launcher, self.layout.node_count
        self._node_charge = launcher.zeros(self._groups * nodes, wp.int64)
        self._surplus = launcher.empty(self._groups * nodes, float)
        deposited = deposit_images(launcher, self._images, self.layout)
        self._target = mix_images(launcher, deposited, self._attracting, nodes)
        self._density = self._blurred(self._target)
        whole, cells = self._attracting.sum(axis=1), self._intervals[0] * self._intervals[1]
        self._mean = launcher.array(whole / cells, float)
        # Beyond an edge of the ground of a density there are no mirrors.
        grounds = [(image > SPARSE * image.mean(dtype=np.float64)).astype(np.float32) for image in self._images]
        if all(ground.all() for ground in grounds):
            self._ground = launcher.array(np.ones(len(self._density)), float)
            return
        share = np.divide(
            self._attracting, whole[:, None], out=np.zeros_like(self._attracting), where=whole[:, None] != 0.0
        )
        share *= [cells * float(ground.mean(dtype=np.float64)) for ground in grounds]
        self._ground = self._blurred(mix_images(launcher, deposit_images(launcher, grounds, self.layout), share, nodes))

    def _change_targets(self) -> None:
        """Multiply what is asked for by the factors; no group gets more in all."""
        if self._asked is None:
            self._asked = wp.clone(self._attraction)
        nodes = self._of_field.node_count
        self._read_factors(self._coarse, self._of_field.for_kernels(), self._attraction)
        blocks = -(-nodes // BLOCK)
        total = self._launcher.empty(self._groups * blocks, wp.float64)
        self._launcher.launch(
            kernels_feedback.multiply,
            len(total),
            [self._asked, nodes, BLOCK, blocks],
            [self._attraction, total],
            grain=GRAIN // BLOCK,
        )
        added, whole = total.numpy().reshape(self._groups, blocks).sum(axis=1), self._attracting.sum(axis=1)
        mean = np.divide(added, whole, out=np.zeros_like(added), where=whole != 0.0)
        self._launcher.launch(
            kernels_feedback.add_to_asked,
            self._groups * nodes,
            [self._asked, self._launcher.array(mean, float), nodes],
            [self._attraction],
        )

    def _read_factors(self, coarse: kernels_feedback.Coarse, nodes: Mesh, factor: wp.array) -> None:
        """Write factors at the nodes of a mesh."""
        blocks = -(-nodes.count_x // BLOCK_OF_ROW)
        self._launcher.launch(
            kernels_feedback.read_factors,
            self._groups * nodes.count_y * blocks,
            [nodes, coarse, BLOCK_OF_ROW, blocks],
            [factor],
            grain=GRAIN // BLOCK_OF_ROW,
        )

    def _weights_of(self, width: np.ndarray) -> tuple[wp.array, wp.array]:
        """Of Gaussians of so many nodes in width, on one side of their middles; of the whole they sum to 1. And how many there are."""
        reach = np.ceil(REACH * width).astype(np.int32)
        weight = np.zeros((len(width), int(reach.max()) + 1))
        for own, many, wide in zip(weight, reach, width, strict=True):
            if wide > 0.0:
                own[: many + 1] = np.exp(-0.5 * (np.arange(many + 1) / wide) ** 2)
                own /= 2.0 * own.sum() - own[0]
        return self._launcher.array(weight, float), self._launcher.array(reach, wp.int32)

    def _blurred(self, values: wp.array) -> wp.array:
        """Values on the mesh, blurred along both axes, at the nodes within the domain."""
        rows, columns = self.layout.shape
        across, up = self._nodes
        for (weight, reach), given, nodes, inner, intervals, others in (
            (self._weights[0], columns, across, 1, self._intervals[0], rows),
            (self._weights[1], rows, up, across, self._intervals[1], 1),
        ):
            result = self._launcher.empty(self._groups * others * nodes * inner, float)
            self._launcher.launch(
                kernels_feedback.blur_along,
                len(result),
                [values, weight, reach, others, given, nodes, inner, intervals, self._margin, int(self._repeats)],
                [result],
            )
            values = result
        return values
