"""The interaction matrix: how strongly every group of bodies repels every other (figures 5, 6 and 8 of the paper).

A group is one size of one class. The paper's entries carry the charges of both partners; here charges belong to the bodies
and the matrix holds the factors that remain, so equation 7's attraction strengths follow from it and need no formula.
"""

from __future__ import annotations

import numpy as np

from .problem import Problem

__all__ = ["interaction_matrix"]


def interaction_matrix(problem: Problem) -> np.ndarray:
    """Return the factors M[g, h], shape ``[group_count, group_count]``, float64.

    Groups are numbered in class, then size order. Within a class, M[g, h] = C^min(rank): the rank of a size counts the
    smaller sizes of its class (equal areas share a rank), so all sizes from any one upwards are evenly spread together.
    Between classes the factor is multiplied by alpha. Both parts are positive semidefinite kernels, and so is their
    product, for every alpha in 0..1 and C >= 1.
    """
    class_of = np.concatenate([np.full(len(c.sizes), i) for i, c in enumerate(problem.classes)])
    rank = np.concatenate(
        [np.unique([s.area for s in c.sizes], return_inverse=True)[1].ravel() for c in problem.classes]
    )
    same_class = class_of[:, None] == class_of[None, :]
    factor = problem.balance.size_emphasis ** np.minimum(rank[:, None], rank[None, :]).astype(np.float64)
    return np.where(same_class, 1.0, problem.balance.class_separation) * factor
