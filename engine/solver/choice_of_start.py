"""Of a few bodies, the start from which the least energy is reached.

A handful of bodies ends in one of several orders, some of which are less even, and which one is chance. So few are solved from several
starts, and begin at the best of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..descent.descent import Descent
from ..model.body_flags import BodyFlags
from ..model.energy import Energy
from ..model.model import Model
from ..model.state import State

__all__ = ["choose_start", "number_of_starts"]

# How many bodies of a class are few, and charges of all classes. Measured on 5, 10, 20 and 50 bodies: the best of 10 starts is within
# 1e-4 a body of the best of 100; of three classes of ten the best of 20 is within 0.0006.
FEW, FEW_CHARGES = 50, 300
STARTS, STARTS_PER_CLASS, STEPS_OF_STARTS = 10, 5, 100
# And as many again where a density varies, which has more orders that bodies can end in. Measured on 10, 20 and 40 bodies on a ring, a
# bump, two discs, a checker and an L in two domains, against the best of 200: on average 0.0004 a body above it from 10 starts, 0.0002
# from 20 and from 30; of 20 bodies the worst was 0.0019 and 0.0017.
STARTS_IN_VARIED = 10
# Starts times groups at most: a step takes longer with every group. All starts of 6, 10 and 20 classes of five then took 0.4 to 0.7
# seconds of one processor, and the best was within 0.0007, 0.0023 and 0.0028 a body of the best of 20.
MOST_STARTS_OF_GROUPS = 60
# Starts times nodes of the field's mesh at most: narrow periodic strips have long meshes, where steps take longer the more nodes they
# have. Of squares and domains ten times longer than wide, which have some thousand nodes, it leaves all starts.
MOST_STARTS_OF_NODES = 2**19
# Energies a body that differ by no more than this are equal; and those of several classes that are near enough to choose the one of
# which no class has two bodies close to each other. A little farther up there may be much larger spacings: if none of those is more
# than so large a share of these, it is the least energy with such a one. Measured on three classes of ten in six seeds, in units of
# what a class has alone: on 9 m x 5 m smallest spacings are .89 to .98 instead of .80 to .92, for .0015 a body; on a square nothing
# changes.
EQUAL, NEARLY_EQUAL, NOT_FAR = 1e-5, 2e-3, 6e-3
LARGE = 0.95


def choose_start(descent: Descent, max_steps: int, tolerance: float, go_on: Callable[[], bool] | None = None) -> int:
    """Go to the start from which the least energy is reached; where bodies are many, stay at the first.

    Args:
        descent: Where no step has been taken yet.
        max_steps: Steps that the run will take at most.
        tolerance: Residual, see :meth:`.direction.Direction.residual`, below which bodies have settled.
        go_on: Asked after each start but the last; returning False leaves it at those that were tried.

    Returns:
        Which of several starts it is, from 0.
    """
    model = descent.model
    number = min(number_of_starts(model), MOST_STARTS_OF_NODES // descent.field.node_count)
    if number < 2:
        return 0
    energy = Energy(model)
    energies, spacings = [], []
    for start in range(number):
        if start:
            descent.restart(start)
        _settle(descent, min(max_steps, STEPS_OF_STARTS), tolerance)
        energies.append(energy.of(descent.charge_position.numpy()))
        spacings.append(_smallest_spacing(model, descent.state))
        if go_on is not None and start < number - 1 and not go_on():
            break
    best = _best_of(np.array(energies) / energy.scale, np.array(spacings), several=len(model.problem.classes) > 1)
    descent.restart(best)
    return best


def number_of_starts(model: Model) -> int:
    """From how many starts to solve: 1 unless there are so few bodies that several cost little, and some of them can move."""
    classes = model.problem.classes
    most = max((c.body_count for c in classes), default=0)
    if most > FEW or model.charge_count > FEW_CHARGES:
        return 1
    if int(((model.body.flags & BodyFlags.PINNED) == 0).sum()) < 2:
        return 1
    varied = STARTS_IN_VARIED if any(c.density_image.size > 1 for c in classes) else 0
    return min(STARTS + varied + STARTS_PER_CLASS * (len(classes) - 1), MOST_STARTS_OF_GROUPS // model.groups.count)


def _settle(descent: Descent, max_steps: int, tolerance: float) -> None:
    """Step until bodies have settled."""
    step = 0
    while step < max_steps:
        # The CPU comes back in between, after a time that no result may depend on.
        step += descent.step.play(max_steps - step, descent.direction.settled(tolerance))
        # What is no number does not settle any more, either.
        if not descent.direction.residual() >= tolerance:
            return


def _smallest_spacing(model: Model, state: State) -> float:
    """Smallest distance between two bodies of a class, times the root of their number, so that classes compare; of all classes."""
    position = state.pose.numpy()[:, :2].astype(np.float64)
    result = math.inf
    for index in np.unique(model.body.class_index):
        own = position[model.body.class_index == index]
        if len(own) < 2:
            continue
        squared = (model.space.shortest(own[:, None] - own) ** 2).sum(axis=2)
        np.fill_diagonal(squared, math.inf)
        result = min(result, math.sqrt(float(squared.min()) * len(own)))
    return result


def _best_of(energy: np.ndarray, spacing: np.ndarray, *, several: bool) -> int:
    """Return which start is best.

    Args:
        energy: Energies a body that were reached, shape ``[starts]``; NaN where a run left the range of float32.
        spacing: Smallest spacings that were reached, shape ``[starts]``.
        several: Whether there are several classes: of nearly equal energies the largest spacing counts then.
    """
    energy = np.nan_to_num(energy, nan=np.inf)
    if several:
        near, not_far = (np.where(energy <= energy.min() + above, spacing, -1.0) for above in (NEARLY_EQUAL, NOT_FAR))
        large = LARGE * not_far.max()
        if near.max() < large:
            return int(np.where(not_far >= large, energy, np.inf).argmin())
        return int(np.flatnonzero(near >= (1.0 - EQUAL) * near.max())[0])
    # The first of equal ones: they are often the same, turned or mirrored.
    return int(np.flatnonzero(energy <= energy.min() + EQUAL)[0])
