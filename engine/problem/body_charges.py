"""The charges that bodies consist of: one on a dot, a row of them on a line.

Lines are those of section 6 of the paper (Schmaltz, Gwosdek and Weickert 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .of_bodies import of_all, one_by_one
from .problem import Problem

__all__ = ["BodyCharges", "charges_of"]


@dataclass(frozen=True, eq=False)
class BodyCharges:
    """Charges of all bodies, body after body.

    Attributes:
        per_body: How many charges every body has, shape ``[body_count]``.
        axial: Coordinate along the body's axis, -1 at one end to 1 at the other, shape ``[charge_count]``; 0 on a dot.
        charge: Charges, shape ``[charge_count]``, of mean 1; those of a body are in proportion to its area.
    """

    per_body: np.ndarray
    axial: np.ndarray
    charge: np.ndarray

    @cached_property
    def first(self) -> np.ndarray:
        """Index of the first charge of every body and, at the end, the number of charges, shape ``[body_count + 1]``, int32."""
        return np.concatenate([[0], np.cumsum(self.per_body)]).astype(np.int32)

    @cached_property
    def body(self) -> np.ndarray:
        """Body of every charge, shape ``[charge_count]``, int32."""
        return np.repeat(np.arange(len(self.per_body), dtype=np.int32), self.per_body)


def charges_of(problem: Problem) -> BodyCharges:
    """Return the charges of all bodies of ``problem``."""
    if all(size.kind.charges == 1 for body_class in problem.classes for size in body_class.sizes):
        area = problem.shared_areas()
        n = len(area)
        factor = n / area.sum()
        return BodyCharges(of_all(1, n), of_all(0.0, n), one_by_one(lambda values: values * factor, area))
    counts, axials, shares = [], [], []
    for body_class in problem.classes:
        for size in body_class.sizes:
            n = size.count or 0
            axial, share = size.kind.charge_places(), size.kind.charge_shares()
            counts.append(np.full(n, len(axial)))
            axials.append(np.tile(axial, n))
            shares.append(np.tile(share, n))
    per_body = np.concatenate(counts)
    charge = np.repeat(problem.shared_areas(), per_body) * np.concatenate(shares)
    return BodyCharges(per_body, np.concatenate(axials), charge * (len(charge) / charge.sum()))
