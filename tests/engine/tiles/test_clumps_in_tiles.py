"""Clumps in tiles: those of one solve in character, without seams between their blocks, and the same bytes whoever makes them."""

from __future__ import annotations

import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.problem.clumps import CROWDING, STRENGTHS
from esh.engine.quality.coverage import coverage_error
from esh.engine.tiles import clump_blocks
from esh.engine.tiles.clump_blocks import ClumpedSource, Clumps, write_block
from esh.engine.tiles.density_windows import ArraySource
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

pytestmark = pytest.mark.slow


def positions(problem: esh.Problem | Path, folder: Path, **options) -> list[np.ndarray]:
    """Positions of the bodies of every class."""
    options = {"device": "cpu", "ending": ".npz", "tile": 40.0, "workers": 0} | options
    esh.solve_tiles(problem, folder, **options)
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    assert len(parts) > 1 and not (folder / ".work").exists()
    place, kind = (np.concatenate([part[key] for part in parts]) for key in ("position", "class_index"))
    return [place[kind == c] for c in range(int(kind.max()) + 1)]


def clumps_of(folder: Path, extent=(100.0, 60.0), wraps=False, size=2.5, clustering=0.8, seed=(1, 8, 0)) -> Clumps:
    return Clumps(size, clustering, extent, wraps, seed, 1.0, 0.0, folder)


def whole(source: ClumpedSource) -> np.ndarray:
    for number in range(math.prod(source.clumps.blocks)):
        write_block(source, number)
    return source.read(0, source.shape[0], 0, source.shape[1])


@pytest.mark.parametrize("wraps", [False, True])
def test_blocks_fit_to_each_other_wherever_they_are_cut(tmp_path, monkeypatch, wraps):
    asked = ArraySource(np.ones((1, 1), np.float32))
    one = whole(ClumpedSource(asked, clumps_of(tmp_path / "one", wraps=wraps)))
    monkeypatch.setattr(clump_blocks, "BLOCK", 70)
    cut = ClumpedSource(asked, clumps_of(tmp_path / "cut", wraps=wraps))
    many = whole(cut)
    assert cut.clumps.blocks == (3, 5) and one.shape == many.shape == (192, 320)
    # Of a whole one that wraps only what is far from its edges is made as if it went on.
    inside = np.s_[64:-64, 64:-64] if wraps else np.s_[:, :]
    assert 0.7 < one.std() < 1.0 and one.mean() == pytest.approx(1.0, abs=0.03)
    assert np.sqrt(((many - one)[inside] ** 2).mean()) < 0.05
    # Steps from pixel to pixel are no larger between blocks than in them.
    across = np.abs(np.diff(many, axis=1)).mean(axis=0)
    edges = [cut.clumps.edges(1, k)[1] - 1 for k in range(4)]
    assert across[edges].max() < 1.6 * across.mean()
    if wraps:
        around = np.abs(many[:, 0] - many[:, -1]).mean()
        assert around < 1.6 * across.mean()


def test_parts_of_a_clumped_density_are_parts_of_the_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(clump_blocks, "BLOCK", 70)
    density = np.random.default_rng(3).random((7, 13)).astype(np.float32) + 0.2
    density[2:4, 5:8] = 0.0
    source = ClumpedSource(ArraySource(density), clumps_of(tmp_path))
    image = whole(source)
    rows, columns = source.shape
    assert rows % 7 == columns % 13 == 0 and rows >= 192 and columns >= 320
    for top, bottom, left, right in ((0, 1, 0, 1), (50, 130, 60, 220), (rows - 3, rows, columns - 5, columns)):
        assert np.array_equal(source.read(top, bottom, left, right), image[top:bottom, left:right])
    fine = np.kron(density, np.ones((rows // 7, columns // 13)))
    assert ((image > 0.0) == (fine > 0.0)).all()
    # Blurred over clumps, it is what was asked for. A wavelength is 5 m.
    pixels = 0.8 * 5.0 * rows / 60.0
    off = gaussian_filter(image, pixels, mode="constant") - gaussian_filter(fine, pixels, mode="constant")
    assert np.sqrt((off**2).mean()) < 0.01 * fine.mean()


def test_clumps_that_are_no_smaller_than_their_strength_crowd_bodies_as_is_known(tmp_path):
    for strength, crowding in zip(STRENGTHS[1:], CROWDING[1:], strict=True):
        clumps = clumps_of(tmp_path / f"{strength:g}", extent=(120.0, 120.0), clustering=strength)
        factor = whole(ClumpedSource(ArraySource(np.ones((1, 1), np.float32)), clumps)).astype(np.float64)
        assert (factor**2).mean() / factor.mean() ** 2 - 1.0 == pytest.approx(crowding, rel=0.1)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_clumps_are_those_of_one_solve_in_character(tmp_path, boundary):
    # Twice as many to the left: at large they are as many as without clumps.
    density = np.array([[2.0, 1.0]], np.float32)
    domain = esh.Domain((80.0, 80.0), boundary)
    sizes = [esh.Size("one", area=0.3, count=6400)]
    problem = esh.Problem(domain, [esh.BodyClass("a", sizes, density, clustering=0.7, clump_size=3.0)], seed=5)
    tiled = positions(problem, tmp_path / "out")[0]
    once = esh.solve(problem, device="cpu").position
    assert len(tiled) == 6400 and (tiled[:, 0] < 40.0).mean() == pytest.approx(2.0 / 3.0, abs=0.005)
    near = [cKDTree(place).query(place, 7)[0][:, (1, 6)] for place in (tiled, once)]
    for percent in (5, 25, 50, 75, 95):
        ours, theirs = (np.percentile(distance, percent, axis=0) for distance in near)
        np.testing.assert_allclose(ours, theirs, rtol=0.06)
    area = np.full(6400, 0.3)
    errors = [[coverage_error(place, area, density, domain, k) for k in (1.0, 6.0)] for place in (tiled, once)]
    assert errors[0][0] == pytest.approx(errors[1][0], rel=0.15)
    assert errors[0][1] < 0.02 * errors[0][0]


RECIPE = """
version = 1
seed = 3
[domain]
size = [64.0, 48.0]
[[class]]
name = "pine"
density = "pine.npy"
clustering = 0.6
[[class.size]]
name = "large"
area = 0.6
count = 3000
[[class]]
name = "beech"
density = 1.0
clustering = 1.0
clump_size = 6.0
[[class.size]]
name = "any"
area = 1.0
count = 2400
"""


def test_any_number_of_workers_makes_the_same_clumps_and_no_two_classes_have_the_same(tmp_path, monkeypatch):
    pine = np.ones((96, 128), np.float32)
    pine[30:50, 40:80] = 0.0
    np.save(tmp_path / "pine.npy", pine)
    (tmp_path / "forest.toml").write_text(RECIPE)
    made: list[str] = []

    def stop(state):
        made.append(state.name)
        if state.name == "pass-1" and state.done:
            raise KeyboardInterrupt

    options = {"tile": 24.0, "steps": (12, 8, 8)}
    classes = positions(tmp_path / "forest.toml", tmp_path / "0", **options)
    with pytest.raises(KeyboardInterrupt):
        positions(tmp_path / "forest.toml", tmp_path / "2", workers=2, progress=stop, **options)
    made.clear()
    positions(tmp_path / "forest.toml", tmp_path / "2", workers=2, progress=lambda s: made.append(s.name), **options)
    assert "clumps" not in made
    files = [sorted((tmp_path / folder).glob("tile-*.npz")) for folder in ("0", "2")]
    assert [path.read_bytes() for path in files[0]] == [path.read_bytes() for path in files[1]]
    # Nobody stands in the lake, and clumps of the two are elsewhere.
    x, y = classes[0].T
    assert (pine[((1.0 - y / 48.0) * 96).astype(int).clip(0, 95), (x * 2.0).astype(int).clip(0, 127)] > 0.0).all()
    held = [np.histogram2d(*place.T, bins=(24, 18), range=((0, 64), (0, 48)))[0] for place in classes]
    assert held[1].std() > 0.6 * held[1].mean()
    there = held[0] > 0.0
    assert abs(np.corrcoef(held[0][there], held[1][there])[0, 1]) < 0.3


@pytest.mark.parametrize(
    ("value", "words"), [("1.5", r"clustering`.* between 0 and 1; got 1\.5"), ('"much"', "clustering`.*much")]
)
def test_clumps_without_meaning_are_named(tmp_path, value, words):
    np.save(tmp_path / "pine.npy", np.ones((4, 4), np.float32))
    (tmp_path / "forest.toml").write_text(RECIPE.replace("clustering = 0.6", f"clustering = {value}"))
    with pytest.raises(esh.EshError, match=words):
        positions(tmp_path / "forest.toml", tmp_path / "out")
