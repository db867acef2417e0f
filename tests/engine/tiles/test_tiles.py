"""Tiles: exact counts, the same bytes whoever makes them, continued after any kill, and no seams."""

from __future__ import annotations

import json
import math
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
from esh.engine.tiles.plan import TileRun, make_plan
from esh.engine.tiles.tiles import STEPS
from PIL import Image
from scipy import ndimage, spatial

pytestmark = pytest.mark.slow

COMMAND = [sys.executable, "-m", "esh.engine.cli.command_line"]
RECIPE = """
version = 1
seed = 3
[domain]
size = [64.0, 48.0]
[[class]]
name = "pine"
density = "pine.npy"
[[class.size]]
name = "large"
area = 2.0
count = 1001
[[class.size]]
name = "small"
area = 0.5
count = 2003
[[class]]
name = "beech"
density = "beech.png"
[[class.size]]
name = "any"
area = 1.0
count = 2400
"""


@pytest.fixture
def recipe(tmp_path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    rows, columns = np.mgrid[0:96, 0:128]
    pine = (columns / 128 + 0.1).astype(np.float32)
    # A lake.
    pine[(rows - 40) ** 2 + (columns - 60) ** 2 < 300] = 0.0
    np.save(folder / "pine.npy", pine)
    beech = np.full((48, 64), 200, np.uint8)
    beech[:, :20] = 40
    Image.fromarray(beech).save(folder / "beech.png")
    (folder / "forest.toml").write_text(RECIPE)
    return folder / "forest.toml"


def solved(recipe, folder, **options) -> dict[str, np.ndarray]:
    options = {"device": "cpu", "ending": ".npz", "tile": 24.0, "steps": (6, 4, 4), "workers": 0} | options
    esh.solve_tiles(recipe, folder, **options)
    return joined(folder)


def joined(folder: Path) -> dict[str, np.ndarray]:
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    keys = ("id", "position", "area", "class_index", "size_index", "angle", "length", "width")
    whole = {key: np.concatenate([part[key] for part in parts]) for key in keys}
    order = np.argsort(whole["id"])
    return {key: values[order] for key, values in whole.items()}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


def test_every_body_is_there_once_and_inside_its_tile_and_density(recipe, tmp_path):
    recipe.write_text(RECIPE.replace("area = 1.0", "area = [0.5, 1.5]"))
    out = tmp_path / "out"
    bodies = solved(recipe, out)
    assert np.array_equal(bodies["id"], np.arange(1001 + 2003 + 2400))
    assert np.bincount(bodies["class_index"] * 2 + bodies["size_index"]).tolist() == [1001, 2003, 2400]
    # The areas of the range are those of one solve.
    assert np.allclose(bodies["area"][3004:], np.linspace(0.5, 1.5, 2400))
    x, y = bodies["position"].T
    pine = np.load(recipe.parent / "pine.npy")
    own = bodies["class_index"] == 0
    row, column = ((1.0 - y[own] / 48.0) * 96).astype(int).clip(0, 95), (x[own] / 0.5).astype(int).clip(0, 127)
    assert (pine[row, column] > 0.0).all()
    index = json.loads((out / "index.json").read_text())
    assert index["bodies"] == index["counted"] == 5404
    assert len(index["tiles"]) == 4
    for tile in index["tiles"]:
        place = np.load(out / tile["file"])["position"]
        assert (place >= tile["low"]).all() and (place <= tile["high"]).all()
    assert not (out / ".work").exists()


def test_a_folder_that_was_emptied_gets_the_problem_that_is_solved_now(tmp_path):
    out, found = tmp_path / "out", []
    for seed in (1, 2):
        trees = esh.BodyClass("tree", [esh.Size("any", area=0.5, count=1600)])
        problem = esh.Problem(esh.Domain((40.0, 40.0)), [trees], seed=seed)
        esh.solve_tiles(problem, out, ending=".npz", steps=(2, 2, 2), device="cpu", workers=0)
        found.append(np.load(next(out.glob("tile-*.npz")))["position"])
        shutil.rmtree(out)
    assert not np.array_equal(*found)


@pytest.mark.parametrize("apart", [False, True])
def test_the_last_pass_is_the_longest(recipe, tmp_path, apart):
    """Where the cuts of the passes before cross, it alone settles bodies: lines were three percent closer to each other there."""
    if apart:
        recipe.write_text(RECIPE.replace("seed = 3", "seed = 3\navoid_overlap = true"))
    # What is kept for the process would be of the other recipe where both had one path.
    passes = make_plan.__wrapped__(TileRun(str(recipe), str(tmp_path), None, (2, 2), STEPS, "cpu", ".npz", "")).passes
    steps = [this.steps for this in passes]
    assert len(steps) == 3 + apart and steps[-1] == STEPS[-1] > 1.1 * max(steps[:-1])
    assert passes[-1].shift == (0.0, 0.0)


def test_counts_follow_the_density(recipe, tmp_path):
    bodies = solved(recipe, tmp_path / "out")
    beech = bodies["position"][bodies["class_index"] == 1]
    dark = 20 * 40 / (20 * 40 + 44 * 200)
    assert (beech[:, 0] < 20.0).sum() == pytest.approx(2400 * dark, abs=20)


def test_any_number_of_workers_makes_the_same_bytes(recipe, tmp_path):
    for workers in (0, 2):
        solved(recipe, tmp_path / str(workers), workers=workers)
    assert contents(tmp_path / "0") == contents(tmp_path / "2")


def test_a_run_that_is_killed_goes_on(recipe, tmp_path):
    options = ["--tile", "24", "--steps", "6,4,4", "--as", ".npz", "--device", "cpu", "--workers", "1"]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert command_line.main(["tiles", str(recipe), "-o", str(whole), "--quiet", *options]) == 0
    kills = 0
    for stage in ("start", "pass-1", "pass-3"):
        process = subprocess.Popen(
            [*COMMAND, "tiles", str(recipe), "-o", str(killed), "--quiet", *options], start_new_session=True
        )
        deadline = time.monotonic() + 120.0
        while process.poll() is None and time.monotonic() < deadline:
            if any((killed / ".work" / stage).glob("0*.npz")):
                break
            time.sleep(0.005)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            kills += 1
        process.wait()
    assert kills >= 2
    assert command_line.main(["tiles", str(recipe), "-o", str(killed), "--quiet", *options]) == 0
    assert contents(killed) == contents(whole)
    # A run that is over has nothing left to do.
    before = (killed / "index.json").stat().st_mtime_ns
    assert command_line.main(["tiles", str(recipe), "-o", str(killed), "--quiet", *options]) == 0
    assert (killed / "index.json").stat().st_mtime_ns == before


def test_parts_that_are_there_are_not_made_again(recipe, tmp_path):
    made: list[tuple[str, int]] = []

    def stop_in_the_second_pass(state):
        made.append((state.name, state.done))
        if state.name == "pass-2" and state.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solved(recipe, tmp_path / "out", progress=stop_in_the_second_pass)
    made.clear()
    solved(recipe, tmp_path / "out", progress=lambda state: made.append((state.name, state.done)))
    assert made[0] == ("pass-2", 2)
    assert [name for name, _ in made if name in ("survey", "start", "pass-1")] == []
    solved(recipe, tmp_path / "out")
    assert not (tmp_path / "out" / ".work").exists()


def test_a_folder_of_another_run_is_left_alone(recipe, tmp_path):
    out = tmp_path / "out"
    solved(recipe, out)
    before = contents(out)
    with pytest.raises(EshError, match="differs in its steps"):
        solved(recipe, out, steps=(7, 4, 4))
    with pytest.raises(EshError, match="differs in its seed"):
        solved(recipe, out, seed=9)
    recipe.write_text(RECIPE.replace("2003", "2004"))
    with pytest.raises(EshError, match="differs in its recipe"):
        solved(recipe, out)
    assert contents(out) == before
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    with pytest.raises(EshError, match="holds other files"):
        solved(recipe, tmp_path / "other")


def uniform(count: int, **more) -> esh.Problem:
    side = math.sqrt(count)
    size = esh.Size("one", area=more.pop("area", 1.0), count=count)
    return esh.Problem(esh.Domain((side, side)), [esh.BodyClass("dot", [size])], seed=5, **more)


def error_map(position: np.ndarray, side: float, blur: float, pixels: int = 4) -> np.ndarray:
    cells = round(side * pixels)
    there, _, _ = np.histogram2d(position[:, 1], position[:, 0], cells, [[0.0, side], [0.0, side]])
    return ndimage.gaussian_filter(there * pixels**2 - len(position) / side**2, blur * pixels, mode="constant")


def rows_along(position: np.ndarray, cut: float) -> float:
    """How unequal the numbers of bodies are in narrow strips beside a cut: bodies along an edge stand in rows."""
    beside = np.concatenate([position[:, axis] - cut for axis in (0, 1)])
    number, _ = np.histogram(beside, np.arange(-4.0, 4.01, 0.5))
    return float(number.std() / number.mean())


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_tiles_are_as_even_as_one_solve_and_have_no_seams(tmp_path):
    problem = uniform(10_000)
    tiled = solved(problem, tmp_path / "out", tile=50.0, steps=(40, 30, 30))["position"]
    whole = esh.solve(problem, device="cpu").position
    for blur, most in ((0.5, 1.1), (1.0, 1.2), (2.0, 1.6)):
        assert rms(error_map(tiled, 100.0, blur)) < most * rms(error_map(whole, 100.0, blur))
    mine = error_map(tiled, 100.0, 1.0)[40:-40, 40:-40]
    place = np.arange(40, 360) / 4.0
    for shift in (50.0 / 3.0, 100.0 / 3.0, 50.0):
        near = np.abs((place - shift + 25.0) % 50.0 - 25.0) < 2.0
        strip = near[None, :] | near[:, None]
        assert rms(mine[strip]) < 1.3 * rms(mine[~strip])
    assert max(rows_along(tiled, cut) for cut in (50.0 / 3.0, 100.0 / 3.0, 50.0, 200.0 / 3.0)) < 0.2
    closest = [spatial.cKDTree(p).query(p, 2)[0][:, 1].min() for p in (tiled, whole)]
    assert closest[0] > 0.97 * closest[1]


def test_tiles_that_lie_side_by_side_unsolved_would_have_seams(tmp_path):
    # What the measures above are worth: windows that know nothing of each other fail them.
    quarter = uniform(2_500)
    one = esh.solve(quarter, device="cpu").position
    tiled = np.concatenate([one + [x, y] for x in (0.0, 50.0) for y in (0.0, 50.0)])
    assert rows_along(tiled, 50.0) > 0.6


def test_a_single_tile_is_one_solve(tmp_path):
    bodies = solved(uniform(400), tmp_path / "out", tile=None, steps=(20, 15, 15))
    assert len(list((tmp_path / "out").glob("tile-*.npz"))) == 1
    nearest = spatial.cKDTree(bodies["position"]).query(bodies["position"], 2)[0][:, 1]
    assert nearest.min() > 0.7


def test_rare_bodies_are_even_among_themselves(tmp_path):
    many = esh.BodyClass("many", [esh.Size("one", area=1.0, count=9_936)])
    rare = esh.BodyClass("rare", [esh.Size("one", area=1.0, count=64)])
    problem = esh.Problem(esh.Domain((100.0, 100.0)), [many, rare], seed=1)
    bodies = solved(problem, tmp_path / "out", tile=33.0)
    few = bodies["position"][bodies["class_index"] == 1]
    place = (few / 50.0).astype(int)
    number = np.bincount(place[:, 1] * 2 + place[:, 0], minlength=4)
    assert number.min() >= 14 and number.max() <= 18
    # Their spacing is 12.5; what is carried along a curve alone comes as near as a third of it, and windows see too few of them.
    assert spatial.cKDTree(few).query(few, 2)[0][:, 1].min() > 10.0


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the largest memory that a process had")
def test_the_largest_process_holds_a_window_and_not_the_domain(tmp_path):
    # A density of 600 MB in a file, of which no process reads more than a window at a time.
    folder = tmp_path / "in"
    folder.mkdir()
    density = np.lib.format.open_memmap(folder / "wide.npy", mode="w+", dtype=np.float32, shape=(12_000, 12_000))
    for row in range(0, 12_000, 3_000):
        density[row : row + 1_500] = 1.0
    density.flush()
    del density
    (folder / "wide.toml").write_text(
        'version = 1\n[domain]\nsize = [12000.0, 12000.0]\n[[class]]\nname = "a"\ndensity = "wide.npy"\n'
        '[[class.size]]\nname = "one"\narea = 1.0\ncount = 4000\n'
    )
    script = (
        "import esh\n"
        f"esh.solve_tiles({str(folder / 'wide.toml')!r}, {str(tmp_path / 'out')!r}, tile=6000.0, steps=(3, 2, 2), device='cpu',"
        " ending='.npz', workers=0)\n"
        "print(next(line for line in open('/proc/self/status') if 'VmHWM' in line).split()[1])\n"
    )
    answer = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert int(answer.stdout.split()[-1]) < 600_000  # kB, of which Python and Warp have 300,000
    bodies = joined(tmp_path / "out")
    assert ((bodies["position"][:, 1] % 3000.0) > 1500.0 - 1e-6).all()


def test_geoparquet_says_where_the_world_is(recipe, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    # A world file: pixels of 5 m, the middle of the first at (1002.5, 7997.5).
    (recipe.parent / "pine.npyw").write_text("5.0\n0.0\n0.0\n-5.0\n1002.5\n7997.5\n")
    esh.solve_tiles(recipe, tmp_path / "geo", tile=24.0, steps=(2, 2, 2), device="cpu", workers=0)
    plain = solved(recipe, tmp_path / "plain", steps=(2, 2, 2))
    tables = [parquet.read_table(path) for path in sorted((tmp_path / "geo").glob("tile-*.parquet"))]
    described = json.loads(tables[0].schema.metadata[b"geo"])
    assert described["columns"]["geometry"]["encoding"] == "point"
    identity = np.concatenate([table["id"].to_numpy() for table in tables])
    place = np.concatenate([np.array([[p["x"], p["y"]] for p in table["geometry"].to_pylist()]) for table in tables])
    assert np.array_equal(place[np.argsort(identity)], plain["position"])
    # 128 pixels of 5 m over 64 m of the domain, the lower left corner at (1000, 7520).
    assert (place.min(axis=0) >= [1000.0, 7520.0]).all()
    assert np.ptp(place, axis=0) == pytest.approx([640.0, 480.0], rel=0.03)
    # The list of the tiles has their corners in the same coordinates.
    index = json.loads((tmp_path / "geo" / "index.json").read_text())["tiles"]
    for tile, table in zip(index, tables, strict=True):
        there = np.array([[p["x"], p["y"]] for p in table["geometry"].to_pylist()])
        assert (there >= tile["low"]).all() and (there <= tile["high"]).all()
    assert [index[0]["low"], index[-1]["high"]] == [[1000.0, 7520.0], [1640.0, 8000.0]]
    back = esh.load_placement(sorted((tmp_path / "geo").glob("tile-*.parquet"))[0])
    assert np.array_equal(back.position[:, :2], place[: len(back.position)])
    assert back.class_name == ("pine", "beech")


def test_values_without_meaning_are_refused(recipe, tmp_path):
    for options, message in (
        ({"tile": 1.0}, "`tile` must be at least"),
        ({"steps": (1, 2)}, "`steps` must be three"),
        ({"workers": -1}, "`workers`"),
        ({"ending": ".csv"}, "`ending` must be"),
    ):
        with pytest.raises(EshError, match=message):
            solved(recipe, tmp_path / "out", **options)
    values = np.load(recipe.parent / "pine.npy")
    values[50, 100] = np.nan
    np.save(recipe.parent / "pine.npy", values)
    with pytest.raises(EshError, match="finite values"):
        solved(recipe, tmp_path / "nan")


def test_the_command_says_what_it_did(recipe, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["tiles", str(recipe), "-o", str(out), "--tile", "24", "--steps", "2,2,2", "--as", ".npz"]
    assert command_line.main([*arguments, "--device", "cpu", "--workers", "0"]) == 0
    assert "5,404 bodies are placed in 4 tiles, 2 by 2" in capsys.readouterr().out
    assert command_line.main([*arguments[:-1], ".csv"]) == 2
    assert "--as must be .parquet or .npz" in capsys.readouterr().err
    shutil.rmtree(out)
    assert command_line.main(["tiles", str(recipe), "-o", str(recipe), "--as", ".npz"]) == 2
    assert "cannot be used" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("count", "said"), [(300, ""), (700, "footprints would cover 140% of the space where they may be, but at most")]
)
def test_what_cannot_fit_is_said_before_it_is_placed(count, said, tmp_path, capsys):
    """Hours went by without a word."""
    image = np.zeros((8, 8), np.float32)
    image[:, :4] = 1.0
    np.save(tmp_path / "half.npy", image)
    (tmp_path / "r.toml").write_text(
        "version = 1\navoid_overlap = true\n[domain]\nsize = [40, 25]\n[[class]]\nname = 'a'\ndensity = 'half.npy'\n"
        f"[[class.size]]\nname = 's'\narea = 1.0\ncount = {count}\n"
    )
    arguments = ["tiles", str(tmp_path / "r.toml"), "-o", str(tmp_path / "out"), "--device", "cpu", "--as", ".npz"]
    assert command_line.main([*arguments, "--workers", "0", "--steps", "1,1,1"]) == 0
    told = capsys.readouterr()
    assert said in told.err and bool(said) == ("footprints" in told.err)
    # And at the end, by whoever reads it there.
    assert said in told.out and bool(said) == ("footprints" in told.out)


@pytest.mark.parametrize("avoided", [False, True])
def test_notes_that_need_no_measuring_are_told(avoided, tmp_path):
    tree = esh.BodyClass("tree", [esh.Size("any", area=1.5, count=1600)], gap=0.1, clump_size=3.0)
    problem = esh.Problem(esh.Domain((40.0, 40.0)), [tree], avoid_overlap=avoided)
    out, seen = tmp_path / "out", []
    for _ in range(2):
        state = esh.solve_tiles(
            problem, out, ending=".npz", steps=(1, 1, 1), device="cpu", workers=0, progress=seen.append
        )
        told = seen[0].notes
        assert state.notes[: len(told)] == told
        assert json.loads((out / "index.json").read_text())["notes"] == list(state.notes)
    said = ["at most about"] if avoided else ["add up to 150% of", "`gap` of class"]
    assert len(told) == len(said) + 1 and all(one in note for one, note in zip(said[:1], told, strict=False))
    for one in (*said, "`clump_size` of class"):
        assert any(one in note for note in told)
    # What is counted at the end is told then.
    counted = state.notes[len(told) :]
    assert len(counted) == avoided and all("pairs of footprints still overlap" in note for note in counted)
    whole = esh.solve(problem, device="cpu", max_steps=1).report.notes
    assert avoided or set(state.notes) == set(whole)


def test_a_geotiff_is_read_by_window_and_keeps_its_place(recipe, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    parquet = pytest.importorskip("pyarrow.parquet")
    values = (np.load(recipe.parent / "pine.npy") * 1000.0).astype(np.uint16)
    place = rasterio.transform.from_origin(400_000.0, 5_300_000.0, 10.0, 10.0)
    described = {"driver": "GTiff", "height": 96, "width": 128, "count": 1, "dtype": "uint16", "nodata": 0}
    with rasterio.open(
        recipe.parent / "pine.tif", "w", **described, crs="EPSG:32632", transform=place, tiled=True
    ) as file:
        file.write(values, 1)
    # The same numbers as an array, for comparison.
    np.save(recipe.parent / "pine.npy", values)
    plain = solved(recipe, tmp_path / "plain")
    recipe.write_text(RECIPE.replace("pine.npy", "pine.tif"))
    options = {"tile": 24.0, "steps": (6, 4, 4), "device": "cpu"}
    esh.solve_tiles(recipe, tmp_path / "geo", **options, workers=1)
    tables = [parquet.read_table(path) for path in sorted((tmp_path / "geo").glob("tile-*.parquet"))]
    identity = np.concatenate([table["id"].to_numpy() for table in tables])
    where = np.concatenate([np.array([[p["x"], p["y"]] for p in table["geometry"].to_pylist()]) for table in tables])
    # 10 m in the world are half a meter in the domain; the upper left corner is the origin.
    expected = np.array([400_000.0, 5_300_000.0 - 960.0]) + plain["position"] * 20.0
    assert np.allclose(where[np.argsort(identity)], expected, atol=1e-6)
    crs = json.loads(tables[0].schema.metadata[b"geo"])["columns"]["geometry"]["crs"]
    assert crs["id"]["code"] == 32632
    recipe.write_text(
        RECIPE.replace("pine.npy", "pine.tif").replace('density = "pine.tif"', 'density = "pine.tif"\nunsharp = {}')
    )
    with pytest.raises(EshError, match="must not be given for a GeoTIFF"):
        solved(recipe, tmp_path / "unsharp")


@pytest.mark.parametrize(
    ("arguments", "options", "said"),
    [
        ((None, "tiles"), {}, "`problem` must be the path of a file; got None"),
        (("dots.toml", 3), {}, "`folder` must be the path of a file; got 3"),
        (("dots.toml", "tiles"), {"steps": 5}, "`steps` must be three numbers, one for each pass; got 5"),
        (("dots.toml", "tiles"), {"progress": "x"}, '`progress` must be a function, or None; got "x"'),
    ],
)
def test_what_has_no_meaning_is_said(arguments, options, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(esh.ProblemError) as caught:
        esh.solve_tiles(*arguments, **{"device": "cpu", **options})
    assert str(caught.value) == said
    assert not list(tmp_path.iterdir())
