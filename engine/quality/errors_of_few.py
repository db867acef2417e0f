"""What is to be said where a coverage error tells mostly of a few: of bodies that are very much larger, or of fixed ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..problem.note import Note, NoteKind
from ..problem.placement import Placement

__all__ = ["notes_on_areas", "notes_on_errors"]

# Coverage errors above which somebody asks why; and how many times more bodies there are than equal ones that would be as coarse.
UNEVEN, MOST_OF_FEW = 0.15, 4.0
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
    count, total, squares = (np.bincount(class_index, w, len(errors)) for w in (None, area, np.square(area)))
    # Equal bodies that are as coarse as these: the square of all charge over the sum of its squares.
    if (np.greater(errors, UNEVEN) & (total**2 * MOST_OF_FEW < count * squares)).any():
        return [
            Note(
                "some bodies are so much larger than most that the space around them counts as uneven: coverage errors look no "
                "farther than the usual spacing",
                NoteKind.ERROR_OF_FEW,
            )
        ]
    return []
