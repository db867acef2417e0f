"""Placements as files: what is in them, that equal ones are equal to the byte, and that none is ever half done."""

from __future__ import annotations

import csv
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from esh import BodyClass, Domain, EshError, Placement, Problem, Report, Size
from esh.engine.files import placement_files
from esh.engine.files.placement_files import (
    WRITERS,
    PlacementWriter,
    check_ending,
    check_writable,
    one_of,
    placement_writer,
    write_files,
    write_placement,
)
from esh.engine.problem.report import ClassReport, SizeReport

ROOT = Path(__file__).parents[3]


@pytest.fixture
def placement() -> Placement:
    classes = [
        BodyClass("pine, old", [Size("large", 2.0, 3), Size('"small"', 1.0, 4)]),
        BodyClass("Bärlauch 木", [Size("only", 0.5, 2)]),
    ]
    problem = Problem(Domain((10.0, 4.0)), classes)
    position = np.random.default_rng(5).random((9, 2)) * problem.domain.size
    return Placement(
        problem,
        position,
        np.array([0] * 7 + [1] * 2, np.int32),
        np.array([0] * 3 + [1] * 4 + [0] * 2, np.int32),
        np.linspace(0, 1, 9),
        np.zeros(9),
        np.zeros(9),
        Report(1, True, 0.1, "cpu", 0.0, None, 0, 0.0, ()),
    )


def test_npz_holds_everything_without_pickle(tmp_path, placement):
    write_placement(tmp_path / "out.npz", placement)
    with np.load(tmp_path / "out.npz", allow_pickle=False) as stored:
        assert set(stored) == {
            *("position", "class_index", "size_index", "angle", "length", "width", "area", "variant", "scale"),
            "class_name",
        }
        for key in ("position", "class_index", "size_index", "angle", "length", "width", "area", "variant", "scale"):
            np.testing.assert_array_equal(stored[key], getattr(placement, key))
            assert stored[key].dtype == getattr(placement, key).dtype
        assert tuple(stored["class_name"]) == placement.class_name


def test_csv_reads_back_to_the_same_numbers(tmp_path, placement):
    write_placement(str(tmp_path / "out.CSV"), placement)
    with (tmp_path / "out.CSV").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    first = ["x", "y", "class_index", "size_index", "angle", "length", "class_name", "size_name"]
    assert list(rows[0]) == [*first, "width", "area", "variant", "scale"]
    np.testing.assert_array_equal([float(row["area"]) for row in rows], placement.area)
    np.testing.assert_array_equal([[float(row["x"]), float(row["y"])] for row in rows], placement.position)
    np.testing.assert_array_equal([int(row["class_index"]) for row in rows], placement.class_index)
    np.testing.assert_array_equal([float(row["angle"]) for row in rows], placement.angle)
    names = [(row["class_name"], row["size_name"]) for row in rows]
    assert names == [("pine, old", "large")] * 3 + [("pine, old", '"small"')] * 4 + [("Bärlauch 木", "only")] * 2


@pytest.mark.parametrize("ending", WRITERS)
def test_equal_placements_give_equal_bytes_at_any_time(tmp_path, placement, ending, monkeypatch):
    try:
        WRITERS[ending].check()
    except EshError as missing:
        pytest.skip(str(missing))
    write_placement(tmp_path / f"a{ending}", placement)
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 1e7)
    write_placement(tmp_path / f"b{ending}", placement)
    assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()


def fail(file):
    file.write(b"half")
    raise OSError(28, "No space left on device")


def test_a_failure_leaves_every_older_file_and_nothing_else(tmp_path, placement):
    old = {tmp_path / "a.npz": b"old a", tmp_path / "b.csv": b"old b"}
    for path, content in old.items():
        path.write_bytes(content)
    first, second = old
    with pytest.raises(EshError, match=r"b\.csv cannot be written: no space left on device"):
        write_files({first: placement_writer(first, placement), second: fail})
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == old


def test_an_interruption_leaves_nothing_behind(tmp_path):
    def interrupt(file):
        raise KeyboardInterrupt

    (tmp_path / "a.npz").write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        write_files({tmp_path / "a.npz": interrupt})
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("a.npz", b"old")]


def test_a_link_stays_a_link_and_rights_stay(tmp_path, placement):
    (tmp_path / "real.npz").write_bytes(b"old")
    (tmp_path / "real.npz").chmod(0o640)
    try:
        (tmp_path / "link.npz").symlink_to(tmp_path / "real.npz")
    except OSError:
        pytest.skip("this system lets only administrators make links")
    write_placement(tmp_path / "link.npz", placement)
    assert (tmp_path / "link.npz").is_symlink()
    assert np.load(tmp_path / "real.npz")["position"].shape == (9, 2)
    if os.name == "posix":
        assert (tmp_path / "real.npz").stat().st_mode & 0o777 == 0o640


def test_what_cannot_be_written_is_said_in_one_sentence(tmp_path, placement):
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "file").write_bytes(b"")
    for path, complaint in {
        tmp_path / "absent" / "a.npz": "cannot be written: there is no folder",
        tmp_path / "file" / "a.npz": "cannot be written: there is no folder",
        tmp_path / "folder.npz": "cannot be written: it is a folder",
        tmp_path / "a.txt": r"must end in \.npz, \.csv, .* or \.geojson; got the ending '\.txt'",
        tmp_path / "npz": r"must end in \.npz, \.csv, .* or \.geojson; got the ending ''",
        tmp_path / "nul\0.npz": "cannot be written",
        tmp_path / ("x" * 300 + ".npz"): "cannot be written",
    }.items():
        with pytest.raises(EshError, match=complaint):
            write_placement(path, placement)
    assert {path.name for path in tmp_path.iterdir()} == {"folder.npz", "file"}


@pytest.mark.skipif(os.name != "posix", reason="rights of folders are POSIX's")
def test_a_folder_without_the_right_to_write():
    # Not tmp_path: only its owner may look into the folders above it.
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o555)
        root = os.geteuid() == 0
        if root:
            # Rights keep everybody out but root, and it is the real user who is asked for.
            os.setreuid(65534, 0)
        try:
            with pytest.raises(EshError, match="no permission to write to the folder"):
                check_writable(folder / "a.npz")
        finally:
            if root:
                os.setreuid(0, 0)


def test_a_new_writer_is_one_entry(tmp_path, placement, monkeypatch):
    counts = PlacementWriter("the number of bodies", lambda file, p, assets: file.write(b"%d" % len(p.position)))
    monkeypatch.setitem(WRITERS, ".count", counts)
    write_placement(tmp_path / "a.COUNT", placement)
    assert (tmp_path / "a.COUNT").read_bytes() == b"9"
    with pytest.raises(EshError, match=r"must end in \.npz, .* or \.count; got the ending '\.txt'"):
        write_placement(tmp_path / "a.txt", placement)


def test_of_endings_that_fit_the_longest_is_taken():
    assert check_ending("a.geo.JSON", [".json", ".geo.json"]) == ".geo.json"
    assert check_ending("a.b.json", [".json", ".geo.json"]) == ".json"
    with pytest.raises(EshError, match=r"^-o \.geo\.json must have a name before its ending, for example plan\.geo"):
        check_ending(".geo.json", [".json", ".geo.json"], "-o")


def test_words_of_a_sentence():
    assert [one_of("a"), one_of("ab"), one_of("abc")] == ["a", "a or b", "a, b or c"]


def test_the_documents_name_every_format():
    for ending in WRITERS:
        assert f"``{ending}``" in placement_files.write_placement.__doc__
        assert f"`{ending}`" in (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8")


def test_the_documents_name_every_key_of_a_report():
    text = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8")
    table = text.partition("The report has these keys")[2].partition("The printed report")[0]
    rows = [row.split(" | ")[0] for row in table.splitlines() if row.startswith("| `")]
    named = " ".join(rows)
    size = SizeReport("only", 1.0, 3, 3)
    report = Report(1, True, 0.1, "cpu", 0.1, None, 0, 0.0, (ClassReport("a", 0.1, (size,)),)).to_dict()
    of_class = report["classes"][0]
    for key in report:
        assert f"| `{key}`" in table, key
    for key in of_class:
        assert f"`{key}`" in named, key
    sizes = next(row for row in table.splitlines() if row.startswith("| `sizes`"))
    for key in of_class["sizes"][0]:
        assert f"`{key}`" in sizes, key
