"""Every setting is described, checked by its description, and explained where people look for it."""

import dataclasses
import inspect
import math
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from esh import EshError
from esh.engine.errors import ProblemError
from esh.engine.files.recipe_keys import keys_of
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass, ClassSettings, PlacingSettings, Unsharp
from esh.engine.problem.domain import Domain
from esh.engine.problem.fixed_bodies import FixedBodies, FixedBody
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.prepared_class import PreparedClass
from esh.engine.problem.problem import Problem, ProblemSettings, SamplingSettings
from esh.engine.problem.scatter_settings import BorderSettings, RunSettings, ScatterSettings, Standing, TargetSettings
from esh.engine.problem.settings import (
    TOGETHER,
    Choice,
    Settings,
    _taken,
    belongs_to,
    described,
    setting,
    settings_of,
    takes,
    values_of,
)
from esh.engine.problem.size import Size
from esh.engine.problem.surface_density import SurfaceAttribute, SurfaceImage, SurfaceTriplanar
from esh.engine.problem.surface_directions import SurfaceVectors
from esh.engine.scenes.solve_many import solve_many
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver
from esh.engine.tiles.tiles import solve_tiles

DESCRIBED = [
    Domain,
    Balance,
    Unsharp,
    Line,
    Size,
    ClassSettings,
    BodyClass,
    SamplingSettings,
    ProblemSettings,
    Footprint,
    Footprints,
    Obstacle,
    FixedBodies,
    FixedBody,
    SurfaceAttribute,
    SurfaceImage,
    SurfaceTriplanar,
    SurfaceVectors,
    Standing,
    RunSettings,
    TargetSettings,
]
ALL = [(cls, name) for cls in [*DESCRIBED, ScatterSettings] for name in settings_of(cls)]
SQUARE, CLASSES = Domain((9.0, 9.0)), [BodyClass("a", [Size("s", 1.0, 3)])]
RECIPES = (Path(__file__).parents[3] / "docs" / "recipes.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("cls", [*DESCRIBED, ScatterSettings], ids=lambda cls: cls.__name__)
def test_every_field_is_described_and_every_description_is_in_the_docstring(cls):
    assert {entry.name for entry in dataclasses.fields(cls)} == settings_of(cls).keys()
    explained = re.findall(r"^    (\w+): ", cls.__doc__.partition("Raises:")[0], re.MULTILINE)
    assert explained == list(settings_of(cls)) == list(inspect.signature(cls).parameters)
    for name, one in settings_of(cls).items():
        assert one.setting.help and not one.setting.help.endswith("."), f"{cls.__name__}.{name}"
        assert " ".join(one.setting.help.split()) in " ".join(cls.__doc__.split())


@pytest.mark.parametrize(("cls", "name"), ALL, ids=[f"{cls.__name__}.{name}" for cls, name in ALL])
def test_a_default_and_both_ends_of_a_range_are_accepted_and_what_is_beyond_is_not(cls, name):
    one = settings_of(cls)[name]
    key = f"`{name}`"
    if not one.required:
        assert np.all(one.checked(one.default, key) == one.default)
    for choice in one.setting.choices:
        assert one.checked(choice.value, key) == choice.value
    for end, beyond in ((one.setting.low, -math.inf), (one.setting.high, math.inf)):
        if end is None:
            continue
        whole = one.kind == "whole" or isinstance(end, int)
        assert one.checked(int(end) if whole else end, key) == end
        if name == "size_emphasis" and beyond > 0:
            # As large as you like; the sidebar ends there.
            continue
        outside = end + math.copysign(1, beyond) if whole else np.nextafter(end, beyond)
        with pytest.raises(ProblemError, match=re.escape(key)):
            one.checked(outside, key)
    for soft, hard in ((one.setting.soft_low, one.setting.low), (one.setting.soft_high, one.setting.high)):
        assert soft is None or hard is None or abs(soft) <= abs(hard) or soft >= hard


def test_a_new_setting_is_one_line():
    """What follows from a description: check, message, docstring, arguments of a function."""

    @described
    @dataclasses.dataclass(frozen=True)
    class Wind(Settings):
        """How the wind blows.

        Raises:
            ProblemError: It cannot blow so.
        """

        speed: float = dataclasses.field(default=2.0, metadata=setting("How fast", unit="m", low=0.0, high=30.0))
        gusts: int = dataclasses.field(default=3, metadata=setting("How often", low=1))
        steady: bool = dataclasses.field(default=False, metadata=setting("Whether it never changes"))
        kind: str = dataclasses.field(
            default="sea",
            metadata=setting(
                "Where from", choices=(Choice("sea", "Sea", "wet", "SEA"), Choice("land", "Land", "dry", "L"))
            ),
        )
        span: tuple[float, float] = dataclasses.field(
            default=(1.0, 2.0), metadata=setting("From where to where", low=0.0)
        )
        unsharp: Unsharp | None = dataclasses.field(default=None, metadata=setting("Blurs", of=Unsharp))

    @takes(Wind)
    def blow(target, *, name="x", **changes):
        """Blow.

        Args:
            target: At what.
            name: Of it.
            changes: Any of the following.

        Returns:
            Nothing.
        """
        return target, name, changes

    assert str(inspect.signature(blow)).startswith("(target, *, speed: ")
    assert list(inspect.signature(blow).parameters) == ["target", *settings_of(Wind), "name"]
    assert "    speed: How fast [m].\n    gusts: How often.\n" in blow.__doc__
    assert Wind.__doc__ == (
        "How the wind blows.\n\nArgs:\n    speed: How fast [m].\n    gusts: How often.\n    steady: Whether it never changes.\n"
        '    kind: Where from. ``"sea"`` (wet), ``"land"`` (dry).\n    span: From where to where.\n    unsharp: Blurs.\n\n'
        "Raises:\n    ProblemError: It cannot blow so.\n"
    )
    made = Wind(speed=np.float32(3), gusts=4.0)
    assert (type(made.speed), made.gusts, type(made.gusts)) == (float, 4, int)
    assert values_of(made, Wind)["kind"] == "sea"
    for values, message in (
        ({"speed": 31}, "`speed` must be a number between 0 and 30; got 31"),
        ({"speed": math.nan}, "`speed` must be a number between 0 and 30; got nan"),
        ({"speed": True}, "`speed` must be a number between 0 and 30; got True"),
        ({"gusts": 0}, "`gusts` must be a whole number of 1 or more, and finite; got 0"),
        ({"gusts": 1.5}, "`gusts` must be a whole number of 1 or more, and finite; got 1.5"),
        ({"steady": 1}, "`steady` must be true or false; got 1"),
        ({"kind": "east"}, '`kind` must be "sea" or "land"; got "east"'),
        ({"span": 1.0}, "`span` must be 2 numbers; got 1"),
        ({"span": [1, -1]}, "`span` must be a number of 0 or more, and finite; got -1"),
        ({"unsharp": 3}, "`unsharp` must be an Unsharp, or None; got 3"),
    ):
        with pytest.raises(ProblemError) as raised:
            Wind(**values)
        assert str(raised.value) == message


def test_what_a_problem_and_a_class_are_told_they_take():
    """Their constructors are not made from the descriptions alone."""
    taken = inspect.signature(Problem).parameters
    for name, one in settings_of(ProblemSettings).items():
        assert taken[name].default == one.default and taken[name].kind is taken[name].KEYWORD_ONLY
        assert f"    {name}: {one.setting.help[:30]}" in Problem.__doc__
    assert settings_of(ClassSettings).keys() <= settings_of(BodyClass).keys()
    assert settings_of(PlacingSettings) == settings_of(PreparedClass)


def test_a_problem_is_told_its_settings_by_name_and_keeps_them():
    classes = [BodyClass("a", [Size("s", 1.0, 3)])]
    given = {"seed": 5, "avoid_overlap": True, "regularity": 0.25, "include_fixed": True}
    problem = Problem(Domain((9.0, 9.0)), classes, **given)
    assert values_of(problem, ProblemSettings) == given
    assert values_of(dataclasses.replace(problem, seed=6), ProblemSettings) == given | {"seed": 6}
    with pytest.raises(ProblemError, match=r"`sead` is not a known setting; did you mean `seed`\?$"):
        Problem(Domain((9.0, 9.0)), classes, sead=3)
    with pytest.raises(ProblemError, match="`regularity` must be a number between 0 and 1; got 2"):
        Problem(Domain((9.0, 9.0)), classes, regularity=2)


@pytest.mark.parametrize(
    ("call", "name", "error", "said"),
    [
        (lambda **more: Problem(SQUARE, CLASSES, **more), "gap", ProblemError, "BodyClass or Footprints: BodyClass"),
        (lambda **more: Problem(SQUARE, CLASSES, **more), "class_separation", ProblemError, "Balance: Balance"),
        (lambda **more: Problem(SQUARE, CLASSES, **more), "max_steps", ProblemError, "solve: solve"),
        (lambda **more: BodyClass("a", [Size("s", 1.0, 3)], **more), "seed", TypeError, "Problem: Problem"),
        (lambda **more: BodyClass("a", [Size("s", 1.0, 3)], **more), "area", TypeError, "Size: Size"),
        (lambda **more: Size("s", 1.0, 3, **more), "density", TypeError, "BodyClass: BodyClass"),
        (lambda **more: Domain((1.0, 1.0), **more), "avoid_overlap", TypeError, "Problem: Problem"),
        (lambda **more: Balance(**more), "regularity", TypeError, "Problem: Problem"),
        (
            lambda **more: solve(Problem(SQUARE, CLASSES), **more),
            "gap",
            TypeError,
            "BodyClass or Footprints: BodyClass",
        ),
        (lambda **more: solve_many([], **more), "seed", TypeError, "Problem: Problem"),
        (lambda **more: solve_tiles("r.toml", "out", **more), "avoid_overlap", TypeError, "Problem: Problem"),
        (lambda **more: Solver(Problem(SQUARE, CLASSES), **more), "avoid_overlap", TypeError, "Problem: Problem"),
    ],
)
def test_of_a_setting_that_belongs_elsewhere_it_is_said_where(call, name, error, said):
    with pytest.raises(error, match=rf"`{name}` is not a .*setting.*; it belongs to {said}\(\.\.\., {name}=\.\.\.\)$"):
        call(**{name: 3})


def test_steps_belong_to_what_takes_them_here():
    taken = r"its method `run` takes it: solver\.run\(max_steps=\.\.\.\)$"
    with pytest.raises(TypeError, match=rf"`max_steps` is not a setting of Solver; {taken}"):
        Solver(Problem(SQUARE, CLASSES), max_steps=3)
    with pytest.raises(
        TypeError, match=r"`max_steps` is not .*; `steps` are those of its passes: solve_tiles\(\.\.\., steps=\("
    ):
        solve_tiles("r.toml", "out", max_steps=3)


def test_what_belongs_nowhere_is_refused_as_ever_and_signatures_stay():
    with pytest.raises(TypeError, match="unexpected keyword argument 'zzz'"):
        BodyClass("a", [Size("s", 1.0, 3)], zzz=3)
    assert [*inspect.signature(Size).parameters][:3] == ["name", "area", "count"]
    assert dataclasses.replace(Size("s", 1.0, 3), count=4).count == 4
    with pytest.raises(TypeError, match="unexpected keyword argument 'zzz'"):
        solve(Problem(SQUARE, CLASSES), zzz=3)
    with pytest.raises(TypeError, match="required positional argument: 'problem'"):
        solve(device="cpu")
    assert [*inspect.signature(solve).parameters][:2] == ["problem", "device"]
    # Every name that a sentence can hold is known by what it belongs to.
    assert {solve.__name__, *TOGETHER["problem"]} <= _taken.keys()


def test_where_a_setting_belongs_is_known_before_anything_is_loaded_that_solves():
    code = (
        "import sys, esh\n"
        "try: esh.Problem(esh.Domain((1.0, 1.0)), [esh.BodyClass('a', [esh.Size('b', 0.01, 5)])], max_steps=3)\n"
        "except esh.ProblemError as error: print(error, 'warp' in sys.modules)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == "`max_steps` is not a known setting; it belongs to solve: solve(..., max_steps=...) False\n"


def test_what_belongs_to_a_purpose_under_another_name_is_noticed_at_once():
    def sovle(problem, gap=0.0):
        return problem, gap

    with pytest.raises(AssertionError, match="sovle belongs to problem"):
        belongs_to("problem")(sovle)
    with pytest.raises(AssertionError, match="solve takes something else"):
        sovle.__name__ = "solve"
        belongs_to("problem")(sovle)


def test_settings_of_a_scatter_are_those_of_its_parts_and_name_themselves():
    parts = [Balance, SamplingSettings, RunSettings, Standing, TargetSettings, BorderSettings]
    assert list(settings_of(ScatterSettings)) == [name for part in parts for name in settings_of(part)]
    for values, message in (
        ({"class_separation": 2}, "`class_separation` must be a number between 0"),
        ({"random_turn": math.inf}, "`random_turn` must be a number between 0 and 10000; got inf"),
        ({"max_steps": 0}, "`max_steps` must be a whole number of 1 or more"),
        (
            {"class_separation": 0.9, "non_overlap": [[1, 0, 1], [0, 1, 1], [1, 1, 1]]},
            "`non_overlap` cannot be combined with `class_separation`",
        ),
    ):
        with pytest.raises(EshError) as raised:
            ScatterSettings(**values)
        assert str(raised.value).startswith(message)
    assert ScatterSettings().avoid_overlap and not SamplingSettings().avoid_overlap


TABLES = {
    "Top level": (
        ProblemSettings,
        {
            "version",
            "[domain]",
            "[balance]",
            "[surface]",
            "[[class]]",
            "[image]",
            "[[fixed]]",
            "[[obstacle]]",
        },
        {},
    ),
    "`[domain]`": (Domain, set(), {}),
    "`[balance]`": (Balance, set(), {}),
    "`[[class]]`": (BodyClass, {"color"}, {"sizes": "[[class.size]]"}),
    "`[[class.size]]`": (Size, set(), {"line": "[class.size.line]"}),
    "`[class.size.line]`": (Line, set(), {}),
    "`[[fixed]]`": (FixedBodies, {"file"}, {}),
    "`[[obstacle]]`": (Obstacle, set(), {}),
}


@pytest.mark.parametrize("heading", TABLES)
def test_the_documentation_lists_every_key_of_a_recipe_with_its_default(heading):
    cls, more, shown_as = TABLES[heading]
    section = RECIPES.partition(f"### {heading}\n")[2].partition("###")[0]
    rows = re.findall(r"^\| `([^`]+)` \| .* \| ([^|]+) \|$", section, re.MULTILINE)
    assert {key for key, _ in rows} == {shown_as.get(key, key) for key in keys_of(cls)} - {None} | more
    known = {**(settings_of(Footprints) if cls is Size else {}), **settings_of(cls)}
    for key, written in rows:
        one = known.get(key)
        # What a density or a size is without the key, words say.
        if one is None or one.required or one.default is None or key in ("density", "size"):
            continue
        default = tomllib.loads(f"value = {written.strip('`')}")["value"]
        assert np.all(default == (list(one.default) if isinstance(one.default, tuple) else one.default)), key


def test_a_value_that_no_rule_follows_for_needs_a_check():
    @dataclasses.dataclass(frozen=True)
    class Wind(Settings):
        field: np.ndarray | None = dataclasses.field(default=None, metadata=setting("Where it blows"))

    with pytest.raises(AssertionError, match="field needs a check"):
        Wind()
