"""Tiles of a domain that wraps: its edges are no edges."""

from __future__ import annotations

import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.tiles.coarse import SCALE, CoarseGrid, displacement, solve_flow
from esh.engine.tiles.density_windows import ArraySource, WrappedSource
from esh.engine.tiles.layout import Layout
from scipy import ndimage, spatial


def solved(problem: esh.Problem, folder: Path, **options) -> dict[str, np.ndarray]:
    """The bodies of all tiles, by their numbers."""
    options = {"device": "cpu", "ending": ".npz", "steps": (20, 14, 14), "workers": 0} | options
    esh.solve_tiles(problem, folder, **options)
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    keys = [key for key in parts[0].files if key not in ("class_name", "size_name")]
    whole = {key: np.concatenate([part[key] for part in parts]) for key in keys}
    order = np.argsort(whole["id"])
    assert np.array_equal(whole["id"][order], np.arange(len(order)))
    return {key: values[order] for key, values in whole.items()}


def periodic(size: esh.Size, extent: tuple[float, float], density=1.0, **more) -> esh.Problem:
    return esh.Problem(esh.Domain(extent, "periodic"), [esh.BodyClass("one", [size], density)], seed=4, **more)


def nearest(position: np.ndarray, extent: tuple[float, float]) -> np.ndarray:
    return spatial.cKDTree(position, boxsize=extent).query(position, 2)[0][:, 1]


def error_map(position: np.ndarray, side: float, blur: float) -> np.ndarray:
    """Relative error of the blurred number of bodies, four pixels a meter; it wraps."""
    n = round(4 * side)
    number = np.histogram2d(position[:, 1], position[:, 0], bins=n, range=[(0.0, side)] * 2)[0]
    return ndimage.gaussian_filter(number, 4.0 * blur, mode="wrap") / (len(position) / n**2) - 1.0


def test_bodies_are_as_even_across_the_edges_as_elsewhere(tmp_path):
    side = 90.0
    problem = periodic(esh.Size("dot", area=1.0, count=8100), (side, side))
    position = solved(problem, tmp_path / "out", tile=45.0, steps=(40, 30, 30))["position"]
    assert (position >= 0.0).all() and (position < side).all()
    whole = esh.solve(problem, device="cpu").position
    for blur, most in ((0.5, 1.1), (1.0, 1.2), (2.0, 1.6)):
        mine, other = error_map(position, side, blur), error_map(whole, side, blur)
        assert np.sqrt(np.mean(mine**2)) < most * np.sqrt(np.mean(other**2))
    mine = error_map(position, side, 1.0)
    place = (np.arange(360) + 0.5) / 4.0
    near = np.minimum(place, side - place) < 2.0
    strip = near[:, None] | near[None, :]
    assert np.sqrt(np.mean(mine[strip] ** 2)) < 1.25 * np.sqrt(np.mean(mine[~strip] ** 2))
    assert nearest(position, (side, side)).min() > 0.97 * nearest(whole, (side, side)).min()


def test_contact_holds_across_the_edges(tmp_path):
    # Discs that cover 55 % of the ground.
    side = 124.0
    problem = periodic(esh.Size("disc", area=0.55, count=15_376), (side, side), avoid_overlap=True)
    bodies = solved(problem, tmp_path / "out", tile=62.0, steps=(10, 8, 8))
    assert nearest(bodies["position"], (side, side)).min() > 2.0 * math.sqrt(0.55 / math.pi) * (1.0 - 1e-3)


def test_densities_obstacles_and_lines_wrap(tmp_path):
    # A density whose waves go on across the edges, an obstacle that lies on a corner, and lines round the torus.
    side = 80.0
    v, u = (np.mgrid[0:64, 0:64] + 0.5) / 64.0
    density = (1.0 + 0.8 * np.cos(2.0 * np.pi * u) * np.cos(2.0 * np.pi * v)).astype(np.float32)
    line = esh.Line(length=1.2, direction=0.3)
    problem = periodic(
        esh.Size("line", area=0.3, count=6400, line=line),
        (side, side),
        density=density,
        obstacles=[esh.Obstacle(disc=(1.0, 79.0, 6.0))],
    )
    bodies = solved(problem, tmp_path / "out", tile=40.0, steps=(30, 20, 20))
    position = bodies["position"]
    way = position - [1.0, 79.0]
    way -= side * np.round(way / side)
    assert np.hypot(*way.T).min() >= 6.0 - 1e-3
    assert np.median(np.abs(bodies["angle"] - 0.3)) < 0.1
    assert bodies["length"].mean() == pytest.approx(1.2, rel=0.05)
    # As many in every block as the density asks for, as in one solve.
    whole = esh.solve(problem, device="cpu").position
    counts = [np.histogram2d(*p.T, bins=5, range=[(0.0, side)] * 2)[0] for p in (position, whole)]
    assert np.abs(counts[0] - counts[1]).max() < 0.04 * counts[1].mean()
    edge = np.minimum(position, side - position).min(axis=1) < 1.5
    spacing = nearest(position, (side, side))
    assert spacing[edge].min() > 0.8 * spacing[~edge].min()


def test_any_number_of_workers_makes_the_same_bytes_and_one_tile_is_one_solve(tmp_path):
    problem = periodic(esh.Size("dot", area=1.0, count=3844), (62.0, 62.0))
    made = []
    for workers in (0, 2):
        folder = tmp_path / str(workers)
        solved(problem, folder, tile=31.0, steps=(6, 4, 4), workers=workers)
        made.append({path.name: path.read_bytes() for path in sorted(folder.glob("tile-*"))})
    assert made[0] == made[1] and len(made[0]) == 4
    one = solved(problem, tmp_path / "one", tile=70.0)
    assert len(list((tmp_path / "one").glob("tile-*"))) == 1
    assert nearest(one["position"], (62.0, 62.0)).min() > 0.7


def test_a_strip_that_is_too_narrow_is_refused(tmp_path):
    problem = periodic(esh.Size("dot", area=1.0, count=8000), (200.0, 40.0))
    with pytest.raises(esh.ProblemError, match="a periodic `domain` must be at least 60 m wide and high for tiles"):
        esh.solve_tiles(problem, tmp_path / "out", tile=50.0, ending=".npz", device="cpu")


def test_windows_of_a_torus_hold_every_place_once():
    layout = Layout((30.0, 20.0), (3, 2), (48, 32), True)
    place = np.random.default_rng(1).random((500, 2)) * layout.size
    for shift in ((0.0, 0.0), (1.0 / 3.0, 1.0 / 3.0), (0.75, 0.25)):
        columns, rows = layout.shape(shift)
        assert (columns, rows) == (3, 2)
        held = np.zeros(500, int)
        for number in range(6):
            box = layout.box(shift, number)
            assert all(box.cut) and box.size == pytest.approx((10.0, 10.0))
            seen = box.framed(place)
            held += box.holds(seen)
            assert np.array_equal(layout.in_domain(seen), place) or np.allclose(layout.in_domain(seen), place)
            # Those that a place may have come from are near.
            for other in range(6):
                inside = layout.box((0.0, 0.0), other).holds(place)
                if (inside & box.holds(seen)).any():
                    assert other in set(layout.near((0.0, 0.0), box, 0.0))
        assert (held == 1).all()


def test_a_repeated_image_is_read_across_its_ends():
    image = np.arange(12.0, dtype=np.float32).reshape(3, 4)
    source = WrappedSource(ArraySource(image))
    assert np.array_equal(source.read(-1, 4, 2, 9), np.tile(image, (3, 3))[2:7, 2:9])


def test_the_warp_goes_round_the_edges(tmp_path):
    # A wave that a domain with edges could not have there: most bodies flow through them.
    side = 96
    y, x = np.mgrid[0:side, 0:side].astype(float)
    lattice = np.stack([x + 0.25 + 0.5 * (y % 2), y + 0.5], axis=-1).reshape(-1, 2)
    wave = 0.2 * np.cos(2.0 * np.pi * lattice[:, 0] / side)
    position = np.mod(lattice + wave[:, None] * [1.0, 0.0], side)
    grid = CoarseGrid((96.0, 96.0), (48, 48), True)
    count = np.zeros((1, 48, 48), np.int64)
    grid.deposit(position, np.zeros(len(position), np.int64), 1).add_to(count)
    flows = solve_flow(grid, count[0] / SCALE, np.full(grid.shape, len(position) / 48**2), 4.0)
    for name, values in zip(("x", "y", "density"), flows, strict=True):
        np.save(tmp_path / f"{name}.npy", values)
    moved = displacement(tmp_path, grid, position, 1.0)
    kept = math.exp(-0.5 * (2.0 * math.pi * 4.0 / side) ** 2)
    fit = -(moved[:, 0] @ wave) / (wave @ wave)
    assert fit == pytest.approx(kept, rel=0.05)
    assert np.abs(moved[:, 0] + kept * wave).max() < 0.02
