"""The files for farms make the same scenes as one machine does, as far as that can be tried without a farm."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from esh.engine.cli import command_line

FARMS = Path(__file__).parents[2] / "demo_scenes" / "farms"
RECIPE = """
version = 1
[domain]
size = [4.0, 3.0]
[[class]]
name = "pine"
density = 1
[[class.size]]
name = "large"
area = 0.02
count = 20
"""
VARIED = "class[pine].size[1].count=10:40"
# A value with a space, as the pages have it.
SPACED = "regularity=normal(0.5, 0.1)"

parquet = pytest.importorskip("pyarrow.parquet")
pytest.importorskip("tomli_w")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder with a recipe, and a command of this package on the path."""
    (tmp_path / "forest.toml").write_text(RECIPE)
    (tmp_path / "bin").mkdir()
    command = tmp_path / "bin" / "esh-scatter"
    command.write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -m esh.engine.cli.command_line "$@" --workers 0 --device cpu\n'
    )
    command.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def hashes(folder: Path) -> list[str]:
    return parquet.read_table(folder / "manifest.parquet")["hash"].to_pylist()


@pytest.fixture
def expected(folder) -> list[str]:
    words = [
        "batch",
        "forest.toml",
        "-o",
        "alone",
        "--seeds",
        "0:3",
        "--set",
        VARIED,
        "--set",
        SPACED,
        "--max-steps",
        "3",
    ]
    assert command_line.main([*words, "--device", "cpu", "--workers", "0", "--quiet"]) == 0
    return hashes(folder / "alone")


@pytest.mark.skipif(not shutil.which("bash") or os.name != "posix", reason="needs bash")
def test_a_slurm_array_shares_the_scenes(folder, expected):
    command = ["bash", FARMS / "batch.slurm.sh", "forest.toml", "the team's out", "0:3", "--set", VARIED]
    command += ["--set", SPACED, "--max-steps", "3"]
    for task in (4, 3):
        assert not (folder / "the team's out" / "manifest.parquet").exists()
        array = {"SLURM_ARRAY_TASK_MIN": "3", "SLURM_ARRAY_TASK_COUNT": "2", "SLURM_ARRAY_TASK_ID": str(task)}
        subprocess.run(command, check=True, env=os.environ | array, timeout=120)
    assert hashes(folder / "the team's out") == expected


@pytest.mark.skipif(importlib.util.find_spec("openjd") is None, reason="openjd-cli is not installed")
@pytest.mark.skipif(not shutil.which("bash") or os.name != "posix", reason="needs bash")
def test_the_open_job_description_is_valid_and_runs(folder, expected):
    openjd = [sys.executable, "-c", "from openjd.cli import main; main()"]
    template = FARMS / "batch.openjd.yaml"
    subprocess.run([*openjd, "check", template], check=True, capture_output=True, timeout=60)
    values = {
        "Recipe": folder / "forest.toml",
        "Output": folder / "the team's out",
        "Seeds": "0:3",
        "Options": f"--set {VARIED} --set '{SPACED}' --max-steps 3",
        "Parts": 2,
    }
    words = [word for name, value in values.items() for word in ("-p", f"{name}={value}")]
    outcome = subprocess.run(
        [*openjd, "run", template, *words], capture_output=True, text=True, timeout=300, check=False
    )
    assert outcome.returncode == 0, outcome.stdout[-3000:] + outcome.stderr[-2000:]
    assert hashes(folder / "the team's out") == expected


@pytest.mark.skipif(not shutil.which("node"), reason="needs Node.js, which runs the job type as Flamenco does")
def test_the_flamenco_job_type_makes_tasks_that_run(folder, expected):
    settings = {
        "recipe": "forest.toml",
        "output": "out",
        "seeds": "0:3",
        "variations": f"{VARIED}  {SPACED}",
        "parts": 2,
    }
    program = f"""
const tasks = [];
class Task {{
    constructor(name, kind) {{ Object.assign(this, {{ name, kind, commands: [], after: [] }}); }}
    addCommand(command) {{ this.commands.push(command); }}
    addDependency(task) {{ this.after.push(task.name); }}
}}
const author = {{ Task: (n, k) => new Task(n, k), Command: (name, parameters) => ({{ name, parameters }}) }};
const compile = new Function("author", {json.dumps((FARMS / "esh_scatter_batch.js").read_text())}
    + "; return [JOB_TYPE, compileJob];");
const [type, compileJob] = compile(author);
const settings = {json.dumps(settings)};
for (const {{ key, type: kind, default: value }} of type.settings) if (!(key in settings)) settings[key] = value;
compileJob({{ settings, addTask: (task) => tasks.push(task) }});
console.log(JSON.stringify([type, tasks]));
"""
    printed = subprocess.run(["node", "-e", program], check=True, capture_output=True, text=True, timeout=60).stdout
    job_type, tasks = json.loads(printed)
    assert {entry["key"] for entry in job_type["settings"]} >= set(settings)
    assert [(task["name"], task["after"]) for task in tasks] == [
        ("part-1", []),
        ("part-2", []),
        ("table", ["part-1", "part-2"]),
    ]
    for task in tasks:
        ((name, parameters),) = [(c["name"], c["parameters"]) for c in task["commands"]]
        assert name == "exec"
        words = [*parameters["args"], "--max-steps", "3"]
        subprocess.run([parameters["exe"], *words], check=True, timeout=120)
    assert hashes(folder / "out") == expected
