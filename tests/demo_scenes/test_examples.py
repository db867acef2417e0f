"""The examples run, show something, and check it; each is in their README with a picture."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "demo_scenes" / "examples"
EXAMPLES = sorted(path for path in FOLDER.glob("*.py") if "\ndef main(" in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_draws_its_picture_and_passes_its_own_check(path: Path, tmp_path: Path, monkeypatch):
    image = pytest.importorskip("PIL.Image")
    if "import bpy" in path.read_text(encoding="utf-8"):
        pytest.importorskip("bpy")
    monkeypatch.syspath_prepend(str(FOLDER))
    spec = importlib.util.spec_from_file_location(f"example_{path.stem}", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    if hasattr(example, "render"):
        # What Cycles draws takes most of the time, of which a quarter of the pixels say as much.
        honest = example.render

        def render_smaller(picture: Path) -> None:
            example.bpy.context.scene.render.resolution_percentage = 50
            honest(picture)

        monkeypatch.setattr(example, "render", render_smaller)
    example.test_final(example.main(tmp_path))
    assert [made.name for made in tmp_path.iterdir()] == [f"{path.stem}.png"]
    picture = np.asarray(image.open(tmp_path / f"{path.stem}.png").convert("L"), float)
    assert min(picture.shape) > (200 if hasattr(example, "render") else 400) and picture.std() > 20.0


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_shows(path: Path):
    text = path.read_text(encoding="utf-8")
    assert re.match(r'"""[A-Z].*\."""\n', text)
    assert 10 <= sum(bool(line.strip()) for line in text.splitlines()) <= 30


def test_all_examples_are_in_their_readme_with_a_small_picture():
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| \[(\w+)\.py\]\((\w+)\.py\).*\(\.\./\.\./docs/examples/(\w+)\.jpg\) \|$", readme, re.MULTILINE
    )
    assert sorted(rows) == [(path.stem,) * 3 for path in EXAMPLES]
    pictures = sorted((ROOT / "docs" / "examples").iterdir())
    assert [picture.name for picture in pictures] == [f"{path.stem}.jpg" for path in EXAMPLES]
    assert all(picture.stat().st_size < 150_000 for picture in pictures)
