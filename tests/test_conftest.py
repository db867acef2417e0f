"""Tests run in several processes with a thread each; one that is marked ``alone`` has the machine to itself meanwhile."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("xdist")
pytest.importorskip("fcntl")

ALONE = """
import os
import time
from pathlib import Path
import pytest

@pytest.mark.alone
@pytest.mark.parametrize("number", range(3))
def test_alone(number):
    assert "ESH_THREADS" not in os.environ
    start = time.time()
    time.sleep(0.2)
    with open({times!r}, "a") as file:
        file.write(f"alone {{start}} {{time.time()}}\\n")
"""
OTHERS = """
import os
import time
import pytest

@pytest.mark.parametrize("number", range(40))
def test_other(number):
    assert os.environ["ESH_THREADS"] == "1"
    start = time.time()
    time.sleep(0.03)
    with open({times!r}, "a") as file:
        file.write(f"other {{start}} {{time.time()}}\\n")
"""


def test_nothing_runs_beside_a_test_that_is_alone(tmp_path):
    shutil.copyfile(Path(__file__).parent / "conftest.py", tmp_path / "conftest.py")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = alone: no other beside it\n", encoding="utf-8")
    times = tmp_path / "times"
    for name, source in (("alone", ALONE), ("others", OTHERS), ("more", OTHERS)):
        (tmp_path / f"test_{name}.py").write_text(source.format(times=str(times)), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "--numprocesses", "3", "--dist", "loadfile", tmp_path]
    environment = {name: value for name, value in os.environ.items() if name != "ESH_THREADS"}
    outcome = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert outcome.returncode == 0, outcome.stdout
    lines = [line.split() for line in times.read_text(encoding="utf-8").splitlines()]
    spans = [(kind, float(start), float(end)) for kind, start, end in lines]
    alone = [span for span in spans if span[0] == "alone"]
    others = [span for span in spans if span[0] == "other"]
    assert len(alone) == 3 and len(others) == 80

    def beside(one, spans):
        return [other for other in spans if other is not one and other[1] < one[2] and one[1] < other[2]]

    assert not any(beside(one, spans) for one in alone)
    # The others do run at the same time.
    assert any(beside(one, others) for one in others)
