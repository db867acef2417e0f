"""What a report says of overlaps that nobody asked to avoid, and where it says nothing as they are meant."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass, Unsharp
from esh.engine.problem.color_separation import halftone_problem
from esh.engine.problem.cover import cover_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.line import Line
from esh.engine.problem.note import NoteKind, kind_of
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality.measurement import measure
from esh.engine.solve import solve

SIDE = 50.0
SQUARE = Domain((SIDE, SIDE))
FLAT = SurfaceMesh([[0.0, 0.0, 0.0], [SIDE, 0.0, 0.0], [SIDE, SIDE, 0.0], [0.0, SIDE, 0.0]], [[0, 1, 2], [0, 2, 3]])
NAMED = "footprints are only kept apart if `avoid_overlap` is true"


def crowd(domain=SQUARE, share=0.7, **more):
    """Large and small discs that add up to a share of the ground and have room beside each other."""
    classes = [
        BodyClass(name, [Size("one", 0.5 * share * SIDE**2 / count, count)])
        for name, count in (("tree", 100), ("bush", 600))
    ]
    return Problem(domain, classes, **more)


def told(problem, steps=30):
    report = solve(problem, device="cpu", max_steps=steps).report
    return [note for note in report.notes if kind_of(note) == NoteKind.MAY_OVERLAP], report


@pytest.mark.parametrize("domain", [SQUARE, Surface([FLAT])], ids=["plane", "surface"])
def test_overlaps_that_nobody_asked_to_avoid_name_the_setting(domain):
    (note,), report = told(crowd(domain))
    assert (
        note == f"{report.overlaps} pairs of footprints overlap, the deepest by {report.deepest_overlap:.3g} m: {NAMED}"
    )
    assert not told(crowd(domain, avoid_overlap=True))[0]
    assert not told(crowd(domain, 0.3))[0]


def test_a_single_pair_of_outlines_is_told_of_among_few():
    few = Problem(SQUARE, [BodyClass("hut", [Size("one", None, 3, footprint=Footprint.rectangle(4.0, 3.0))])])
    placement = solve(few, device="cpu", max_steps=2)
    there = replace(placement, position=np.array([[10.0, 10.0], [12.0, 11.0], [40.0, 40.0]]), angle=np.zeros(3))
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        notes = measure(there, launcher).notes
    assert notes == (f"1 pair of footprints overlaps, the deepest by 2 m: {NAMED}",)


@pytest.mark.parametrize("avoided", [True, False])
def test_a_printed_report_begins_with_what_cannot_fit(avoided):
    report = solve(crowd(share=1.25, avoid_overlap=avoided), device="cpu", max_steps=5).report
    (note,) = [note for note in report.notes if "125% of " in note]
    assert str(report).splitlines()[0] == note and str(report).count(note) == 1
    assert all(other in str(report).splitlines()[3:] for other in report.notes if other != note)


@pytest.mark.parametrize("steps", [1, 60])
def test_that_the_densest_places_are_evened_out_is_said_once_whether_or_not_all_were_parted(steps):
    peak = np.full((32, 32), 0.1)
    peak[12:20, 12:20] = 1.0
    discs = BodyClass("disc", [Size("one", 0.2, 5000)], peak)
    problem = Problem(SQUARE, [discs], avoid_overlap=True)
    report = solve(problem, device="cpu", max_steps=steps).report
    assert report.overlaps == 0
    warning = cover_of(problem).warning
    assert report.notes == (warning,) and "the density is evened out there" in warning
    assert str(report).splitlines()[0] == warning and str(report).count(warning) == 1


def test_a_few_that_touch_are_not_told_of():
    notes, report = told(crowd(share=0.45), steps=100)
    assert report.overlaps and not notes


@pytest.mark.parametrize(
    "kind", ["stippling", "hatching", "cover", "sharpened", "classes by themselves", "too dark", "inks"]
)
def test_what_overlaps_on_purpose_is_not_told_of(kind):
    ramp = np.linspace(0.0, 1.0, 64)[None, :].repeat(64, 0)
    dots = [Size("large", 1.5, 300), Size("small", 0.5, 900)]
    line = Line(4.0, "none", width=0.3)
    problem = {
        "stippling": lambda: Problem(SQUARE, [BodyClass("ink", [Size("dot", 0.9, 2000)], ramp)]),
        "hatching": lambda: Problem(SQUARE, [BodyClass("ink", [Size("line", 1.2, 800, line=line)])]),
        "cover": lambda: Problem(
            SQUARE, [BodyClass("ink", [Size("a", 1.5, share=0.5), Size("b", 0.5, share=0.5)], ramp, count="cover")]
        ),
        "sharpened": lambda: Problem(SQUARE, [BodyClass("ink", dots, ramp, unsharp=Unsharp(1.0, 2.0))]),
        "classes by themselves": lambda: crowd(balance=Balance(0.0), share=0.4),
        "inks": lambda: halftone_problem(np.random.default_rng(0).random((64, 64, 3)) * 0.9, "CMY"),
        "too dark": lambda: Problem(SQUARE, [BodyClass("ink", dots, ramp**4)]),
    }[kind]()
    notes, report = told(problem)
    assert report.overlaps > 50 and not notes


@pytest.mark.parametrize("kind", ["cover", "outlines to cover", "beside lines", "beside a picture"])
def test_overlaps_are_told_of_however_counts_were_given_and_whatever_else_is_there(kind):
    stones = [Size("large", 18.0, share=0.5), Size("small", 2.0, share=0.5)]
    boxes = [Size("box", None, 450, footprint=Footprint.rectangle(2.5, 1.5))]
    ink = [Size("line", 1.2, 80, line=Line(4.0, "none", width=0.3))]
    ramp = np.linspace(0.0, 1.0, 64)[None, :]
    problem = {
        "cover": lambda: Problem(SQUARE, [BodyClass("stone", stones, 0.7, count="cover")]),
        "outlines to cover": lambda: Problem(
            SQUARE, [BodyClass("box", [Size("box", None, footprint=boxes[0].footprint)], 0.6, count="cover")]
        ),
        "beside lines": lambda: Problem(SQUARE, [BodyClass("box", boxes), BodyClass("ink", ink)]),
        "beside a picture": lambda: Problem(
            SQUARE,
            [BodyClass("box", boxes), BodyClass("ink", [Size("dot", 0.2, 500)], ramp, unsharp=Unsharp(1.0, 2.0))],
        ),
    }[kind]()
    (note,), report = told(problem)
    assert report.overlaps and note.endswith(NAMED)


@pytest.mark.parametrize("domain", [SQUARE, Surface([FLAT])], ids=["plane", "surface"])
@pytest.mark.parametrize("beside", ["lines", "pictures"])
def test_what_overlaps_on_purpose_is_not_counted_beside_solid_bodies_that_overlap(domain, beside):
    boxes = BodyClass("box", [Size("box", None, 3, footprint=Footprint.rectangle(4.0, 3.0))])
    ink = {
        "lines": BodyClass("ink", [Size("line", 1.2, 3, line=Line(6.0, "none", width=0.3))]),
        "pictures": BodyClass("ink", [Size("dot", 12.0, 3)], np.ones((1, 1)), unsharp=Unsharp(1.0, 2.0)),
    }[beside]
    placement = solve(Problem(domain, [boxes, ink]), device="cpu", max_steps=2)
    # Two boxes, one of which all of the ink crosses.
    x, y = np.array([[10.0, 12.0, 40.0, 10.0, 10.0, 10.2], [10.0, 11.0, 40.0, 10.0, 10.1, 10.0]])
    if domain is SQUARE:
        there = replace(placement, position=np.stack([x, y], axis=1), angle=np.zeros(6))
    else:
        triangle = np.where(y <= x, 0, 1)
        corners = np.array([[1.0 - x / SIDE, (x - y) / SIDE, y / SIDE], [1.0 - y / SIDE, x / SIDE, (y - x) / SIDE]])
        there = replace(
            placement,
            position=np.stack([x, y, 0.0 * x], axis=1),
            tangent=np.tile([1.0, 0.0, 0.0], (6, 1)),
            mesh=np.zeros(6, np.int32),
            triangle=triangle.astype(np.int32),
            barycentric=corners[triangle, :, np.arange(6)],
        )
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        report = measure(there, launcher)
    assert report.overlaps > 4
    assert [n for n in report.notes if kind_of(n) == NoteKind.MAY_OVERLAP] == [
        f"1 pair of footprints overlaps, the deepest by 2 m: {NAMED}"
    ]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"gap": 0.1}, '`gap` of class "tree" does nothing: '),
        ({"gap": 0.1, "room": 1.5}, '`gap` and `room` of class "tree" do nothing: '),
        ({"room": 0.8}, None),
    ],
)
def test_room_that_nobody_keeps_is_told_of(given, expected):
    problem = Problem(SQUARE, [BodyClass("tree", [Size("one", 1.0, 20)], **given)])
    notes = solve(problem, device="cpu", max_steps=2).report.notes
    assert notes == (() if expected is None else (expected + NAMED,))
    assert all(kind_of(note) == NoteKind.IGNORED for note in notes)
