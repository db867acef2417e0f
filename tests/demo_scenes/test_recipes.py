"""The example recipes: small, and what their comments say."""

from __future__ import annotations

import re
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.drawing.halftone import render_halftone
from esh.engine.files.image_files import read_color, read_density
from esh.engine.files.recipe import recipe_colors, recipe_densities
from esh.engine.space.density import sample_density

FOLDER = Path(__file__).parents[2] / "demo_scenes" / "recipes"
RECIPES = sorted(FOLDER.glob("*.toml"))


def solved(name: str, steps: int):
    problem = esh.read_recipe(FOLDER / name)
    return esh.solve(problem, device="cpu", max_steps=steps)


def test_there_are_recipes_of_bodies_of_lines_and_of_inks():
    assert [path.stem for path in RECIPES] == ["halftone", "hatching", "meadow"]


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_their_images_are_small_beside_them_and_their_comments_show_the_command(path):
    images = recipe_densities(path)
    assert images and all(image.parent == FOLDER and image.stat().st_size < 100_000 for image in images)
    comment = "\n".join(re.findall(r"^#(.*)", path.read_text(encoding="utf-8"), re.MULTILINE))
    assert f"esh-scatter solve {path.name} -o " in comment
    (script,) = re.findall(r"\b\w+\.py\b", comment)
    assert (FOLDER / script).is_file()


def test_hatching_follows_tone_length_and_fur():
    placement = solved("hatching.toml", 40)
    problem = placement.problem
    (stroke,) = problem.classes
    assert len(placement.position) == 9000 and (placement.length > 0).all()
    half = 0.5 * placement.length[:, None] * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)
    rounding = 2 * np.spacing(np.float32(max(problem.domain.size)))
    for ends in (placement.position - half, placement.position + half):
        assert (ends >= -rounding).all() and (ends <= np.array(problem.domain.size) + rounding).all()
    # As much ink in every quarter of the picture as there is darkness.
    share = stroke.density_image / stroke.density_image.sum()
    height, width = share.shape
    middle = np.array(problem.domain.size) / 2
    for rows, above in ((slice(0, height // 2), True), (slice(height // 2, None), False)):
        for columns, right in ((slice(0, width // 2), False), (slice(width // 2, None), True)):
            here = ((placement.position > middle) == [right, above]).all(axis=1)
            assert here.mean() == pytest.approx(share[rows, columns].sum(), abs=0.01)
    # White asks for lines more than twice as long as black.
    gray = sample_density(read_density(FOLDER / "cat.png"), placement.position, problem.domain.size)
    light, dark = (placement.length[mask].mean() for mask in (gray > 0.7, gray < 0.25))
    assert light > 1.35 * dark
    # Sharpened without halos, the density is nowhere below 0.
    assert placement.report.notes == ()


def test_the_halftone_has_the_photographs_colors():
    placement = solved("halftone.toml", 30)
    problem = placement.problem
    assert [c.name for c in problem.classes] == ["C", "M", "Y", "K"]
    for number, body_class in enumerate(problem.classes):
        ink = body_class.density_image.mean(dtype=float) * problem.domain.area
        assert placement.area[placement.class_index == number].sum() == pytest.approx(ink, abs=2 * 1.6)
        large, small = (size.count for size in body_class.sizes)
        assert abs(small - 2 * large) <= 2
    colors = recipe_colors(FOLDER / "halftone.toml", problem)
    shown = render_halftone(placement, pixels_per_metre=4, colors=colors).reshape(9, 64, 9, 64, 3).mean(axis=(1, 3))
    wanted = read_color(FOLDER / "astronaut.png").reshape(9, 16, 9, 16, 3).mean(axis=(1, 3))
    assert np.abs(shown - wanted).mean() < 0.06
    independent = np.abs(wanted.mean(axis=(0, 1)) - wanted).mean()
    assert np.abs(shown - wanted).mean() < 0.35 * independent
