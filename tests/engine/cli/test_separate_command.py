"""``esh-scatter separate``, and halftones: from a color image to ink on paper."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from esh import read_recipe
from esh.engine.cli import command_line
from esh.engine.files.image_files import read_color
from esh.engine.files.recipe import recipe_colors
from esh.engine.problem.color_separation import MODELS, halftone_problem
from PIL import Image


@pytest.fixture
def folder(tmp_path, monkeypatch):
    # Cyan on the left, yellow on the right, lighter downwards; a dark band at the bottom.
    image = np.full((24, 32, 3), 255, np.uint8)
    image[:, :16, 0] = image[:, 16:, 2] = np.linspace(0, 200, 24).astype(np.uint8)[:, None]
    image[20:] = 60
    Image.fromarray(image).save(tmp_path / "photo.png")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def everything_in(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("model", MODELS)
def test_channels_and_recipe_pose_the_problem_of_the_image(folder, capfd, model):
    assert command_line.main(["separate", "photo.png", "--model", model, "--area", "0.5", "-o", "inks"]) == 0
    out, err = capfd.readouterr()
    assert err == "" and out.count("\n") == 1
    names = [ink.name for ink in MODELS[model].inks]
    assert {path.name for path in (folder / "inks").iterdir()} == {f"{name}.png" for name in names} | {"recipe.toml"}

    image = read_color("photo.png").astype(float)
    held = {ink.name: np.array(ink.cmy, float) for ink in MODELS[model].inks}
    stored = {name: np.asarray(Image.open(f"inks/{name}.png"), float) / 65535 for name in names}
    mixed = sum(stored[name][..., None] * held[name] for name in names)
    np.testing.assert_allclose(mixed, 1.0 - image, atol=len(names) / 65535)

    direct = halftone_problem(image, model, area=0.5)
    problem = read_recipe("inks/recipe.toml")
    assert problem.domain == direct.domain
    assert [c.name for c in problem.classes] == [c.name for c in direct.classes]
    np.testing.assert_array_equal(problem.balance.non_overlap, direct.balance.non_overlap)
    for read, asked in zip(problem.classes, direct.classes, strict=True):
        np.testing.assert_allclose(read.density_image, asked.density_image, atol=1e-5)
        assert abs(read.body_count - asked.body_count) <= 1
        assert [size.area for size in read.sizes] == [0.5]
    rgb = {ink.name: ink.rgb for ink in MODELS[model].inks}
    assert recipe_colors("inks/recipe.toml", problem) == [rgb[c.name] for c in problem.classes]


@pytest.mark.parametrize("recipe", ["separated", "image"])
def test_the_halftone_of_a_recipe_has_the_colors_of_the_image(folder, capfd, recipe):
    if recipe == "separated":
        assert command_line.main(["separate", "photo.png", "-o", "."]) == 0
    else:
        text = 'version = 1\n[domain]\nsize = [32, 24]\n[image]\nfile = "photo.png"\narea = 1.0\n'
        Path("recipe.toml").write_text(text)
    for halftone in ("h.png", "h.svg"):
        arguments = ["recipe.toml", "-o", "a.npz", "--halftone", halftone, "--scale", "5", "--max-steps", "30"]
        assert command_line.main(["solve", *arguments, "--device", "cpu", "--quiet"]) == 0
    assert capfd.readouterr().err == ""

    with Image.open("h.png") as picture:
        assert picture.size == (160, 120)
        shown = np.asarray(picture.convert("RGB"), float) / 255
    wanted = read_color("photo.png").repeat(5, axis=0).repeat(5, axis=1)
    for rows in (slice(0, 50), slice(100, 120)):
        for columns in (slice(0, 80), slice(80, 160)):
            np.testing.assert_allclose(
                shown[rows, columns].mean(axis=(0, 1)), wanted[rows, columns].mean(axis=(0, 1)), atol=0.12
            )
    # Left there is cyan and no yellow, above the dark band.
    assert shown[:90, :75, 0].mean() < 0.75 < 0.97 < shown[:90, :75, 2].mean()

    tags = [element.tag.rpartition("}")[2] for element in ElementTree.parse("h.svg").iter()]
    with np.load("a.npz") as stored:
        assert len(stored["position"]) <= len(tags)


def test_classes_without_a_color_are_black_beside_those_that_have_one(folder):
    text = "version = 1\n[domain]\nsize = [1, 1]\n"
    for name, color in (("a", "color = [0, 0.5, 1]\n"), ("b", "")):
        text += f'[[class]]\nname = "{name}"\ndensity = 1\n{color}[[class.size]]\nname = "s"\narea = 0.01\ncount = 2\n'
    Path("recipe.toml").write_text(text)
    assert recipe_colors("recipe.toml", read_recipe("recipe.toml")) == [(0.0, 0.5, 1.0), (0.0, 0.0, 0.0)]
    Path("recipe.toml").write_text(text.replace("color = [0, 0.5, 1]\n", ""))
    assert recipe_colors("recipe.toml", read_recipe("recipe.toml")) is None


@pytest.mark.parametrize(
    "color", ["[0, 0.5]", "[0, 0.5, 1.5]", "[0, -1, 0]", '"red"', "[0, 0, true]", "0.5", "[nan, 0, 0]"]
)
def test_colors_without_meaning(folder, capfd, color):
    text = f'version = 1\n[domain]\nsize = [1, 1]\n[[class]]\nname = "a"\ndensity = 1\ncolor = {color}\n'
    Path("recipe.toml").write_text(f'{text}[[class.size]]\nname = "s"\narea = 0.01\ncount = 2\n')
    assert command_line.main(["solve", "recipe.toml", "-o", "a.npz"]) == 2
    expected = '`class[1].color` (class "a") must be three numbers between 0 and 1, red, green and blue; got '
    assert expected in capfd.readouterr().err


MISTAKES = {
    "model": (["photo.png", "--model", "RGB", "-o", "x"], "--model must be one of CMY, CMYK, CMY-RG-K, CMY-RB-K"),
    "absent image": (["none.png", "-o", "x"], "none.png does not exist"),
    "no image": (["note.txt", "-o", "x"], "note.txt is not of a kind that can be read"),
    "nothing to print": (["white.png", "-o", "x"], "white.png: the image is white"),
    "large dots": (["photo.png", "--area", "1e6", "-o", "x"], "photo.png: "),
    "area": (["photo.png", "--area", "-1", "-o", "x"], "--area: must be a number above 0; got '-1'"),
    "folder of none": (["photo.png", "-o", "absent/x"], "-o absent/x cannot be made: there is no folder"),
    "file": (["photo.png", "-o", "note.txt"], "-o note.txt must be a folder; it is a file"),
    "own source": (["K.png", "-o", "."], "-o . would overwrite K.png, which this run reads"),
    "no output": (["photo.png"], "required: -o"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_one_sentence_and_change_nothing(folder, capfd, mistake):
    arguments, expected = MISTAKES[mistake]
    Image.new("RGB", (4, 4), "white").save("white.png")
    Image.new("RGB", (4, 4), "teal").save("K.png")
    Path("note.txt").write_text("note")
    before = everything_in(folder)
    try:
        status = command_line.main(["separate", *arguments])
    except SystemExit as leaving:  # argparse
        status = leaving.code
    out, err = capfd.readouterr()
    assert status == 2 and out == ""
    assert expected in err and err.startswith("esh-scatter: ") and err.count("\n") == 1
    assert everything_in(folder) == before and not Path("x").exists()


def test_a_full_disk_leaves_no_folder(folder, capfd, monkeypatch):
    from esh.engine.files import placement_files

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(placement_files.os, "fsync", fail)
    assert command_line.main(["separate", "photo.png", "-o", "inks"]) == 2
    assert "cannot be written: no space left on device" in capfd.readouterr().err
    assert not Path("inks").exists()


def test_transparent_places_and_16_bits_are_taken_as_they_are(folder):
    clear = np.zeros((4, 4, 4), np.uint8)
    clear[:, 2:] = (255, 0, 0, 255)
    Image.fromarray(clear).save("clear.png")
    Image.fromarray(np.full((4, 4), 30_000, np.uint16)).save("deep.png")
    assert command_line.main(["separate", "clear.png", "-o", "a"]) == 0
    magenta = np.asarray(Image.open("a/M.png"))
    assert (magenta[:, :2] == 0).all() and (magenta[:, 2:] == 65535).all()
    assert not np.asarray(Image.open("a/K.png")).any()
    assert command_line.main(["separate", "deep.png", "-o", "b"]) == 0
    np.testing.assert_allclose(np.asarray(Image.open("b/K.png")), 65535 - 30_000, atol=1)
