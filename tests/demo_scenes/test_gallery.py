"""The scenes of the gallery: their own checks on whole scenes of few bodies, what these checks find, and a run with a tiny picture."""

import re
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCENES = ROOT / "demo_scenes"
NAMES = ("meadow", "beach", "crowd", "portrait")


def built(scene, quick=True):
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True)
    return scene.build("cpu", quick)


@pytest.mark.parametrize("name", ["meadow", "beach", "crowd"])
def test_a_scene_keeps_its_promises(blender_module, name):
    scene = blender_module(name)
    made = built(scene)
    measured = scene.test_final(made)
    assert measured["placed"] > 40 and measured["overlaps"] == 0
    if name == "crowd":
        # The checks find who looks away.
        turned = made.results[0].object.data.attributes["rotation"].data
        w, _, _, z = turned[0].value
        turned[0].value = (-z, 0.0, 0.0, w)  # half a turn on
        made.results[0].object.data.update()
        with pytest.raises(AssertionError, match="degrees past the stage"):
            scene.test_final(made)


def test_the_meadow_has_its_clumps_with_all_of_its_flowers_too(blender_module):
    # Its clumps are smaller than those of few flowers, which plants that keep apart leave less of.
    scene = blender_module("meadow")
    scene.test_final(built(scene, quick=False))


def test_nothing_of_the_path_is_left_out(blender_module):
    meadow = blender_module("meadow")
    way = meadow.path_points()
    # It goes through the points that it was given but for its ends, and its distance is that of its nearest point.
    given = np.array(meadow.PATH[1:-1])
    assert np.hypot(*np.moveaxis(given[:, None] - way, 2, 0)).min(axis=1).max() < 1e-6
    place = np.random.default_rng(1).uniform((-10.0, -4.0), (10.0, 30.0), (200, 2))
    nearest = np.hypot(*np.moveaxis(place[:, None] - way, 2, 0)).min(axis=1)
    away = meadow.distance_to_path(place)
    assert (away <= nearest + 1e-9).all() and np.allclose(away, nearest, atol=0.1)
    assert meadow.distance_to_path(way).max() < 1e-9


def test_a_scene_is_rendered_and_saved(blender_module, tmp_path, capsys):
    blender_module("portrait").main(["--quick", "--output", str(tmp_path), "--device", "cpu"])
    assert "all checks passed" in capsys.readouterr().out
    from PIL import Image

    with Image.open(tmp_path / "portrait.png") as picture:
        assert picture.size == (128, 96) and np.asarray(picture.convert("L")).std() > 5.0
    assert (tmp_path / "portrait.blend").stat().st_size > 10_000


@pytest.mark.parametrize("name", ["forest", "pizza", *NAMES])
def test_the_gallery_shows_the_scene_its_command_and_its_script(name):
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    script = (SCENES / f"{name}.py").read_text(encoding="utf-8")
    picture = re.search(rf"^!\[[^\]]+\]\({name}\.(png|jpg)\)$", page, re.MULTILINE)
    assert picture, f"{name} is not in the gallery"
    under = page[picture.end() :].partition("\n![")[0]
    assert f"    make {'demo' if name == 'forest' else name}\n" in under
    path = ROOT / "docs" / f"{name}.{picture.group(1)}"
    if name in NAMES:
        assert script.count("# begin: scatter") == script.count("# end: scatter") == 1
        assert f"demo_scenes/{name}.py" in under and ":start-after:" in under
        assert path.stat().st_size <= 300_000
