"""Sentences of a report on what overlaps, lies in obstacles or reaches across the border: what is so, and what helps."""

from __future__ import annotations

import math

import numpy as np

from ..problem.cover import cover_of
from ..problem.note import Note, NoteKind
from ..problem.notes_on_settings import ONLY_IF, note_on_fit
from ..problem.placement import Placement
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.size import Size
from .out_of_place import OutOfPlace
from .overlaps import MOST_NAMED, Overlaps

__all__ = [
    "note_on_pairs",
    "notes_on_distant_outlines",
    "notes_on_fixed",
    "notes_on_fixed_places",
    "notes_on_overlaps",
    "notes_on_places",
    "notes_on_what_is_not_parted",
    "solid_bodies",
]

# Overlaps of footprints that nobody asked to keep apart are told of where at least this share of the bodies overlap others, and the
# deepest by at least this share of the smaller one's width. A few of thousands that touch are seen by nobody.
MANY, DEEP = 0.05, 0.1


def notes_on_overlaps(
    placement: Placement, overlaps: Overlaps, among_solid: Overlaps, covered: float, parted: bool = True
) -> list[str]:
    """Say what overlaps or was parted where it is too dense, why, and what helps.

    Args:
        placement: What was placed.
        overlaps: What of it overlaps.
        among_solid: The same of its :func:`solid_bodies` among themselves, where nothing keeps them apart.
        covered: Share of the ground that footprints have come to take.
        parted: Whether it was tried to part what overlaps.
    """
    problem = placement.problem
    cover = cover_of(problem) if problem.avoid_overlap else None
    if not overlaps.count:
        # What shrank, as lines do in a crowd, or lies beyond the border may have fitted after all. Places that are too dense are
        # evened out all the same.
        return [] if cover is None or cover.warning is None or cover.too_much else [cover.warning]
    notes: list[str] = []
    if cover is not None:
        notes.append(note_on_pairs(overlaps.count, overlaps.deepest, parted))
    if cover is not None and cover.warning is not None:
        notes.append(cover.warning)
    elif (no_room := note_on_fit(problem, covered)) is not None:
        notes.append(no_room)
    elif cover is None and _is_unwanted(placement, among_solid):
        pairs = f"{_pairs(among_solid.count, 'overlap')}, the deepest by {among_solid.deepest:.3g} m"
        notes.append(Note(f"{pairs}: {ONLY_IF}", NoteKind.MAY_OVERLAP))
    return notes


def note_on_pairs(count: int, deepest: float, parted: bool = True) -> Note:
    """Say that so many pairs of footprints overlap that keep apart, and by how much the deepest does [m].

    Args:
        count: Of pairs, at least 1.
        deepest: See :attr:`.Overlaps.deepest`.
        parted: Whether it was tried to part them.
    """
    pairs = _pairs(count, "still overlap" if parted else "overlap")
    return Note(f"{pairs}, the deepest by {deepest:.3g} m", NoteKind.OVERLAPS)


def _pairs(count: int, overlap: str) -> str:
    return f"1 pair of footprints {overlap}s" if count == 1 else f"{count} pairs of footprints {overlap}"


def solid_bodies(problem: Problem) -> np.ndarray:
    """Return which bodies somebody may mind to see in others, shape ``[n]``, bool.

    Lines that cross are hatching. Dots overlap for the tone of a picture where their density was prepared as that of a halftone is.
    """
    sizes = [(size.count or 0, _is_solid(c, size)) for c in problem.classes for size in c.sizes]
    count, is_solid = zip(*sizes, strict=True)
    return np.repeat(is_solid, count)


def _is_solid(body_class: PreparedClass, size: Size) -> bool:
    return size.line is None and not _is_tone(body_class)


def _is_unwanted(placement: Placement, overlaps: Overlaps) -> bool:
    """Whether solid footprints that nobody asked to keep apart overlap so much that somebody will mind, and nothing asked for it.

    Dots overlap for a tone as well where their density asks for more than fits, and where all are alike: they only meet where it is
    high. Outlines are those of solid things.

    Args:
        placement: What was placed.
        overlaps: What of its solid bodies overlaps among them.
    """
    problem = placement.problem
    solid = [size for c in problem.classes for size in c.sizes if _is_solid(c, size)]
    if len(overlaps.bodies) < min(MANY * sum(size.count or 0 for size in solid), MOST_NAMED) or overlaps.pair is None:
        return False
    pair = list(overlaps.pair)
    if problem.balance.class_separation == 0.0 and len(set(placement.class_index[pair].tolist())) > 1:
        # Each class is spread as if the other were not there.
        return False
    if overlaps.deepest < DEEP * 2.0 * math.sqrt(float(placement.area[pair].min()) / math.pi):
        return False
    if any(size.footprint is not None for size in solid):
        return True
    return not _are_alike(problem) and cover_of(problem).warning is None


def _are_alike(problem: Problem) -> bool:
    """Whether solid bodies of classes that make room for each other are of one size: inks that are to overlap are so by themselves."""
    solid = [[size for size in c.sizes if _is_solid(c, size)] for c in problem.classes]
    number, apart = np.array([len(sizes) for sizes in solid]), problem.balance.classes_apart
    together = number.sum() if apart is None else (apart[number > 0] @ number).max()
    return bool(together == 1) and not any(isinstance(size.area, tuple) for sizes in solid for size in sizes)


def _is_tone(body_class: PreparedClass) -> bool:
    """Whether a class draws a picture: its density was prepared as that of a halftone is."""
    asked = body_class.asked
    return asked is not None and (bool(asked.density_correction) or asked.unsharp is not None)


def notes_on_places(problem: Problem, found: OutOfPlace, parted: bool = True) -> list[str]:
    """Say what lies in obstacles or reaches across the border, and what helps; if it was not ``parted``, something else does."""
    if not (found.in_obstacles or found.beyond_border):
        return []
    notes = []
    # Where there is room for all, those that are left may only need time to find it.
    helps = ("" if cover_of(problem).warning else "take more steps, or ") + "lower the counts or the areas"
    helps = f"; {helps}" if parted else ""
    if found.in_obstacles:
        lie = "1 body lies" if found.in_obstacles == 1 else f"{found.in_obstacles} bodies lie"
        notes.append(f"{lie} in obstacles, the deepest by {found.deepest:.3g} m{helps}")
    if found.beyond_border:
        reach = "1 body reaches" if found.beyond_border == 1 else f"{found.beyond_border} bodies reach"
        notes.append(f"{reach} across the border, the farthest by {found.farthest:.3g} m{helps}")
    return notes


def notes_on_what_is_not_parted(problem: Problem, overlaps: Overlaps, found: OutOfPlace, stopped: bool) -> list[str]:
    """Say that bodies that lie where they may not have not been parted yet, and why, or how they are."""
    if not problem.avoid_overlap or not (overlaps.count or found.in_obstacles or found.beyond_border):
        return []
    if stopped:
        return ["the run was stopped before bodies were parted"]
    return ["bodies were not parted after the last step: call `separate()` of the Solver"]


def notes_on_distant_outlines(problem: Problem) -> list[str]:
    """Say which obstacles were given so far from the surface that their outlines do not reach it: their places may be wrong."""
    away = problem.outlines_on_surface.out_of_reach
    if not len(away):
        return []
    if len(away) == 1:
        return [
            f"an obstacle's `position` is {away[0]:.3g} m from the surface: it was taken to the nearest point of it"
        ]
    farthest = f"the farthest {away.max():.3g} m"
    return [
        f"{len(away)} positions of obstacles are far from the surface, {farthest}: they were taken to the nearest points of it"
    ]


def notes_on_fixed(found: Overlaps) -> list[str]:
    """Say which fixed bodies overlap each other, which nothing can part."""
    if not found.count:
        return []
    pairs = "1 pair of fixed bodies overlaps" if found.count == 1 else f"{found.count} pairs of fixed bodies overlap"
    return [f"{pairs} each other, the deepest by {found.deepest:.3g} m: they stay where they are"]


def notes_on_fixed_places(found: OutOfPlace) -> list[str]:
    """Say which fixed bodies lie in obstacles or reach across the border, which nothing can move."""
    notes = []
    if found.in_obstacles == 1:
        notes.append(f"1 fixed body lies in obstacles, by {found.deepest:.3g} m: it stays where it is")
    elif found.in_obstacles:
        deepest = f"the deepest by {found.deepest:.3g} m"
        notes.append(f"{found.in_obstacles} fixed bodies lie in obstacles, {deepest}: they stay where they are")
    if found.beyond_border == 1:
        notes.append(f"1 fixed body reaches across the border, by {found.farthest:.3g} m: it stays where it is")
    elif found.beyond_border:
        farthest = f"the farthest by {found.farthest:.3g} m"
        notes.append(
            f"{found.beyond_border} fixed bodies reach across the border, {farthest}: they stay where they are"
        )
    return notes
