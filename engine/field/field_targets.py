"""Targets of a field: the density images that groups of charges follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

__all__ = ["FieldTarget", "TargetImages", "counts_of", "distinct_images"]


@dataclass(frozen=True, eq=False)
class FieldTarget:
    """Target density of one group: an image (see :mod:`~esh.engine.problem.problem`) and the charge that its integral stands for.

    Groups of one ``class_index`` follow one image. Groups of several classes may, too; then it is laid on the mesh once. ``more`` are
    other targets that are added to it. If the image fades towards a cut, ``whole`` is the image before that, which says how dense
    bodies stand.
    """

    image: np.ndarray
    charge: float
    more: tuple[FieldTarget, ...] = ()
    class_index: int | None = None
    whole: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class TargetImages:
    """The images that groups follow, each of them once.

    Attributes:
        images: The images. Equal ones are one array.
        whole: What they were before they faded towards a cut; the same arrays, if they did not.
        charge: Charge of each group by image, shape ``[group_count, image_count]``.
        of_class: Index of every class's image.
    """

    images: list[np.ndarray]
    whole: list[np.ndarray]
    charge: np.ndarray
    of_class: dict[int, int]

    @cached_property
    def uniform(self) -> bool:
        """Whether all images are of one density each."""
        return all(float(np.ptp(image)) == 0.0 for image in self.whole)

    @property
    def faded(self) -> bool:
        """Whether any image is another one than before it faded towards a cut."""
        return any(a is not b for a, b in zip(self.images, self.whole, strict=True))

    def followers(self, charge_group: np.ndarray) -> list[float]:
        """Return the number of charges that follow each image: those of a group in proportion to its charge by image.

        Args:
            charge_group: Group of every charge, shape ``[n]``.
        """
        share = self.charge / np.maximum(self.charge.sum(axis=1, keepdims=True), 1e-300)
        if len(share) == 1:
            return (len(charge_group) * share[0]).tolist()
        return (counts_of(charge_group, len(share)) @ share).tolist()


def distinct_images(targets: Sequence[FieldTarget]) -> TargetImages:
    """Find the images that groups follow, one per class."""
    images: list[np.ndarray] = []
    whole: list[np.ndarray] = []
    place: dict[tuple[str, int], int] = {}
    entries = []
    for group, target in enumerate(targets):
        for part in (target, *target.more):
            key = ("image", id(part.image)) if part.class_index is None else ("class", part.class_index)
            if key not in place:
                place[key] = len(images)
                images.append(_known(part.image, images))
                whole.append(images[-1] if part.whole is None else _known(part.whole, whole))
            entries.append((group, place[key], part.charge))
    charge = np.zeros((len(targets), len(images)))
    for group, index, amount in entries:
        charge[group, index] += amount
    of_class = {number: index for (kind, number), index in place.items() if kind == "class"}
    return TargetImages(images, whole, charge, of_class)


def counts_of(group: np.ndarray, count: int) -> np.ndarray:
    """Return the number of charges or bodies of every group; most lie group after group, which takes a third of the time."""
    if count == 1:
        return np.array([len(group)])
    if (group[1:] >= group[:-1]).all():
        return np.diff(np.searchsorted(group, np.arange(count + 1, dtype=group.dtype)))
    return np.bincount(group, minlength=count)


def _known(image: np.ndarray, images: list[np.ndarray]) -> np.ndarray:
    """Return the one of ``images`` that equals an image, so that it is not worked on again; or the image itself."""
    for known in images:
        if known is image:
            return known
        if known.shape == image.shape and np.array_equal(known[0], image[0]) and np.array_equal(known, image):
            return known
    return image
