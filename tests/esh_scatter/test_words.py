"""Reports in the words of the sidebar."""

import json

import numpy as np
import pytest
from esh.engine.problem.cover import Cover
from esh.engine.problem.note import Note, NoteKind
from esh.engine.quality.errors_of_few import groups_kept_off, notes_on_areas, notes_on_larger_classes
from esh.esh_scatter.result import words


def report(placed=1042, error=0.01, alone=0.02, **changes):
    sizes = [{"name": "Large", "area": 1.0, "asked": placed, "placed": placed}]
    made = {
        "converged": True, "seconds": 0.84, "coverage_error": error, "overlaps": 0, "notes": [],
        "classes": [{"name": "Pine", "coverage_error": alone, "sizes": sizes}],
    }  # fmt: skip
    return made | changes


def test_a_summary_is_one_line():
    assert words.summary(report()) == "1,042 placed · no overlap · very even · 0.8 s"
    assert words.summary(report(overlaps=1)) == "1,042 placed · 1 overlap · very even · 0.8 s"
    assert words.summary(report(overlaps=2000)) == "1,042 placed · 2,000 overlaps · very even · 0.8 s"
    assert words.summary(report(placed=3)) == "3 placed · no overlap · 0.8 s", "three are neither even nor uneven"


def test_what_leans_into_each_other_is_told_beside_what_overlaps_on_the_ground():
    lean = {"leaning": 1112, "leaning_pair": [3, 4], "deepest_leaning": 0.2}
    assert words.summary(report(**lean), seconds=False) == (
        "1,042 placed · no overlap on the ground · 1,112 pairs lean into each other · very even"
    )
    assert not words.has_trouble(report(**lean)) and words.leans(report(**lean))
    assert words.leaning(report(**lean)) == "1,112 pairs" and words.worst(report(**lean)) == ((3, 4), 0.2)
    assert "· 1 pair leans into each other ·" in words.summary(report(leaning=1))
    both = report(**lean, overlaps=2, deepest_pair=[1, 2], deepest_overlap=0.1)
    assert "· 2 overlaps · 1,112 pairs lean into each other ·" in words.summary(both)
    assert words.worst(both) == ((1, 2), 0.1), "on the ground it counts more"
    changed = report(**lean) | {words.LEANING_CHANGED: True}
    assert "no overlap on the ground · leaning not counted again" in words.summary(changed)
    assert words.leaning(changed) == "changed since" and words.worst(changed) is None
    for none in (report(), report(leaning=None), report(leaning=0)):
        assert "· no overlap ·" in words.summary(none) and not words.leans(none) and words.worst(none) is None
    assert words.leaning(report(leaning=0)) == "none" and words.leaning(report()) == ""
    assert "lean" not in words.summary(report(**lean) | {words.MAY_OVERLAP: True})


@pytest.mark.parametrize(
    ("error", "alone", "word"),
    [
        (0.01, 0.3, "very even"),
        (0.3, 0.01, "very even"),
        (0.07, 0.3, "even"),
        (0.2, 0.2, "uneven"),
        (0.31, 0.31, "uneven"),
    ],
)
def test_the_better_of_together_and_alone_counts(error, alone, word):
    assert words.evenness(report(error=error, alone=alone)) == word


def test_uneven_classes_are_named():
    entry = report()["classes"][0]
    classes = [entry | {"name": name, "coverage_error": error} for name, error in (("Pine", 0.05), ("Beech", 0.2))]
    assert words.evenness(report(error=0.2, classes=classes)) == "uneven: Beech"


def test_more_steps_are_advised_only_where_they_help():
    assert words.notes(report(converged=False)) == []
    assert words.notes(report(error=0.3, alone=0.3)) == []
    assert words.notes(report(error=0.3, alone=0.3, converged=False, overlaps=300)) == [], "there is no room"
    assert words.notes(report(error=0.3, alone=0.3, converged=False, notes=["`a` is wrong"])) == [
        "A is wrong",
        "More steps would make it more even (Advanced)",
    ]


def test_what_helps_is_called_as_the_sidebar_calls_it():
    note = "2 bodies lie in obstacles, the deepest by 0.1 m; take more steps, or lower the counts or the areas"
    said = "2 objects lie in obstacles, the deepest by 0.1 m; raise Max Steps (Advanced), or lower counts or Scale"
    assert words.notes(report(notes=[note])) == [said]


def test_where_the_figure_tells_of_large_objects_only_nothing_is_called_uneven():
    """Pebbles that are spread among boulders, for example: no steps make that figure smaller."""
    area = np.repeat([1.0, 1e-4], [40, 60_000])
    found = notes_on_areas(area, np.zeros(len(area), np.int32), [0.3])
    assert found
    told = report(error=0.3, alone=0.3, converged=False, notes=found)
    assert words.notes(told) == [] and words.summary(told) == "1,042 placed · no overlap · 0.8 s"
    assert words.evenness(report(error=0.1, alone=0.3, notes=found)) == "even"
    # Of all together the sidebar shows no figure that would have to be explained.
    together = report(error=1.9, notes=[Note("it is large because ...", NoteKind.ALL_TOGETHER)])
    assert words.notes(report(notes=[Note("it does nothing", NoteKind.IGNORED)])) == [], "nor what does nothing"
    assert words.notes(together) == [] and words.evenness(together) == "very even"


def test_grass_that_trees_keep_off_is_not_uneven_and_it_is_said_what_helps():
    area, index = np.repeat([1.0, 1e-3], [20, 3000]), np.repeat([0, 1], [20, 3000])
    every = np.ones((2, 2), bool)
    assert groups_kept_off(area, index, [0.01, 1.0], every) == [1]
    found = notes_on_larger_classes(["Grass"], mixed=True)
    told = report(error=1.0, alone=1.0, converged=False, notes=found)
    said = 'Much larger objects keep "Grass" off part of the ground, or crowd it beside them, which counts as uneven'
    assert words.notes(told) == [f"{said}; a lower Mix Classes lets them closer"]
    assert words.summary(told) == "1,042 placed · no overlap · 0.8 s"
    found = notes_on_larger_classes(["Grass"], mixed=False)
    assert words.notes(report(error=1.0, alone=1.0, converged=False, notes=found)) == [said]
    # All together may be even.
    assert "even" not in words.summary(report(error=0.01, alone=1.0, notes=found))
    assert notes_on_larger_classes([], mixed=True) == []
    # Not where it is even, nor where the others are as large or fill no ground.
    for own, errors in ((area, [0.01, 0.1]), (np.ones(3020), [0.01, 1.0]), (np.where(index, area, 0.01), [0.01, 1.0])):
        assert groups_kept_off(own, index, errors, every) == []
    assert groups_kept_off(area, index, [0.01, 1.0], np.eye(2, dtype=bool)) == []


def test_beside_grass_that_trees_keep_off_others_that_are_uneven_are_named():
    entry = report()["classes"][0]
    grass = entry | {"name": "Grass", "coverage_error": 0.4, "kept_off": True}
    tree, fern = ({"name": name, "kept_off": False} for name in ("Tree", "Fern"))
    even = [entry | tree | {"coverage_error": 0.02}, entry | fern | {"coverage_error": 0.03}, grass]
    uneven = [even[0], entry | fern | {"coverage_error": 0.3}, grass]
    found = notes_on_larger_classes(["Grass"], mixed=False)
    assert words.evenness(words.kept(report(error=1.0, classes=uneven, notes=found))) == "uneven: Fern"
    assert words.evenness(report(error=1.0, classes=even, notes=found)) == "", "only what is kept off is uneven"
    assert words.evenness(report(error=1.0, classes=[grass], notes=found)) == ""
    # Reports of earlier versions do not say which class the note is about.
    before = [{key: value for key, value in one.items() if key != "kept_off"} for one in uneven]
    assert words.evenness(report(error=1.0, classes=before, notes=found)) == ""


@pytest.mark.parametrize(
    ("length", "text"),
    [(1234.5, "1,234 m"), (12.34, "12.3 m"), (0.342, "0.34 m"), (0.0123, "0.012 m"), (7.0, "7.00 m")],
)
def test_lengths_have_the_digits_that_are_worth_reading(length, text):
    assert words.meters(length) == text


def test_overlaps_are_told_once():
    told = report(
        overlaps=12, deepest_overlap=0.051, notes=[Note("12 pairs, the deepest by 0.051 m", NoteKind.OVERLAPS), "b"]
    )
    assert words.overlaps(told) == "12 pairs" and words.notes(told) == ["B"]
    assert words.overlaps(report(overlaps=1)) == "1 pair" and words.overlaps(report()) == "none"


def test_what_lies_where_it_is_not_to_lie_is_in_the_one_line():
    assert "no overlap" in words.summary(report()) and not words.has_trouble(report())
    told = report(
        in_obstacles=2,
        fixed_overlaps=1,
        beyond_border=3,
        notes=["1 pair of fixed bodies overlaps each other, the deepest by 0.5 m: they stay where they are"],
    )
    assert words.has_trouble(told) and "no overlap" not in words.summary(told)
    for part in ("1 overlap among pinned", "2 in obstacles", "3 across the border"):
        assert part in words.summary(told)
    assert words.notes(told)[0].startswith("1 pair of pinned objects overlaps")


def test_a_rule_is_left_out_before_what_was_given():
    said = 'Density of class "Bush" must be above 0 somewhere; image "Bush" is 0 everywhere: paint it'
    assert words.behind_rule(said) == 'Image "Bush" is 0 everywhere: paint it'
    assert words.behind_rule("The target was deleted") == "The target was deleted"


def test_what_cannot_fit_is_said_once():
    """Below the button, where it is known before the run; the engine's own words are those that are left out."""
    said = Cover(0.55, 0.5, 0.0).warning
    told = report(overlaps=3, notes=[said, "2 objects lie in obstacles"])
    assert len(words.notes(told)) == 2
    assert words.notes(told, foreseen=True) == ["2 objects lie in obstacles"]


def test_what_is_too_crowded_says_what_to_do():
    said = "Too crowded in places: 34% of the objects go where not all fit. Lower counts, or even densities out"
    assert words.cover(Cover(0.4, 0.8, 0.34)) == said


def test_a_report_that_is_kept_says_what_its_notes_are_about():
    """Whatever their words are; and what it says is not lost when it is kept again."""
    made = report(overlaps=3, notes=[Note("too much", NoteKind.COVER), "a", Note("so many", NoteKind.OVERLAPS)])
    assert json.loads(json.dumps(made["notes"])) == ["too much", "a", "so many"]
    kept = json.loads(json.dumps(words.kept(made)))
    for told in (made, kept, json.loads(json.dumps(words.kept(kept)))):
        assert words.notes(told) == ["Too much", "A"] and words.notes(told, foreseen=True) == ["A"]
    switched_off = [Note("`avoid_overlap` would", NoteKind.MAY_OVERLAP), Note("no `gap` then", NoteKind.IGNORED)]
    assert words.notes(report(overlaps=3, may_overlap=True, notes=switched_off)) == []
    assert words.notes(report(notes=["12 pairs still overlap"])) == ["12 pairs still overlap"], (
        "no words are looked for"
    )
    uneven = words.kept(report(error=0.3, alone=0.3, notes=[Note("large ones", NoteKind.ERROR_OF_FEW)]))
    assert words.evenness(json.loads(json.dumps(uneven))) == ""


def test_overlaps_that_may_be_are_no_trouble_and_clumps_are_not_uneven():
    told = report(overlaps=12, may_overlap=True)
    assert not words.has_trouble(told) and "overlap" not in words.summary(told)
    assert words.has_trouble(report(overlaps=12, may_overlap=False))
    uneven = report(coverage_error=0.5)
    for entry in uneven["classes"]:
        entry["coverage_error"] = 0.5
    assert words.evenness(uneven).startswith("uneven")
    assert words.evenness({**uneven, "clumped": True}) == ""


def test_of_later_scatters_in_the_way_as_many_are_named_as_fit():
    assert words.in_the_way([]) == ""
    assert words.in_the_way(["Grass"]) == '"Grass" does not make room for this yet: update it, too'
    assert words.in_the_way(["Grass", "Fern"]) == '"Grass" and "Fern" do not make room for this yet: update them, too'
    many = '"A", "B" and 2 more do not make room for this yet: update them, too'
    assert words.in_the_way(["A", "B", "C", "D"]) == many


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([], "No scatter was updated"),
        (["Wood"], '"Wood" updated'),
        (["Wood", "Fern"], '"Wood" and "Fern" updated'),
        (["Wood", "Fern", "Moss"], '"Wood", "Fern" and "Moss" updated'),
        (["A", "B", "C", "D"], '"A", "B" and 2 more updated'),
    ],
)
def test_of_scatters_that_were_updated_together_as_many_are_named_as_fit(names, said):
    assert words.updated(names) == said
