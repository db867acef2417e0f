"""Whatever is asked for, the answer is one sentence and nothing changed, or a placement that keeps every promise."""

from __future__ import annotations

import dataclasses
import importlib
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.problem.given_values import FOREIGN_ERRORS
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(ROOT / "tools")
    fuzz, fuzz_checks, fuzz_edits = map(importlib.import_module, ("fuzz", "fuzz_checks", "fuzz_edits"))

QUIETLY = settings(
    deadline=None, max_examples=int(os.environ.get("ESH_EXAMPLES", "60")), suppress_health_check=list(HealthCheck)
)


class Drawn:
    """Decisions of Hypothesis, which finds the simplest that go wrong."""

    def __init__(self, data: st.DataObject) -> None:
        self._data = data

    def pick(self, options):
        return options[self._data.draw(st.integers(0, len(options) - 1))]

    def between(self, low, high):
        return math.exp(self._data.draw(st.floats(math.log(low), math.log(high))))


@QUIETLY
@given(st.data())
def test_any_recipe_is_placed_or_refused_in_a_sentence(data):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fuzz.check(fuzz.any_recipe(Drawn(data), folder), folder)


ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.integers(),
    st.floats(),
    st.text(max_size=4),
    st.binary(max_size=4),
    st.lists(st.floats(), max_size=3),
    st.tuples(st.floats(0.1, 2.0), st.floats(0.1, 2.0)),
    st.sampled_from(["density", "none", "cover", "linear", "uniform", "open", "periodic"]),
    st.builds(np.array, st.lists(st.floats(0.0, 2.0), min_size=1, max_size=4)),
    st.builds(np.float32, st.floats(0.0, 2.0, width=32)),
    st.just(np.ones((3, 4))),
    st.just(np.zeros((2, 2))),
    st.just(np.array(3)),
    st.just(np.array([["a"]])),
    st.just(object()),
)
USUAL = {
    esh.Domain: {"size": (4.0, 3.0), "boundary": "open"},
    esh.Balance: {"class_separation": 0.5, "size_emphasis": 2.0, "non_overlap": None, "rare_emphasis": 1.0},
    esh.Line: {
        "length": 0.5,
        "direction": "none",
        "width": None,
        "charges": 3,
        "middle_charge": 6.0,
        "turn_weights": (0.4, 0.4),
        "stretch_weights": (0.2, 0.1),
        "straightness": None,
        "tensor_scales": (1.0, 3.0),
    },
    esh.Size: {"name": "a", "area": 0.01, "count": 5, "share": None, "distribution": "linear", "line": None},
    esh.BodyClass: {
        "name": "a",
        "sizes": [esh.Size("a", 0.01, 5)],
        "density": 1.0,
        "count": None,
        "density_correction": False,
        "unsharp": None,
        "clustering": 0.0,
        "clump_size": 0.0,
        "look_at": None,
    },
    esh.LookAt: {"point": (0.0, 0.0, 0.0), "spread": 0.0, "front": "-y"},
    esh.Unsharp: {"amount": 1.0, "radius": 2.0, "overshoot": 0.0},
    esh.Problem: {
        "domain": esh.Domain((4.0, 3.0)),
        "classes": [esh.BodyClass("a", [esh.Size("a", 0.01, 5)])],
        "balance": esh.Balance(),
        "seed": 0,
        "avoid_overlap": False,
        "regularity": 0.6,
    },
}


def problem_with(part: object) -> esh.Problem:
    """A problem that a part of one is in."""
    size = part if isinstance(part, esh.Size) else esh.Size("a", 0.01, 5)
    if isinstance(part, esh.Line):
        size = esh.Size("a", 0.01, 5, line=part)
    image = np.linspace(0.1, 1.0, 12).reshape(3, 4)
    body_class = part if isinstance(part, esh.BodyClass) else esh.BodyClass("a", [size], image)
    if isinstance(part, esh.Unsharp):
        body_class = esh.BodyClass("a", [size], image, unsharp=part)
    if isinstance(part, esh.LookAt):
        body_class = esh.BodyClass("a", [size], image, look_at=part)
    domain = part if isinstance(part, esh.Domain) else esh.Domain((4.0, 3.0))
    balance = part if isinstance(part, esh.Balance) else esh.Balance()
    return part if isinstance(part, esh.Problem) else esh.Problem(domain, [body_class], balance)


@pytest.mark.parametrize("kind", USUAL, ids=lambda kind: kind.__name__)
@settings(QUIETLY, max_examples=40)
@given(st.data())
def test_any_argument_of_the_api_is_placed_or_refused_in_a_sentence(kind, data):
    usual = USUAL[kind]
    changed = data.draw(st.lists(st.sampled_from(sorted(usual)), min_size=1, max_size=2, unique=True))
    arguments = {**usual, **{key: data.draw(ANYTHING) for key in changed}}
    try:
        problem = problem_with(kind(**arguments))
        if problem.body_count > 2000:
            return
        placement = esh.solve(problem, device="cpu", max_steps=3)
    except esh.EshError as error:
        assert "\n" not in str(error) and 0 < len(str(error)) < 1000
        return
    fuzz_checks.check_placement(placement)


@QUIETLY
@given(
    st.binary(max_size=400),
    st.sampled_from([b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0", b"v/1\x01", b"\x93NUMPY\x01\x00"]),
    st.sampled_from([".png", ".jpg", ".exr", ".npy"]),
)
def test_any_bytes_as_an_image_are_read_or_refused_in_a_sentence(content, start, ending):
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / f"image{ending}"
        path.write_bytes(start + content)
        try:
            assert np.isfinite(esh.read_density(path)).all()
        except esh.EshError as error:
            assert "\n" not in str(error)


@settings(QUIETLY, max_examples=30)
@given(ANYTHING, st.sampled_from(["problem", "device", "max_steps", "progress", "path"]))
def test_any_argument_of_the_functions_is_used_or_refused_in_a_sentence(value, where):
    small = esh.Problem(esh.Domain((1.0, 1.0)), [esh.BodyClass("a", [esh.Size("s", 0.1, 3)])])
    try:
        if where == "path":
            esh.read_recipe(value)
        elif where == "problem":
            esh.solve(value)
        else:
            if where == "max_steps" and isinstance(value, (int, float)) and value > 50:
                return
            esh.solve(small, **{"device": "cpu", "max_steps": 1, where: value})
    except esh.EshError as error:
        # The name of a file is shown as it is.
        assert "\n" not in str(error).replace(str(value), "")
    except FOREIGN_ERRORS as error:
        # A name that no file can have is the system's to refuse.
        assert isinstance(value, str) and where == "path", error


def test_the_fuzz_finds_what_is_broken(tmp_path):
    script = (
        f"import sys\nsys.path.insert(0, {str(ROOT / 'tools')!r})\n"
        "import fuzz\nprint(fuzz.main(['--seconds', sys.argv[1]]))\n"
    )
    finished = subprocess.run(
        [sys.executable, "-c", script, "4"], capture_output=True, text=True, timeout=200, check=True
    )
    assert finished.stdout.endswith(" 0 broken\n0\n")
    assert int(finished.stdout.split()[0]) >= 1


def test_a_placement_that_breaks_a_promise_is_told_of():
    problem = esh.Problem(esh.Domain((4.0, 3.0)), [esh.BodyClass("a", [esh.Size("s", 0.1, 30)], np.eye(4))])
    placement = esh.solve(problem, device="cpu", max_steps=5)
    fuzz_checks.check_placement(placement)
    position = placement.position.copy()
    position[3] = np.nan
    outside = placement.position + [9.0, 0.0]
    empty = placement.position.copy()
    empty[0] = [0.1, 0.1]
    report = placement.report
    for broken, said in (
        ({"position": position}, "no number"),
        ({"position": outside}, "outside"),
        ({"position": empty}, "no density"),
        ({"class_index": placement.class_index + 1}, "counts"),
        ({"report": dataclasses.replace(report, overlaps=report.overlaps + 100)}, "overlaps are reported"),
        ({"report": dataclasses.replace(report, coverage_error=math.nan)}, "report is no number"),
    ):
        with pytest.raises(AssertionError, match=said):
            fuzz_checks.check_placement(dataclasses.replace(placement, **broken))


class Doubling:
    """Decisions that lead to edits of twice as many bodies."""

    def pick(self, options):
        return "counts" if "counts" in options else options[-1]

    def between(self, low, high):
        return high


def test_an_edit_that_breaks_a_promise_is_told_of(tmp_path, monkeypatch):
    problem = esh.Problem(esh.Domain((4.0, 3.0)), [esh.BodyClass("a", [esh.Size("s", 1e-3, 30)])])
    recipe = tmp_path / "recipe.toml"
    esh.write_recipe(recipe, problem)
    assert fuzz_edits.check_edits(recipe, Doubling()) == fuzz_edits.EDITS
    edit = esh.Solver.edit
    monkeypatch.setattr(esh.Solver, "edit", lambda *given, **named: edit(*given, **named)._replace(added=np.arange(1)))
    with pytest.raises(AssertionError, match="identities differ"):
        fuzz_edits.check_edits(recipe, Doubling())


def test_a_placement_on_a_surface_that_breaks_a_promise_is_told_of():
    corner = [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
    mesh = esh.SurfaceMesh(corner, [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    problem = esh.Problem(esh.Surface(mesh), [esh.BodyClass("a", [esh.Size("s", 0.01, 30)])])
    placement = esh.solve(problem, device="cpu", max_steps=5)
    fuzz_checks.check_placement(placement)
    for broken, said in (
        ({"position": placement.position + 0.1}, "not on its triangle"),
        ({"triangle": placement.triangle[::-1]}, "not on its triangle"),
        ({"barycentric": placement.barycentric * 2.0}, "weights"),
        ({"normal": placement.normal * 0.5}, "length of 1"),
        ({"tangent": placement.normal}, "tangent"),
    ):
        with pytest.raises(AssertionError, match=said):
            fuzz_checks.check_placement(dataclasses.replace(placement, **broken))
