"""How wide charges and targets are blurred.

A charge cannot show detail finer than the spacing of the charges around it. Where charges repel as points, and are attracted by a
target that is smoothed, the energy is lowest at a density that differs from the target's: by the laplacian of its logarithm over
8 pi, for a gas of charges at zero temperature. So both sides are blurred alike, and the energy is a distance between blurred charges
and blurred target. The blur follows the local spacing, and that of small charges is narrower: what is too narrow loses tone, what is
too wide lets pairs of charges collapse.

Charges belong to *families*, the classes; between two of these the blur is narrower.

Every charge, and every piece of the target, has a Gaussian of its own; what acts between two of them has the sum of their variances.
Targets are blurred at a few *levels* of variance, and whatever lies between two of them is shared between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..device.summaries import extremes
from ..space.mesh_layout import MeshLayout
from ..space.target_deposit import deposit_images, mix_images
from . import kernels_blur
from .influence import convolution_of, product_influence

__all__ = [
    "BLUR_OVER_SPACING",
    "CORE",
    "CORE_REACH",
    "CORE_REACH_OF_UNIFORM",
    "CORE_REACH_OF_WIDEST",
    "EXPONENT",
    "LARGEST_Q",
    "LEAST_OF_SMALL",
    "LOWEST",
    "SHARPER_BETWEEN",
    "USUAL_REGULARITY",
    "WIDEST",
    "Blur",
    "BlurSettings",
    "blur_over_spacing",
    "core",
]

# Width of the blur between two charges over their spacing, as it usually is; and where the density is everywhere the same, so that
# there is less tone to lose: wider ones have the nearest neighbors of all closer together than points have.
BLUR_OVER_SPACING, BLUR_OF_UNIFORM = 0.5, 0.48
# What is blurred more widely than the spacing of a lattice has no lattice of least energy. So the blur decides how regular a pattern
# is: at a regularity of 0 it is as wide as it can be without pairs of charges that collapse.
USUAL_REGULARITY = 0.6
WIDEST_OVER_SPACING, WIDEST_OF_UNIFORM = 0.75, 0.8
# What is blurred hardly keeps close pairs apart. So every charge has a *core*, too: a repulsion of this strength, (1 - q / end)² / r
# where q = r² / (2 variance), that ends a spacing away. Neighbors that stand evenly hardly feel it, so that it does not bias tone;
# farther reaching ones do on images, by 3 dB at a reach of 1.15, and shorter ones leave smallest distances as they are. What is
# blurred less than usual needs less of it, and what is blurred more, so as not to be a lattice, must not be held to one by it.
CORE, CORE_REACH, CORE_REACH_OF_UNIFORM, CORE_REACH_OF_WIDEST = 0.5, 1.0, 1.15, 0.6
# Kernels know q up to here.
LARGEST_Q = 12.0
# Between classes the variance is smaller by this factor: bodies of two classes stand closer than those of one, whose own repulsion is
# stronger, and what is soft lets them come closer still. Half way from 1, where the union has close pairs, to points, where the
# classes are as uneven as they would be without a blur.
SHARPER_BETWEEN = 1.75
# The variance falls with this power of the number density, between bounds: at 1 it would follow the spacing entirely. Thin regions
# would then look smoother and less even; and bodies that are few have few neighbors to be even with.
EXPONENT = 0.75
LOWEST, WIDEST = 0.5, 2.0
# A charge's variance is in proportion to it, since it fills so much space, between this share and the usual: one that is far smaller
# than its neighbors keeps a blur, and one that is larger is no worse for being sharp.
LEAST_OF_SMALL = 0.125
# The density is smoothed by so many spacings first: the blur must not change within its own width.
SMOOTHING = 1.0
# Ratio of the variances of two levels, at most.
LEVEL_RATIO = 2.0
# A blur that varies less than this is taken to be everywhere the same.
NEGLIGIBLE = 1.1


@dataclass(frozen=True)
class BlurSettings:
    """How a field blurs charges and targets.

    Attributes:
        regularity: How regular patterns are to be, 0 to 1.
        over_spacing: Width of the blur between two charges over their spacing; None for the width that the regularity asks for.
        sharper: By how much the variance between charges of two families is divided.
        smooth: Whether charges have no core, and are blurred by that width however few they are.
    """

    regularity: float = USUAL_REGULARITY
    over_spacing: float | None = None
    sharper: float = SHARPER_BETWEEN
    smooth: bool = False


def blur_over_spacing(regularity: float, uniform: bool) -> float:
    """Width of the blur between two charges over their spacing, for a regularity from 0 to 1."""
    usual, widest = (BLUR_OF_UNIFORM, WIDEST_OF_UNIFORM) if uniform else (BLUR_OVER_SPACING, WIDEST_OVER_SPACING)
    return widest + (usual - widest) * regularity / USUAL_REGULARITY


def core(blur_over_spacing: float, uniform: bool, longest: float | None = None) -> tuple[float, float]:
    """Strength of the core, and the q at which it ends: ``longest`` spacings away at most, None for that of the plane."""
    usual, widest = (BLUR_OF_UNIFORM, WIDEST_OF_UNIFORM) if uniform else (BLUR_OVER_SPACING, WIDEST_OVER_SPACING)
    if longest is None:
        longest = CORE_REACH_OF_UNIFORM if uniform else CORE_REACH
    wider = min(max((blur_over_spacing - usual) / (widest - usual), 0.0), 1.0)
    reach = longest + (CORE_REACH_OF_WIDEST - longest) * wider
    end = 0.5 * (reach / blur_over_spacing) ** 2
    return CORE * min(blur_over_spacing / usual, 1.0) ** 4, min(end, LARGEST_Q)


class Blur:
    """Variance of every charge's blur, by its place.

    Args:
        launcher: Where to run.
        layout: The mesh that the targets are on.
        deposited: Share of every image's integral at every node; see :func:`~esh.engine.space.target_deposit.deposit_images`.
        number: Charges that follow every image.
        spacing: Typical distance of neighboring charges where they are dense.
        width: Blur between two charges at that spacing.
        widest: Largest blur that the near part reaches.
        uniform: Whether the density is everywhere the same.
        charge: All charges, in units of their mean.

    Attributes:
        variance: Of every node, flat; that of a mean charge there, half of what acts between two of them.
        uniform: Whether that of a mean charge is everywhere the same.
        levels: Variances of the levels, a geometric series; one where the blur of all charges is everywhere the same.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        layout: MeshLayout,
        deposited: wp.array,
        number: Sequence[float],
        spacing: float,
        width: float,
        widest: float,
        uniform: bool,
        charge: np.ndarray,
    ) -> None:
        self._launcher = launcher
        self._layout = layout
        self.uniform = uniform
        usual = 0.5 * min(width, widest) ** 2
        self.variance = launcher.alike(np.broadcast_to(np.float32(usual), layout.node_count), float)
        self.levels = [usual]
        low = high = usual
        if not uniform:
            self.variance = launcher.empty(layout.node_count, float)
            bounds = (LOWEST * usual, min(WIDEST * usual, 0.5 * widest**2))
            self._follow_density(deposited, number, spacing, usual, bounds)
            low, high = extremes(launcher, self.variance)
        # What is the same of all need not be gone through.
        each = charge[:1] if charge.strides == (0,) else charge
        share = np.clip(each, LEAST_OF_SMALL, 1.0)
        # What of its place's variance the target has: that of the charges which are to make it up.
        self._of_target = float((each * share).sum() / each.sum())
        low *= float(share.min())
        if high < NEGLIGIBLE * low:
            self.variance = launcher.alike(np.broadcast_to(np.float32(usual), layout.node_count), float)
            return
        count = math.ceil(math.log(high / low) / math.log(LEVEL_RATIO)) + 1
        self.levels = [low * (high / low) ** (level / (count - 1)) for level in range(count)]

    @property
    def constant(self) -> bool:
        """Whether it is everywhere the same."""
        return len(self.levels) == 1

    def take_level(self, level: int, images: wp.array) -> wp.array:
        """What of each of the ``images``, on the mesh, flat, one after the other, is blurred at a level: all of it, of one level."""
        if self.constant:
            return images
        levels = self._launcher.array(np.array(self.levels), float)
        result = self._launcher.empty(len(images), float)
        node_count = self._layout.node_count
        self._launcher.launch(
            kernels_blur.take_level,
            len(images),
            [images, node_count, self.variance, self._of_target, levels, level],
            [result],
        )
        return result

    def _follow_density(
        self, deposited: wp.array, number: Sequence[float], spacing: float, usual: float, bounds: tuple[float, float]
    ) -> None:
        launcher, layout = self._launcher, self._layout
        convolution = convolution_of(launcher, layout, 1)
        rows, columns = layout.padded
        sigma = SMOOTHING * spacing
        along_y, along_x = (
            np.exp(-0.5 * (2.0 * np.pi * np.arange(count // 2 + 1) / count * sigma / step) ** 2)
            for count, step in zip((rows, columns), layout.spacing[::-1], strict=True)
        )
        smooth = product_influence(convolution, along_y / (rows * columns), along_x)
        charges = mix_images(launcher, deposited, np.array([list(number)]), layout.node_count)
        convolution.apply(smooth, charges)
        # Beyond the border of an open domain there is nothing, which is no density to follow.
        inside = deposit_images(launcher, [np.ones((1, 1), np.float32)], layout)
        convolution.apply(smooth, inside)
        # Of the whole domain, a node's share of the area, and the charges there would be if it were dense everywhere.
        area = layout.whole.area
        whole, dense = layout.node_area / area, area / spacing**2
        launcher.launch(
            kernels_blur.find_variances,
            layout.node_count,
            [charges, inside, whole, dense, usual, EXPONENT, *bounds],
            [self.variance],
        )
