"""What is to be said where some bodies are very much larger than most, and a coverage error tells mostly of these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..problem.note import Note, NoteKind

__all__ = ["notes_on_areas"]

# Coverage errors above which somebody asks why; and how many times more bodies there are than equal ones that would be as coarse.
UNEVEN, MOST_OF_FEW = 0.15, 4.0


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
                NoteKind.UNEQUAL_AREAS,
            )
        ]
    return []
