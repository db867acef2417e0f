"""Batches: same bytes whoever makes them, continued after any kill, failures listed and not fatal."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import esh
import numpy as np
import pytest
from esh import EshError
from esh.engine.cli import command_line
from esh.engine.scenes.batch import Batch, run_batch
from PIL import Image

parquet = pytest.importorskip("pyarrow.parquet")
pytest.importorskip("tomli_w")

COMMAND = [sys.executable, "-m", "esh.engine.cli.command_line"]
RECIPE = """
version = 1
[domain]
size = [4.0, 3.0]
[[class]]
name = "pine"
density = "images/pine.png"
[[class.size]]
name = "large"
area = 0.02
count = 20
[[class]]
name = "beech"
density = 1
[[class.size]]
name = "only"
area = 0.01
count = 10
"""
SET = ("class[pine].size[1].count=10:40", "balance.class_separation=0.2:0.8")


@pytest.fixture
def recipe(tmp_path) -> Path:
    (tmp_path / "in" / "images").mkdir(parents=True)
    image = np.zeros((6, 8), np.uint8)
    image[:, :4] = 255
    Image.fromarray(image).save(tmp_path / "in" / "images" / "pine.png")
    (tmp_path / "in" / "forest.toml").write_text(RECIPE)
    return tmp_path / "in" / "forest.toml"


def contents(folder: Path) -> dict[str, bytes]:
    """Everything in a batch that does not depend on how long something took."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.name == "report.json":
            report = json.loads(path.read_bytes())
            report.pop("seconds", None)
            found[name] = report
        elif path.name == "manifest.parquet":
            found[name] = parquet.read_table(path).drop(["seconds"]).to_pydict()
        elif path.is_file():
            found[name] = path.read_bytes()
    return found


def make(recipe: Path, folder: Path, seeds: range = range(4), *, variations=SET, **options):
    batch_options = {key: options.pop(key) for key in ("endings", "design") if key in options}
    batch = Batch(recipe, folder, seeds, variations, max_steps=5, **batch_options)
    return run_batch(batch, device="cpu", **{"workers": 0} | options)


def test_same_bytes_for_any_number_of_workers_and_parts(recipe, tmp_path):
    states = [make(recipe, tmp_path / f"w{n}", workers=n) for n in (0, 2)]
    assert all((s.scenes, s.done, s.made, dict(s.failed)) == (4, 4, 4, {}) for s in states)
    expected = contents(tmp_path / "w0")
    assert contents(tmp_path / "w2") == expected
    first = make(recipe, tmp_path / "p", part=(1, 2))
    assert (first.done, first.made) == (2, 2) and not (tmp_path / "p" / "manifest.parquet").exists()
    assert make(recipe, tmp_path / "p", part=(2, 2)).made == 2
    assert make(recipe, tmp_path / "p").made == 0
    assert contents(tmp_path / "p") == expected


def test_the_manifest_says_what_was_asked_and_reached(recipe, tmp_path):
    make(recipe, tmp_path / "out", endings=(".npz", ".ply"))
    rows = parquet.read_table(tmp_path / "out" / "manifest.parquet").to_pylist()
    assert [(row["scene"], row["seed"], row["folder"]) for row in rows] == [(n, n, f"{n:06d}") for n in range(4)]
    assert len({row["hash"] for row in rows}) == 4
    for row in rows:
        folder = tmp_path / "out" / row["folder"]
        assert {path.name for path in folder.iterdir()} == {
            *("placement.npz", "placement.ply", "recipe.toml", "report.json")
        }
        bodies = esh.load_placement(folder / "placement.npz")
        assert row["bodies"] == len(bodies.position) == row["class[pine].size[1].count"] + 10
        assert 0.2 < row["balance.class_separation"] < 0.8
        assert row["seconds"] > 0.0 and row["error"] is None and row["overlaps"] >= 0
        # The recipe that lies there makes the same again, from there.
        again = esh.solve(esh.read_recipe(folder / "recipe.toml"), device="cpu", max_steps=5)
        np.testing.assert_array_equal(again.position, bodies.position[:, :2])
        assert again.problem.seed == row["seed"]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux")
def test_a_batch_that_is_killed_goes_on_and_makes_nothing_twice(recipe, tmp_path):
    make(recipe, tmp_path / "whole", range(12))
    folder = tmp_path / "killed"
    arguments = ["batch", recipe, "-o", folder, "--seeds", "0:12", "--max-steps", "5", "--device", "cpu"]
    arguments += [word for text in SET for word in ("--set", text)]
    command = [*COMMAND, *map(str, arguments), "--workers", "2"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while len(list(folder.glob("0*"))) < 3:
        assert running.poll() is None and time.monotonic() < deadline
        time.sleep(0.005)
    workers = [
        int(word)
        for task in Path(f"/proc/{running.pid}/task").iterdir()
        for word in (task / "children").read_text().split()
    ]
    running.send_signal(signal.SIGKILL)
    running.wait()
    kept = {path: path.stat().st_mtime_ns for path in folder.glob("0*/*")}
    assert workers and len(kept) >= 9 and not (folder / "manifest.parquet").exists()
    while any(alive(pid) for pid in workers):
        assert time.monotonic() < deadline, "the workers must end with the one that started them"
        time.sleep(0.05)
    # What a kill at the worst moment leaves.
    shutil.copytree(folder / "000000", folder / ".000011.1234abcd.part")
    (folder / ".000011.1234abcd.part" / "report.json").unlink()

    state = make(recipe, folder, range(12))
    assert state.done == 12 and state.made == 12 - len(kept) // 3
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert contents(folder) == contents(tmp_path / "whole")


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_scenes_that_fail_are_listed_and_the_others_made(recipe, tmp_path, capfd):
    folder = tmp_path / "out"
    arguments = ["batch", recipe, "-o", folder, "--seeds", "0:2", "--set", "class[1].size[1].count=5,0,7"]
    arguments += ["--design", "grid", "--max-steps", "3", "--device", "cpu", "--workers", "0"]
    assert command_line.main([*map(str, arguments)]) == 1
    out, err = capfd.readouterr()
    assert "6 scenes are done (6 in this run), 2 of them failed" in out
    assert err.count("\n") == 2 and "scene 000002 failed: " in err and "`count`" in err and "large" in err
    rows = parquet.read_table(folder / "manifest.parquet").to_pylist()
    assert [row["error"] is None for row in rows] == [True, True, False, False, True, True]
    assert [row["class[1].size[1].count"] for row in rows] == [5, 5, 0, 0, 7, 7]
    assert [path.name for path in (folder / "000002").iterdir()] == ["report.json"]
    # Neither made nor tried again, until that is asked for.
    assert command_line.main([*map(str, arguments)]) == 1
    assert "(0 in this run)" in capfd.readouterr().out
    assert command_line.main([*map(str, arguments), "--retry"]) == 1
    assert "(2 in this run)" in capfd.readouterr().out


def test_scenes_that_lacked_a_file_are_tried_again_once_it_is_there(recipe, tmp_path):
    def run(folder: Path, **more):
        variations = ["class[pine].density=images/pine.png,late.png"]
        return run_batch(
            Batch(recipe, folder, range(2), variations, "grid", max_steps=3), device="cpu", workers=0, **more
        )

    assert set(run(tmp_path / "out").failed) == {2, 3}
    Image.fromarray(np.full((4, 4), 9, np.uint8)).save(recipe.parent / "late.png")
    state = run(tmp_path / "out", retry=True)
    assert (state.made, dict(state.failed)) == (2, {})
    run(tmp_path / "whole")
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")


def test_a_machine_without_the_recipe_s_folder_makes_the_same(recipe, tmp_path):
    from dataclasses import replace

    from esh.engine.files.recipe import ParsedRecipe, parse_recipe
    from esh.engine.scenes.scene import Scene, solved_scene

    parsed = parse_recipe(recipe)
    parameters = {"class[pine].size[1].count": 12}
    here = Scene(3, 7, parameters, parsed, recipe.parent, tmp_path / "out" / "000003", "cpu", 4, (".npz",))
    expected = solved_scene(here)
    inputs = {"images/pine.png": (recipe.parent / "images" / "pine.png").read_bytes()}
    # There, the paths of here lead nowhere.
    there = replace(here, recipe=ParsedRecipe(Path("/nowhere/forest.toml"), parsed.entries))
    made = solved_scene(there, inputs)
    assert made["placement.npz"] == expected["placement.npz"]
    assert made["recipe.toml"] == expected["recipe.toml"]
    assert b'density = "../../in/images/pine.png"' in made["recipe.toml"]
    failed = json.loads(solved_scene(replace(there, parameters={"class[1].size[1].count": 0}), inputs)["report.json"])
    assert failed["error"].startswith("/nowhere/forest.toml: ")


MISTAKES = {
    "recipe": (["absent.toml"], "absent.toml"),
    "key": (["--set", "class[oak].count=1,2"], "there is no class[oak] in the recipe; it has pine, beech"),
    "unknown key": (["--set", "domain.depth=1,2"], "domain.depth"),
    "values": (["--set", "seed=1,2"], "seeds by --seeds"),
    "twice": (["--set", "domain.size[1]=1,2", "--set", "domain.size[1]=1,2"], "every key once"),
    "grid": (["--design", "grid", "--set", "domain.size[1]=1:2"], "a grid needs"),
    "ending": (["--as", ".txt"], "must end in .npz"),
    "seeds": (["--seeds", "5:5"], "A below B"),
    "part": (["--part", "3/2"], "I from 1 to N"),
    "device": (["--device", "cuda:99"], "cuda:99"),
    "nowhere": (["-o", "/dev/null/x"], "/dev/null/x"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_one_sentence_before_anything_is_made(recipe, tmp_path, capfd, mistake):
    words, complaint = MISTAKES[mistake]
    first = [str(recipe)] if not words[0].endswith(".toml") else []
    try:
        status = command_line.main(
            ["batch", *first, "-o", str(tmp_path / "out"), "--seeds", "0:3", "--workers", "0", *words]
        )
    except SystemExit as left:
        status = left.code
    assert status == 2
    message = capfd.readouterr().err
    assert complaint in message and message.count("\n") == 1
    assert not list(tmp_path.glob("out/0*"))


def test_another_batch_in_the_folder_is_not_touched(recipe, tmp_path):
    make(recipe, tmp_path / "out", range(2))
    before = contents(tmp_path / "out")
    for change, complaint in (
        (lambda: make(recipe, tmp_path / "out", range(3)), "differs in its seeds"),
        (lambda: make(recipe, tmp_path / "out", range(2), variations=SET[:1]), "differs in its set"),
        (lambda: make(recipe, tmp_path / "out", range(2), endings=(".ply",)), "differs in its as"),
    ):
        with pytest.raises(EshError, match=complaint):
            change()
    Image.fromarray(np.full((4, 4), 9, np.uint8)).save(recipe.parent / "images" / "pine.png")
    with pytest.raises(EshError, match="differs in its files"):
        make(recipe, tmp_path / "out", range(2))
    assert contents(tmp_path / "out") == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    with pytest.raises(EshError, match="must be empty or hold this batch; it holds other files"):
        make(recipe, tmp_path / "mine", range(2))


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C of POSIX")
def test_ctrl_c_says_how_far_it_came(recipe, tmp_path):
    folder = tmp_path / "out"
    command = [
        *COMMAND,
        "batch",
        str(recipe),
        "-o",
        str(folder),
        "--seeds",
        "0:2000",
        "--device",
        "cpu",
        "--workers",
        "1",
    ]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while len(list(folder.glob("0*"))) < 2:
        assert running.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "of 2,000 scenes are done, and the same command continues" in err and err.count("\n") == 1
    assert all((path / "report.json").is_file() for path in folder.glob("0*"))
