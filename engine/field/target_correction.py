"""The part of the targets' potential that the charges' mesh is too coarse for, on a finer mesh of its own.

Charges move, so their mesh is transformed at every step and costs; targets rest, so a mesh that shows every detail which bodies can
follow is transformed once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..device.summaries import largest_of_rows
from ..space.space import Space
from ..space.target_deposit import deposit_images, mix_images
from . import kernels_correction
from .blur import Blur
from .field_meshes import FINEST_BLUR_OVER_MESH, target_mesh, widest_blur
from .field_targets import TargetImages
from .influence import convolution_of, rest_influences

__all__ = ["TargetCorrection"]


class TargetCorrection:
    """Potential of K * (blur - split) * u for every group; the far part on the charges' mesh lacks it.

    It is there for every level of the charges' own blur; see :mod:`.blur`.

    Args:
        launcher: Where to run.
        space: What the targets lie over.
        within: Where that begins in the space that images lie over, and this.
        images: The target densities of all classes.
        attraction: Charge of each image that attracts each group, shape ``[2, group_count, image_count]``: of its own
            family, and of all others, whose variances are divided by ``sharper``.
        sharper: See :mod:`.blur`.
        number: Charges that follow each image.
        spacing: Typical distance of neighboring bodies where they are dense.
        charge: All charges, before they faded.
        blur_over_spacing: Width of the blur between two charges at that spacing, over it.
        cutoff: Where the split ends; see :mod:`.splitting`.
        fewest_nodes: Nodes of the fine mesh at least, where charges are few.

    Attributes:
        layout: The fine mesh.
        blur: The blur of charges and targets.
        potential: Potentials, flat: for every row all levels, one after the other.
        row: Index of the row of every group; groups whose potentials are multiples of each other share one.
        scale: Its factor.
        acts: Whether there is more than rounding in a block of nodes, uint8, flat: for every row all blocks.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        space: Space,
        within: tuple[tuple[float, float], Space],
        images: TargetImages,
        attraction: np.ndarray,
        sharper: float,
        number: Sequence[float],
        spacing: float,
        charge: np.ndarray,
        blur_over_spacing: float,
        cutoff: float,
        fewest_nodes: int,
    ) -> None:
        self._launcher = launcher
        uniform = images.uniform
        self.layout = target_mesh(
            space,
            spacing,
            charge_count=len(charge),
            cutoff=cutoff,
            on_gpu=launcher.device.is_cuda,
            blur_over_spacing=blur_over_spacing,
            uniform=uniform,
            fewest_nodes=fewest_nodes,
        ).in_part(*within)
        deposited = deposit_images(launcher, images.images, self.layout)
        at_first = images.faded and not uniform
        self.blur = Blur(
            launcher,
            layout=self.layout,
            deposited=deposit_images(launcher, images.whole, self.layout) if at_first else deposited,
            number=number,
            spacing=spacing,
            width=blur_over_spacing * spacing,
            widest=widest_blur(cutoff),
            uniform=uniform,
            charge=charge,
        )
        row, scale, distinct = _distinct_rows(
            np.concatenate(attraction, axis=1), [id(image) for image in images.images]
        )
        self.row = launcher.array(np.asarray(row, np.int32), wp.int32)
        self.scale = launcher.array(np.asarray(scale, np.float32), float)
        of_row = len(self.blur.levels) * self.layout.node_count
        self.potential = launcher.zeros(len(distinct) * of_row, float)
        for place, weights in enumerate(distinct):
            own, others = np.split(weights, 2)
            parts = [(part, narrower) for part, narrower in ((own, 1.0), (others, sharper)) if part.any()]
            if parts:
                result = self.potential[place * of_row : (place + 1) * of_row]
                self._find_potential(launcher, deposited, parts, cutoff, result)
        self._blocks = tuple(-(-count // kernels_correction.BLOCK_OF_NODES) for count in self.layout.shape)
        self.acts = self._find_where_it_acts(launcher, len(distinct))

    def for_kernels(self) -> kernels_correction.Correction:
        """The potentials as kernels take them."""
        correction = kernels_correction.Correction()
        correction.mesh = self.layout.for_kernels()
        correction.potential, correction.row, correction.scale = self.potential, self.row, self.scale
        correction.levels = self._launcher.array(np.array(self.blur.levels), float)
        correction.acts = self.acts
        correction.blocks_y, correction.blocks_x = self._blocks
        return correction

    def _find_where_it_acts(self, launcher: Launcher, rows: int) -> wp.array:
        """Look for the blocks of nodes over which every potential of a row is flat, as it is where targets are."""
        blocks = self._blocks[0] * self._blocks[1]
        spread, largest = (launcher.empty(rows * blocks, float) for _ in range(2))
        launcher.launch(
            kernels_correction.find_ranges,
            rows * blocks,
            [self.potential, len(self.blur.levels), self.layout.for_kernels(), *self._blocks[::-1]],
            [spread, largest],
            grain=GRAIN_OF_NEIGHBORS,
        )
        of_row = largest_of_rows(launcher, largest, rows)
        acts = launcher.empty(rows * blocks, wp.uint8)
        launcher.launch(kernels_correction.mark_acting, rows * blocks, [spread, blocks, of_row], [acts])
        return acts

    def _find_potential(
        self,
        launcher: Launcher,
        deposited: wp.array,
        parts: list[tuple[np.ndarray, float]],
        cutoff: float,
        result: wp.array,
    ) -> None:
        """Write a row's potentials, of ``parts``: what of all images attracts, and what variances are divided by."""
        layout, levels = self.layout, self.blur.levels
        convolution = convolution_of(launcher, layout, 1)
        # What the mesh is too coarse for would be aliases.
        least = (FINEST_BLUR_OVER_MESH * max(layout.spacing)) ** 2

        def meshes() -> Iterator[wp.array]:
            for part, _ in parts:
                targets = mix_images(launcher, deposited, part[None], layout.node_count)
                for level in range(len(levels)):
                    yield self.blur.take_level(level, targets)

        variances = [
            max((of_charge + of_target) / narrower, least)
            for of_charge in levels
            for _, narrower in parts
            for of_target in levels
        ]
        influences = rest_influences(convolution, layout, variances, cutoff)
        of_level = len(parts) * len(levels)
        convolution.add_up(
            [influences[begin : begin + of_level] for begin in range(0, len(influences), of_level)], meshes(), result
        )


def _distinct_rows(attraction: np.ndarray, image: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of ``attraction`` that are no multiples of each other: index and factor of every row, and the rows.

    Columns are of own and of other families' images; rows of different columns are alike, too, where these have the same ``image``.
    """
    scale = attraction.sum(axis=1)
    # A group that nothing attracts has a potential of zero, whatever it is scaled by.
    unit = attraction / np.where(scale > 0.0, scale, 1.0)[:, None]
    distinct, row = np.unique(np.round(unit, 9), axis=0, return_inverse=True)
    columns = [(half, number) for half in range(2) for number in image]
    seen: dict[tuple[object, ...], int] = {}
    first: list[int] = []
    for weights in distinct:
        used = np.flatnonzero(weights)
        alike = tuple((columns[column], weights[column]) for column in used)
        first.append(seen.setdefault(alike, len(first)))
    kept, place = np.unique(first, return_inverse=True)
    return place.ravel()[row.ravel()].astype(np.int32), scale, distinct[kept]
