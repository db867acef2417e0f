"""What the README shows runs as it stands there."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
SCRIPTS = re.findall(r"^```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
RECIPES = re.findall(r"^```toml\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_the_readme_has_a_script_for_each_world_and_recipes_of_bodies_and_of_inks():
    assert ["bpy" in script for script in SCRIPTS] == [False, True]
    assert ["[image]" in recipe for recipe in RECIPES] == [False, True]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: "blender" if "bpy" in script else "engine")
def test_a_script_runs_and_prints_its_report(script: str, tmp_path: Path):
    if "bpy" in script and importlib.util.find_spec("bpy") is None:
        pytest.skip("needs Blender as a Python module")
    outcome = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert outcome.returncode == 0, outcome.stderr
    assert "asked" in outcome.stdout and "placed" in outcome.stdout
    if "bpy" in script:
        assert (tmp_path / "scattered.blend").stat().st_size > 10_000


def test_the_script_places_what_its_text_says():
    names: dict = {}
    exec(SCRIPTS[0], names)
    placement = names["placement"]
    width = placement.problem.domain.size[0]
    mean_x = [placement.position[placement.class_index == index, 0].mean() / width for index in (0, 1)]
    # The means of densities that fall and rise linearly.
    assert np.allclose(mean_x, [1 / 3, 2 / 3], atol=0.02)
    assert placement.report.overlaps == 0
    assert np.bincount(placement.class_index).tolist() == [300, 80]


@pytest.mark.parametrize("recipe", RECIPES, ids=["bodies", "inks"])
def test_the_recipes_can_be_solved_as_they_stand(recipe: str, tmp_path: Path):
    image = pytest.importorskip("PIL.Image")
    (tmp_path / "recipe.toml").write_text(recipe, encoding="utf-8")
    image.fromarray(np.full((30, 40), 255, np.uint8)).save(tmp_path / "pine.png")
    image.fromarray(np.full((16, 16, 3), 200, np.uint8)).save(tmp_path / "photo.png")
    # From another folder: the image is looked for beside the recipe.
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    command = [
        sys.executable,
        "-m",
        "esh.engine.cli.command_line",
        "solve",
        str(tmp_path / "recipe.toml"),
        "-o",
        "out.npz",
    ]
    command += ["--report", "report.json", "--max-steps", "5"]
    outcome = subprocess.run(command, cwd=elsewhere, capture_output=True, text=True, timeout=600)
    assert outcome.returncode == 0, outcome.stderr
    with np.load(elsewhere / "out.npz", allow_pickle=False) as arrays:
        documented = set(re.findall(r"^\| `(\w+)` \|", README, re.MULTILINE))
        # Nothing may bend here.
        assert set(arrays) == documented - {"bends"}
        if recipe == RECIPES[0]:
            pine, log = tomllib.loads(recipe)["class"]
            assert len(arrays["position"]) == pine["size"][0]["count"] + log["count"]
            assert (arrays["length"] > 0).sum() == log["count"]
        else:
            # An even grey of 55 of 255 takes black dots alone.
            assert len(arrays["position"]) == round(256 * 256 * 55 / 255)


def test_every_make_target_that_is_named_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^    make (\w+)", README, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"make {target}"


def test_every_picture_and_file_that_is_linked_exists():
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / link).is_file(), f"{link} is missing"
