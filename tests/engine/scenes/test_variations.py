"""Which scenes a batch consists of."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from esh import EshError
from esh.engine.scenes.variations import parse_variation, scene_parameters, set_key, varied

RECIPE = {
    "domain": {"size": [4.0, 3.0]},
    "class": [
        {"name": "pine", "size": [{"name": "large", "area": 1.0, "count": 3}, {"name": "2", "area": 0.5, "count": 4}]},
        {"name": "beech", "size": [{"name": "only", "area": 1.0, "count": 2}]},
    ],
}


@pytest.mark.parametrize(
    ("text", "kind", "values"),
    [
        ("a=1:5", "range", (1, 5)),
        ("a = 0.5 : 2e1", "range", (0.5, 20.0)),
        ("a=-1:1.5:4", "range", (-1, 1.5)),
        ("a=normal(0.5, 1e-2)", "normal", (0.5, 0.01)),
        ("a=normal(300, 50)", "normal", (300, 50)),
        ("a=1, 2.5,true", "list", (1, 2.5, True)),
        ("a=left.png,right side.png", "list", ("left.png", "right side.png")),
        ('a="x,y",z', "list", ("x,y", "z")),
        ("a=[1, 2],[3, 4]", "list", ([1, 2], [3, 4])),
        ("a=7", "list", (7,)),
        ("class[pine].size[2].area=1:2", "range", (1, 2)),
    ],
)
def test_values_are_read(text, kind, values):
    variation = parse_variation(text)
    assert (variation.kind, variation.values) == (kind, values)
    assert [type(v) for v in variation.values] == [type(v) for v in values]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a", "must be KEY=VALUES"),
        ("=1", "must be KEY=VALUES"),
        ("a.=1", "must be KEY=VALUES"),
        ("a b=1", "must be KEY=VALUES"),
        ("a= ", "must be KEY=VALUES"),
        ("a=3:3", "from a smaller to a larger number; got '3:3'"),
        ("a=1:2:1", "at least 2 values"),
        ("a=normal(1, 0)", "above 0"),
    ],
)
def test_what_has_no_meaning_is_said(text, complaint):
    with pytest.raises(EshError, match=complaint):
        parse_variation(text)


def test_a_latin_hypercube_draws_every_share_once():
    variations = [parse_variation(text) for text in ("x=0.0:1.0", "y=normal(300, 20)", "z=1:4", "w=a,b")]
    scenes = list(scene_parameters(variations, range(100, 180), "latin"))
    assert [seed for seed, _ in scenes] == list(range(100, 180))
    x = np.array([values["x"] for _, values in scenes])
    np.testing.assert_array_equal(np.sort((80 * x).astype(int)), np.arange(80))
    y = np.array([values["y"] for _, values in scenes])
    assert y.mean() == pytest.approx(300.0, abs=0.5) and y.std() == pytest.approx(20.0, rel=0.05)
    assert np.bincount([values["z"] for _, values in scenes]).tolist() == [0, 20, 20, 20, 20]
    assert sorted(values["w"] for _, values in scenes) == ["a"] * 40 + ["b"] * 40
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.3
    # As ranges do, normal distributions of whole numbers give whole numbers: a count can be no other.
    assert {type(values[key]) for _, values in scenes for key in "yz"} == {int}
    # Another key more changes nothing of the others.
    fewer = list(scene_parameters(variations[:1], range(100, 180), "latin"))
    assert [values["x"] for _, values in fewer] == x.tolist()


def test_a_grid_is_all_combinations():
    variations = [parse_variation(text) for text in ("x=0.0:1.0:3", "z=1:10:4", "w=a,b")]
    scenes = list(scene_parameters(variations, range(2), "grid"))
    assert len(scenes) == 3 * 4 * 2 * 2
    assert sorted({values["z"] for _, values in scenes}) == [1, 4, 7, 10]
    assert len({(seed, *values.values()) for seed, values in scenes}) == len(scenes)
    with pytest.raises(EshError, match="--set y: a grid needs a list or a range with the number of its values"):
        list(scene_parameters([parse_variation("y=0:1")], range(2), "grid"))


def test_keys_are_found_by_number_and_by_name():
    before = copy.deepcopy(RECIPE)
    changed = varied(
        RECIPE,
        {
            "class[1].size[large].count": 9,
            "class[beech].count": 5,
            "domain.size[2]": 8.0,
            "balance.class_separation": 0.7,
            "class[pine].size[2].area": 0.1,
        },
    )
    assert before == RECIPE
    assert changed["class"][0]["size"][0]["count"] == 9
    assert changed["class"][1]["count"] == 5
    assert changed["domain"]["size"] == [4.0, 8.0]
    assert changed["balance"] == {"class_separation": 0.7}
    assert changed["class"][0]["size"][1]["area"] == 0.1


@pytest.mark.parametrize(
    ("key", "complaint"),
    [
        ("class[oak].count", r"there is no class\[oak\] in the recipe; it has pine, beech"),
        ("class[3].count", r"there is no class\[3\] in the recipe; it has pine, beech"),
        ("class.count", r"say which class, for example class\[1\]"),
        ("domain.size[3]", r"there is no size\[3\] in the recipe"),
        ("domain.size.x", "say which size"),
    ],
)
def test_keys_that_are_not_there_are_said(key, complaint):
    with pytest.raises(EshError, match=complaint):
        set_key(copy.deepcopy(RECIPE), key, 1)
