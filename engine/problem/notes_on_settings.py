"""Sentences of a report that are known from the problem alone: settings that do nothing, and what cannot fit."""

from __future__ import annotations

from .cover import ABOUT
from .note import Note, NoteKind
from .prepared_class import PreparedClass
from .problem import Problem

__all__ = ["ONLY_IF", "is_to_cover", "note_on_fit", "notes_on_settings"]

ONLY_IF = "footprints are only kept apart if `avoid_overlap` is true"


def notes_on_settings(problem: Problem) -> list[str]:
    """Say what became of the classes' densities, and which settings do nothing."""
    return [note for c in problem.classes for note in c.notes] + _notes_on_room(problem)


def note_on_fit(problem: Problem, covered: float) -> Note | None:
    """Say that footprints cannot fit that add up to more than the ground; None where they may, or were asked to cover it."""
    if covered <= 1.0:
        return None
    helps = "lower the counts or the areas"
    if not problem.avoid_overlap and any(is_to_cover(c) for c in problem.classes):
        # A class that is to cover the ground, and may overlap, is asked to do so. Several together may be by mistake; inks are not, of
        # which it is said which make room for each other, nor are counts that were rounded up.
        if problem.balance.classes_apart is not None or covered * _share_to_cover(problem) <= ABOUT:
            return None
        helps = "lower the densities of the classes that are to cover it"
    text = f"the footprints add up to {covered:.0%} of the space where they may be: they cannot fit without overlap; {helps}"
    return Note(text, NoteKind.CANNOT_FIT)


def _share_to_cover(problem: Problem) -> float:
    """Share of all footprints that is of classes that are to cover the ground."""
    amount = [sum((s.count or 0) * s.mean_area for s in c.sizes) for c in problem.classes]
    return sum(a for a, c in zip(amount, problem.classes, strict=True) if is_to_cover(c)) / sum(amount)


def is_to_cover(body_class: PreparedClass) -> bool:
    """Whether a class has as many bodies as cover its density."""
    return body_class.asked is not None and body_class.asked.count == "cover"


def _notes_on_room(problem: Problem) -> list[str]:
    """Say which distances between footprints do nothing, as these are not kept apart."""
    notes: list[str] = []
    for body_class in () if problem.avoid_overlap else problem.classes:
        given = {
            "gap": max(body_class.gap, *(size.gap for size in body_class.sizes)) > 0.0,
            "room": max(body_class.room, *(size.room for size in body_class.sizes)) > 1.0,
        }
        if names := [f"`{name}`" for name, is_given in given.items() if is_given]:
            does = "does" if len(names) == 1 else "do"
            text = f'{" and ".join(names)} of class "{body_class.name}" {does} nothing: {ONLY_IF}'
            notes.append(Note(text, NoteKind.IGNORED))
    return notes
