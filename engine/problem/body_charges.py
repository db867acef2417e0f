"""The charges that bodies consist of: one on a dot, a row of them on a line.

Lines are those of section 6 of the paper (Schmaltz, Gwosdek and Weickert 2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .of_bodies import of_all, one_by_one
from .problem import Problem

__all__ = ["BodyCharges", "charges_of"]


@dataclass(frozen=True, eq=False)
class BodyCharges:
    """Charges of all bodies, body after body.

    Attributes:
        body: Body of every charge, shape ``[charge_count]``, int32.
        first: Index of the first charge of every body and, at the end, the number of charges, shape ``[body_count + 1]``, int32.
        axial: Coordinate along the body's axis, -1 at one end to 1 at the other, shape ``[charge_count]``; 0 on a dot.
        charge: Charges, shape ``[charge_count]``, of mean 1; those of a body are in proportion to its area.
    """

    body: np.ndarray
    first: np.ndarray
    axial: np.ndarray
    charge: np.ndarray


def charges_of(problem: Problem) -> BodyCharges:
    """Return the charges of all bodies of ``problem``."""
    if all(size.kind.charges == 1 for body_class in problem.classes for size in body_class.sizes):
        area = problem.shared_areas()
        n = len(area)
        number = np.arange(n + 1, dtype=np.int32)
        factor = n / area.sum()
        return BodyCharges(number[:n], number, of_all(0.0, n), one_by_one(lambda values: values * factor, area))
    counts, axials, shares = [], [], []
    for body_class in problem.classes:
        for size in body_class.sizes:
            n = size.count or 0
            axial, share = size.kind.charge_places(), size.kind.charge_shares()
            counts.append(np.full(n, len(axial)))
            axials.append(np.tile(axial, n))
            shares.append(np.tile(share, n))
    count = np.concatenate(counts)
    body = np.repeat(np.arange(len(count)), count)
    charge = problem.shared_areas()[body] * np.concatenate(shares)
    return BodyCharges(
        body.astype(np.int32),
        np.concatenate([[0], np.cumsum(count)]).astype(np.int32),
        np.concatenate(axials),
        charge * (len(charge) / charge.sum()),
    )
