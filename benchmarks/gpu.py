"""What a GPU takes for runs in the plane and on a surface, for edits and for many small scenes, and where that time goes.

    python benchmarks/gpu.py
    python benchmarks/gpu.py --parts runs edits --functions

The parts: *first* is the first run of a process, whose kernels are compiled if nothing is kept from earlier ones; *runs* are whole
runs in the plane, *surfaces* on a sphere; *edits* are those of ``live_edits.py``; *scenes* are many small problems in one call. With
``--functions`` the Python functions in which one of the runs spends its time follow each line.
"""

from __future__ import annotations

import argparse
import cProfile
import io
import pstats
import statistics
import time
from collections.abc import Callable

import esh
import live_edits
import surface_meshes as meshes
import warp as wp
from esh.engine.device.profile import Profile
from esh.engine.solve import solve
from pictures import camera
from problems import problem_of

PARTS = ("first", "runs", "surfaces", "edits", "scenes")
# Warm runs whose median is taken, and seconds after which there are no more.
MOST_RUNS, ENOUGH = 7, 6.0
# Functions that are shown.
FUNCTIONS = 30
SCENES, SCENE_BODIES = 100, 200


def median_of(run: Callable[[], object], functions: bool) -> str:
    """Time warm runs; describe the median, the extremes and, if asked for, where the time of one more goes."""
    run()
    seconds: list[float] = []
    while len(seconds) < MOST_RUNS and sum(seconds) < ENOUGH:
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    text = f"{statistics.median(seconds):.4f} s ({min(seconds):.4f} to {max(seconds):.4f})"
    return f"{text}\n{functions_of(run)}" if functions else text


def functions_of(run: Callable[[], object]) -> str:
    """The functions in which a run spends its time, as a table."""
    profile = cProfile.Profile()
    profile.enable()
    run()
    profile.disable()
    text = io.StringIO()
    pstats.Stats(profile, stream=text).sort_stats("tottime").print_stats(FUNCTIONS)
    return "\n".join(line for line in text.getvalue().splitlines() if line.strip())


def on_sphere(bodies: int) -> esh.Problem:
    """So many small bodies on a sphere of 20,480 triangles."""
    surface = esh.Surface(esh.SurfaceMesh(*meshes.sphere(5)))
    return esh.Problem(surface, [esh.BodyClass("a", [esh.Size("s", 1e-6, bodies)])])


def time_first(device: str) -> None:
    """Print what the first run takes, and those after it whose meshes have other sizes."""
    for bodies in (10_000, 23_000, 50_000):
        start = time.perf_counter()
        solve(problem_of(bodies), device=device)
        print(f"first run of {bodies:,} bodies: {time.perf_counter() - start:.2f} s", flush=True)


def time_runs(counts: list[int], groups: list[int], device: str, functions: bool) -> None:
    """Print what whole runs in the plane take."""
    for bodies in counts:
        for group_count in groups:
            problem = problem_of(bodies, group_count)
            line = median_of(lambda problem=problem: solve(problem, device=device), functions)
            profile = Profile()
            solve(problem, device=device, profile=profile)
            print(f"{bodies:,} bodies in the plane, groups: {group_count}: {line}\n{profile}", flush=True)


def time_surfaces(counts: list[int], device: str, functions: bool) -> None:
    """Print what whole runs on a sphere take; every one prepares its surface."""
    for bodies in counts:
        line = median_of(lambda bodies=bodies: solve(on_sphere(bodies), device=device), functions)
        profile = Profile()
        solve(on_sphere(bodies), device=device, profile=profile)
        print(f"{bodies:,} bodies on a sphere: {line}\n{profile}", flush=True)


def time_edits(counts: list[int], device: str, functions: bool) -> None:
    """Print what the edits of ``live_edits.py`` take whose counts follow the density."""
    density = (camera(live_edits.PIXELS) + 0.1).astype("float32")
    for bodies in counts:
        for factor in (0.2, 3.0):
            one = live_edits.edit(density, factor, bodies, True, device, MOST_RUNS)
            print(
                f"{bodies:,} bodies, a stroke of {factor:g}: {one.seconds:.4f} s, error {one.error:.2f}, "
                f"unmoved {one.unmoved:.0%}",
                flush=True,
            )
        if functions:
            print(functions_of(lambda bodies=bodies: live_edits.edit(density, 0.2, bodies, True, device, 10)))


def time_scenes(device: str, functions: bool) -> None:
    """Print what many small scenes take, in this process and in as many as suit."""
    problems = [problem_of(SCENE_BODIES) for _ in range(SCENES)]
    for workers in (0, None):
        line = median_of(
            lambda workers=workers: esh.solve_many(problems, device=device, workers=workers),
            functions and workers == 0,
        )
        print(f"{SCENES} scenes of {SCENE_BODIES} bodies, workers {workers}: {line}", flush=True)


def main() -> None:
    """Print the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="auto")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--bodies", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--groups", type=int, nargs="+", default=[1, 6], help="of runs in the plane")
    parser.add_argument("--functions", action="store_true", help="say where the time goes")
    options = parser.parse_args()
    wp.config.quiet = True
    device = wp.get_preferred_device()
    print(f"{device.name if options.device in ('auto', str(device)) else options.device}", flush=True)
    if "first" in options.parts:
        time_first(options.device)
    if "runs" in options.parts:
        time_runs(options.bodies, options.groups, options.device, options.functions)
    if "surfaces" in options.parts:
        time_surfaces([n for n in options.bodies if n >= 100_000] or options.bodies, options.device, options.functions)
    if "edits" in options.parts:
        time_edits(options.bodies, options.device, options.functions)
    if "scenes" in options.parts:
        time_scenes(options.device, options.functions)


if __name__ == "__main__":
    main()
