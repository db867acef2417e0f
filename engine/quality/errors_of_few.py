"""What is to be said where a coverage error tells mostly of a few: of bodies that are very much larger, or of fixed ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..problem.balance import Balance
from ..problem.note import Note, NoteKind
from ..problem.placement import Placement

__all__ = ["notes_on_areas", "notes_on_errors", "notes_on_larger_classes"]

# Coverage errors above which somebody asks why; and how many times more bodies there are than equal ones that would be as coarse.
UNEVEN, MOST_OF_FEW = 0.15, 4.0
# How much classes are mixed unless it is asked for.
USUAL = Balance()
# Share of a coverage error that is made by what is fixed, above which this explains it.
MOSTLY = 0.5


def notes_on_errors(
    placement: Placement, area: np.ndarray, errors: Sequence[float], excess: Callable[[int], float]
) -> list[str]:
    """Say why coverage errors are large, where that is known.

    Args:
        placement: What was placed.
        area: Footprints of its bodies [m²], shape ``[n]``.
        errors: Coverage errors of the classes.
        excess: Returns which part of that of a class is made where fixed bodies are more than its density asks for.
    """
    left, made, classes = list(errors), {}, placement.problem.classes
    for k in np.unique(placement.class_index[placement.fixed]).tolist():
        if errors[k] > UNEVEN and (part := excess(k)) > MOSTLY * errors[k]:
            left[k], made[k] = 0.0, part
    notes = notes_on_areas(area, placement.class_index, left)
    balance = placement.problem.balance
    if balance.class_separation > 0.0 or placement.problem.avoid_overlap:
        mixed = balance.class_separation > (
            USUAL.class_separation if balance.rare_emphasis >= USUAL.rare_emphasis else 0.0
        )
        apart = balance.classes_apart
        apart = np.ones((len(classes), len(classes)), bool) if apart is None else apart
        names = [c.name for c in classes]
        notes += notes_on_larger_classes(area, placement.class_index, left, names, apart, mixed=mixed)
    if made:
        most = max(made, key=made.__getitem__)
        of_class = f' of class "{classes[most].name}"' if len(classes) > 1 else ""
        said = f"fixed bodies{of_class} are more than the density asks for where they are, which alone makes a coverage error of "
        notes.append(Note(f"{said}{math.floor(100.0 * made[most]) / 100.0:.2f}", NoteKind.ERROR_OF_FEW))
    return notes


def notes_on_areas(area: np.ndarray, class_index: np.ndarray, errors: Sequence[float]) -> list[str]:
    """Say where a coverage error is large because areas differ by very much.

    Args:
        area: Footprints of the bodies [m²], shape ``[n]``.
        class_index: Their classes, shape ``[n]``.
        errors: Coverage errors of the classes.
    """
    if max(errors) <= UNEVEN:
        return []
    if (np.greater(errors, UNEVEN) & _coarse(*_summed(area, class_index, len(errors)))).any():
        return [
            Note(
                "some bodies are so much larger than most that the space around them counts as uneven: coverage errors look no "
                "farther than the usual spacing",
                NoteKind.ERROR_OF_FEW,
            )
        ]
    return []


def notes_on_larger_classes(
    area: np.ndarray,
    class_index: np.ndarray,
    errors: Sequence[float],
    names: Sequence[str],
    apart: np.ndarray,
    *,
    mixed: bool,
) -> list[str]:
    """Say which classes are kept off a part of the ground by much larger bodies of others, which counts as uneven.

    These cover it; and all classes together are even where every body has ground in proportion to its area, so the more classes are
    mixed, the farther grass keeps from trees.

    Args:
        area: Footprints of the bodies [m²], shape ``[n]``.
        class_index: Their classes, shape ``[n]``.
        errors: Coverage errors of the classes.
        names: Of the classes.
        apart: Which classes keep apart, shape ``[class_count, class_count]``, bool.
        mixed: Whether classes are mixed more than they are unless it is asked for, so that less of it helps.
    """
    if max(errors) <= UNEVEN:
        return []
    sums = _summed(area, class_index, len(errors))
    mean = sums[1] / np.maximum(sums[0], 1.0)
    found = []
    for k in np.flatnonzero(np.greater(errors, UNEVEN) & ~_coarse(*sums)).tolist():
        with_larger = (np.arange(len(errors)) == k) | ((mean > mean[k]) & apart[k])
        if _coarse(*(one[with_larger].sum() for one in sums)):
            found.append(names[k])
    if not found:
        return []
    said = ", ".join(f'"{name}"' for name in found[:3]) + (" and others" if len(found) > 3 else "")
    text = f"much larger bodies of other classes keep {said} off part of the ground, which counts as uneven"
    if mixed:
        text += "; a lower `class_separation` lets them closer"
    return [Note(text, NoteKind.AROUND_LARGER)]


def _summed(area: np.ndarray, class_index: np.ndarray, classes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many bodies each class has, what their areas sum up to, and the squares of these."""
    count, total, squares = (np.bincount(class_index, w, classes) for w in (None, area, np.square(area)))
    return count, total, squares


def _coarse(count: np.ndarray, total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Whether so few equal bodies are as coarse as these: the square of all charge over the sum of its squares."""
    return total**2 * MOST_OF_FEW < count * squares
