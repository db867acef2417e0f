"""The command as a process: signals, full disks, closed streams, caches that nobody may write to, pipes where files are expected."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from esh.engine.cli import command_line
from esh.engine.errors import EshError
from esh.engine.files import placement_files
from esh.engine.files.body_formats import FORMATS
from esh.engine.files.placement_files import WRITERS

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")

COMMAND = [sys.executable, "-m", "esh.engine.cli.start"]
RECIPE = """
version = 1
[domain]
size = [80.0, 60.0]
[[class]]
name = "pine"
density = 1
[[class.size]]
name = "any"
area = 0.01
count = {count}
"""
OUTPUTS = ("a.csv", "b.npz", "r.json")
SOLVE = ("solve", "forest.toml", "-o", "a.csv", "-o", "b.npz", "--report", "r.json", "--device", "cpu")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write(tmp_path, 200)
    for name in OUTPUTS:
        (tmp_path / name).write_bytes(b"old " + name.encode())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder: Path, count: int) -> None:
    (folder / "forest.toml").write_text(RECIPE.format(count=count))


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def hear_hang_up() -> None:
    """Have a process that is to be started hear SIGHUP, also where the tests themselves do not (``nohup``)."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def start(*arguments: str, **options) -> subprocess.Popen:
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "preexec_fn": hear_hang_up, **options}
    return subprocess.Popen([*COMMAND, *arguments], text=True, **options)


def full_disk(limit: int) -> dict[str, object]:
    """Options of :func:`start` for a process that can write so many bytes into a file.

    The kernels' cache stays as it is: nothing is written into it. Nor is any module compiled, of which Python would keep a part, so
    that nobody could import it any more.
    """
    import resource

    return {
        "preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        "env": {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    }


def end_of(process: subprocess.Popen) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def test_a_place_that_cannot_be_taken_leaves_all_older_files(folder, monkeypatch):
    honest = Path.replace

    def replace(self, target):
        if Path(target).name == "r.json" and self.suffix == ".part":
            raise OSError(1, "Operation not permitted")
        return honest(self, target)

    before = files_of(folder)
    writers = {Path(name): lambda file: file.write(b"new") for name in ("a.csv", "none.npz", "r.json")}
    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", replace)
        with pytest.raises(EshError, match=r"r\.json cannot be written: operation not permitted"):
            placement_files.write_files(writers)
    assert files_of(folder) == before
    placement_files.write_files(writers)
    assert files_of(folder) == {**before, "a.csv": b"new", "none.npz": b"new", "r.json": b"new"}


def test_file_systems_without_hard_links_keep_what_was_there_too(folder, monkeypatch):
    def link(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(placement_files.os, "link", link)
    test_a_place_that_cannot_be_taken_leaves_all_older_files(folder, monkeypatch)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_signals_during_the_run_change_nothing(folder, name):
    # More bodies than any machine places before the signal.
    write(folder, 2_000_000)
    before = files_of(folder)
    process = start(*SOLVE, "--max-steps", "1000000")
    time.sleep(3.0)
    process.send_signal(getattr(signal, name))
    status, out, err = end_of(process)
    assert (status, out) == (128 + getattr(signal, name), "")
    assert err.startswith("esh-scatter: ") and err.endswith("; nothing was written\n") and err.count("\n") == 1
    assert files_of(folder) == before


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_signal_while_files_are_written_leaves_the_older_ones(folder, name):
    # A table that takes a second.
    write(folder, 400_000)
    before = files_of(folder)
    process = start(*SOLVE, "--max-steps", "1")
    deadline = time.monotonic() + 100
    while not list(folder.glob(".*.part")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.005)
    # Who is impatient presses Ctrl-C again, while the files are taken away.
    for _ in range(3 if name == "SIGINT" else 1):
        process.send_signal(getattr(signal, name))
        time.sleep(0.02)
    status, out, err = end_of(process)
    said = "stopped by Ctrl-C" if name == "SIGINT" else f"ended by {name}"
    assert (status, out, err) == (128 + getattr(signal, name), "", f"esh-scatter: {said}; nothing was written\n")
    assert files_of(folder) == before


@pytest.mark.parametrize(("name", "said"), [("SIGTERM", "ended by SIGTERM"), ("SIGINT", "stopped by Ctrl-C")])
def test_a_signal_that_a_library_swallows_while_it_writes_is_not_lost(folder, name, said):
    before = files_of(folder)
    script = f"""
import os, signal, sys
from esh.engine.cli import solve_command, start
def writer(path, placement, assets):
    def write(file):
        file.write(b"new")
        try:
            os.kill(os.getpid(), signal.{name})
            for _ in range(1000):
                pass
        except BaseException:
            pass
    return write
solve_command.placement_writer = writer
sys.argv[1:] = {list(SOLVE)} + ["--max-steps", "1", "--quiet"]
sys.exit(start.main())
"""
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False)
    status = 128 + getattr(signal, name)
    assert (finished.returncode, finished.stderr) == (status, f"esh-scatter: {said}; nothing was written\n")
    assert files_of(folder) == before


def test_a_program_that_ignores_hang_ups_goes_on(folder):
    process = start(*SOLVE, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    time.sleep(0.4)
    process.send_signal(signal.SIGHUP)
    assert end_of(process)[0] == 0


def test_ctrl_c_before_anything_is_loaded_is_a_sentence(folder):
    script = """
import os, signal, sys
class Press:
    def find_spec(self, name, path=None, target=None):
        if name == "argparse":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Press())
from esh.engine.cli.start import main
main()
"""
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert finished.returncode == 130
    assert (finished.stdout, finished.stderr) == ("", "esh-scatter: stopped by Ctrl-C; nothing was written\n")


# What numpy's own module in C makes of an exception while it is imported.
WHILE_IMPORTED = """
import os, signal, sys
class Press:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            try:
                os.kill(os.getpid(), signal.{signal})
            except BaseException:
                raise ImportError("you should not try to import numpy from its source directory")
sys.meta_path.insert(0, Press())
sys.argv = ["esh-scatter", {command!r}, "forest.toml", "-o", {output!r}, *{more!r}]
from esh.engine.cli.{start} import main
sys.exit(main())
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("start_module", ["start", "command_line"])
@pytest.mark.parametrize(
    ("command", "output", "more"),
    [("solve", "b.npz", ()), ("batch", "scenes", ("--seeds", "0:2")), ("tiles", "tiled", ())],
)
def test_signals_while_libraries_are_loaded_are_a_sentence(folder, name, start_module, command, output, more):
    before = files_of(folder)
    script = WHILE_IMPORTED.format(
        module="numpy.linalg", signal=name, command=command, output=output, more=more, start=start_module
    )
    words = [sys.executable, "-c", script]
    finished = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False, preexec_fn=hear_hang_up)
    assert finished.returncode == 128 + getattr(signal, name), finished.stderr
    said = "stopped by Ctrl-C" if name == "SIGINT" else f"ended by {name}"
    assert finished.stdout == "" and finished.stderr.startswith(f"esh-scatter: {said}; ")
    assert finished.stderr.count("\n") == 1
    assert files_of(folder) == before


@pytest.mark.parametrize("when", [0.1, 0.2, 0.3, 0.45])
def test_ctrl_c_at_any_time_after_the_start_is_a_sentence(folder, when):
    write(folder, 2_000_000)
    before = files_of(folder)
    process = start(*SOLVE, "--max-steps", "1000000")
    time.sleep(when)
    process.send_signal(signal.SIGINT)
    status, out, err = end_of(process)
    # Earlier than our first line, Python itself answers.
    if "esh-scatter: " in err:
        assert (status, err.count("\n")) == (130, 1) and "Traceback" not in err
    assert out == "" and files_of(folder) == before


# Nothing but what is wrong is written with --quiet, and the profile is a part of the report.
@pytest.mark.parametrize(
    ("closed", "option"),
    [("stdout", "--profile"), ("stdout", "--max-steps=3"), ("stderr", "--quiet"), ("stderr", "--max-steps=3")],
)
def test_whoever_reads_may_leave_at_any_time(folder, closed, option):
    # Crowded, so that there is something to say before the run as well.
    text = (folder / "forest.toml").read_text().replace("area = 0.01", "area = 60.0")
    (folder / "forest.toml").write_text(text.replace("[domain]", "avoid_overlap = true\n[domain]"))
    process = start(*SOLVE, "--max-steps", "2", option)
    getattr(process, closed).close()
    setattr(process, closed, None)
    status, out, err = end_of(process)
    assert status == 0 and "Warp" not in (out or "")
    assert not err or (err.count("\n") == 1 and "footprints would cover 250%" in err)
    assert np.load("b.npz")["position"].shape == (200, 2)
    assert (folder / "a.csv").read_bytes() != b"old a.csv"


def test_no_stream_at_all_is_no_reason_to_lose_a_file(folder):
    command = " ".join(["exec", *COMMAND, *SOLVE, "--max-steps", "2", "--profile", ">&-", "2>&-"])
    assert subprocess.run(["sh", "-c", command], timeout=120, check=False).returncode == 0
    assert np.load("b.npz")["position"].shape == (200, 2)


def test_a_stream_that_closes_before_all_is_written_is_said(folder, monkeypatch, capsys):
    def solve(*_, **__):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr("esh.engine.solve.solve", solve)
    before = files_of(folder)
    status = command_line.main(list(SOLVE))
    assert status == 2 and "nothing was written" in capsys.readouterr().err
    assert files_of(folder) == before


@pytest.mark.parametrize(("name", "said"), [("SIGINT", "Ctrl-C"), ("SIGTERM", "SIGTERM")])
def test_signals_end_compiled_code_that_does_not_come_back(name, said):
    # Waiting for a condition that never holds: like a kernel, it knows nothing of signals.
    script = """
import ctypes, signal, sys
from esh.engine.cli import signals
from esh.engine.cli.compiled_code import ends_in_compiled_code
lock, condition = (ctypes.create_string_buffer(256) for _ in range(2))
library = ctypes.CDLL(None)
with signals.on_signals((*signals.INTERRUPTING, *signals.ENDING), signals.end), ends_in_compiled_code(lambda: False):
    print("waiting", flush=True)
    library.pthread_mutex_lock(lock)
    library.pthread_cond_wait(condition, lock)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "waiting\n"
    time.sleep(0.2)
    process.send_signal(getattr(signal, name))
    status, _, err = end_of(process)
    assert status == 128 + getattr(signal, name)
    assert err == f"esh-scatter: stopped by {said} in the middle of a step; nothing was written\n"


@pytest.mark.parametrize("limit", [0, 20_000])
def test_a_full_disk_is_a_sentence_and_leaves_older_files(folder, limit):
    write(folder, 3000)
    before = files_of(folder)
    process = start(
        *SOLVE,
        *("--max-steps", "1"),
        **full_disk(limit),
    )
    status, out, err = end_of(process)
    assert (status, out) == (2, "")
    assert err == "esh-scatter: a.csv cannot be written: file too large\n"
    assert files_of(folder) == before


def test_an_archive_that_breaks_off_says_nothing_from_its_destructor(folder):
    write(folder, 3000)
    before = files_of(folder)
    process = start(
        *("solve", "forest.toml", "-o", "b.npz", "--device", "cpu", "--max-steps", "1"),
        **full_disk(30_000),
    )
    assert end_of(process) == (2, "", "esh-scatter: b.npz cannot be written: file too large\n")
    assert files_of(folder) == before


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_a_full_disk_is_a_sentence_whatever_the_format(folder, ending):
    if ending in FORMATS:
        pytest.importorskip(FORMATS[ending].library or "numpy")
    write(folder, 3000)
    Path(f"b{ending}").write_text("before")
    before = files_of(folder)
    process = start(
        *("solve", "forest.toml", "-o", f"b{ending}", "--device", "cpu", "--max-steps", "1"),
        **full_disk(3_000),
    )
    status, out, err = end_of(process)
    assert (status, out) == (2, "")
    assert err.startswith(f"esh-scatter: b{ending} cannot be written: ") and err.endswith("file too large\n")
    assert err.count("\n") == 1
    assert files_of(folder) == before


@pytest.fixture
def full_device():
    """What nothing can be written to, where the system has one."""
    path = Path("/dev/full")
    if not path.exists():
        pytest.skip("needs /dev/full")
    with path.open("w") as full:
        yield full


def test_a_report_that_cannot_be_printed_is_a_sentence(folder, full_device):
    process = start(*SOLVE, stdout=full_device)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err == ("esh-scatter: the files are written, but the report could not be printed: no space left on device\n")
    assert np.load("b.npz")["position"].shape == (200, 2)


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [("--help",), ("--version",), ("solve", "--help")])
def test_help_that_cannot_be_printed_is_a_sentence(words, unbuffered, full_device):
    process = start(*words, stdout=full_device, env={**os.environ, "PYTHONUNBUFFERED": unbuffered})
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err == "esh-scatter: what was asked for could not be printed: no space left on device\n"
    process = start(*words)
    process.stdout.close()
    process.stdout = None
    assert end_of(process)[::2] == (0, "")


@pytest.mark.parametrize("closed", [(1,), (2,), (0, 1, 2)])
def test_closed_streams_harm_nobody(folder, closed):
    process = start(*SOLVE, preexec_fn=lambda: [os.close(number) for number in closed])
    status, _, err = end_of(process)
    assert (status, err) == (0, "")
    assert np.load("b.npz")["position"].shape == (200, 2)
    assert Path("a.csv").read_text().startswith("x,y,") and Path("r.json").read_text().startswith("{")
    assert not list(folder.glob(".*"))


def test_a_pipe_is_no_recipe(folder):
    os.mkfifo("pipe.toml")
    status, out, err = end_of(start("solve", "pipe.toml", "-o", "c.npz"))
    assert (status, out) == (2, "")
    assert err == "esh-scatter: pipe.toml is not a regular file; a recipe is a TOML file\n"


def environment_without_cache(tmp_path: Path) -> dict[str, str]:
    kept = {key: value for key, value in os.environ.items() if key not in ("WARP_CACHE_PATH", "XDG_CACHE_HOME")}
    return {**kept, "HOME": "/dev/null", "TMPDIR": str(tmp_path)}


@pytest.mark.parametrize("spoilt", [False, True])
def test_a_home_that_cannot_be_written_has_its_kernels_elsewhere_and_says_so(tmp_path, spoilt):
    script = """
import warnings
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    from esh.engine.device.devices import resolve_device
    resolve_device("cpu")
import warp
print(warp.config.kernel_cache_dir)
print([str(note.message) for note in caught])
"""
    usual = tmp_path / f"esh-scatter-kernels-{os.getuid()}"
    if spoilt:  # others could put code into it
        usual.mkdir()
        usual.chmod(0o777)
    environment = environment_without_cache(tmp_path)
    finished = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment, timeout=60, check=True
    )
    where, notes = finished.stdout.splitlines()
    folder = Path(where).parent
    assert folder.parent == tmp_path and (folder == usual) is not spoilt
    assert folder.stat().st_mode & 0o077 == 0
    assert "compiled kernels cannot be kept in /dev/null/" in notes and str(folder) in notes
    assert finished.stderr == ""


def test_two_cold_caches_at_once(tmp_path):
    script = """
from esh import *
from esh.engine.descent.initial_placement import initial_placement
problem = Problem(Domain((4.0, 3.0)), [BodyClass("a", [Size("s", 0.1, 50)])], seed=1)
print(initial_placement(problem).tobytes().hex())
"""
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cold")}
    running = [
        subprocess.Popen(
            [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        )
        for _ in range(2)
    ]
    ends = [end_of(process) for process in running]
    assert [status for status, _, _ in ends] == [0, 0], ends
    assert ends[0][1] == ends[1][1] and len(ends[0][1]) > 500


def test_two_hundred_runs_keep_their_memory():
    script = """
import os
from esh import *
problem = Problem(Domain((4.0, 3.0)), [BodyClass("a", [Size("s", 0.01, 300)])], avoid_overlap=True)
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
for k in range(200):
    solve(problem, device="cpu", max_steps=2)
    if k == 60:
        before = resident()
print(resident() - before, len(os.listdir("/proc/self/task")))
"""
    if not Path("/proc/self/statm").exists():
        pytest.skip("needs /proc")
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=200, check=True)
    grown, threads = map(int, finished.stdout.split())
    assert grown < 10_000_000
    # Those of the libraries alone.
    assert threads < 40


def test_separating_replaces_nothing_unasked(folder, capfd):
    from PIL import Image

    Image.new("RGB", (8, 6), "teal").save("photo.png")
    Path("recipe.toml").write_text("# mine\n")
    before = files_of(folder)
    assert command_line.main(["separate", "photo.png", "-o", "."]) == 2
    assert "-o . holds another recipe.toml, which would be replaced; choose another folder, or add --overwrite" in (
        capfd.readouterr().err
    )
    assert files_of(folder) == before
    assert command_line.main(["separate", "photo.png", "-o", ".", "--overwrite"]) == 0
    made = files_of(folder)
    assert made["recipe.toml"].startswith(b"# photo.png in the inks of CMYK")
    # What would be the same again is no loss.
    assert command_line.main(["separate", "photo.png", "-o", "."]) == 0
    assert files_of(folder) == made
    assert command_line.main(["separate", "photo.png", "-o", ".", "--area", "2"]) == 2


@pytest.mark.parametrize("name", ['=HYPERLINK("http://x")', "+1", "-1", "@SUM(A1)", "\uff1d1"])
def test_names_are_no_formulas_in_a_spreadsheet(folder, name):
    import csv

    text = RECIPE.format(count=5).replace('name = "pine"', f"name = '{name}'").replace('"any"', f"'{name}'")
    (folder / "forest.toml").write_text(text, encoding="utf-8")
    assert command_line.main([*SOLVE, "--quiet"]) == 0
    with open("a.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["class_name"], row["size_name"]) for row in rows} == {(f"'{name}", f"'{name}")}
    assert np.load("b.npz")["class_name"].tolist() == [name]
