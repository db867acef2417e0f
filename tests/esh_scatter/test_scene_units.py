"""Lengths and areas are told in the units of a scene."""

import pytest

bpy = pytest.importorskip("bpy")
from esh.esh_scatter.result.scene_units import (  # noqa: E402
    area_unit,
    in_scene_units,
    length_text,
    sentence,
)

SAID = (
    "1 body lies in obstacles, the deepest by 0.5 m; the domain is 2 by 1.5 m, and a dot 0.04 m² of 1,200 m², "
    "at 3 m/s, tree2 m, 5 more"
)


@pytest.fixture
def scene(empty_file):
    made = bpy.data.scenes.new("units")
    yield made
    bpy.data.scenes.remove(made)


def test_meters_stay_as_they_were_said(scene):
    assert in_scene_units(scene, SAID) == SAID
    assert area_unit(scene) == "m²" and length_text(scene, 0.5) == "0.50 m"


def test_small_units_feet_and_none_are_told(scene):
    scene.unit_settings.scale_length = 0.01
    assert in_scene_units(scene, SAID) == (
        "1 body lies in obstacles, the deepest by 5 mm; the domain is 0.02 m by 0.015 m, and a dot 4 mm² of 1200 cm², "
        "at 3 m/s, tree2 m, 5 more"
    )
    assert area_unit(scene) == "unit²"
    scene.unit_settings.system, scene.unit_settings.scale_length = "IMPERIAL", 1.0
    assert in_scene_units(scene, "by 0.3048 m, 1 m²") == "by 1', 1.2 sq yd"
    scene.unit_settings.length_unit = "INCHES"
    assert length_text(scene, 0.254) == "10.0 in"
    scene.unit_settings.system = "METRIC"
    scene.unit_settings.length_unit = "CENTIMETERS"
    assert in_scene_units(scene, "by 0.5 m") == "by 50.0 cm" and area_unit(scene) == "m²"
    scene.unit_settings.system = "NONE"
    assert in_scene_units(scene, "by 0.5 m of 4 by 3 m and 0.25 m²") == "by 0.50 of 4.00 by 3.00 and 0.25 unit²"


def test_errors_and_amounts_are_told_in_them(scene):
    scene.unit_settings.scale_length = 0.01
    made = scene.esh_scatter.scatters.add().classes.add()
    made.count_kind, made.distance = "DISTANCE", 50.0
    assert made.amount == "0.50 m apart"
    made.count_kind, made.per_area = "PER_AREA", 2.0
    assert made.amount == "2/unit²"
    bpy.context.scene.unit_settings.scale_length = 0.01
    assert sentence("the `area` is 5 m wide") == "The Area is 0.05 m wide"
