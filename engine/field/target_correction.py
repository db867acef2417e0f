"""The part of the targets' potential that the charges' mesh is too coarse for, on a finer mesh of its own.

Charges move, so their mesh is transformed at every step and costs; targets rest, so a mesh that shows every detail which bodies can
follow is transformed once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.mesh_layout import MeshLayout
from ..space.space import Space
from ..space.target_deposit import deposit_images, mix_images
from .field_meshes import BLUR_OVER_MESH, BLUR_OVER_SPACING, FEWEST_NODES, target_mesh
from .influence import convolution_of, smoothed_influence

__all__ = ["FEWEST_NODES", "TargetCorrection"]


class TargetCorrection:
    """Potential of K * (gauss(blur) - gauss(split)) * u for every group; the far part on the charges' mesh lacks it.

    Args:
        launcher: Where to run.
        space: What the targets lie over.
        images: The distinct target densities.
        attraction: Charge of each image that attracts each group, shape ``[group_count, image_count]``.
        spacing: Typical distance of neighbouring bodies where they are dense.
        charge_count: Number of charges.
        split: Standard deviation of the Gaussian that the far part is smoothed by.
        fewest_nodes: Nodes of the fine mesh at least, where charges are few.

    Attributes:
        layout: The fine mesh.
        blur: Standard deviation of the Gaussian by which the targets are smoothed.
        potential: Potentials, flat, one after the other; groups whose potentials are multiples of each other share one.
        row: Index of the potential of every group.
        scale: Its factor.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        space: Space,
        images: Sequence[np.ndarray],
        attraction: np.ndarray,
        spacing: float,
        charge_count: int,
        split: float,
        fewest_nodes: int = FEWEST_NODES,
    ) -> None:
        self.layout = target_mesh(
            space,
            spacing,
            charge_count=charge_count,
            split=split,
            on_gpu=launcher.device.is_cuda,
            fewest_nodes=fewest_nodes,
        )
        self.blur = max(BLUR_OVER_SPACING * spacing, BLUR_OVER_MESH * max(self.layout.spacing))
        row, scale, distinct = _distinct_rows(attraction)
        device = launcher.device
        self.row = wp.array(row, dtype=wp.int32, device=device)
        self.scale = wp.array(scale, dtype=float, device=device)
        self.potential = _potentials(launcher, self.layout, self.blur, split, images, distinct)


def _distinct_rows(attraction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of ``attraction`` that are no multiples of each other: index and factor of every row, and the rows."""
    scale = attraction.sum(axis=1)
    # A group that nothing attracts has a potential of zero, whatever it is scaled by.
    unit = attraction / np.where(scale > 0.0, scale, 1.0)[:, None]
    distinct, row = np.unique(np.round(unit, 9), axis=0, return_inverse=True)
    return row.ravel().astype(np.int32), scale, distinct


def _potentials(
    launcher: Launcher,
    layout: MeshLayout,
    blur: float,
    split: float,
    images: Sequence[np.ndarray],
    rows: np.ndarray,
) -> wp.array:
    convolution = convolution_of(launcher, layout, len(rows))
    influence = launcher.kept(
        ("influence", layout, blur, split),
        lambda: smoothed_influence(convolution, layout, blur, split, np.pi * (split**2 - blur**2)),
    )
    result = mix_images(launcher, deposit_images(launcher, images, layout), rows, layout.node_count)
    convolution.apply(influence, result)
    return result
