"""A problem that is written as a recipe reads back as the same problem; no setting is forgotten on the way."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest
from esh import EshError, read_recipe, solve, write_recipe
from esh.engine.files.recipe import recipe_colors
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass, ClassSettings, PlacingSettings, Unsharp
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.look_at import LookAt
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.prepared_class import PreparedClass
from esh.engine.problem.problem import Problem, ProblemSettings
from esh.engine.problem.settings import settings_of, values_of
from esh.engine.problem.size import Size
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).parents[3]
RECIPES = sorted([*(ROOT / "tests" / "recipes").glob("*.toml"), *(ROOT / "demo_scenes" / "recipes").glob("*.toml")])
IMAGE = np.random.default_rng(0).random((5, 7)).astype(np.float32)
VECTORS = np.random.default_rng(1).normal(size=(4, 6, 2)).astype(np.float32)

# Values beside the default of every setting that a recipe has. A new setting without one fails the first test.
SAMPLES = {
    Domain: {"size": [(7.5, 0.1 + 0.2)], "boundary": ["mirror", "natural", "periodic"], "inset": [True]},
    Balance: {
        "class_separation": [0.1 + 0.2],
        "size_emphasis": [1.0, [2.0, 3.5]],
        "non_overlap": [np.eye(2)],
        "rare_emphasis": [0.0, 0.1 + 0.2],
    },
    ProblemSettings: {
        "seed": [2**62 + 1],
        "avoid_overlap": [True],
        "regularity": [0.0, 0.1 + 0.2],
        "include_fixed": [True],
    },
    BodyClass: {
        "name": ['Bärlauch 木 "\\', "a"],
        "sizes": [[Size("a", 0.01, 3)]],
        "density": [0.1, IMAGE],
        "count": [7, "cover"],
        "density_correction": [True],
        "unsharp": [Unsharp(), Unsharp(0.3, 1.5)],
        "room": [1.25],
        "gap": [0.1],
        "clustering": [0.1 + 0.2, 1.0],
        "clump_size": [1.0 / 3.0],
        "look_at": [LookAt(), LookAt((1.0 / 3.0, -2.0, 0.0), 0.1 + 0.2, "x")],
    },
    LookAt: {"point": [(1.0, 2.0, 1.0 / 3.0)], "spread": [0.1 + 0.2], "front": ["x"]},
    Unsharp: {"amount": [0.0, 1.0 / 3.0], "radius": [1e-5], "overshoot": [0.25]},
    Size: {
        "name": ["größer ⌀ ≥ 1"],
        "area": [0.1 + 0.2, (0.1, 1.0 / 3.0)],
        "count": [12],
        "share": [1.0],
        "distribution": ["uniform", np.linspace(0.1, 1.0 / 3.0, 3)],
        "usual_area": [0.3],
        "line": [Line(0.5)],
        "footprint": [
            Footprints(
                [Footprint.rectangle(0.3, 0.1, 1.0 / 30.0), Footprint.disc(0.1)], weights=[1.0, 1.0 / 3.0], gap=0.01
            ),
            Footprints(
                Footprint.polygon([[0.0, 0.0], [0.1, 0.0], [0.0, 1.0 / 7.0]]),
                variant=[0, 0, 0],
                scale=[1.0, 2.0 / 3.0, 0.1 + 0.2],
                turn=[0.0, 1.0 / 3.0, -2.0],
                room=1.1,
            ),
            Footprints(Footprint.capsule(0.3, 0.1), scale=0.7, turn="random", scale_jitter=0.1, tilt=0.2),
            Footprints(Footprint.rectangle(0.3, 0.1), slope=VECTORS),
        ],
    },
    Footprints: {
        "variants": [Footprint.disc(0.1), [Footprint.rectangle(0.3, 0.1, 1.0 / 30.0), Footprint.disc(0.1)]],
        "weights": [[0.1 + 0.2, 1.0]],
        "variant": [[0, 1, 1]],
        "scale": [2.0 / 3.0, [1.0, 2.0 / 3.0, 0.1 + 0.2]],
        "scale_jitter": [1.0 / 3.0],
        "turn": ["random", 1.0 / 3.0, [0.0, 1.0 / 3.0, -2.0]],
        "may_turn": [True, False],
        "room": [1.1],
        "gap": [0.01],
        "slope": [VECTORS],
        "tilt": [0.1],
    },
    Obstacle: {
        "polygon": [[[0.0, 0.0], [1.0 / 3.0, 0.0], [0.0, 1.0]]],
        "disc": [(1.0 / 3.0, 1.0, 0.25)],
        "image": [np.eye(9) > 0.5],
        "margin": [0.1 + 0.2],
    },
    Line: {
        "length": [1.0 / 3.0, 0.5 + IMAGE],
        "direction": ["none", 0.1, 1, 7.0 * IMAGE, VECTORS],
        "width": [0.01],
        "charges": [5],
        "middle_charge": [1.0 / 3.0],
        "turn_weights": [(0.1, 1.0 / 3.0)],
        "stretch_weights": [(0.0, 0.1)],
        "straightness": [0.0, 0.25],
        "tensor_scales": [(0.7, 2.0)],
    },
}


TWO = [Footprint.rectangle(0.3, 0.1), Footprint.disc(0.1)]
# Only for what lies on a surface, of which no recipe is written.
NOT_WRITTEN = {Obstacle: {"ball", "position", "normal", "tangent", "scale", "mesh", "triangle"}}


def same(one, other):
    """Whether two values are the same, to the last bit."""
    if dataclasses.is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, f.name), getattr(other, f.name)) for f in dataclasses.fields(one)
        )
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple | list):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and one == other


def problem_with(cls, name, value):
    """A problem in which one setting has this value."""
    own = {name: value}
    size = {"name": "s", "area": 0.01, "count": 3}
    body_class = {"name": "a", "sizes": [], "density": 1.0}
    if cls is Line:
        size["line"] = Line(**{"length": 0.5, **own})
    if cls is Size:
        size |= own
    if cls is Unsharp:
        body_class |= {"density": IMAGE, "unsharp": Unsharp(**own)}
    if cls is LookAt:
        body_class |= {"look_at": LookAt(**own)}
    if cls in (BodyClass, ClassSettings):
        body_class |= own
    if name == "distribution" or isinstance(size["area"], tuple):
        size["area"] = (0.1, 1.0 / 3.0)
    if body_class.get("count") is not None or size.get("share") is not None:
        body_class["count"] = body_class.get("count") or 12
        size |= {"count": None, "share": 1.0}
    if cls is Footprints:
        size |= {"area": None, "footprint": Footprints(**{"variants": TWO, **own})}
    classes = [BodyClass(**{**body_class, "sizes": body_class["sizes"] or [Size(**size)]})]
    if isinstance(value, list) and name == "size_emphasis":
        classes.append(BodyClass("b", [Size(str(area), area, 4) for area in (0.01, 0.02, 0.03)]))
    if name == "non_overlap":
        classes.append(BodyClass("b", [Size("s", 0.02, 4)]))
    return Problem(
        Domain(**{"size": (4.0, 3.0), **(own if cls is Domain else {})}),
        classes,
        Balance(**(own if cls is Balance else {})),
        obstacles=[Obstacle(**({"disc": (1.0, 1.0, 0.5)} if name == "margin" else {}), **own)]
        if cls is Obstacle
        else (),
        **(own if cls is ProblemSettings else {"avoid_overlap": True} if name == "inset" else {}),
    )


@pytest.mark.parametrize("cls", SAMPLES, ids=lambda cls: cls.__name__)
def test_every_setting_has_a_sample(cls):
    assert SAMPLES[cls].keys() == settings_of(cls).keys() - NOT_WRITTEN.get(cls, set())
    for name, values in SAMPLES[cls].items():
        default = settings_of(cls)[name].default
        assert not any(same(value, default) for value in values), f"{name} is at its default"


CASES = [(cls, name, value) for cls, of in SAMPLES.items() for name, values in of.items() for value in values]


@pytest.mark.parametrize(("cls", "name", "value"), CASES, ids=[f"{cls.__name__}.{name}" for cls, name, _ in CASES])
def test_every_setting_reads_back_as_it_was_written(tmp_path, cls, name, value):
    problem = problem_with(cls, name, value)
    write_recipe(tmp_path / "r.toml", problem)
    assert same(read_recipe(tmp_path / "r.toml"), problem)
    # As it was written: what is at its default is left out.
    again = tmp_path / "again"
    again.mkdir()
    write_recipe(again / "r.toml", read_recipe(tmp_path / "r.toml"))
    assert {p.name: p.read_bytes() for p in again.iterdir()} == {
        p.name: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()
    }


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.stem)
def test_every_recipe_of_the_project_reads_back_as_the_same_problem(tmp_path, recipe):
    problem = read_recipe(recipe)
    colors = recipe_colors(recipe, problem)
    write_recipe(tmp_path / recipe.name, problem, colors=colors)
    again = read_recipe(tmp_path / recipe.name)
    assert same(again, problem)
    assert recipe_colors(tmp_path / recipe.name, again) == colors


@pytest.mark.parametrize("name", ["lines-along-images-of-angle-vector-length", "inks-cmyk"])
def test_a_recipe_that_was_written_is_placed_in_the_same_bytes(tmp_path, name):
    problem = read_recipe(ROOT / "tests" / "recipes" / f"{name}.toml")
    write_recipe(tmp_path / "r.toml", problem)
    one, other = (solve(p, device="cpu", max_steps=8) for p in (problem, read_recipe(tmp_path / "r.toml")))
    for values in ("position", "angle", "length", "width", "area"):
        assert getattr(one, values).tobytes() == getattr(other, values).tobytes()


@given(names=st.lists(st.text(min_size=1), min_size=1, max_size=4, unique=True), area=st.floats(1e-6, 1e-3))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_names_of_any_letters_read_back(tmp_path, names, area):
    try:
        sizes = [Size(name, area, 2) for name in names]
        problem = Problem(Domain((1.0, 1.0)), [BodyClass(name, sizes) for name in names])
    except EshError:
        return
    write_recipe(tmp_path / "r.toml", problem)
    assert same(read_recipe(tmp_path / "r.toml"), problem)


def test_equal_images_are_one_file(tmp_path):
    classes = [BodyClass(name, [Size("s", 0.01, 3)], IMAGE) for name in "abc"]
    classes.append(BodyClass("d", [Size("s", 0.01, 3)], IMAGE[::-1]))
    write_recipe(tmp_path / "trees.toml", Problem(Domain((1.0, 1.0)), classes))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "trees-1-density.npy", "trees-2-density.npy", "trees.toml",
    ]  # fmt: skip


def test_a_class_that_was_not_asked_for_alone_is_written_as_it_is_placed(tmp_path):
    """Those of Blender: the slopes of the surface are in their densities."""
    placed = PreparedClass("a", (Size("s", 0.01, 3),), IMAGE, ("a note",))
    problem = Problem(Domain((1.0, 1.0)), [placed], seed=3)
    write_recipe(tmp_path / "r.toml", problem)
    (read,) = read_recipe(tmp_path / "r.toml").classes
    assert same(read.density_image, IMAGE) and same(read.sizes, placed.sizes)


def test_such_a_class_is_written_with_all_that_it_has_beside_its_density(tmp_path):
    given = {name: SAMPLES[BodyClass][name][0] for name in settings_of(PlacingSettings)}
    placed = PreparedClass("a", (Size("s", 0.01, 3),), IMAGE, **given)
    write_recipe(tmp_path / "r.toml", Problem(Domain((4.0, 4.0)), [placed]))
    (read,) = read_recipe(tmp_path / "r.toml").classes
    assert {name: getattr(read.asked, name) for name in given} == given == values_of(read, PlacingSettings)


def test_a_folder_that_is_not_there_is_said_and_nothing_is_written(tmp_path):
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.01, 3)], IMAGE)])
    with pytest.raises(EshError, match="there is no folder"):
        write_recipe(tmp_path / "absent" / "r.toml", problem)
    assert not os.listdir(tmp_path)


def test_arrays_of_lengths_and_directions_are_taken_as_they_are(tmp_path):
    np.save(tmp_path / "length.npy", (1.0 + IMAGE).astype(np.float64))
    np.save(tmp_path / "angle.npy", 5.0 * IMAGE)
    np.save(tmp_path / "flow.npy", VECTORS)
    text = (
        'version = 1\n[domain]\nsize = [4, 3]\n[[class]]\nname = "a"\ndensity = 1\n[[class.size]]\nname = "s"\narea = 0.1\n'
        'count = 3\n[class.size.line]\nlength = "length.npy"\n'
    )
    recipe = tmp_path / "r.toml"
    for more, direction in (
        ('direction = "angle.npy"\ndirection_kind = "radians"\n', 5.0 * IMAGE),
        ('direction = "flow.npy"\ndirection_kind = "vector"\n', VECTORS),
    ):
        recipe.write_text(text + more)
        line = read_recipe(recipe).classes[0].sizes[0].line
        np.testing.assert_array_equal(line.length, 1.0 + IMAGE)
        np.testing.assert_array_equal(line.direction, direction)
    for name, more, complaint in (
        ("gray.png", 'direction_kind = "radians"\n', "must be a .npy file; got the ending '.png'"),
        ("length.npy", 'direction_kind = "degrees"\n', '"radians" for a .npy file; got "degrees"'),
    ):
        recipe.write_text(f'{text}direction = "{name}"\n{more}')
        with pytest.raises(EshError) as raised:
            read_recipe(recipe)
        assert complaint in str(raised.value)
