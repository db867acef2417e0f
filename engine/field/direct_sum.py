"""The paper's direct summation in float64 with NumPy: the reference that the fast field is measured against.

O(n²) in time. Tests, benchmarks and the table of quality figures use it; :func:`~esh.engine.solve.solve` does not. The paper,
whose equations are named below, is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..space.density import box_integrals
from ..space.space import Space
from .field_targets import FieldTarget

__all__ = ["direct_field"]

# Pairs handled at once; bounds the memory to a few hundred megabytes.
PAIRS_AT_ONCE = 4_000_000
# The variance of points, so to say: between two of them q is larger than anything that matters.
TINY = 1e-30


def direct_field(
    position: np.ndarray,
    *,
    space: Space,
    interaction: np.ndarray,
    targets: Sequence[FieldTarget],
    charge: np.ndarray,
    charge_group: np.ndarray,
    blur: float,
    variance: Callable[[np.ndarray], np.ndarray] | None = None,
    core: tuple[float, float] = (0.0, 1.0),
    chosen: np.ndarray | None = None,
) -> np.ndarray:
    """Force per unit charge on charges, equations 1, 2 and 7 of the paper.

    Args:
        position: Charge positions, shape ``[n, 2]``.
        space: Where the charges are; where it wraps, the sums run over all images (Ewald summation).
        interaction: M, shape ``[group_count, group_count]``.
        targets: One per group.
        charge: Charges, shape ``[n]``.
        charge_group: Group of every charge, shape ``[n]``.
        blur: Standard deviation of the Gaussian that smooths what acts between two charges, and between a charge and the
            target. Targets are summed over points half as far apart.
        variance: Where the blur differs from place to place: that of a charge or a piece of target at positions, shape
            ``[m, 2]``; what acts between two has the sum of their variances. ``blur`` then is the narrowest.
        core: Strength of the charges' core, and where it ends; see :func:`.blur.core`.
        chosen: Indices of the charges whose field is wanted, shape ``[m]``; None for all. All charges act on them.

    Returns:
        Field, shape ``[n, 2]`` or ``[m, 2]``, float64.
    """
    size = space.size
    # Whole cells per pixel, so that every cell has one density and its charge lies at its middle.
    rows, columns = (int(np.lcm.reduce([t.image.shape[axis] for t in targets])) for axis in (0, 1))
    rows *= max(1, int(np.ceil(2.0 * size[1] / blur / rows)))
    columns *= max(1, int(np.ceil(2.0 * size[0] / blur / columns)))
    y = (np.arange(rows) + 0.5) / rows * size[1]
    x = (np.arange(columns) + 0.5) / columns * size[0]
    points = np.stack([np.tile(x, rows), np.repeat(y, columns)], axis=1)
    of_charge = np.full(len(position), 0.5 * blur**2) if variance is None else variance(position)
    of_point = np.full(len(points), 0.5 * blur**2) if variance is None else variance(points)
    # A point stands for a cell of the grid; a Gaussian that is wider by the cell's own variance makes up for its extent.
    of_point = of_point + (size[0] / columns * size[1] / rows) / 12.0
    image_charge = np.stack([t.charge * box_integrals(t.image, (rows, columns)).ravel() for t in targets])
    chosen = np.arange(len(position)) if chosen is None else np.asarray(chosen)
    result = np.zeros((len(chosen), 2))
    for g in range(len(targets)):
        in_group = charge_group[chosen] == g
        own = chosen[in_group]
        pulling = -interaction[g] @ image_charge
        pushing = charge * interaction[g, charge_group]
        sources = ((position, pushing, of_charge, core), (points, pulling, of_point, (0.0, 1.0)))
        total = np.zeros((len(own), 2))
        for source, strength, variances, cores in sources:
            if space.periodic:
                total += _periodic_sum(position[own], of_charge[own], source, strength, variances, cores, size)
            else:
                total += _plane_sum(position[own], of_charge[own], source, strength, variances, cores)
        result[in_group] = total
    return result


def _plane_sum(
    at: np.ndarray,
    own_variance: np.ndarray,
    source: np.ndarray,
    strength: np.ndarray,
    variance: np.ndarray,
    core: tuple[float, float],
) -> np.ndarray:
    result = np.empty_like(at)
    for part in _parts(len(at), len(source)):
        dx = at[part, None, 0] - source[None, :, 0]
        dy = at[part, None, 1] - source[None, :, 1]
        r2 = dx**2 + dy**2
        q = 0.5 * r2 / (own_variance[part, None] + variance + TINY)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = strength * (_core(q, core) - np.expm1(-q)) / r2
        factor[r2 == 0.0] = 0.0
        result[part, 0] = (factor * dx).sum(axis=1)
        result[part, 1] = (factor * dy).sum(axis=1)
    return result


def _periodic_sum(
    at: np.ndarray,
    own_variance: np.ndarray,
    source: np.ndarray,
    strength: np.ndarray,
    variance: np.ndarray,
    core: tuple[float, float],
    size: tuple[float, float],
) -> np.ndarray:
    """Ewald summation; both sums are cut where their terms fall below 1e-9."""
    # Wide enough that one ring of images suffices in real space.
    split = min(size) / 7.0
    result = np.zeros_like(at)
    for part in _parts(len(at), len(source)):
        for shift_x in (-1, 0, 1):
            for shift_y in (-1, 0, 1):
                dx = at[part, None, 0] - source[None, :, 0] + shift_x * size[0]
                dy = at[part, None, 1] - source[None, :, 1] + shift_y * size[1]
                r2 = dx**2 + dy**2
                q = 0.5 * r2 / (own_variance[part, None] + variance + TINY)
                decay = np.exp(-r2 / (2.0 * split**2)) - np.exp(-q) + _core(q, core)
                with np.errstate(divide="ignore", invalid="ignore"):
                    factor = strength * decay / r2
                factor[r2 == 0.0] = 0.0
                result[part, 0] += (factor * dx).sum(axis=1)
                result[part, 1] += (factor * dy).sum(axis=1)
    largest = [int(np.ceil(6.5 / split * length / (2.0 * np.pi))) for length in size]
    for mx in range(largest[0] + 1):
        for my in range(-largest[1], largest[1] + 1):
            if mx == 0 and my <= 0:
                continue
            k = np.array([2.0 * np.pi * mx / size[0], 2.0 * np.pi * my / size[1]])
            k2 = k @ k
            phase = source @ k
            amplitude = 2.0 * 2.0 * np.pi / k2 * np.exp(-0.5 * split**2 * k2) / (size[0] * size[1])
            sine, cosine = (strength * np.sin(phase)).sum(), (strength * np.cos(phase)).sum()
            own = at @ k
            result += (amplitude * (np.sin(own) * cosine - np.cos(own) * sine))[:, None] * k
    return result


def _core(q: np.ndarray, core: tuple[float, float]) -> np.ndarray:
    strength, end = core
    return strength * np.maximum(1.0 - q / end, 0.0) ** 2


def _parts(rows: int, columns: int) -> list[slice]:
    step = max(1, PAIRS_AT_ONCE // columns)
    return [slice(start, start + step) for start in range(0, rows, step)]
