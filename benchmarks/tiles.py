"""Tiles beside one global solve of the same problem: how even, how exact, and what is left of the seams.

    python benchmarks/tiles.py                        # 160,000 bodies, all cases
    python benchmarks/tiles.py --bodies 40000 uniform # some

For every case, ratios of the coverage error of tiles to that of the global solve, for blurs of half to four spacings; the error
in strips of two spacings to either side of the cuts over that farther inside; the smallest spacing of both; overlaps, with contact;
and how many small ones touch large ones.
"""

from __future__ import annotations

import argparse
import math
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import esh
import numpy as np
from esh.engine.tiles.clump_blocks import write_block
from esh.engine.tiles.plan import SHIFTS, SHIFTS_OF_CONTACT, TileRun, make_plan
from scipy import ndimage, spatial

BLURS = (0.5, 1.0, 2.0, 4.0)
# Pixels per mean spacing of the grid that errors are measured on.
PIXELS = 4
# Half width of strips along cuts, and how far from every cut and edge the interior begins [spacings].
STRIP, INSIDE = 2.0, 8.0
HEXAGONAL = math.sqrt(2.0 / math.sqrt(3.0))


@dataclass(frozen=True)
class Solved:
    """What of a placement is measured: positions [m], groups, areas [m²]."""

    position: np.ndarray
    group: np.ndarray
    area: np.ndarray


def gradient(side: int = 512) -> np.ndarray:
    """A density that falls to a twentieth from left to right."""
    return np.broadcast_to(np.linspace(1.0, 0.05, side), (side, side)).astype(np.float32)


def photograph() -> np.ndarray:
    """The camera man of scikit-image, dark = many."""
    from skimage import data

    return 1.0 - data.camera().astype(np.float32) / 255.0


def problem_of(case: str, bodies: int) -> esh.Problem:
    """One of the cases."""
    side = math.sqrt(bodies)
    domain = esh.Domain((side, side))
    if case == "uniform":
        return esh.Problem(domain, [esh.BodyClass("dot", [esh.Size("one", area=1.0, count=bodies)])], seed=7)
    if case in ("gradient", "photograph"):
        density = gradient() if case == "gradient" else photograph()
        return esh.Problem(domain, [esh.BodyClass("dot", [esh.Size("one", area=1.0, count=bodies)], density)], seed=7)
    if case == "classes":
        density = gradient()
        few, many = bodies // 10, bodies * 4 // 10
        sizes = [esh.Size("large", area=2.5, count=few), esh.Size("small", area=0.625, count=many)]
        return esh.Problem(
            domain, [esh.BodyClass("a", sizes, density), esh.BodyClass("b", sizes, 1.05 - density)], seed=7
        )
    if case == "rare":
        rare = esh.BodyClass("rare", [esh.Size("one", area=1.0, count=100)])
        return esh.Problem(
            domain, [esh.BodyClass("many", [esh.Size("one", area=1.0, count=bodies - 100)]), rare], seed=7
        )
    if case == "clumps":
        sizes = [esh.Size("one", area=0.3, count=bodies)]
        return esh.Problem(domain, [esh.BodyClass("dot", sizes, clustering=0.7)], seed=7)
    if case == "range":
        size = esh.Size("all", area=(0.4, 1.6), count=bodies)
        return esh.Problem(domain, [esh.BodyClass("dot", [size])], seed=7)
    if case == "lines":
        u = (np.arange(64) + 0.5) / 64
        angle = np.pi * np.sin(2.0 * np.pi * u)[None, :] * np.cos(2.0 * np.pi * u)[:, None]
        flow = np.stack([np.cos(angle), np.sin(angle)], axis=-1).astype(np.float32)
        line = esh.Line(length=1.2, direction=flow)
        return esh.Problem(
            domain, [esh.BodyClass("line", [esh.Size("one", area=0.3, count=bodies, line=line)])], seed=7
        )
    if case == "contact":
        # 60 % of the ground.
        size = esh.Size("one", area=0.6, count=bodies)
        return esh.Problem(domain, [esh.BodyClass("disc", [size])], seed=7, avoid_overlap=True)
    if case == "rocks":
        # Boulders, stones and gravel of one class, 440 to 33 to 1: they cover half of the ground.
        boulders, stones = bodies // 344, bodies // 34
        sizes = [
            esh.Size("boulder", area=69.0, count=boulders),
            esh.Size("stone", area=5.2, count=stones),
            esh.Size("gravel", area=0.155, count=bodies - boulders - stones),
        ]
        return esh.Problem(domain, [esh.BodyClass("rock", sizes)], seed=7, avoid_overlap=True)
    raise ValueError(case)


CASES = ("uniform", "photograph", "gradient", "classes", "rare", "range", "lines", "contact", "rocks", "clumps")


def in_tiles(
    problem: esh.Problem, tile: float | None, workers: int, steps: Sequence[int]
) -> tuple[Solved, float, tuple[int, int], esh.Problem]:
    """Solve in tiles; returns the bodies in the order of a global placement, the seconds, columns and rows of tiles, and the problem.

    Clumps of the problem that is returned are those that tiles have.
    """
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        first, *others = steps
        state = esh.solve_tiles(
            problem, folder, tile=tile, workers=workers, device="cpu", ending=".npz", steps=(first, *others)
        )
        seconds = time.perf_counter() - start
        if any(c.clustering for c in problem.classes):
            problem = with_clumps_of_tiles(problem, Path(folder), state.tiles)
        parts = [np.load(path) for path in sorted(Path(folder).glob("tile-*.npz"))]
        joined = {
            key: np.concatenate([part[key] for part in parts])
            for key in ("id", "position", "area", "class_index", "size_index")
        }
    order = np.argsort(joined["id"])
    assert np.array_equal(joined["id"][order], np.arange(problem.body_count)), "every body, and each once"
    group = joined["class_index"] * 1000 + joined["size_index"]
    return Solved(joined["position"][order], group[order], joined["area"][order]), seconds, state.tiles, problem


def with_clumps_of_tiles(problem: esh.Problem, folder: Path, tiles: tuple[int, int]) -> esh.Problem:
    """The problem with the densities that it had in tiles: clumps are elsewhere than in one solve."""
    recipe = folder / "problem" / "problem.toml"
    plan = make_plan(TileRun(str(recipe), str(folder), None, tiles, (1, 1, 1), "cpu", ".npz", ""))
    classes = []
    for index, body_class in enumerate(problem.classes):
        density = body_class.density_image
        if index in plan.clumped:
            source = plan.clumped[index]
            for number in range(math.prod(source.clumps.blocks)):
                write_block(source, number)
            density = source.read(0, source.shape[0], 0, source.shape[1])
        classes.append(esh.BodyClass(body_class.name, body_class.sizes, density))
    return esh.Problem(problem.domain, classes, seed=problem.seed)


def at_once(problem: esh.Problem) -> tuple[Solved, float]:
    """Solve as a whole."""
    start = time.perf_counter()
    placement = esh.solve(problem, device="cpu")
    seconds = time.perf_counter() - start
    group = placement.class_index * 1000 + placement.size_index
    return Solved(placement.position, group, placement.area), seconds


def error_maps(solved: Solved, problem: esh.Problem, chosen: np.ndarray) -> dict[float, np.ndarray]:
    """Blurred charges less the blurred target over its mean, row 0 at the bottom, for every blur."""
    size = np.array(problem.rectangle.size)
    position, area = solved.position[chosen], solved.area[chosen]
    spacing = math.sqrt(float(size.prod()) / len(position))
    columns, rows = np.maximum(1, np.round(size / spacing * PIXELS)).astype(int).tolist()
    target = np.zeros((rows, columns))
    group = solved.group[chosen]
    for g in np.unique(group).tolist():
        image = problem.classes[g // 1000].density_image[::-1].astype(float)
        part = ndimage.zoom(
            image, (rows / image.shape[0], columns / image.shape[1]), order=0, mode="nearest", grid_mode=True
        )
        target += part * (area[group == g].sum() / part.sum())
    there = deposited(position / size, area, (rows, columns))
    mean = float(target.mean())
    return {k: ndimage.gaussian_filter(there - target, k * PIXELS, mode="constant") / mean for k in BLURS}


def deposited(place: np.ndarray, weight: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Weights between the centers of pixels, linearly."""
    rows, columns = shape
    x, y = place[:, 0] * columns - 0.5, place[:, 1] * rows - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    result = np.zeros(rows * columns)
    for a, u in ((0, 1.0 - (x - i)), (1, x - i)):
        for b, v in ((0, 1.0 - (y - j)), (1, y - j)):
            at = np.clip(j + b, 0, rows - 1) * columns + np.clip(i + a, 0, columns - 1)
            result += np.bincount(at, u * v * weight, rows * columns)
    return result.reshape(rows, columns)


def to_cuts(place: np.ndarray, length: float, tiles: int, shift: float) -> np.ndarray:
    """Distance of places along an axis to the nearest cut of a pass."""
    if tiles == 1:
        return np.full(place.shape, np.inf)
    cuts = (np.arange(0 if shift else 1, tiles) + shift) * (length / tiles)
    return np.abs(place[:, None] - cuts).min(axis=1)


def strips(
    problem: esh.Problem, tiles: tuple[int, int], x: np.ndarray, y: np.ndarray, spacing: float
) -> list[np.ndarray]:
    """Truth values over a grid of x and y: near the cuts of each pass, and last the interior."""
    width, height = problem.rectangle.size
    shifts = SHIFTS_OF_CONTACT if problem.avoid_overlap else SHIFTS
    edge = np.minimum(np.minimum(x, width - x)[None, :], np.minimum(y, height - y)[:, None])
    within = edge > INSIDE * spacing
    result = []
    nearest = np.full((len(y), len(x)), np.inf)
    for across, up in shifts:
        away = np.minimum(to_cuts(x, width, tiles[0], across)[None, :], to_cuts(y, height, tiles[1], up)[:, None])
        result.append(within & (away < STRIP * spacing))
        nearest = np.minimum(nearest, away)
    return [*result, within & (nearest > INSIDE * spacing)]


def smallest_spacing(solved: Solved) -> float:
    """Smallest distance of two bodies over that in a hexagonal lattice of so many in the same area, as if uniform."""
    tree = spatial.cKDTree(solved.position)
    near = tree.query(solved.position, 2)[0][:, 1]
    extent = np.ptp(solved.position, axis=0)
    return float(near.min() / (HEXAGONAL * math.sqrt(float(extent.prod()) / len(near))))


def overlaps(solved: Solved) -> int:
    """Pairs of discs that overlap by more than a thousandth of their width."""
    radius = np.sqrt(solved.area / math.pi)
    pairs = spatial.cKDTree(solved.position).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    apart = np.hypot(*(solved.position[pairs[:, 0]] - solved.position[pairs[:, 1]]).T)
    return int((radius[pairs].sum(axis=1) - apart > 2e-3 * radius[pairs].min(axis=1)).sum())


def block_error(solved: Solved, problem: esh.Problem, chosen: np.ndarray, blocks: int = 4) -> float:
    """RMS of the bodies of a uniform class that blocks of the domain have too many, over their mean number."""
    place = (solved.position[chosen] / problem.rectangle.size * blocks).astype(int).clip(0, blocks - 1)
    number = np.bincount(place[:, 1] * blocks + place[:, 0], minlength=blocks**2)
    return float(np.sqrt(np.mean((number / number.mean() - 1.0) ** 2)))


def touching(solved: Solved) -> float:
    """How many of the smallest bodies touch one of the largest, to a spacing of all bodies along its rim."""
    small, large = solved.area == solved.area.min(), solved.area == solved.area.max()
    reach = (math.sqrt(solved.area.min() / math.pi), math.sqrt(solved.area.max() / math.pi))
    gap = spatial.cKDTree(solved.position[large]).query(solved.position[small])[0] - sum(reach)
    return float((gap < 0.07).sum() / (large.sum() * 2.0 * math.pi * reach[1]))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def compare(
    case: str, bodies: int, tile: float | None, workers: int, steps: Sequence[int], say: Callable[[str], None]
) -> None:
    problem = problem_of(case, bodies)
    tiled, seconds, tiles, problem = in_tiles(problem, tile, workers, steps)
    whole, seconds_whole = at_once(problem)
    say(f"{case}: {bodies:,} bodies, {tiles[0]} x {tiles[1]} tiles, {seconds:.0f} s; at once {seconds_whole:.0f} s")
    everyone = np.ones(bodies, bool)
    parts: list[tuple[str, np.ndarray]] = [("all", everyone)]
    if len(problem.classes) > 1:
        parts += [(c.name, tiled.group // 1000 == k) for k, c in enumerate(problem.classes) if c.body_count > 1000]
    for name, chosen in parts:
        spacing = math.sqrt(problem.domain.area / int(chosen.sum()))
        mine, other = error_maps(tiled, problem, chosen), error_maps(whole, problem, chosen)
        rows, columns = mine[1.0].shape
        width, height = problem.rectangle.size
        x, y = (np.arange(columns) + 0.5) / columns * width, (np.arange(rows) + 0.5) / rows * height
        masks = strips(problem, tiles, x, y, spacing)
        ratio = [rms(mine[k]) / rms(other[k]) for k in BLURS]
        # Where the density differs from place to place, so does the error: strips of both solves, each over its interior.
        worst = [
            max(
                (rms(mine[k][m]) / rms(mine[k][masks[-1]])) / (rms(other[k][m]) / rms(other[k][masks[-1]]))
                for m in masks[:-1]
            )
            if masks[0].any() and masks[-1].any()
            else math.nan
            for k in BLURS
        ]
        errors = " ".join(f"{rms(mine[k]):.5f}" for k in BLURS)
        say(f"  {name:8s} tiles/global at k = .5 1 2 4: {' '.join(f'{v:5.2f}' for v in ratio)}; error {errors}")
        say(f"  {'':8s} worst strip/interior:      {' '.join(f'{v:5.2f}' for v in worst)}")
    say(f"  smallest spacing {smallest_spacing(tiled):.3f}, global {smallest_spacing(whole):.3f}")
    if case == "rare":
        few = tiled.group // 1000 == 1
        say(
            f"  blocks of the rare: {block_error(tiled, problem, few):.3f}, global {block_error(whole, problem, few):.3f}"
        )
        near = [
            spatial.cKDTree(s.position[few]).query(s.position[few], 2)[0][:, 1].min()
            / math.sqrt(problem.domain.area / 100)
            for s in (tiled, whole)
        ]
        say(f"  smallest distance of two rare ones over their spacing: {near[0]:.3f}, global {near[1]:.3f}")
    if case == "rocks":
        say(f"  small ones that touch large ones: {touching(tiled):.3f} to a spacing, global {touching(whole):.3f}")
    if problem.avoid_overlap:
        say(f"  overlaps {overlaps(tiled)}, global {overlaps(whole)}")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], default=[])
    parser.add_argument("--bodies", type=int, default=160_000)
    parser.add_argument("--tile", type=float, default=None, help="meters; mean spacings here")
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--steps", type=int, nargs=3, default=None)
    options = parser.parse_args(arguments)
    from esh.engine.tiles.tiles import STEPS

    for case in options.cases or CASES:
        compare(
            case,
            options.bodies,
            options.tile,
            options.workers,
            options.steps or STEPS,
            lambda line: print(line, flush=True),
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process {peak:,.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
