"""Recipes: what they mean, and one sentence for everything that they cannot mean."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from esh import EshError, InputFileError, Problem, ProblemError, read_recipe
from esh.engine.files.recipe import recipe_densities
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

EXAMPLE = Path(__file__).parents[3] / "demo_scenes" / "recipes" / "meadow.toml"

COMPLETE = """
version = 1
seed = 7
[domain]
size = [40.0, 30]
boundary = "periodic"
[balance]
class_separation = 0.25
size_emphasis = 3
[[class]]
name = "pine"
density = "pine.png"
invert = true
[[class.size]]
name = "large"
area = 3.0
count = 120
[[class.size]]
name = "small"
area = 1
count = 300.0
[[class]]
name = "beech"
density = 0.5
[[class.size]]
name = "only"
area = 2.5
count = 60
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    Image.fromarray(np.array([[0, 51], [102, 255]], np.uint8)).save(tmp_path / "pine.png")
    return tmp_path


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "forest.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def complaint(folder: Path, text: str | bytes) -> str:
    with pytest.raises(InputFileError) as refusal:
        read_recipe(write(folder, text))
    sentence = str(refusal.value)
    assert sentence.startswith(str(folder / "forest.toml")) and sentence.isprintable()
    return sentence.removeprefix(str(folder / "forest.toml"))


def test_every_key_arrives(folder):
    problem = read_recipe(write(folder, COMPLETE))
    assert problem.seed == 7
    assert (problem.domain.size, problem.domain.boundary) == ((40.0, 30.0), "periodic")
    assert (problem.balance.class_separation, problem.balance.size_emphasis) == (0.25, 3.0)
    pine, beech = problem.classes
    assert (pine.name, beech.name) == ("pine", "beech")
    assert [(s.name, s.area, s.count) for s in pine.sizes] == [("large", 3.0, 120), ("small", 1.0, 300)]
    assert [(s.name, s.area, s.count) for s in beech.sizes] == [("only", 2.5, 60)]
    np.testing.assert_allclose(pine.density_image, [[1, 0.8], [0.6, 0]], atol=1e-6)
    assert beech.density_image.shape == (1, 1) and beech.density_image[0, 0] == 0.5


def test_defaults(folder):
    text = (
        'version=1\n[domain]\nsize=[1,2]\n[[class]]\nname="a"\ndensity=1\n[[class.size]]\nname="b"\narea=1\ncount=1\n'
    )
    problem = read_recipe(write(folder, text))
    assert (problem.seed, problem.domain.boundary) == (0, "open")
    assert (problem.balance.class_separation, problem.balance.size_emphasis) == (0.5, 2.0)


def test_the_seed_given_wins(folder):
    path = write(folder, COMPLETE)
    assert read_recipe(path, seed=11).seed == 11
    assert read_recipe(str(path), seed=0).seed == 0
    with pytest.raises(ProblemError, match="`seed` must be a whole number"):
        read_recipe(path, seed=-1)


def test_a_byte_order_mark_and_windows_line_ends_are_fine(folder):
    assert read_recipe(write(folder, b"\xef\xbb\xbf" + COMPLETE.replace("\n", "\r\n").encode())).seed == 7


def test_densities_are_found_beside_the_recipe_from_anywhere(folder, tmp_path_factory, monkeypatch):
    path = write(folder, COMPLETE)
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert isinstance(read_recipe(path), Problem)
    assert recipe_densities(path) == [folder / "pine.png"]


def test_the_example_is_what_its_comment_says():
    problem = read_recipe(EXAMPLE)
    assert [(k.name, [s.name for s in k.sizes]) for k in problem.classes] == [
        ("shrub", ["large", "small"]),
        ("tussock", ["large", "small"]),
    ]
    dry, banks = (k.density_image for k in problem.classes)
    assert dry.shape == banks.shape
    water = (dry == 0) & (banks == 0)
    assert 0.03 < water.mean() < 0.2  # the brook
    assert len(np.unique(banks)) > 1000  # 16 bits


# (what is replaced in COMPLETE, by what, what the sentence must hold)
MISTAKES = {
    "version missing": ("version = 1", "", "`version` is missing: write `version = 1` at the top of the recipe"),
    "version unknown": ("version = 1", "version = 2", "`version` must be 1, the only version; got 2"),
    "version text": ("version = 1", 'version = "1"', "`version` must be 1"),
    "version true": ("version = 1", "version = true", "`version` must be 1"),
    "seed": ("seed = 7", "seed = -7", "`seed` must be a whole number of at least 0 and below 2**63; got -7"),
    "seed fraction": ("seed = 7", "seed = 7.5", "`seed` must be a whole number"),
    "unknown top key": ("seed = 7", "sede = 7", "`sede` is not a known key; did you mean `seed`"),
    "unknown key, far": (
        "seed = 7",
        "wxyz = 7",
        "`wxyz` is not a known key; known are version, seed, avoid_overlap, regularity, include_fixed, domain",
    ),
    "unknown class key, in British spelling": (
        "density = 0.5",
        'density = 0.5\ncolour = "red"',
        '`class[2].colour` (class "beech") is not a known key; did you mean `color`',
    ),
    "unknown domain key": ("boundary =", "boundry =", "`domain.boundry` is not a known key; did you mean `boundary`"),
    "unknown balance key": (
        "class_separation",
        "separation",
        "`balance.separation` is not a known key; did you mean `class_",
    ),
    "unknown class key": (
        "density = 0.5",
        "densty = 0.5",
        '`class[2].densty` (class "beech") is not a known key; did you mean `density`',
    ),
    "unknown size key": (
        "count = 60",
        "Count = 60",
        '`class[2].size[1].Count` (class "beech", size "only") is not a known key; did you mean `count`',
    ),
    "top key in a table": (
        'boundary = "periodic"',
        'boundary = "periodic"\navoid_overlap = true',
        "`domain.avoid_overlap` is not a known key here; it belongs at the top, before the first table",
    ),
    "class key at the top": (
        "seed = 7",
        "gap = 0.1",
        "`gap` is not a known key here; it belongs under [[class]] or under [[class.size]]",
    ),
    "size key at the top": (
        "seed = 7",
        "area = 7",
        "`area` is not a known key here; it belongs under [[class.size]] or under [image]",
    ),
    "size key in a class": (
        "density = 0.5",
        "density = 0.5\nturn = 0.1",
        '`class[2].turn` (class "beech") is not a known key here; it belongs under [[class.size]]',
    ),
    "class key in a size": (
        "count = 60",
        "count = 60\ndensity = 0.5",
        '`class[2].size[1].density` (class "beech", size "only") is not a known key here; it belongs under [[class]]',
    ),
    "balance key at the top": (
        "seed = 7",
        "size_emphasis = 2",
        "`size_emphasis` is not a known key here; it belongs under [balance]",
    ),
    "option in the recipe": (
        "seed = 7",
        "max_steps = 7",
        "`max_steps` is not a known key here; it belongs in the command, as an option",
    ),
    "domain missing": (
        '[domain]\nsize = [40.0, 30]\nboundary = "periodic"',
        "",
        "`domain` is missing: write a table [domain]",
    ),
    "size missing": ("size = [40.0, 30]", "", "`domain.size` is missing"),
    "size zero": ("[40.0, 30]", "[40.0, 0]", "`domain.size` must be a number in meters above 0, and finite; got 0"),
    "size infinite": (
        "[40.0, 30]",
        "[inf, 30]",
        "`domain.size` must be a number in meters above 0, and finite; got inf",
    ),
    "size nan": ("[40.0, 30]", "[nan, 30]", "`domain.size` must be a number in meters above 0, and finite; got nan"),
    "one length": ("[40.0, 30]", "40.0", "`domain.size` must be two lengths in meters, x and y; got 40"),
    "three lengths": ("[40.0, 30]", "[1, 2, 3]", "`domain.size` must be two lengths in meters"),
    "boundary": (
        '"periodic"',
        '"mirrored"',
        '`domain.boundary` must be "open" or "mirror" or "natural" or "periodic"; got "mirrored"; did you mean "mirror"?',
    ),
    "domain twice": ("[domain]", "[[domain]]", "`domain` must be one table, under a line [domain]"),
    "alpha": ("0.25", "1.5", "`balance.class_separation` must be a number between 0"),
    "alpha text": ("0.25", '"half"', 'got "half"'),
    "emphasis": ("size_emphasis = 3", "size_emphasis = 0.9", "`balance.size_emphasis` must be a number of 1 or more"),
    "name missing": ('name = "pine"', "", "`class[1].name` is missing"),
    "name empty": ('name = "pine"', 'name = " "', "`class[1].name` must be text, and not empty"),
    "name number": ('name = "pine"', "name = 3", "`class[1].name` must be text, and not empty; got 3"),
    "class names": (
        'name = "beech"',
        'name = "pine"',
        '`class[2].name` must differ from that of class[1]; got "pine"',
    ),
    "size names": (
        'name = "small"',
        'name = "large"',
        '`class[1].size[2].name` (class "pine") must differ from that of size[1]; got "large"',
    ),
    "density missing": ("density = 0.5", "", '`class[2].density` (class "beech") is missing'),
    "density zero": ("density = 0.5", "density = 0", '`class[2].density` (class "beech") must be above 0'),
    "density negative": ("density = 0.5", "density = -1", "its smallest value is -1"),
    "density true": (
        "density = 0.5",
        "density = true",
        "must be the name of an image file or a number above 0; got True",
    ),
    "density list": ("density = 0.5", "density = [1]", "must be the name of an image file or a number above 0"),
    "density absent": ('"pine.png"', '"pin.png"', "pin.png does not exist; an image is a PNG, JPEG, EXR or .npy file"),
    "density of a kind": ('"pine.png"', '"pine.gif"', "got the ending '.gif'"),
    "invert text": (
        "invert = true",
        'invert = "yes"',
        '`class[1].invert` (class "pine") must be true or false; got "yes"',
    ),
    "invert number": (
        "density = 0.5",
        "density = 0.5\ninvert = true",
        "is only for a `density` that is an image; `density` is 0.5",
    ),
    "area zero": (
        "area = 2.5",
        "area = 0",
        '`class[2].size[1].area` (class "beech", size "only") must be a number in m²',
    ),
    "area negative": ("area = 2.5", "area = -2.5", "above 0, and finite; got -2.5"),
    "area text": ("area = 2.5", 'area = "2.5"', 'above 0, and finite; got "2.5"'),
    "area missing": ("area = 2.5", "", '`class[2].size[1].area` (class "beech", size "only") is missing'),
    "count zero": (
        "count = 60",
        "count = 0",
        '`count` of size "only" of class "beech" must be a whole number of at least 1, unless bodies of it are fixed; got 0',
    ),
    "count negative": ("count = 60", "count = -6", "must be a whole number of at least 1; got -6"),
    "count fraction": ("count = 60", "count = 6.5", "must be a whole number of at least 1; got 6.5"),
    "count infinite": ("count = 60", "count = inf", "must be a whole number of at least 1; got inf"),
    "count true": ("count = 60", "count = true", "must be a whole number of at least 1; got True"),
    "count text": ("count = 60", 'count = "60"', 'must be a whole number of at least 1; got "60"'),
    "count date": ("count = 60", "count = 2020-01-01", "must be a whole number of at least 1; got "),
    "no class": (COMPLETE[COMPLETE.index("[[class]]") :], "", "`class` is missing: write at least one table [[class]]"),
    "class in single brackets": (
        COMPLETE[COMPLETE.index("[[class]]") :],
        '[class]\nname = "a"',
        "`class` must be tables, each under a line [[class]]",
    ),
    "no size": (
        '[[class.size]]\nname = "only"\narea = 2.5\ncount = 60',
        "",
        '`class[2].size` (class "beech") is missing: write at least one table [[class.size]]',
    ),
    "size is a number": (
        '[[class.size]]\nname = "only"\narea = 2.5\ncount = 60',
        "size = 3",
        "must be tables, each under a line",
    ),
    "not TOML": ("seed = 7", "seed : 7", " is not TOML: "),
    "key twice": ("seed = 7", "seed = 7\nseed = 8", " is not TOML: "),
    "endless number": ("seed = 7", "seed = " + "9" * 5000, " is not TOML: "),
    "endless nesting": ("seed = 7", "seed = " + "[" * 100_000, " is not TOML: "),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_one_sentence_names_key_value_and_what_would_do(folder, mistake):
    before, after, expected = MISTAKES[mistake]
    assert COMPLETE.count(before) == 1
    assert expected in complaint(folder, COMPLETE.replace(before, after))


def test_what_is_not_text(folder):
    assert "is not UTF-8 text (byte 1)" in complaint(folder, b"\xff\xfe" + COMPLETE.encode("utf-16-le"))
    assert "is not TOML" in complaint(folder, (folder / "pine.png").read_bytes()[:0] + b"\0\1\2")


def test_what_is_not_a_file(tmp_path):
    with pytest.raises(InputFileError, match=r"absent\.toml does not exist; a recipe is a TOML file"):
        read_recipe(tmp_path / "absent.toml")
    with pytest.raises(InputFileError) as refusal:
        read_recipe(tmp_path)
    assert str(refusal.value) == f"{tmp_path} is a folder; a recipe is a TOML file"
    with pytest.raises(InputFileError, match="cannot be read"):
        read_recipe(tmp_path / "nul\0.toml")
    with pytest.raises(InputFileError, match="cannot be read"):
        read_recipe(tmp_path / ("x" * 5000))
    with (tmp_path / "film.toml").open("wb") as film:
        film.truncate(2**24 + 1)
    with pytest.raises(InputFileError, match="is larger than 16 MB"):
        read_recipe(tmp_path / "film.toml")
    if Path("/dev/zero").exists():
        with pytest.raises(InputFileError, match="is not a regular file"):
            read_recipe("/dev/zero")


LINES = range(len(COMPLETE.splitlines()))
KEYS = re.findall(r"^(\w+) =", COMPLETE, re.MULTILINE)
VALUES = [
    "",
    "1",
    "-1",
    "1e400",
    "nan",
    "true",
    '""',
    '"x"',
    "[]",
    "[1]",
    "[[1, 2], 3]",
    "{}",
    "{a = 1}",
    "1979-05-27",
    "07:32:00",
]


@given(
    line=st.sampled_from(LINES),
    key=st.sampled_from([None, *KEYS]),
    value=st.sampled_from(VALUES),
)
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_line_replaced_by_any_other_is_read_or_refused(folder, line, key, value):
    lines = COMPLETE.splitlines()
    lines[line] = "" if key is None else f"{key} = {value}"
    try:
        assert isinstance(read_recipe(write(folder, "\n".join(lines))), Problem)
    except EshError as error:
        assert str(folder / "forest.toml") in str(error) and str(error).isprintable()


@given(st.binary(max_size=200))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_are_refused(folder, content):
    with pytest.raises(InputFileError):
        read_recipe(write(folder, content))


def test_a_version_that_is_written_as_a_fraction_is_the_same(folder):
    assert isinstance(read_recipe(write(folder, COMPLETE.replace("version = 1", "version = 1.0"))), Problem)


@pytest.mark.parametrize("path", [None, 3, b"\x00", ["a.toml"]])
def test_what_is_no_name_of_a_recipe_is_a_sentence(path):
    with pytest.raises(InputFileError):
        read_recipe(path)


@pytest.mark.parametrize("path", [None, 3, ["recipe.toml"]])
def test_what_is_no_name_of_a_file_is_no_recipe(path):
    with pytest.raises(InputFileError, match="`path` must be the path of a recipe; got "):
        read_recipe(path)
