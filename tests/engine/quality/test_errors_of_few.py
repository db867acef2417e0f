"""What a report says where coverage errors are large for a reason."""

import numpy as np
import pytest
from esh import Balance, BodyClass, Domain, Problem, Size, Surface, SurfaceMesh, solve
from esh.engine.problem.note import NoteKind, kind_of


def ground(kind):
    if kind == "plane":
        return Domain((3.5, 3.5))
    corners = np.array([(0.0, 0.0, 0.0), (3.5, 0.0, 0.0), (3.5, 3.5, 0.3), (0.0, 3.5, 0.0)])
    return Surface(SurfaceMesh(corners, np.array([(0, 1, 2), (0, 2, 3)])))


@pytest.mark.parametrize("kind", ["plane", "surface"])
@pytest.mark.parametrize(
    ("separation", "apart", "said", "closer"),
    [(1.0, True, True, True), (0.5, True, True, False), (0.0, True, True, False), (0.0, False, False, False)],
)
def test_small_bodies_that_large_ones_keep_off_are_named_and_what_lets_them_closer(
    kind, separation, apart, said, closer
):
    classes = [BodyClass("plate", [Size("p", 0.15, 20)]), BodyClass("disc", [Size("d", 0.0002, 1500)])]
    problem = Problem(ground(kind), classes, Balance(class_separation=separation), avoid_overlap=apart)
    placement = solve(problem, max_steps=60, device="cpu")
    found = [note for note in placement.report.notes if kind_of(note) == NoteKind.AROUND_LARGER]
    assert len(found) == said
    if said:
        assert '"disc"' in found[0] and '"plate"' not in found[0] and ("lower" in found[0]) == closer
    assert {entry.name for entry in placement.report.classes if entry.kept_off} == ({"disc"} if said else set())
    error = {entry["name"]: entry["coverage_error"] for entry in placement.report.to_dict()["classes"]}["disc"]
    # What the plates cover is not free; and where classes are mixed wholly, nor is what is theirs around it.
    assert (error > 0.15) == said and (error > 0.5) == closer
