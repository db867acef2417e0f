"""How contact fares: a table of crowded scenes, their overlaps counted by shapely, pair by pair.

    python benchmarks/contact.py                     # all scenes
    python benchmarks/contact.py planks --bodies 300 # those whose names hold a word, with so many bodies

Of every scene: overlaps deeper than 1e-3 of the narrower width before contact and after it, the deepest left, the coverage error at
k = 1 before and after, how far bodies moved in mean spacings, and the seconds that contact took.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.body_footprints import CAPSULE, footprints_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.measurement import measure
from esh.engine.solver.solver import Solver

PLANK = Footprint.rectangle(2.0, 0.3)
BOX = Footprint.rectangle(0.8, 0.8)
SHORT_PLANK = Footprint.rectangle(1.4, 0.3)
DISC = Footprint.disc(0.3)


def scene(
    sizes: Sequence[tuple[Footprints, int]],
    cover: float,
    *,
    density: np.ndarray | float = 1.0,
    periodic: bool = False,
    inset: bool = False,
    seed: int = 1,
) -> Problem:
    """Bodies in a square that they cover to this share."""
    ground = sum(count * footprints.mean_area for footprints, count in sizes)
    side = math.sqrt(ground / cover)
    domain = Domain((side, side), "periodic" if periodic else "open", inset=inset)
    listed = [Size(f"size {k}", None, count, footprint=footprints) for k, (footprints, count) in enumerate(sizes)]
    return Problem(domain, [BodyClass("bodies", listed, density)], seed=seed, avoid_overlap=True)


def random_polygons(count: int, seed: int = 3) -> list[Footprint]:
    """Convex outlines of five to twelve points each, of areas that are spread lognormally about 1."""
    rng = np.random.default_rng(seed)
    outlines = []
    while len(outlines) < count:
        angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, int(rng.integers(5, 13))))
        points = np.stack([np.cos(angle) * rng.uniform(1.0, 2.2), np.sin(angle)], axis=1)
        outline = Footprint.polygon(points * rng.uniform(0.8, 1.0, (len(points), 1)))
        if outline.area > 0.9:
            outlines.append(outline.scaled(math.exp(rng.normal(0.0, 0.5)) / math.sqrt(outline.area)))
    return outlines


def collection(outlines: Sequence[Footprint], shares: Sequence[float], count: int) -> Footprints:
    """Several outlines, of each as many as its share says."""
    steps = np.round(np.cumsum([0.0, *shares]) * count).astype(int)
    return Footprints(outlines, variant=np.repeat(np.arange(len(outlines)), np.diff(steps)))


def ramp() -> np.ndarray:
    """A density that rises from half to one and a half times the mean."""
    return np.linspace(0.5, 1.5, 128)[None, :]


# Name, problem of so many bodies.
SCENES: dict[str, Callable[[int], Problem]] = {
    "planks free, 50 %": lambda n: scene([(Footprints(PLANK), n)], 0.5),
    "planks free, 70 %": lambda n: scene([(Footprints(PLANK), n)], 0.7),
    "planks free, 80 %": lambda n: scene([(Footprints(PLANK), n)], 0.8),
    "planks fixed, 50 %": lambda n: scene([(Footprints(PLANK, turn="random"), n)], 0.5),
    "planks fixed, 60 %": lambda n: scene([(Footprints(PLANK, turn="random"), n)], 0.6),
    "planks free, periodic, 70 %": lambda n: scene([(Footprints(PLANK), n)], 0.7, periodic=True),
    "planks free, on a ramp, 55 %": lambda n: scene([(Footprints(PLANK), n)], 0.55, density=ramp()),
    "planks free, inset, 70 %": lambda n: scene([(Footprints(PLANK), n)], 0.7, inset=True),
    "planks, boxes, discs, 80 %": lambda n: scene(
        [(Footprints(outline), n // 3) for outline in (SHORT_PLANK, BOX, DISC)], 0.8
    ),
    "jittered discs, 75 %": lambda n: scene([(Footprints(DISC, scale_jitter=0.5), n)], 0.75),
    "jittered boxes, 75 %": lambda n: scene([(Footprints(BOX, scale_jitter=0.5), n)], 0.75),
    "collection, radii 1 and 0.1, 75 %": lambda n: scene(
        [(collection([Footprint.disc(1.0), Footprint.disc(0.1)], [0.1, 0.9], n), n)], 0.75
    ),
    "collection, 20 to 1, 75 %": lambda n: scene(
        [
            (
                collection(
                    [Footprint.rectangle(4.0, 4.0), Footprint.disc(0.1), Footprint.rectangle(0.4, 0.1)],
                    [0.02, 0.49, 0.49],
                    n,
                ),
                n,
            )
        ],
        0.75,
    ),
    "random polygons, 60 %": lambda n: scene([(Footprints(random_polygons(n), variant=np.arange(n)), n)], 0.6),
    "random polygons, 80 %": lambda n: scene([(Footprints(random_polygons(n), variant=np.arange(n)), n)], 0.8),
    "capsules, 70 %": lambda n: scene([(Footprints(Footprint.capsule(2.0, 0.3)), n)], 0.7),
    "discs of three sizes, 82 %": lambda n: scene(
        [(Footprints(Footprint.disc(r)), k) for r, k in ((1.0, n // 10), (0.5, n * 3 // 10), (0.25, n * 6 // 10))], 0.82
    ),
}


def overlaps_by_shapely(placement: Placement, tolerance: float = 1e-3) -> tuple[int, float]:
    """Pairs of outlines that overlap by more than ``tolerance`` of the narrower width, and the deepest overlap [m]: pair by pair."""
    import shapely

    problem = placement.problem
    footprints = footprints_of(problem)
    n = len(placement.position)
    cores, rounding, width = [], np.zeros(n), np.zeros(n)
    for i in range(n):
        if footprints.shape[i] == CAPSULE:
            half = 0.5 * placement.length[i]
            core = np.array([[-half, 0.0], [half, 0.0]])
            rounding[i], width[i] = 0.5 * placement.width[i], placement.width[i]
        else:
            outline, factor = footprints.shapes[footprints.shape[i]], footprints.factor[i]
            core = outline.corners * factor
            rounding[i], width[i] = outline.rounding * factor, outline.width * factor
        c, s = math.cos(placement.angle[i]), math.sin(placement.angle[i])
        cores.append(core @ np.array([[c, s], [-s, c]]) + placement.position[i])
    shifts = [(0.0, 0.0)]
    if problem.domain.periodic:
        x, y = problem.domain.size
        shifts += [(a * x, b * y) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    items = [(i, core + np.array(shift)) for shift in shifts for i, core in enumerate(cores)]
    shapes = np.array([(shapely.Point, shapely.LineString, shapely.Polygon)[min(len(c), 3) - 1](c) for _, c in items])
    near = shapely.STRtree(shapes).query(shapes[:n], predicate="dwithin", distance=2.0 * rounding.max() + 1e-12)
    pairs, deepest = set(), 0.0
    for a, b in near.T.tolist():
        i, j = items[a][0], items[b][0]
        if i < j:
            apart = float(shapely.distance(shapes[a], shapes[b]))
            inside = -apart if apart > 0.0 or len(cores[i]) + len(cores[j]) == 2 else _depth(items[a][1], items[b][1])
            depth = rounding[i] + rounding[j] + inside
            deepest = max(deepest, depth)
            if depth > tolerance * min(width[i], width[j]):
                pairs.add((i, j))
    return len(pairs), deepest


def _depth(one: np.ndarray, other: np.ndarray) -> float:
    """The shortest way that parts two convex polygons: across one of their edges."""
    least = math.inf
    for corners in (one, other):
        if len(corners) > 1:
            edge = np.roll(corners, -1, axis=0) - corners
            normal = np.stack([edge[:, 1], -edge[:, 0]]) / np.hypot(*edge.T)
            p, q = one @ normal, other @ normal
            least = min(least, float(np.minimum(p.max(0) - q.min(0), q.max(0) - p.min(0)).min()))
    return least


def outcome(problem: Problem) -> dict[str, float]:
    """What came of a scene."""
    with Solver(problem, device="cpu") as solver:
        solver.run(100)
        before = solver.placement()
        error_before = measure(before, solver.launcher).coverage_error
        start = time.perf_counter()
        solver.separate()
        seconds = time.perf_counter() - start
        after = solver.placement()
        report = measure(after, solver.launcher)
    way = after.position - before.position
    if problem.domain.periodic:
        way -= np.array(problem.domain.size) * np.round(way / np.array(problem.domain.size))
    left, deepest = overlaps_by_shapely(after)
    return {
        "before": overlaps_by_shapely(before)[0],
        "left": left,
        "reported": report.overlaps,
        "deepest": deepest,
        "error before": error_before,
        "error": report.coverage_error,
        "moved": float(np.hypot(*way.T).mean() / math.sqrt(problem.domain.area / len(way))),
        "seconds": seconds,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("word", nargs="?", default="", help="only scenes whose names hold this")
    parser.add_argument("--bodies", type=int, default=300, metavar="N")
    options = parser.parse_args(arguments)
    print("| scene | overlaps | left | reported | deepest [m] | coverage error | moved | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    worst = 0
    for name, make in SCENES.items():
        if options.word in name:
            o = outcome(make(options.bodies))
            worst = max(worst, int(o["left"]))
            print(
                f"| {name} | {o['before']} | {o['left']} | {o['reported']} | {max(o['deepest'], 0.0):.1e} | {o['error before']:.3f} → "
                f"{o['error']:.3f} | {o['moved']:.2f} | {o['seconds']:.2f} |",
                flush=True,
            )
    return 1 if worst else 0


if __name__ == "__main__":
    raise SystemExit(main())
