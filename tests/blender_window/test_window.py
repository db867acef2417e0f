"""The zip in a real window: installed, its panel drawn, its button pressed. Needs ``BLENDER=…``, which has a display."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLENDER = os.environ.get("BLENDER")

if not BLENDER:
    pytest.skip("set BLENDER to a command that starts a windowed Blender", allow_module_level=True)


def test_the_button_scatters_in_a_window(tmp_path: Path):
    image = pytest.importorskip("PIL.Image")
    # A Blender of another file system root still sees temporary folders.
    driver = shutil.copy(Path(__file__).with_name("driver.py"), tmp_path)
    build = [sys.executable, ROOT / "tools" / "build_extension.py", "--output", tmp_path]
    subprocess.run(build, check=True, timeout=600)
    (package,) = tmp_path.glob("*.zip")
    command = [BLENDER, "--factory-startup", "--python", driver, "--", package, tmp_path]
    finished = subprocess.run(command, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL)
    answer_file = tmp_path / "answer.json"
    assert answer_file.exists(), finished.stdout[-2000:] + finished.stderr[-2000:]
    answer = json.loads(answer_file.read_text(encoding="utf-8"))
    assert "error" not in answer, answer["error"]
    assert answer["pressed"] == ["RUNNING_MODAL"]
    assert answer["points"] == answer["instances"] == sum(answer["asked"].values())
    assert list(answer["asked"]) == ["Beech", "Log", "Mushroom", "Pebble", "Pine"]
    placed = [size["placed"] for entry in answer["report"]["classes"] for size in entry["sizes"]]
    assert placed == list(answer["asked"].values()) and answer["report"]["overlaps"] == 0
    # The panel of the last operation makes the same scatter anew with another value.
    assert (answer["last"], answer["tuned"]) == ("ESH_OT_scatter_selection", ["FINISHED"])
    assert answer["scatters_after_tuning"] == 1
    assert answer["instances_after_tuning"] == answer["asked_after_tuning"] <= 102
    assert answer["hidden_at_once"] and not answer["outdated_by_tilt"]
    assert sorted(answer["changes"]) == ["count of Log", "without Beech", "without Pebble"]
    before, after = (image.open(tmp_path / name).convert("RGB") for name in ("before.png", "after.png"))
    # A black window has no colors; a window in which nothing happened looks the same twice.
    assert len(after.getcolors(10**7)) > 100
    assert before.tobytes() != after.tobytes()
    kept = os.environ.get("BLENDER_SCREENSHOTS")
    if kept:
        for name in ("before.png", "after.png", "changed.png"):
            shutil.copy(tmp_path / name, kept)
