"""What is to be said where a coverage error tells mostly of a few: of bodies that are very much larger, or of fixed ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..problem.balance import Balance
from ..problem.note import Note, NoteKind
from ..problem.placement import Placement
from ..problem.report import UNEVEN
from .groups_by_area import GroupsByArea

__all__ = [
    "ErrorsExplained",
    "explain_errors",
    "groups_kept_off",
    "notes_on_all_together",
    "notes_on_areas",
    "notes_on_larger_classes",
]

# How many times more bodies there are than equal ones that would be as coarse.
MOST_OF_FEW = 4.0
# How much classes are mixed unless it is asked for.
USUAL = Balance()
# Share of a coverage error that is made by what is fixed, above which this explains it.
MOSTLY = 0.5
# So many times that of any class, the coverage error of all bodies together is none of a class.
FAR_ABOVE = 2.0


@dataclass(frozen=True)
class ErrorsExplained:
    """Why coverage errors are large, where that is known.

    Attributes:
        notes: Sentences for the report.
        kept_off: Numbers of the classes that much larger bodies of others keep off part of the ground.
    """

    notes: list[str]
    kept_off: list[int]


def explain_errors(
    placement: Placement,
    area: np.ndarray,
    groups: GroupsByArea,
    errors: Sequence[float],
    whole: float,
    excess: Callable[[int], float],
) -> ErrorsExplained:
    """Say why coverage errors are large, where that is known.

    Args:
        placement: What was placed.
        area: Footprints of its bodies [m²], shape ``[n]``.
        groups: Which of them are measured together.
        errors: Coverage errors of the classes.
        whole: Coverage error of all bodies together.
        excess: Returns which part of that of a class is made where fixed bodies are more than its density asks for.
    """
    left, made, classes = list(errors), {}, placement.problem.classes
    for k in _with_other_fixed(placement, area, groups):
        if errors[k] > UNEVEN and (part := excess(k)) > MOSTLY * errors[k]:
            left[k], made[k] = 0.0, part
    # Those of every group's class.
    of_groups = [left[c] for c in groups.of_class]
    notes = notes_on_areas(area, groups.index, of_groups)
    balance, kept_off = placement.problem.balance, []
    if balance.class_separation > 0.0 or placement.problem.avoid_overlap:
        mixed = balance.class_separation > (
            USUAL.class_separation if balance.rare_emphasis >= USUAL.rare_emphasis else 0.0
        )
        apart = balance.classes_apart
        apart = np.ones((len(classes), len(classes)), bool) if apart is None else apart
        found = groups_kept_off(area, groups.index, of_groups, apart[np.ix_(groups.of_class, groups.of_class)])
        kept_off = sorted({groups.of_class[group] for group in found})
        notes += notes_on_larger_classes([classes[k].name for k in kept_off], mixed=mixed)
    own = [error for k, error in enumerate(errors) if k not in kept_off]
    notes += notes_on_all_together(area, own, whole, judged=not kept_off)
    if made:
        most = max(made, key=made.__getitem__)
        of_class = f' of class "{classes[most].name}"' if len(classes) > 1 else ""
        said = f"fixed bodies{of_class} are more than the density asks for where they are, which alone makes a coverage error of "
        notes.append(Note(f"{said}{math.floor(100.0 * made[most]) / 100.0:.2f}", NoteKind.ERROR_OF_FEW))
    return ErrorsExplained(notes, kept_off)


def _with_other_fixed(placement: Placement, area: np.ndarray, groups: GroupsByArea) -> list[int]:
    """Return which classes have fixed bodies, but not those that are as coarse with the areas that were asked for.

    There any body of the largest size is a heavy spot, be it fixed or not.
    """
    fixed = placement.fixed
    if not fixed.any():
        return []
    asked = np.repeat(
        [size.mean_area for c in placement.problem.classes for size in c.sizes],
        [size.count or 0 for c in placement.problem.classes for size in c.sizes],
    )
    coarse = _coarse(*_summed(np.where(fixed, asked, area), groups.index, len(groups.own)))
    of_coarse = {groups.of_class[group] for group in np.flatnonzero(coarse).tolist()}
    return [k for k in np.unique(placement.class_index[fixed]).tolist() if k not in of_coarse]


def notes_on_areas(area: np.ndarray, group: np.ndarray, errors: Sequence[float]) -> list[str]:
    """Say where a coverage error is large because areas differ by very much.

    Args:
        area: Footprints of the bodies [m²], shape ``[n]``.
        group: Which of them are measured together, shape ``[n]``.
        errors: Coverage errors of these groups' classes.
    """
    if max(errors) <= UNEVEN:
        return []
    if (np.greater(errors, UNEVEN) & _coarse(*_summed(area, group, len(errors)))).any():
        return [
            Note(
                "some bodies are so much larger than most that the space around them counts as uneven: coverage errors look no "
                "farther than the usual spacing",
                NoteKind.ERROR_OF_FEW,
            )
        ]
    return []


def groups_kept_off(area: np.ndarray, group: np.ndarray, errors: Sequence[float], apart: np.ndarray) -> list[int]:
    """Return which groups are kept off a part of the ground by much larger bodies of others, which counts as uneven.

    These cover it; and all classes together are even where every body has ground in proportion to its area, so the more classes are
    mixed, the farther grass keeps from trees.

    Args:
        area: Footprints of the bodies [m²], shape ``[n]``.
        group: Which of them are measured together, shape ``[n]``.
        errors: Coverage errors of these groups' classes.
        apart: Which groups keep apart, shape ``[groups, groups]``, bool.
    """
    if max(errors) <= UNEVEN:
        return []
    sums = _summed(area, group, len(errors))
    mean = sums[1] / np.maximum(sums[0], 1.0)
    found = []
    for k in np.flatnonzero(np.greater(errors, UNEVEN) & ~_coarse(*sums)).tolist():
        with_larger = (np.arange(len(errors)) == k) | ((mean > mean[k]) & apart[k])
        if _coarse(*(one[with_larger].sum() for one in sums)):
            found.append(k)
    return found


def notes_on_larger_classes(names: Sequence[str], *, mixed: bool) -> list[str]:
    """Say which classes are kept off a part of the ground.

    Args:
        names: Of the classes of :func:`groups_kept_off`.
        mixed: Whether classes are mixed more than they are unless it is asked for, so that less of it helps.
    """
    if not names:
        return []
    said = ", ".join(f'"{name}"' for name in names[:3]) + (" and others" if len(names) > 3 else "")
    text = f"much larger bodies keep {said} off part of the ground, or crowd it beside them, which counts as uneven"
    if mixed:
        text += "; a lower `class_separation` lets them closer"
    return [Note(text, NoteKind.AROUND_LARGER)]


def notes_on_all_together(area: np.ndarray, errors: Sequence[float], whole: float, *, judged: bool = True) -> list[str]:
    """Say where the coverage error of all bodies together is far larger than those of classes because areas differ by very much.

    Args:
        area: Footprints of the bodies [m²], shape ``[n]``.
        errors: Coverage errors of the classes, without those of :func:`groups_kept_off`.
        whole: Coverage error of all bodies together.
        judged: Whether those of all classes say how even they are: not of those that are kept off.
    """
    if whole <= max(UNEVEN, FAR_ABOVE * max(errors, default=0.0)):
        return []
    if not _coarse(*(one[0] for one in _summed(area, np.zeros(len(area), np.int32), 1))):
        return []
    text = "the coverage error of all bodies together is large because some are so much larger than most that each is one heavy spot"
    if judged:
        text += "; judge each class by its own"
    return [Note(text, NoteKind.ALL_TOGETHER)]


def _summed(area: np.ndarray, group: np.ndarray, groups: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many bodies each group has, what their areas sum up to, and the squares of these."""
    count, total, squares = (np.bincount(group, w, groups) for w in (None, area, np.square(area)))
    return count, total, squares


def _coarse(count: np.ndarray, total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Whether so few equal bodies are as coarse as these: the square of all charge over the sum of its squares."""
    return total**2 * MOST_OF_FEW < count * squares
