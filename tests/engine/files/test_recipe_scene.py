"""Fixed bodies and obstacles in recipes and files: what is written reads back, and mistakes are named."""

from pathlib import Path

import numpy as np
import pytest
from esh import (
    BodyClass,
    Domain,
    EshError,
    FixedBodies,
    Footprint,
    InputFileError,
    Line,
    Obstacle,
    Problem,
    Size,
    load_placement,
    read_fixed_bodies,
    read_recipe,
    solve,
    write_placement,
    write_recipe,
)
from esh.engine.files.recipe import recipe_densities
from esh.engine.files.recipe_scene import read_obstacles
from esh.engine.files.recipe_table import RecipeTable
from esh.engine.problem.settings import settings_of

HEAD = """
version = 1
[domain]
size = [20, 10]
[[class]]
name = "pine"
density = 1.0
[[class.size]]
name = "large"
area = 1.0
count = 30
[[class.size]]
name = "small"
area = [0.1, 0.3]
count = 20
[[class]]
name = "rock"
density = 1.0
[[class.size]]
name = "any"
area = 2.0
count = 0
"""
ROCK = '[[fixed]]\nclass = "rock"\nposition = [[15, 5]]\n'


def write(tmp_path, text, name="r.toml"):
    path = tmp_path / name
    path.write_text(HEAD + ROCK + text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def before():
    classes = [
        BodyClass("pine", [Size("large", 1.0, 5), Size("small", (0.1, 0.3), 4)]),
        BodyClass("rock", [Size("any", 2.0, 2, line=Line(1.0, 0.3))]),
    ]
    return solve(
        Problem(Domain((20.0, 10.0)), classes, fixed=FixedBodies([[3.0, 3.0]], id=[70])), device="cpu", max_steps=3
    )


@pytest.mark.parametrize("ending", [".csv", ".npz"])
def test_a_placement_that_was_written_can_be_fixed(before, tmp_path, ending):
    write_placement(tmp_path / f"before{ending}", before)
    problem = read_recipe(write(tmp_path, f'[[fixed]]\nfile = "before{ending}"\n'))
    table = problem.fixed
    assert len(table.id) == 13
    own = table.id >= 0
    order = np.argsort(table.id[own])
    expected = np.argsort(before.id)
    np.testing.assert_array_equal(table.position[own][order], before.position[expected])
    np.testing.assert_array_equal(table.area[own][order], before.area[expected])
    np.testing.assert_array_equal(table.size_index[own][order], before.size_index[expected])
    np.testing.assert_array_equal(table.angle[own][order], before.angle[expected])
    assert 70 in table.id


def test_files_say_who_was_fixed(before, tmp_path):
    write_placement(tmp_path / "a.csv", before)
    header, *lines = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
    assert header.endswith(",id,fixed")
    assert [line.endswith(",70,1") for line in lines].count(True) == 1
    write_placement(tmp_path / "a.npz", before)
    with np.load(tmp_path / "a.npz") as stored:
        assert stored["id"][stored["fixed"]].tolist() == [70]
        assert stored["size_name"].tolist().count("small") == 4


def test_a_table_from_elsewhere_needs_only_positions(tmp_path):
    (tmp_path / "t.csv").write_text("name,x,y\noak,1,2\n,3.5,4\n", encoding="utf-8")
    table = read_recipe(write(tmp_path, '[[fixed]]\nfile = "t.csv"\nclass = "pine"\nsize = "small"\n')).fixed
    assert table.position[:2].tolist() == [[1.0, 2.0], [3.5, 4.0]]
    assert table.size_index.tolist() == [1, 1, 0]
    assert table.area[:2].tolist() == [0.2, 0.2]
    np.savez(tmp_path / "t.npz", position=[[1.0, 2.0]])
    assert read_fixed_bodies(tmp_path / "t.npz").position.tolist() == [[1.0, 2.0]]


def test_bodies_and_obstacles_stand_in_a_recipe(tmp_path):
    np.save(tmp_path / "lake.npy", np.eye(4))
    text = """
[[fixed]]
position = [[1, 2], [3, 4]]
angle = [0.1, 0.2]
area = 4
id = [7, 8]
[[obstacle]]
polygon = [[0, 0], [4, 0], [4, 3]]
margin = 0.5
[[obstacle]]
disc = [10, 5, 2]
[[obstacle]]
image = "lake.npy"
invert = true
"""
    path = write(tmp_path, text)
    problem = read_recipe(path)
    assert problem.fixed.id.tolist() == [7, 8, -1]
    assert problem.fixed.angle.tolist() == [0.1, 0.2, 0.0]
    assert problem.fixed.area.tolist() == [4.0, 4.0, 2.0]
    polygon, disc, image = problem.obstacles
    assert polygon.polygon.tolist() == [[0, 0], [4, 0], [4, 3]]
    assert (polygon.margin, disc.disc) == (0.5, (10.0, 5.0, 2.0))
    np.testing.assert_array_equal(image.image, np.eye(4) == 0)
    assert [p.name for p in recipe_densities(path)] == ["lake.npy"]
    assert problem.body_count == 53
    # At the top, before the tables.
    whole = (
        path.read_text(encoding="utf-8")
        .replace("version = 1", "version = 1\ninclude_fixed = true")
        .replace("count = 0", "count = 1")
    )
    (tmp_path / "all.toml").write_text(whole, encoding="utf-8")
    assert read_recipe(tmp_path / "all.toml").body_count == 51


def test_a_problem_is_written_with_them_and_solves_to_the_same_bytes(tmp_path):
    lines = [Size("stick", 0.5, 9, line=Line(1.0))]
    problem = Problem(
        Domain((20.0, 10.0)),
        [BodyClass("pine", [Size("a", 0.5, 40)]), BodyClass("log", lines)],
        fixed=[
            FixedBodies([[1.0, 1.0 / 3.0], [2.0, 9.0]], "pine", id=[3, 9]),
            FixedBodies([[8.0, 8.0]], "log", length=2.0),
        ],
        include_fixed=True,
        obstacles=[
            Obstacle(disc=(5, 5, 1), margin=0.1),
            Obstacle(polygon=[[9, 9], [12, 9], [12, 7]]),
            Obstacle(image=np.eye(9)),
        ],
        avoid_overlap=True,
    )
    write_recipe(tmp_path / "r.toml", problem)
    again = read_recipe(tmp_path / "r.toml")
    assert again.body_count == problem.body_count == 49
    first, second = (solve(p, device="cpu", max_steps=5) for p in (problem, again))
    for name in ("position", "angle", "length", "area", "id", "fixed"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_a_ball_is_an_obstacle_of_a_surface():
    table = RecipeTable(Path("r.toml"), "", "", {"obstacle": [{"ball": [1, 2, 3, 0.5], "margin": 0.1}]})
    (ball,) = read_obstacles(table)
    assert (ball.ball, ball.margin) == ((1.0, 2.0, 3.0, 0.5), 0.1)
    for value in ([1, 2, 0.5], [1, 2, 3, 0], [1, 2, 3, "r"], 4):
        with pytest.raises(
            EshError, match=r"`obstacle\[1\].ball` must be x, y, z and a radius above 0, in meters; got"
        ):
            read_obstacles(RecipeTable(Path("r.toml"), "", "", {"obstacle": [{"ball": value}]}))


# Of every value that a recipe has of fixed bodies, one beside its default.
SAMPLES = {
    "position": [[1.0, 1.0 / 3.0], [7.0, 8.0]],
    "body_class": "log",
    "size": "b",
    "angle": [0.1 + 0.2, -1.0],
    "length": [1.0 / 3.0, 0.5],
    "area": [0.25, 0.1 + 0.2],
    "id": [7, 3],
    "variant": [1, 0],
    "scale": [1.0 / 3.0, 2.0],
}


@pytest.mark.parametrize("name", SAMPLES)
def test_every_value_of_fixed_bodies_is_written_and_read_back(tmp_path, name):
    assert SAMPLES.keys() == settings_of(FixedBodies).keys() - {"mesh", "triangle", "barycentric"}  # of surfaces
    outlines = [Footprint.disc(0.1), Footprint.rectangle(0.4, 0.2)]
    classes = [
        BodyClass("pine", [Size("a", None, 4, footprint=outlines), Size("b", 0.5, 4)]),
        BodyClass("log", [Size("a", 0.5, 4, line=Line(1.0)), Size("b", 0.5, 4, line=Line(1.0))]),
    ]
    given = {"position": SAMPLES["position"], name: SAMPLES[name]} | ({"body_class": "log"} if name == "length" else {})
    problem = Problem(Domain((9.0, 9.0)), classes, fixed=FixedBodies(**given))
    assert name == "position" or any(
        not np.array_equal(one, other, equal_nan=True)
        for one, other in zip(
            problem.fixed, Problem(problem.domain, classes, fixed=FixedBodies(given["position"])).fixed, strict=True
        )
    )
    write_recipe(tmp_path / "r.toml", problem)
    for one, other in zip(problem.fixed, read_recipe(tmp_path / "r.toml").fixed, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[fixed]]\n", r"`fixed\[2\].position` or `file` must be given: one of the two"),
        ('[[fixed]]\nposition = [[1, 2]]\nfile = "a.csv"\n', "`fixed.2..position` cannot be combined with `file`"),
        ('[[fixed]]\nfile = "a.csv"\nangle = 1\n', "`fixed.2..angle` is only for bodies that the recipe lists"),
        (
            '[[fixed]]\nfile = "a.csv"\n',
            "`fixed.2..file` cannot be used: .*a.csv does not exist; fixed bodies are a .npz or",
        ),
        ('[[fixed]]\nfile = "a.txt"\n', "must end in .csv, .npz, .usd, .* or .geojson; got the ending '.txt'"),
        ("[[fixed]]\nposition = [1, 2]\n", "`fixed.2..position` must be a list of positions, each x and y in meters"),
        (
            "[[fixed]]\nposition = [[1, 2]]\nangle = true\n",
            "`fixed.2..angle` must be a number, or a list of one for every",
        ),
        (
            "[[fixed]]\nposition = [[1, 2]]\nbarycentric = [[1, 0, 0], [0, 1, 0]]\n",
            r"r\.toml: `fixed\[2\]\.barycentric` must have shape \[1, 3\]; got shape \[2, 3\]$",
        ),
        (
            '[[fixed]]\nposition = [[1, 2]]\nclass = "oak"\n',
            '`fixed.2.`, body 1: `fixed.class` must be one of "pine", "rock"',
        ),
        (
            "[[fixed]]\nposition = [[1, 2], [30, 1]]\n",
            r"r\.toml: `fixed\[2\]`, body 2: `fixed\.position` must lie inside the domain, .*; got \[30\.0, 1\.0\]",
        ),
        ("[[fixed]]\nposition = [[1, 2]]\nid = [0.5]\n", "`fixed.2..id` must be whole numbers of 0 or more"),
        (
            "[[fixed]]\nposition = [[1, 2]]\npositon = 1\n",
            "`fixed.2..positon` is not a known key; did you mean `position`",
        ),
        ("[[obstacle]]\nmargin = 1\n", "`obstacle.1.`: an obstacle must have one of"),
        ("[[obstacle]]\ndisc = [1, 2]\n", "`obstacle.1..disc` must be x, y and a radius above 0, in meters; got"),
        ("[[obstacle]]\ndisc = [1, 2, 3]\nmargin = -1\n", "`obstacle.1..margin` must be a number between 0 and"),
        (
            "[[obstacle]]\ndisc = [1, 2, 3]\ninvert = true\n",
            "`obstacle.1..invert` is only for an obstacle that is an `image`",
        ),
        ('[[obstacle]]\nimage = "no.png"\n', "`obstacle.1..image` cannot be used: .*no.png does not exist"),
    ],
)
def test_mistakes_are_named(tmp_path, text, message):
    with pytest.raises(InputFileError, match=message):
        read_recipe(write(tmp_path, text))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x;y\n1;2\n", "must have a column `x`"),
        ("x,y\n1\n", "must have 2 cells in every line; line 2 has 1"),
        ("x,y\n1,b\n", 'must hold numbers in its column `y`; line 2 has "b"'),
        ("x,y,area\n1,2,3\n1,2,-3\n", r"t\.csv, line 3: `fixed\.area` must be above 0, and finite; got -3"),
        ("x,y,scale\n\n1,2,\n1,2,inf\n", r"t\.csv, line 4: `fixed\.scale` must be above 0, and finite; got inf"),
        ("x,y,length\n1,2,0\n1,2,-1\n", r"t\.csv, line 3: `fixed\.length` must be above 0"),
        ("x,y,variant\n1,2,0\n1,2,-2\n", r"t\.csv, line 3: `fixed\.variant` must be whole numbers"),
        ("x,y,angle\n1,2,0\n1,2,nan\n", r"t\.csv, line 3: `fixed\.angle` must be finite everywhere"),
        ("x,y\n1,2\n1,inf\n", r"t\.csv, line 3: `fixed\.position` must be finite everywhere"),
        ("", "must have a column `x`"),
        ("X,Y\n1,2\n", 'must name its columns in small letters; it has "X"'),
        ("x,y,Angle\n1,2,1\n", 'small letters; it has "Angle"'),
        ("x,x,y\n1,2,3\n", "must have one column `x`; it has 2"),
        ("x,y,class_index\n1,2,0\n1,2,0.5\n", 'must hold whole numbers in its column `class_index`; line 3 has "0.5"'),
        ("x,y,size_index\n1,2,nan\n", 'must hold whole numbers in its column `size_index`; line 2 has "nan"'),
        ("x,y,variant\n1,2,1e20\n", 'whole numbers of at most 32 bits in its column `variant`; line 2 has "1e20"'),
        ("x,y,id\n1,2,-9223372036854775809\n", "whole numbers of at most 64 bits in its column `id`; line 2"),
        ("x,y,id\n1,2,-1\n1,2,-5\n", "line 3: `fixed.id` must be whole numbers of 0 or more, .*; got -5$"),
    ],
)
def test_damaged_tables_are_named(tmp_path, content, message):
    path = tmp_path / "t.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputFileError, match=message):
        read_fixed_bodies(path)


def test_cells_of_columns_that_nobody_reads_may_hold_anything(tmp_path):
    (tmp_path / "t.csv").write_text("note,x,note,y,variant,id,\na,1,b,2,,7.0,\nc,3,d,4,2,8e0,\n", encoding="utf-8")
    bodies = read_fixed_bodies(tmp_path / "t.csv")
    assert bodies.position.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert bodies.variant.tolist() == [0, 2] and bodies.id.tolist() == [7, 8]


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_a_table_in_another_encoding_is_to_be_saved_as_utf_8(tmp_path, encoding):
    path = tmp_path / "t.csv"
    path.write_text("x,y,class_name\n1,2,d\u00f6rr\n", encoding=encoding)
    for read in (read_fixed_bodies, load_placement):
        with pytest.raises(InputFileError, match=r"t\.csv must be text in UTF-8; save it as UTF-8"):
            read(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x,y\n1,1\n30,1\n", r"line 3: `fixed\.position` must lie inside the domain, .*; got \[30\.0, 1\.0\]"),
        ("x,y,class_name\n1,1,oak\n", r'line 2: `fixed\.class` must be one of "pine", "rock"; got "oak"'),
        ("x,y,size_name\n\n1,1,\n", r'line 3: `fixed\.size` of class "pine" must be one of .*; got ""'),
        ("x,y,id\n1,1,3\n2,1,4\n2,2,3\n", r"line 4: `fixed\.id` must differ from body to body; got 3 twice"),
    ],
)
def test_what_does_not_fit_the_problem_is_told_with_its_line(tmp_path, content, message):
    (tmp_path / "t.csv").write_text(content, encoding="utf-8")
    with pytest.raises(InputFileError, match=rf"r\.toml: .*t\.csv, {message}"):
        read_recipe(write(tmp_path, '[[fixed]]\nposition = [[2, 2]]\n[[fixed]]\nfile = "t.csv"\n'))


def test_what_the_recipe_says_itself_has_no_line(tmp_path):
    np.savez(tmp_path / "t.npz", position=[[1.0, 2.0], [5.0, 2.0]])
    with pytest.raises(InputFileError, match=r"r\.toml: `fixed\.class` must be one of"):
        read_recipe(write(tmp_path, '[[fixed]]\nfile = "t.npz"\nclass = "oak"\n'))
    np.savez(tmp_path / "t.npz", position=[[1.0, 2.0], [50.0, 2.0]])
    with pytest.raises(InputFileError, match=r"r\.toml: .*t\.npz, body 2: `fixed\.position` must lie inside"):
        read_recipe(write(tmp_path, '[[fixed]]\nfile = "t.npz"\n'))


def test_arrays_have_all_that_tables_have(tmp_path):
    """NaN stands for what is not said, as an empty cell does."""
    given = {"variant": [1, 0], "scale": [0.5, np.nan], "area": [np.nan, 2.0], "id": [7, -1]}
    np.savez(tmp_path / "t.npz", position=[[1.0, 2.0], [3.0, 4.0]], **given)
    (tmp_path / "t.csv").write_text("x,y,variant,scale,area,id\n1,2,1,0.5,,7\n3,4,0,,2,-1\n", encoding="utf-8")
    for ending in (".npz", ".csv"):
        bodies = read_fixed_bodies(tmp_path / f"t{ending}")
        for name, values in given.items():
            np.testing.assert_array_equal(getattr(bodies, name), values, ending)


def test_damaged_archives_are_named(tmp_path):
    path = tmp_path / "t.npz"
    path.write_bytes(b"PK nothing")
    with pytest.raises(InputFileError, match="cannot be read"):
        read_fixed_bodies(path)
    np.savez(path, points=[[1.0, 2.0]])
    with pytest.raises(InputFileError, match="must hold an array `position`; it holds"):
        read_fixed_bodies(path)
    np.savez(path, position=[[1.0, 2.0]], class_index=[3], class_name=["a"])
    with pytest.raises(EshError, match="must have a name for every `class_index`; it has 1 names"):
        read_fixed_bodies(path)
    np.savez(path, position=[[1.0, 2.0]], class_index=[0.5], class_name=["a"])
    with pytest.raises(EshError, match="must have a name for every `class_index`; it has 1 names"):
        read_fixed_bodies(path)
    np.savez(path, position=np.zeros((1, 2), "datetime64[s]"))
    with pytest.raises(EshError, match=r"`fixed\.position` must be a list of positions, .*; got \[\['1970-01-01T"):
        read_fixed_bodies(path)
    np.savez(path, position=[[1.0, 2.0]] * 2, scale=[1.0, -1.0])
    with pytest.raises(EshError, match=r"t\.npz, body 2: `fixed\.scale` must be above 0"):
        read_fixed_bodies(path)
    np.savez(path, position=[[1.0, 2.0]], id=[-5])
    with pytest.raises(EshError, match=r"`fixed\.id` must be whole numbers .*; got -5$"):
        read_fixed_bodies(path)


def test_what_only_is_called_an_archive_is_told(tmp_path):
    path = tmp_path / "t.npz"
    path.write_text("x,y\n1,2\n", encoding="utf-8")
    for read in (read_fixed_bodies, load_placement):
        with pytest.raises(InputFileError, match=r"must hold several named arrays, .*; it holds something else, or is"):
            read(path)
    np.savez(path, position=np.array([None, 1], dtype=object))
    for read in (read_fixed_bodies, load_placement):
        with pytest.raises(InputFileError, match=r"it holds objects of Python, which may be anything$"):
            read(path)


def test_files_of_fixed_bodies_that_hold_something_else_are_named(tmp_path):
    table, array = tmp_path / "t.csv", tmp_path / "t.npz"
    table.write_text("x,y,id\n1,2,99999999999999999999\n", encoding="utf-8")
    with pytest.raises(EshError, match="id"):
        read_fixed_bodies(table)
    with array.open("wb") as file:
        np.save(file, np.zeros((3, 2)))
    with pytest.raises(InputFileError, match="several named arrays"):
        read_fixed_bodies(array)
    with pytest.raises(InputFileError, match="cannot be read as NumPy arrays"):
        load_placement(array)
