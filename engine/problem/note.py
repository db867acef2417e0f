"""Sentences of a report that say what they are about, so that whoever shows a report can tell them apart without reading them."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["Note", "NoteKind", "kind_of"]


class NoteKind(StrEnum):
    """What a note is about, where a front end may have something of its own to say about it."""

    OTHER = "other"
    # How many pairs overlap, and how deep the deepest does.
    OVERLAPS = "overlaps"
    # The same where footprints are not kept apart, and which setting would.
    MAY_OVERLAP = "may overlap"
    # What footprints cover, and that they cannot fit: known before the run, too.
    COVER = "cover"
    # The same where only the run has shown it.
    CANNOT_FIT = "cannot fit"
    # Coverage errors are large because of how large some bodies are, or because of where fixed ones are; saved reports call both so.
    ERROR_OF_FEW = "unequal areas"
    # Which classes leave room around much larger bodies of others, so that their coverage errors are large.
    AROUND_LARGER = "around larger"
    # The coverage error of all bodies together is large because areas differ, while those of the classes are small.
    ALL_TOGETHER = "all together"
    # A setting does nothing because of what another one is.
    IGNORED = "ignored"


class Note(str):
    """A sentence for a report. It is a text like any other, in files too.

    Args:
        text: The sentence.
        kind: What it is about.
    """

    kind: NoteKind

    def __new__(cls, text: str, kind: NoteKind) -> Note:
        """Make a text that has a kind."""
        note = super().__new__(cls, text)
        note.kind = kind
        return note

    def __getnewargs__(self) -> tuple[str, NoteKind]:  # type: ignore[override]
        """What copies are made of."""
        return str(self), self.kind


def kind_of(note: str) -> NoteKind:
    """Return what a note of a report is about."""
    return note.kind if isinstance(note, Note) else NoteKind.OTHER
