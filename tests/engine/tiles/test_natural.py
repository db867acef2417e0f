"""Tiles with a natural border: nobody stands in rows along it, and counts are exact."""

from __future__ import annotations

import math
from pathlib import Path

import esh
import numpy as np
import pytest
from esh.engine.quality.coverage import coverage_error
from scipy import spatial

SIDE = 80.0
ROW, COLUMN = (np.indices((256, 256)) + 0.5) / 256.0 - 0.5
LAKE = (np.hypot(COLUMN, ROW) > 0.2).astype(np.float32)
UNIFORM = np.ones((1, 1), np.float32)


def solved(problem: esh.Problem, folder: Path, **options) -> np.ndarray:
    """Positions of the bodies of all tiles, by their numbers, none of which is missing or there twice."""
    esh.solve_tiles(problem, folder, **({"device": "cpu", "ending": ".npz", "workers": 0, "tile": 40.0} | options))
    parts = [np.load(path) for path in sorted(folder.glob("tile-*.npz"))]
    identity = np.concatenate([part["id"] for part in parts])
    assert np.array_equal(np.sort(identity), np.arange(len(identity)))
    return np.concatenate([part["position"] for part in parts])[np.argsort(identity)]


def problem_of(boundary, image=UNIFORM, count=6400, seed=1, **more):
    size = esh.Size("s", area=0.1, count=count)
    return esh.Problem(
        esh.Domain((SIDE, SIDE), boundary), [esh.BodyClass("a", [size], density=image)], seed=seed, **more
    )


def depth_of(image, position):
    """Distance inwards from the edge [m], and the area within a distance of it as a function [m²]."""
    if image is LAKE:
        radius = 0.2 * SIDE
        depth = np.hypot(*(position - 0.5 * SIDE).T) - radius
        return depth, lambda d: math.pi * ((radius + d) ** 2 - radius**2)
    return np.minimum(position, SIDE - position).min(axis=1), lambda d: SIDE**2 - (SIDE - 2.0 * d) ** 2


@pytest.mark.parametrize("image", [UNIFORM, LAKE], ids=["square", "lake"])
def test_no_row_along_the_border(tmp_path, image):
    spacing = math.sqrt(SIDE**2 * float(image.mean()) / 6400)
    edges = 0.1 * spacing * np.arange(21)
    most, error = {}, {}
    for boundary in ("open", "natural"):
        found, even, errors = np.zeros(20), np.zeros(20), []
        for seed in (1, 2):
            position = solved(problem_of(boundary, image, seed=seed), tmp_path / f"{boundary}-{seed}")
            depth, area_within = depth_of(image, position)
            assert depth.min() > -0.3 * spacing
            assert (position >= 0.0).all() and (position <= SIDE).all()
            found += np.histogram(depth, edges)[0]
            even += np.diff(area_within(edges)) / spacing**2
            domain = esh.Domain((SIDE, SIDE))
            errors.append([coverage_error(position, np.ones(6400), image, domain, k) for k in (1.0, 2.0)])
            assert spatial.cKDTree(position).query(position, 2)[0][:, 1].min() > 0.4 * spacing
        most[boundary], error[boundary] = (found / even).max(), np.mean(errors, axis=0)
    assert most["natural"] < 2.0 < most["open"]
    assert error["natural"][1] < 2.0 * error["open"][1] and error["natural"][0] < 0.006


def test_all_kinds_of_bodies_make_the_same_bytes_with_any_number_of_workers(tmp_path):
    # Ranges, lines, outlines, fixed bodies beside the border and an obstacle across it.
    trees = [esh.Size("l", area=1.0, count=250), esh.Size("s", area=(0.2, 0.6), count=750, distribution="uniform")]
    boxes = esh.Size("boxes", footprint=esh.Footprint.rectangle(0.9, 0.4), count=400)
    lines = esh.Size("lines", area=0.3, count=400, line=esh.Line(length=1.5, direction=0.5))
    left = np.linspace(1.0, 0.2, 50, dtype=np.float32)[None]
    problem = esh.Problem(
        esh.Domain((SIDE, 0.5 * SIDE), "natural"),
        [esh.BodyClass("a", trees, density=left), esh.BodyClass("b", [boxes], LAKE), esh.BodyClass("c", [lines])],
        obstacles=[esh.Obstacle(disc=(79.0, 25.0, 6.0))],
        fixed=[esh.FixedBodies(np.array([[5.0, 5.0], [0.3, 0.3]]), 0, 0)],
        seed=3,
    )
    made = []
    for workers in (0, 2):
        folder = tmp_path / str(workers)
        position = solved(problem, folder, steps=(4, 3, 3), workers=workers, tile=40.0)
        made.append({path.name: path.read_bytes() for path in sorted(folder.glob("tile-*"))})
    assert made[0] == made[1] and len(made[0]) == 2
    assert len(position) == 1802
    assert np.array_equal(position[250:252], [[5.0, 5.0], [0.3, 0.3]])
    assert np.hypot(*(position - [79.0, 25.0]).T).min() > 6.0 - 1e-3


def test_nobody_overlaps(tmp_path):
    # Discs that cover 55 % of the ground.
    side = 124.0
    discs = esh.BodyClass("disc", [esh.Size("disc", area=0.55, count=15_376)])
    problem = esh.Problem(esh.Domain((side, side), "natural"), [discs], avoid_overlap=True, seed=1)
    position = solved(problem, tmp_path / "out", tile=62.0, steps=(10, 8, 8))
    nearest = spatial.cKDTree(position).query(position, 2)[0][:, 1]
    assert nearest.min() > 2.0 * math.sqrt(0.55 / math.pi) * (1.0 - 1e-3)
    depth = np.minimum(position, side - position).min(axis=1)
    found = np.histogram(depth, np.linspace(0.0, 2.0, 21))[0]
    even = np.diff(side**2 - (side - 2.0 * np.linspace(0.0, 2.0, 21)) ** 2)
    assert (found / even).max() < 2.0


def test_rare_bodies_are_even_and_stand_in_no_row(tmp_path):
    many, few = (esh.BodyClass(name, [esh.Size("s", area=0.1, count=n)]) for name, n in (("a", 6300), ("b", 100)))
    found, spacing = np.zeros(5), SIDE / 10.0
    for seed in (2, 5, 6):
        problem = esh.Problem(esh.Domain((SIDE, SIDE), "natural"), [many, few], seed=seed)
        rare = solved(problem, tmp_path / str(seed), steps=(20, 15, 15))[6300:]
        # Which of them the border keeps is evened out: seed 6 had two that stood at a seventh of the spacing.
        assert spatial.cKDTree(rare).query(rare, 2)[0][:, 1].min() > 0.65 * spacing
        found += np.histogram(np.minimum(rare, SIDE - rare).min(axis=1), spacing * np.linspace(0.0, 1.0, 6))[0]
    even = np.diff(SIDE**2 - (SIDE - 2.0 * spacing * np.linspace(0.0, 1.0, 6)) ** 2) / spacing**2 * 3.0
    assert (found / even).max() < 1.6
