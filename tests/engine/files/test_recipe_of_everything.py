"""Recipes of lines, ranges, shares, overlap and inks, and what is said of mistakes in them."""

import numpy as np
import pytest
from esh.engine.errors import InputFileError
from esh.engine.files.recipe import read_recipe, recipe_densities
from PIL import Image

LINES = """
version = 1
avoid_overlap = true
[domain]
size = [40.0, 30.0]
[balance]
size_emphasis = [2.0]
non_overlap = [[1, 0], [0, 1]]
[[class]]
name = "stick"
density = "gray.png"
count = 100
density_correction = true
unsharp = { amount = 0.5, radius = 1.5 }
[[class.size]]
name = "long"
area = 2.0
share = 0.5
[class.size.line]
length = "gray.png"
length_range = [1.0, 2.0]
direction = "flow.png"
direction_kind = "vector"
width = 0.2
charges = 5
middle_charge = 4
turn_weights = [0.3, 0.5]
stretch_weights = [0.0, 0.1]
straightness = 0.25
tensor_scales = [1.0, 2.0]
[[class.size]]
name = "short"
area = 1.0
share = 0.5
[[class]]
name = "stone"
density = 0.5
[[class.size]]
name = "any"
area = 0.75
count = 20
"""

INKS = """
version = 1
[domain]
size = [32.0, 32.0]
[image]
file = "color.png"
model = "CMYK"
area = 1.0
"""


@pytest.fixture
def folder(tmp_path):
    gray = np.linspace(0, 255, 32 * 32).reshape(32, 32).astype(np.uint8)
    Image.fromarray(gray, "L").save(tmp_path / "gray.png")
    flow = np.full((4, 4, 3), 128, np.uint8)
    flow[..., 0] = 255
    Image.fromarray(flow, "RGB").save(tmp_path / "flow.png")
    Image.fromarray(np.full((4, 4, 3), 128, np.uint8), "RGB").save(tmp_path / "still.png")
    color = np.random.default_rng(0).integers(0, 255, (32, 32, 4)).astype(np.uint8)
    Image.fromarray(color, "RGBA").save(tmp_path / "color.png")
    Image.fromarray(np.full((8, 8, 3), 255, np.uint8), "RGB").save(tmp_path / "white.png")
    Image.fromarray(np.zeros((4, 4, 3), np.uint8), "RGB").save(tmp_path / "black.png")
    return tmp_path


def write(folder, text):
    path = folder / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_key_of_lines_arrives(folder):
    path = write(folder, LINES)
    problem = read_recipe(path)
    assert problem.avoid_overlap
    assert problem.balance.size_emphasis == (2.0,)
    np.testing.assert_array_equal(problem.balance.non_overlap, np.eye(2))
    stick = problem.classes[0]
    # Half of the charge in bodies twice as large: a third of the bodies.
    assert [size.count for size in stick.sizes] == [33, 67]
    assert stick.asked.density_correction
    assert (stick.asked.unsharp.amount, stick.asked.unsharp.radius) == (0.5, 1.5)
    line = stick.sizes[0].line
    assert (line.width, line.charges, line.middle_charge, line.straightness) == (0.2, 5, 4.0, 0.25)
    assert (line.turn_weights, line.stretch_weights, line.tensor_scales) == ((0.3, 0.5), (0.0, 0.1), (1.0, 2.0))
    assert line.length.min() == pytest.approx(1.0) and line.length.max() == pytest.approx(2.0)
    np.testing.assert_allclose(line.direction[..., 0], 1.0)
    np.testing.assert_array_equal(line.direction[..., 1], 0.0)
    assert [p.name for p in recipe_densities(path)] == ["gray.png", "gray.png", "flow.png"]


def test_an_image_with_alpha_becomes_one_class_per_ink(folder):
    path = write(folder, INKS)
    problem = read_recipe(path)
    assert [c.name for c in problem.classes] == ["C", "M", "Y", "K"]
    assert problem.balance.non_overlap.tolist()[3] == [1, 1, 1, 1]
    for c in problem.classes:
        assert abs(c.body_count - c.density_image.mean() * 32 * 32) <= 0.5
    assert [p.name for p in recipe_densities(path)] == ["color.png"]


MISTAKES = {
    "matrix not symmetric": ("[[1, 0], [0, 1]]", "[[1, 0.5], [0, 1]]", "`balance.non_overlap` must be symmetric"),
    "matrix of another size": ("[[1, 0], [0, 1]]", "[[1]]", "must have one row per class, 2; got 1"),
    "emphasis falls": (
        "[2.0]",
        "[3.0, 2.0]",
        "lower 3 to 2 or less, because with 2 after it the interaction matrix has the eigenvalue",
    ),
    "shares": (
        "share = 0.5\n[class.size.line]",
        "share = 0.7\n[class.size.line]",
        "must add up to 1; they add up to 1.2",
    ),
    "count and share": ("area = 1.0\nshare = 0.5", "area = 1.0\ncount = 3", "`class[1].size[2].count`"),
    "length 0": ("length_range = [1.0, 2.0]", "length_range = [0, 2.0]", "`class[1].size[1].line.length_range`"),
    "longer than the domain": (
        "length_range = [1.0, 2.0]",
        "length_range = [1.0, 99.0]",
        "longer than the domain, 40 m; got 99",
    ),
    "one charge": ("charges = 5", "charges = 1", "`class[1].size[1].line.charges`"),
    "no direction": ('direction = "flow.png"', 'direction = "still.png"', "all its vectors are 0"),
    "weights": ("turn_weights = [0.3, 0.5]", "turn_weights = [0.8, 0.5]", "must not add up to more than 1"),
    "straightness": ("straightness = 0.25", "straightness = 1.5", "between 0 and 1; got 1.5"),
    "unsharp": ("radius = 1.5", "radius = 0", "`class[1].unsharp.radius`"),
    "switch": ("avoid_overlap = true", 'avoid_overlap = "yes"', "`avoid_overlap` must be true or false"),
    "unknown key": ("charges = 5", "charge = 5", "did you mean `charges`"),
    "kind": ('"vector"', '"flow"', 'must be "angle" or "vector"'),
    "negative length": (
        'length = "gray.png"\nlength_range = [1.0, 2.0]',
        "length = -1",
        '`class[1].size[1].line.length` (class "stick", size "long") must be a number in meters above 0, and finite; got -1',
    ),
    "no length": ('length = "gray.png"\nlength_range = [1.0, 2.0]', "", "`class[1].size[1].line.length` (class"),
    "length is a word": ('length = "gray.png"', 'length = "long"', 'or the name of an image; got "long"'),
    "length without a range": ("length_range = [1.0, 2.0]\n", "", "`class[1].size[1].line.length_range`"),
    "range without an image": (
        'length = "gray.png"',
        "length = 1.0",
        "is only for a `length` that is an image; `length` is 1",
    ),
    "direction is a word": (
        'direction = "flow.png"\ndirection_kind = "vector"',
        'direction = "up"',
        'must be "density", "none", an angle in radians or the name of an image; got "up"',
    ),
    "direction of zeros": (
        'direction = "flow.png"',
        'direction = "black.png"',
        "must have a direction somewhere; red and green of its image are 0 everywhere, and 0.5 means none",
    ),
    "kind without an image": ('"flow.png"', "0.5", "is only for a `direction` that is an image; `direction` is 0.5"),
    "line is a number": (
        LINES[LINES.index("[class.size.line]") : LINES.index('[[class.size]]\nname = "short"')],
        "line = 3\n",
        '`class[1].size[1].line` (class "stick", size "long") must be one table, under a line [class.size.line]; got 3',
    ),
    "unsharp is a number": (
        "unsharp = { amount = 0.5, radius = 1.5 }",
        "unsharp = 3",
        '`class[1].unsharp` (class "stick") must be one table, under a line [class.unsharp]; got 3',
    ),
    "negative amount": (
        "amount = 0.5",
        "amount = -1",
        '`class[1].unsharp.amount` (class "stick") must be a number of 0',
    ),
    "count of a word": (
        "count = 100",
        'count = "many"',
        'must be a whole number of at least 1, or "cover"; got "many"',
    ),
    "cover of more than everything": (
        "count = 100\ndensity_correction = true\nunsharp = { amount = 0.5, radius = 1.5 }",
        "count = \"cover\"\n[[class.size]]\nname = 'x'\narea = 0.1\nshare = 0.5",
        "must add up to 1; they add up to 1.5",
    ),
    "range upside down": (
        "area = 2.0",
        "area = [2.0, 1.0]",
        "must be a range with its smallest area first; got [2.0, 1.0]",
    ),
    "distribution": (
        "area = 2.0",
        'area = [1.0, 2.0]\ndistribution = "normal"',
        'must be "linear" or "uniform", or a list',
    ),
    "distribution beyond the range": (
        "area = 0.75\ncount = 20",
        "area = [0.5, 1.0]\ncount = 2\ndistribution = [0.5, 1.5]",
        "must lie within the `area`, 0.5 to 1; got 0.5 to 1.5",
    ),
    "distribution of another count": (
        "area = 0.75\ncount = 20",
        "area = [0.5, 1.0]\ncount = 3\ndistribution = [0.5, 1.0]",
        "must hold one area per body, 3; got 2",
    ),
    "not positive semidefinite": (
        "[2.0]\nnon_overlap = [[1, 0], [0, 1]]",
        "2.0\nclass_separation = 0.9\nnon_overlap = [[1, 0, 1], [0, 1, 1], [1, 1, 1]]",
        "cannot be combined with `class_separation` 0.9, because their interaction matrix would have the eigenvalue -0.273, "
        "which is below 0; lower `class_separation` to 0.707 or less",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_one_sentence_names_what_is_wrong_with_lines(folder, mistake):
    before, after, expected = MISTAKES[mistake]
    assert LINES.count(before) == 1
    with pytest.raises(InputFileError) as raised:
        read_recipe(write(folder, LINES.replace(before, after)))
    assert expected in str(raised.value)
    assert "\n" not in str(raised.value)


INK_MISTAKES = {
    "unknown model": ('model = "CMYK"', 'model = "RGB"', "must be one of CMY, CMYK"),
    "inks without cyan": (
        'model = "CMYK"',
        'inks = [{ name = "M", cmy = [0, 1, 0] }]\nnon_overlap = [[1]]',
        "must hold cyan",
    ),
    "matrix of another size": (
        'model = "CMYK"',
        'inks = [{ name = "C", cmy = [1, 0, 0] }, { name = "M", cmy = [0, 1, 0] }, { name = "Y", cmy = [0, 0, 1] }]\n'
        "non_overlap = [[1, 0], [0, 1]]",
        "one row and column per ink, 3; got 2",
    ),
    "not positive semidefinite": (
        "[image]",
        "[balance]\nclass_separation = 0.9\n[image]",
        "would have the eigenvalue -0.559, which is below 0; lower `class_separation` to 0.577 or less",
    ),
    "white": ('"color.png"', '"white.png"', "the image is white"),
    "missing": ('"color.png"', '"none.png"', "`image.file` cannot be used"),
}


@pytest.mark.parametrize("mistake", INK_MISTAKES)
def test_one_sentence_names_what_is_wrong_with_inks(folder, mistake):
    before, after, expected = INK_MISTAKES[mistake]
    assert INKS.count(before) == 1
    with pytest.raises(InputFileError) as raised:
        read_recipe(write(folder, INKS.replace(before, after)))
    assert expected in str(raised.value)
