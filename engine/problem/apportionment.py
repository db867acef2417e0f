"""Whole counts from shares."""

from __future__ import annotations

import numpy as np

__all__ = ["apportion"]


def apportion(total: int, weights: np.ndarray) -> np.ndarray:
    """Split ``total`` into whole parts in proportion to ``weights``, by largest remainders: exact in total.

    Args:
        total: What to split, >= 0.
        weights: Shape ``[k]``, >= 0, not all 0.

    Returns:
        Parts, shape ``[k]``, int64, each within 1 of its exact share; equal remainders go to the earlier part.
    """
    exact = total * np.asarray(weights, dtype=np.float64) / np.sum(weights)
    parts = np.floor(exact).astype(np.int64)
    missing = total - int(parts.sum())
    parts[np.argsort(-(exact - parts), kind="stable")[:missing]] += 1
    return parts
