"""The field in a space whose borders are mirrors, so that they neither attract nor repel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.space import Space
from . import kernels_mirror
from .field import Field
from .field_targets import FieldTarget

__all__ = ["COPIES", "MirroredField"]

# Every charge has three images: across the right border, the upper one, and both.
COPIES = 4


class MirroredField:
    """Evaluates the field of charges and of their images beyond the borders: a periodic one of twice the extent along both axes.

    Args:
        launcher: Where to run.
        space: Where the charges are.
        targets: One per group.
        charge: Charge of every particle, shape ``[n]``.
        charge_group: Its group, shape ``[n]``.
        whole_charge: What charges were before they faded, see :class:`~.field.Field`; None where none did.
        more: What else :class:`~.field.Field` takes.

    Attributes:
        field: The field of all of them.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        space: Space,
        targets: Sequence[FieldTarget],
        charge: np.ndarray,
        charge_group: np.ndarray,
        whole_charge: np.ndarray | None = None,
        **more: Any,
    ) -> None:
        self._launcher = launcher
        self._size = wp.vec2(*space.size)
        self._count = len(charge)
        # An image that several groups follow stays one.
        parts = [part for target in targets for part in (target, *target.more)]
        images = [image for part in parts for image in (part.image, part.whole) if image is not None]
        mirrored = {id(image): mirror(image) for image in images}
        self.field = Field(
            launcher,
            space=space.with_mirror_images(),
            targets=[_mirrored(target, mirrored) for target in targets],
            charge=np.tile(charge, COPIES),
            charge_group=np.tile(charge_group, COPIES),
            whole_charge=None if whole_charge is None else np.tile(whole_charge, COPIES),
            **more,
        )
        self._position = launcher.empty(COPIES * self._count, wp.vec2)
        self._all = launcher.zeros(COPIES * self._count, wp.vec2)

    def evaluate(self, position: wp.array, field: wp.array) -> None:
        """Write the force per unit charge at every charge; see :meth:`.field.Field.evaluate`."""
        self._mirror(position)
        self.field.evaluate(self._position, self._all)
        self._launcher.launch(kernels_mirror.take_first, self._count, [self._all], [field])

    def correct_targets(self, position: wp.array) -> None:
        """Change the targets by how dense charges stand; see :meth:`.field.Field.correct_targets`."""
        self._mirror(position)
        self.field.correct_targets(self._position)

    def _mirror(self, position: wp.array) -> None:
        self._launcher.launch(
            kernels_mirror.mirror_positions, self._count, [position, self._count, self._size], [self._position]
        )


def mirror(image: np.ndarray) -> np.ndarray:
    """An image (row 0 at the top) with those beyond its right and upper borders."""
    wide = np.concatenate([image, image[:, ::-1]], axis=1)
    return np.ascontiguousarray(np.concatenate([wide[::-1], wide], axis=0))


def _mirrored(target: FieldTarget, images: dict[int, np.ndarray]) -> FieldTarget:
    more = tuple(_mirrored(part, images) for part in target.more)
    whole = None if target.whole is None else images[id(target.whole)]
    return FieldTarget(images[id(target.image)], COPIES * target.charge, more, target.class_index, whole)
