"""Points spread evenly over densities: where an edit takes bodies out, and where it sets new ones down."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.launcher import Launcher
from ..problem.balance import Balance
from ..problem.domain import Domain
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.size import Size
from .descent import Descent
from .final_placement import position_in_meters
from .model import Model

__all__ = ["spread"]

# Not many: what follows moves them once more. With 20, errors after an edit are larger by a twentieth.
STEPS = 24
# A coarse mesh will do for what attracts points.
FEWEST_NODES = 2**14
# Density over the largest that is there everywhere: points may leave where there is none, and nobody has to look for the way back.
LEAST = 1e-7


def spread(
    launcher: Launcher, domain: Domain, densities: Sequence[np.ndarray], counts: Sequence[int], seed: int
) -> list[np.ndarray]:
    """Return points [m] for each density, shape ``[count, 2]``: even by themselves, and all of them together.

    Args:
        launcher: Where to run.
        domain: Where.
        densities: Each of shape ``[rows, columns]``, row 0 at the bottom, somewhere above 0 where points are asked for.
        counts: How many points for each.
        seed: Decides what is random.
    """
    asked = [i for i, count in enumerate(counts) if count > 0]
    result = [np.zeros((0, 2)) for _ in counts]
    if not asked:
        return result
    classes = [PreparedClass(str(i), (Size("point", 1.0, counts[i]),), _image(densities[i])) for i in asked]
    model = Model(Problem(domain, classes, Balance(), seed=seed))
    descent = Descent(model, launcher, fewest_nodes=FEWEST_NODES)
    if model.body_count > 1:
        descent.step.play(STEPS)
    position = position_in_meters(model, descent.state, launcher)
    launcher.release(descent.step)
    # Bodies are in the order of their classes.
    ends = np.cumsum([counts[i] for i in asked])
    for i, end in zip(asked, ends, strict=True):
        result[i] = position[end - counts[i] : end]
    return result


def _image(density: np.ndarray) -> np.ndarray:
    """A density with row 0 at the top, above 0 everywhere."""
    upright = np.ascontiguousarray(density[::-1], dtype=np.float32)
    return np.maximum(upright, np.float32(LEAST) * upright.max())
