"""Outlines in recipes: every form arrives, and mistakes are named by their keys."""

import pytest
from esh.engine.errors import InputFileError
from esh.engine.files.recipe import read_recipe

RECIPE = """
version = 1
avoid_overlap = true
[domain]
size = [40.0, 30.0]
inset = true
[[class]]
name = "a"
density = 1.0
[[class.size]]
name = "plank"
count = 20
footprint = { rectangle = [2, 0.3], rounding = 0.1 }
turn = "random"
scale_jitter = 0.25
gap = 0.1
[[class.size]]
name = "mixed"
area = [0.5, 2.0]
count = 30
footprint = [{ polygon = [[0, 0], [1, 0], [0, 1]], weight = 3 }, { disc = 0.5 }, { capsule = [2, 0.5] }]
turn = 0.5
room = 1.2
"""


def read(tmp_path, text):
    path = tmp_path / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    return read_recipe(path)


def test_every_key_of_outlines_arrives(tmp_path):
    problem = read(tmp_path, RECIPE)
    assert problem.domain.inset
    plank, mixed = (size.footprint for size in problem.classes[0].sizes)
    assert problem.classes[0].sizes[0].area is None
    assert plank.outlines[0].width == pytest.approx(0.5)
    assert (plank.turn, plank.scale_jitter, plank.gap, plank.room) == ("random", 0.25, 0.1, 1.0)
    assert [len(outline.corners) for outline in mixed.outlines] == [3, 1, 2]
    assert mixed.weights == (3.0, 1.0, 1.0)
    assert (mixed.turn, mixed.room) == (0.5, 1.2)
    assert problem.classes[0].sizes[1].area == (0.5, 2.0)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("{ rectangle = [2, 0.3], rounding = 0.1 }", '"box"', "`class[1].size[1].footprint`"),
        ("{ rectangle = [2, 0.3], rounding = 0.1 }", "{ box = [2, 0.3] }", "must be { disc = radius }"),
        ("{ rectangle = [2, 0.3], rounding = 0.1 }", "{ rectangle = 2 }", "`rectangle` must be two lengths in meters"),
        (
            "{ rectangle = [2, 0.3], rounding = 0.1 }",
            "{ disc = 1, rounding = 0.1 }",
            "only for a rectangle or a polygon",
        ),
        ("{ rectangle = [2, 0.3], rounding = 0.1 }", "{ polygon = [[0, 0], [1, 1]] }", "must not lie on one line"),
        ("{ rectangle = [2, 0.3], rounding = 0.1 }", "{ disc = -1 }", "`radius` of a disc must be a number"),
        ("footprint = { rectangle = [2, 0.3], rounding = 0.1 }", "area = 1.0", "only for a size with a `footprint`"),
        (
            'turn = "random"',
            'turn = "round"',
            '`class[1].size[1].turn` (class "a", size "plank") must be "free", "random"',
        ),
        (
            "scale_jitter = 0.25",
            "scale_jitter = 2",
            '`class[1].size[1].scale_jitter` (class "a", size "plank") must be below 1',
        ),
        ("gap = 0.1", "gap = 0.1\nroom = 2", "cannot be combined with a `gap`"),
        ("weight = 3", "weight = -3", "`weight` of"),
        ("gap = 0.1", "gaps = 0.1", "did you mean `gap`"),
        ("inset = true", 'inset = true\nboundary = "periodic"', "which has no edges"),
        ("avoid_overlap = true", "avoid_overlap = false", "it is contact that keeps footprints inside"),
    ],
)
def test_a_mistake_is_named_by_its_key(tmp_path, before, after, message):
    assert before in RECIPE
    with pytest.raises(InputFileError) as caught:
        read(tmp_path, RECIPE.replace(before, after, 1))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
