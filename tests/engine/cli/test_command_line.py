"""The command as users run it: in a folder of files, in a pipe, in a terminal, with mistakes, with Ctrl-C."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.cli import command_line
from PIL import Image

RECIPES = Path(__file__).parents[3] / "demo_scenes" / "recipes"
COMMAND = [sys.executable, "-m", "esh.engine.cli.command_line"]

SMALL = """
version = 1
seed = 3
[domain]
size = [8.0, 6.0]
[[class]]
name = "pine"
density = "pine.png"
[[class.size]]
name = "large"
area = 0.1
count = 12
[[class.size]]
name = "small"
area = 0.02
count = 40
[[class]]
name = "beech"
density = 1
[[class.size]]
name = "only"
area = 0.05
count = 20
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "forest.toml").write_text(SMALL)
    image = np.zeros((6, 8), np.uint8)
    image[:, :4] = 255  # pines in the left half
    Image.fromarray(image).save(tmp_path / "pine.png")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def run(*arguments, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False, **options
    )


def test_every_output_of_the_example(tmp_path):
    for path in RECIPES.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    # Piped, as in a script, from another folder than the recipe's.
    outputs = [tmp_path / name for name in ("a.npz", "b.npz", "a.csv", "r.json", "p.png")]
    a, b, table, report_file, plot = outputs
    finished = run(
        *("solve", tmp_path / "meadow.toml", "-o", a, "-o", table, "-o", b, "--report", report_file, "--plot", plot),
        *("--max-steps", "30", "--device", "cpu"),
        cwd=Path(__file__).parent,
    )
    assert (finished.returncode, finished.stderr) == (0, "")

    problem = esh.read_recipe(tmp_path / "meadow.toml")
    with np.load(a, allow_pickle=False) as stored:
        position, class_index, size_index = stored["position"], stored["class_index"], stored["size_index"]
        assert list(stored["class_name"]) == ["shrub", "tussock"]
        assert stored["angle"].shape == stored["length"].shape == (problem.body_count,)
    assert a.read_bytes() == b.read_bytes()
    assert ((position >= 0) & (position <= problem.domain.size)).all()
    # Rows are in class, then size order, with the counts asked for.
    asked = [(c, s) for c, k in enumerate(problem.classes) for s, z in enumerate(k.sizes) for _ in range(z.count)]
    assert list(zip(class_index.tolist(), size_index.tolist(), strict=True)) == asked

    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    np.testing.assert_array_equal([[float(row["x"]), float(row["y"])] for row in rows], position)

    report = json.loads(report_file.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert report["steps"] <= 30 and report["device"] == "cpu" and report["seconds"] > 0
    assert isinstance(report["converged"], bool) and report["overlaps"] >= 0
    assert [entry["name"] for entry in report["classes"]] == ["shrub", "tussock"]
    for entry, body_class in zip(report["classes"], problem.classes, strict=True):
        assert entry["coverage_error"] >= 0
        assert [size["asked"] for size in entry["sizes"]] == [size.count for size in body_class.sizes]
        assert [size["placed"] for size in entry["sizes"]] == [size.count for size in body_class.sizes]
    assert "shrub" in finished.stdout and "900" in finished.stdout and "steps" in finished.stdout

    with Image.open(plot) as picture:
        assert picture.format == "PNG" and min(picture.size) > 1000


def solve(*arguments) -> int:
    return command_line.main(["solve", "forest.toml", "--device", "cpu", "--max-steps", "10", *map(str, arguments)])


def test_the_same_bytes_for_the_same_seed_and_others_for_another(folder, capfd):
    assert solve("-o", "a.npz") == solve("-o", "b.npz", "--seed", 3) == solve("-o", "c.npz", "--seed", 4) == 0
    files = files_of(folder)
    assert files["a.npz"] == files["b.npz"] != files["c.npz"]
    position, class_index = (np.load("a.npz")[key] for key in ("position", "class_index"))
    assert (position[class_index == 0, 0] < 4.0).all()
    assert "pine" in capfd.readouterr().out


def test_quiet_says_nothing(folder, capfd):
    assert solve("-o", "a.npz", "--quiet") == 0
    assert capfd.readouterr() == ("", "")


def test_a_pipe_gets_the_report_and_nothing_else(folder, capfd):
    assert solve("-o", "a.npz") == 0
    out, err = capfd.readouterr()
    assert err == "" and "\x1b" not in out and "\r" not in out
    assert out.startswith("class") and out.count("\n") < 10


def test_what_cannot_fit_is_said_before_the_run(folder, capfd):
    full = SMALL.replace("seed = 3", "seed = 3\navoid_overlap = true").replace("count = 20", "count = 1000")
    (folder / "forest.toml").write_text(full)
    assert solve("-o", "a.npz", "--max-steps", "2") == 0
    out, err = capfd.readouterr()
    assert (
        err.startswith("esh-scatter: forest.toml: footprints would cover ") and "fits" in err and err.count("\n") == 1
    )
    assert "still overlap, the deepest by" in out
    assert solve("-o", "a.npz", "--max-steps", "2", "--quiet") == 0
    assert capfd.readouterr() == ("", "")


MISTAKES = {
    "no output": ([], "required: -o"),
    "ending": (["-o", "a.txt"], "-o a.txt must end in .npz, .csv, .usd"),
    "no ending": (["-o", "npz"], "must end in .npz, .csv, .usd"),
    "twice": (["-o", "a.npz", "-o", "./a.npz"], "is the same file as a.npz"),
    "report's ending": (["-o", "a.npz", "--report", "r.txt"], "--report r.txt must end in .json"),
    "plot's ending": (["-o", "a.npz", "--plot", "p.jpg"], "--plot p.jpg must end in .png"),
    "plot over density": (["-o", "a.npz", "--plot", "pine.png"], "--plot pine.png would overwrite pine.png"),
    "no folder": (["-o", "absent/a.npz"], "absent/a.npz cannot be written: there is no folder"),
    "no folder for the plot": (["-o", "a.npz", "--plot", "absent/p.png"], "there is no folder"),
    "seed": (["-o", "a.npz", "--seed", "-1"], "--seed: must be a whole number of at least 0; got '-1'"),
    "seed text": (["-o", "a.npz", "--seed", "x"], "--seed: must be a whole number of at least 0; got 'x'"),
    "huge seed": (
        ["-o", "a.npz", "--seed", str(2**63)],
        "--seed: must be below 2**63 = 9223372036854775808; got '9223372036854775808'",
    ),
    "endless seed": (
        ["-o", "a.npz", "--seed", "9" * 5000],
        "--seed: must be below 2**63 = 9223372036854775808; got '999",
    ),
    "only an ending": (["-o", ".npz"], "-o .npz must have a name before its ending, for example plan.npz"),
    "only a plot's ending": (["-o", "a.npz", "--plot", ".PNG"], "--plot .PNG must have a name before its ending"),
    "only a hidden name": (["-o", ".hidden"], "-o .hidden must end in .npz, .csv, .usd"),
    "halftone's ending": (["-o", "a.npz", "--halftone", "h.pdf"], "--halftone h.pdf must end in .png or .svg"),
    "halftone over a recipe's density": (["-o", "a.npz", "--halftone", "pine.png"], "would overwrite pine.png"),
    "halftone over the plot": (["-o", "a.npz", "--plot", "p.png", "--halftone", "p.png"], "is the same file as p.png"),
    "scale": (["-o", "a.npz", "--scale", "0"], "--scale: must be a number above 0; got '0'"),
    "endless scale": (["-o", "a.npz", "--scale", "inf"], "--scale: must be a number above 0; got 'inf'"),
    "no scale": (["-o", "a.npz", "--scale", "nan"], "--scale: must be a number above 0; got 'nan'"),
    "steps": (["-o", "a.npz", "--max-steps", "0"], "--max-steps: must be a whole number of at least 1; got '0'"),
    "option": (["-o", "a.npz", "--sede", "1"], "unrecognized arguments: --sede 1"),
    "device": (["-o", "a.npz", "--device", "gpu"], "`device`"),
    "absent GPU": (["-o", "a.npz", "--device", "cuda:99"], "cuda:99"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_the_command_are_one_sentence_and_change_nothing(folder, capfd, mistake):
    arguments, expected = MISTAKES[mistake]
    (folder / "a.npz").write_bytes(b"old")
    before = files_of(folder)
    try:
        status = command_line.main(["solve", "forest.toml", *arguments])
    except SystemExit as leaving:  # argparse
        status = leaving.code
    out, err = capfd.readouterr()
    assert status == 2
    assert expected in err and err.startswith("esh-scatter: ") and err.count("\n") == 1 and out == ""
    assert files_of(folder) == before


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("version = 1", "version = 9", "forest.toml: `version` must be 1"),
        ("count = 12", "count = 0", '`count` of size "large" of class "pine" must be a whole number of at least 1'),
        ("count = 12", "count = 1000000000000", "of memory"),
        ("count = 12", "count = 1" + "0" * 400, "of memory"),
        ("count = 12", "cuont = 12", "did you mean `count`"),
        ('"pine.png"', '"absent.png"', "absent.png does not exist"),
        ('"pine.png"', '"forest.toml"', "not of a kind that can be read"),
        ("[domain]", "[domain", "is not TOML"),
    ],
)
def test_mistakes_in_the_recipe_are_one_sentence_and_change_nothing(folder, capfd, before, after, expected):
    (folder / "forest.toml").write_text(SMALL.replace(before, after))
    (folder / "a.npz").write_bytes(b"old")
    files = files_of(folder)
    assert solve("-o", "a.npz", "--report", "r.json", "--plot", "p.png") == 2
    out, err = capfd.readouterr()
    assert expected in err and "forest.toml" in err and err.count("\n") == 1 and out == ""
    assert files_of(folder) == files


def test_a_failing_disk_leaves_older_files(folder, capfd, monkeypatch):
    from esh.engine.drawing import plan

    def fail(*arguments, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(plan, "draw_plan", fail)
    (folder / "a.npz").write_bytes(b"old")
    before = files_of(folder)
    assert solve("-o", "a.npz", "--plot", "p.png") == 2
    assert "p.png cannot be written: no space left on device" in capfd.readouterr().err
    assert files_of(folder) == before


def test_reports_hold_no_numbers_that_json_does_not_know(folder, monkeypatch, capfd):
    from esh.engine.problem import report

    honest = report.Report.to_dict
    extra = {"bad": [float("nan"), np.float32("inf"), {"n": np.int32(3)}]}
    monkeypatch.setattr(report.Report, "to_dict", lambda self: {**honest(self), **extra})
    assert solve("-o", "a.npz", "--report", "r.json") == 0
    assert json.loads(Path("r.json").read_text(), parse_constant=pytest.fail)["bad"] == [None, None, {"n": 3}]


def test_ctrl_c_ends_the_run_with_130_and_writes_nothing(folder):
    # Enough work for a minute: the key is pressed in the middle of it.
    (folder / "forest.toml").write_text(SMALL.replace("count = 40", "count = 200000"))
    (folder / "a.npz").write_bytes(b"old")
    before = files_of(folder)
    steps = ["--max-steps", "1000000"]
    process = subprocess.Popen(
        [*COMMAND, "solve", "forest.toml", "-o", "a.npz", "--report", "r.json", "--device", "cpu", *steps],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(4.0)
    process.send_signal(signal.SIGINT if os.name == "posix" else signal.CTRL_C_EVENT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130 and out == ""
    assert (
        err.startswith("esh-scatter: stopped by Ctrl-C")
        and err.endswith("; nothing was written\n")
        and err.count("\n") == 1
    )
    assert files_of(folder) == before


def test_an_interruption_between_steps(folder, capfd, monkeypatch):
    """Ctrl-C while the solver is at work, without the clock: pressed by the solver's own first report of progress."""
    from esh.engine import solve as solve_module

    honest = solve_module.solve

    def interrupted(problem, *, progress, **options):
        def press(step):
            answer = progress(step)
            os.kill(os.getpid(), signal.SIGINT)
            return answer

        return honest(problem, progress=press, **options)

    if os.name != "posix":
        pytest.skip("no process can press its own Ctrl-C there")
    handler = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(solve_module, "solve", interrupted)
    before = files_of(folder)
    assert solve("-o", "a.npz") == 130
    assert " of 10 steps; nothing was written" in capfd.readouterr().err
    assert files_of(folder) == before
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.skipif(os.name != "posix", reason="pseudo terminals are a thing of POSIX")
def test_a_terminal_gets_a_progress_bar(folder):
    import pty

    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [*COMMAND, "solve", "forest.toml", "-o", "a.npz", "--device", "cpu"],
        stdout=subprocess.PIPE,
        stderr=follower,
        env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "120"},
    )
    os.close(follower)
    shown = b""
    while True:
        try:
            part = os.read(leader, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        shown += part
    out, _ = process.communicate(timeout=60)
    os.close(leader)
    assert process.returncode == 0
    assert b"\x1b[" in shown and b"steps" in shown and b"Warp" not in shown
    assert out.startswith(b"class") and b"\x1b" not in out


def test_a_reader_that_has_enough_is_no_error(folder):
    process = subprocess.Popen(
        [*COMMAND, "solve", "forest.toml", "-o", "a.npz", "--device", "cpu"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    process.stdout.close()
    assert process.stderr.read() == b"" and process.wait(timeout=60) == 0
    assert np.load("a.npz")["position"].shape == (72, 2)


def test_help_and_version_are_quick_and_light():
    for arguments, expected in {
        ("--version",): f"esh-scatter {esh.__version__}",
        ("--help",): "solve",
        ("solve", "--help"): "--max-steps",
    }.items():
        finished = run(*arguments)
        assert finished.returncode == 0 and expected in finished.stdout and finished.stderr == ""
    script = (
        "import sys\n"
        "from esh.engine.cli.command_line import main\n"
        "try: main(['solve', '--help'])\nexcept SystemExit: pass\n"
        "print([name for name in ('warp', 'numpy', 'PIL', 'rich', 'bpy') if name in sys.modules])"
    )
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert finished.stdout.splitlines()[-1] == "[]"


def test_no_command_is_one_sentence():
    finished = run()
    assert finished.returncode == 2 and finished.stdout == ""
    assert finished.stderr.count("\n") == 1 and "COMMAND" in finished.stderr


def test_one_run_writes_for_several_programs(folder, capfd):
    outputs = ["a.npz", "a.glb", "a.ply", "a.geojson"]
    assert solve(*(word for name in outputs for word in ("-o", name))) == 0
    position = np.load("a.npz")["position"]
    for name in outputs[1:]:
        bodies = esh.load_placement(name)
        np.testing.assert_allclose(bodies.position[:, :2], position, atol=1e-6)
        assert bodies.class_name == ("pine", "beech")


@pytest.mark.parametrize("command", [("batch", "--seeds", "0:2"), ("tiles",)], ids=lambda command: command[0])
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--gpus", "nan"), "--gpus: must be a number from 0 to 64; got 'nan'"),
        (("--gpus", "-1"), "--gpus: must be a number from 0 to 64; got '-1'"),
        (("--workers", "-1"), "--workers: must be a whole number of at least 0; got '-1'"),
    ],
)
def test_long_runs_take_the_same_options(folder, capfd, command, words, expected):
    with pytest.raises(SystemExit) as left:
        command_line.main([command[0], "forest.toml", "-o", "out", *command[1:], *words])
    assert left.value.code == 2
    assert expected in capfd.readouterr().err
    assert not (folder / "out").exists()


def test_assets_are_checked_before_the_run(folder, capfd, monkeypatch):
    pytest.importorskip("pxr.Usd")
    monkeypatch.setattr("esh.engine.cli.solve_command._run", lambda *_: pytest.fail("a run has begun"))
    (folder / "pine.glb").write_bytes(b"")
    (folder / "bare.usda").write_text('#usda 1.0\ndef Sphere "a" {}\n')
    for words, complaint in (
        (["--asset", "pine"], "must be CLASS=FILE or CLASS/SIZE=FILE; got 'pine'"),
        (["--asset", "oak=pine.glb"], "an asset must be for a class or a size (pine/large, pine/small, beech/only)"),
        (["--asset", "pine/large=absent.glb"], "absent.glb does not exist; an asset is"),
        (["--asset", "pine=pine.glb", "-o", "pine.glb"], "would overwrite pine.glb, which this run reads"),
        (["--asset", "pine=pine.glb"], "pine.glb must be a binary glTF 2 file (.glb); it is something else"),
        (["--asset", "pine=bare.usda"], 'the asset of "pine/large" for a .glb file must end in .glb; got bare.usda'),
        (["--asset", "beech=bare.usda", "-o", "b.usd"], 'the asset of "beech" for a .glb file must end in .glb'),
        (["--asset", "beech=bare.usda", "-o", "b.usda"], "bare.usda must be a USD file that has a default prim"),
    ):
        first = [] if words[-1] == "b.usda" else ["-o", "a.glb"]
        try:
            status = solve(*first, *words)
        except SystemExit as left:
            status = left.code
        assert status == 2
        message = capfd.readouterr().err
        assert complaint in message and message.count("\n") == 1
    assert not (folder / "a.glb").exists()


def test_a_new_format_is_known_to_arguments_and_help(folder, capfd, monkeypatch):
    from esh.engine.files.placement_files import WRITERS, PlacementWriter

    counts = PlacementWriter(
        "the number of bodies", lambda file, placement, assets: file.write(b"%d" % len(placement.position))
    )
    monkeypatch.setitem(WRITERS, ".count", counts)
    assert solve("-o", "a.count", "--max-steps", 1, "--quiet") == 0
    assert Path("a.count").read_bytes() == b"72"
    assert solve("-o", "a.txt") == 2
    assert "or .count; got the ending '.txt'" in capfd.readouterr().err
    monkeypatch.setenv("COLUMNS", "1000")
    with pytest.raises(SystemExit):
        command_line.main(["solve", "--help"])
    told = capfd.readouterr().out
    assert ".npz (NumPy arrays), .csv (a table of text)," in told and " or .count (the number of bodies);" in told


def test_a_recipe_is_parsed_once_in_a_run(folder, monkeypatch):
    from esh.engine.files import recipe_table

    parsed = []
    loads = recipe_table.tomllib.loads
    monkeypatch.setattr(recipe_table.tomllib, "loads", lambda text: parsed.append(text) or loads(text))
    assert solve("-o", "a.npz", "--halftone", "h.png", "--max-steps", 1, "--quiet") == 0
    assert len(parsed) == 1


def test_the_help_of_separate_lists_the_ink_models(capfd, monkeypatch):
    from esh.engine.problem.color_separation import MODELS

    monkeypatch.setenv("COLUMNS", "1000")
    with pytest.raises(SystemExit):
        command_line.main(["separate", "--help"])
    shown = capfd.readouterr().out
    assert all(name in shown for name in MODELS) and "CMYK (default)" in shown


def test_help_loads_nothing_that_takes_time():
    code = "import sys; from esh.engine.cli import command_line as c; c._parser(); print({'numpy', 'warp'} & set(sys.modules))"
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True)
    assert outcome.stdout == "set()\n"
