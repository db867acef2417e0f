"""How the target is blurred in its near field, and where a near field from before an edit is still good enough for that."""

from __future__ import annotations

import numpy as np

from .softness import Softness

__all__ = ["TargetBlur"]

# A near field is kept while densities have changed by less than this [natural logarithm] since it was found, in one edit or in
# several: nobody sees whether a blur follows a twentieth.
MOST_DENSER = 0.05
# Smallest density that ratios and logarithms are taken of.
TINY = 1e-300


class TargetBlur:
    """The blur of the target in its near field.

    If charges are points, the target has a fixed blur, which differs for uniform images. If they are soft, it is blurred as they are;
    where the blur follows the density, forces are found for a few shares of its variance, because small charges are blurred less.

    Args:
        facet_count: Number of facets.
        uniform: Which images are uniform, shape ``[image_count]``.
        softness: How soft charges are; None for points.
        charge: Charge of every particle, shape ``[n]``.
        charge_group: Its group, shape ``[n]``.
        group_count: Number of groups.

    Attributes:
        uniform: Which images are uniform.
        softness: How soft charges are; None for points.
        shares: Shares of the variance of a mean charge that forces are found for, shape ``[k]``.
        of_group: Which of these shares every group has, shape ``[group_count]``.
        of_target: Share of the variance of a mean charge that the target itself is blurred by.
    """

    def __init__(
        self,
        facet_count: int,
        uniform: np.ndarray,
        softness: Softness | None,
        charge: np.ndarray,
        charge_group: np.ndarray,
        group_count: int,
    ) -> None:
        self.uniform, self.softness = uniform, softness
        self.shares, self.of_group, self.of_target = np.ones(1), np.zeros(group_count, np.int32), 1.0
        # All that the blur depends on, except densities. How many charges there are counts as density.
        kinds = uniform.tolist() if softness is None else []
        if softness is not None and softness.following is not None:
            following = softness.following
            self.shares, self.of_group = following.shares_of_groups(charge, charge_group, group_count)
            self.of_target = float(np.average(following.shares(charge), weights=charge))
            softness = softness._replace(following=following._replace(number=()))
        self._how = (softness, kinds, self.shares.tolist(), round(self.of_target, 6))
        # Density of charges now over that for which the near field of a facet was found, shape ``[image_count, facet_count]``.
        self._density = np.ones((len(uniform), facet_count))

    @property
    def follows_density(self) -> bool:
        """Whether the blur differs from place to place."""
        return self.softness is not None and self.softness.following is not None

    def carry(self, before: TargetBlur, factor: np.ndarray) -> np.ndarray:
        """Return on which facets a near field from before is blurred about as it would be now; shape ``[facet_count]``.

        Args:
            before: The blur before an edit.
            factor: What the edit multiplied the shares of most tiles by, for every image.
        """
        if self._how != before._how:
            return np.zeros(self._density.shape[1], bool)
        if self.softness is not None and self.softness.following is not None:
            assert before.softness is not None
            assert before.softness.following is not None
            number, number_before = self.softness.following.number, before.softness.following.number
            change = factor * np.array(number) / np.maximum(number_before, TINY)
            self._density = before._density * change[:, None]
        return (np.abs(np.log(np.maximum(self._density, TINY))) < MOST_DENSER).all(axis=0)

    def forget(self, facets: np.ndarray) -> None:
        """Note that the near field of these facets is found anew, bool, shape ``[facet_count]``."""
        self._density[:, facets] = 1.0
