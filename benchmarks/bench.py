"""All timings in one run, as Markdown tables: ours, direct summation, fmm2dpy, finufft, pocketfft, Blender's own Poisson disks.

    python benchmarks/bench.py --output output/bench.md [--device cuda:0] [--bodies 10000 100000] [--fmm .venv-fmm/bin/python]

Our own times are pytest-benchmark's (:mod:`timings`), kept beside the tables as JSON. Medians of ``--repeat`` warm runs; whole
runs beside direct summation alternate with it. Machines differ and are shared: look at the ratios.
The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from direct_summation import DirectSummation, direct_solve
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.splitting import split_variance
from esh.engine.quality.coverage import coverage_error
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver
from problems import SQUARE, problem_of
from quality import quality_table

UNIFORM = np.ones((1, 1), dtype=np.float32)
# Where direct summation is compared over a whole run; and with --quick, which only shows that everything runs.
DIRECT_BODIES, DIRECT_BODIES_QUICK = 16_384, 1024
# Steps that the paper's scheme takes, and direct descent with our step lengths.
PAPER_STEPS, DIRECT_STEPS = 1000, 300
# What the parts of a step take as separate kernels of Warp on an H200 [s]: neighbors from a hash grid, deposit, two transforms.
GPU_STEP_OF_A_MILLION = 1.4e-3
# A Gaussian's transform exp(-s²k²/2) falls to 1e-3 at k = 3.72/s.
LAST_WAVE = 3.72


def timed(run: Callable[[], object]) -> float:
    """Seconds of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def timings(device: str, counts: list[int], repeat: int, json_path: Path) -> list[dict[str, Any]]:
    """What pytest-benchmark measures; see :mod:`timings`."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        str(Path(__file__).parent / "timings.py"),
        "-q",
        "-p",
        "no:cacheprovider",
        # The root is a package: pytest is not to import it, since the folder's name need not be one for Python.
        f"--confcutdir={Path(__file__).parent}",
    ]
    command += ["--device", device, "--repeat", str(repeat), f"--benchmark-json={json_path}", "--benchmark-quiet"]
    subprocess.run([*command, "--bodies", *map(str, counts)], check=True)
    return json.loads(json_path.read_text(encoding="utf-8"))["benchmarks"]


def named(entries: list[dict[str, Any]], test: str, **parameters: int) -> dict[str, Any]:
    """The entry of a test with these parameters."""
    return next(
        entry for entry in entries if entry["name"].partition("[")[0] == test and (entry["params"] or {}) == parameters
    )


def whole_runs(entries: list[dict[str, Any]], counts: list[int], on_gpu: bool) -> list[str]:
    """Table of whole runs, and how time grows."""
    lines = ["| bodies | one group | six groups | coverage error | peak memory, one / six |", "|---|---|---|---|---|"]
    if on_gpu:
        lines = [line + extra for line, extra in zip(lines, (" times the bound, one / six |", "---|"), strict=True)]
    median: dict[tuple[int, int], float] = {}
    for count in counts:
        runs = [named(entries, "test_whole_run", count=count, groups=groups) for groups in (1, 6)]
        seconds = [run["stats"]["median"] for run in runs]
        median[count, 1], median[count, 6] = seconds
        memory = " / ".join(f"{run['extra_info']['memory']:.1f} GB" for run in runs)
        error = runs[0]["extra_info"]["coverage_error"]
        lines.append(f"| {count:,} | {seconds[0]:.2f} s | {seconds[1]:.2f} s | {error:.4f} | {memory} |")
        if on_gpu:
            bounds = [run["extra_info"]["steps"] * GPU_STEP_OF_A_MILLION * count / 1e6 for run in runs]
            lines[-1] += " " + " / ".join(f"{s / b:.1f}" for s, b in zip(seconds, bounds, strict=True)) + " |"
    if len(counts) > 1:
        growth = [
            math.log(median[counts[-1], g] / median[counts[0], g]) / math.log(counts[-1] / counts[0]) for g in (1, 6)
        ]
        lines += ["", f"Time grows as n^{growth[0]:.2f} (one group) and n^{growth[1]:.2f} (six groups)."]
    start = named(entries, "test_start_of_the_command")["stats"]["median"]
    return [*lines, "", f"`esh-scatter solve` on nine bodies, as a process: {start:.2f} s."]


def against_direct(launcher: Launcher, count: int, repeat: int) -> list[str]:
    """Our run, whole and stopped at the paper's quality, against direct summation of the same problem."""
    problem = problem_of(count)
    device = launcher.device.alias

    def errors(position: np.ndarray) -> list[float]:
        return [coverage_error(position, np.ones(count), UNIFORM, SQUARE, k) for k in (0.5, 1.0, 2.0)]

    paper = errors(direct_solve(problem, launcher, steps=PAPER_STEPS, double=False, paper_step=True))
    ours_in_direct = errors(direct_solve(problem, launcher, steps=DIRECT_STEPS, double=False))
    whole = solve(problem, device=device)
    # Steps, in tens, after which ours is no worse: at k = 1, and at every k. As good as the paper's is what is within two per cent.
    reached = {steps: errors(solve(problem, device=device, max_steps=steps).position) for steps in range(10, 160, 10)}
    at_one = next(steps for steps, error in reached.items() if error[1] <= paper[1])
    at_all = next(
        (steps for steps, e in reached.items() if all(a <= 1.02 * b for a, b in zip(e, paper, strict=True))), None
    )
    sums = DirectSummation(problem, launcher, double=False)
    position = np.random.default_rng(0).random((count, 2)) * sums.size
    shorter = [steps for steps in (at_one, at_all) if steps is not None]
    step_seconds: list[float] = []
    seconds: dict[int, list[float]] = {whole.report.steps: [], **{steps: [] for steps in shorter}}
    for _ in range(repeat):
        for steps, times in seconds.items():
            times.append(timed(partial(solve, problem, device=device, max_steps=steps)))
        step_seconds += [timed(lambda: (sums.repulsion(position), sums.attraction(position))) for _ in range(5)]
    step = statistics.median(step_seconds)
    rows = [
        ("direct summation, the paper's step of 0.1", PAPER_STEPS, PAPER_STEPS * step, paper),
        ("direct summation, our step lengths", DIRECT_STEPS, DIRECT_STEPS * step, ours_in_direct),
        ("ours, whole run", whole.report.steps, statistics.median(seconds[whole.report.steps]), errors(whole.position)),
    ]
    if at_all is not None:
        name = "ours, stopped at the paper's quality at every k"
        rows.append((name, at_all, statistics.median(seconds[at_all]), reached[at_all]))
    name = "ours, stopped at the paper's quality at k = 1"
    rows.append((name, at_one, statistics.median(seconds[at_one]), reached[at_one]))
    return [
        f"| {count:,} bodies, uniform | steps | seconds | coverage error, k = 0.5 / 1 / 2 | times as fast as the paper's |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | {steps} | {taken:.2f} | {' / '.join(f'{error:.4f}' for error in error_of)} | "
            f"{PAPER_STEPS * step / taken:.1f} |"
            for name, steps, taken, error_of in rows
        ),
        "",
        f"Direct summation: steps times the median of a step in float32 on all cores, {1e3 * step:.1f} ms.",
    ]


def force_evaluations(
    entries: list[dict[str, Any]], launcher: Launcher, counts: list[int], repeat: int, fmm: Path | None
) -> list[str]:
    """One evaluation of all forces: ours, direct, fmm2dpy, finufft."""
    lines = ["| charges | ours | direct, float32 | fmm2dpy | finufft, far part only |", "|---|---|---|---|---|"]
    for count in counts:
        own = named(entries, "test_evaluation_of_all_forces", count=count)["stats"]["median"]
        cells = [f"{own:.4f} s"]
        rng = np.random.default_rng(0)
        if count <= 100_000:
            sums = DirectSummation(problem_of(count), launcher, double=False)
            scaled = rng.random((count, 2)) * sums.size
            sums.repulsion(scaled)
            seconds = timed(partial(sums.repulsion, scaled))
            cells.append(f"{seconds:.2f} s ({seconds / own:.0f} times)")
        else:
            cells.append("-")
        others = [] if fmm is None else [other_libraries(fmm, launcher, count) for _ in range(repeat)]
        for name in ("fmm2dpy", "finufft"):
            if others:
                seconds = statistics.median(entry[name] for entry in others)
                cells.append(f"{seconds:.2f} s ({seconds / own:.1f} times)")
            else:
                cells.append("-")
        lines.append(f"| {count:,} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    return lines


def other_libraries(python: Path, launcher: Launcher, count: int) -> dict[str, float]:
    """Seconds that other libraries take to evaluate the same forces."""
    with Solver(problem_of(count), device=launcher.device.alias) as solver:
        size, cutoff = solver.model.size, solver.descent.field.cutoff
    position = (np.random.default_rng(0).random((count, 2)) * size).astype(np.float32)
    # As many modes as the same split needs for an accuracy of 1e-3, over twice the domain.
    modes = 2 * math.ceil(LAST_WAVE / math.sqrt(split_variance(cutoff)) * max(size) / math.pi)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "points.npz"
        np.savez(path, position=position.astype(np.float64), charge=np.ones(count), modes=modes)
        command = [str(python), str(Path(__file__).parent / "other_libraries.py"), str(path)]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return json.loads(output.splitlines()[-1])


def table_of(script: str, *arguments: str) -> str:
    """The Markdown table that another script of this folder prints, and what it says below."""
    command = [sys.executable, str(Path(__file__).parent / script), *arguments]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return output[output.index("|") :].strip()


def main() -> None:
    """Print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("output/bench.md"))
    parser.add_argument("--device", default="auto")
    parser.add_argument("--bodies", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="tiny problems, once: does everything run?")
    parser.add_argument("--fmm", type=Path, help="Python that has fmm2dpy and finufft")
    options = parser.parse_args()
    if options.quick:
        options.bodies, options.repeat = [1000, 2000], 1
    device = resolve_device(options.device)
    launcher = Launcher(device)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    large = [count for count in options.bodies if count >= 100_000] or options.bodies
    options.output.parent.mkdir(parents=True, exist_ok=True)
    entries = timings(device.alias, options.bodies, options.repeat, options.output.with_suffix(".json"))
    direct = DIRECT_BODIES_QUICK if options.quick else DIRECT_BODIES
    repeat = ["--repeat", str(options.repeat)]
    counts = ["--bodies", *map(str, options.bodies)]
    written = Sections(options.output)
    written.add(
        f"# Benchmark\n\n{device.name} ({device.alias}), {processor()}, {cores} cores used, {platform.machine()}; "
        f"medians of {options.repeat}."
    )
    written.add("## Quality\n\n" + "\n".join(quality_table(device.alias)))
    written.add("## Whole runs\n\n" + "\n".join(whole_runs(entries, options.bodies, device.is_cuda)))
    written.add("## Against direct summation\n\n" + "\n".join(against_direct(launcher, direct, options.repeat)))
    forces = force_evaluations(entries, launcher, large, options.repeat, options.fmm)
    written.add("## One evaluation of the forces\n\n" + "\n".join(forces))
    if not device.is_cuda:
        written.add("## Transforms\n\n" + table_of("transforms.py", *repeat, *counts))
        few = [str(count) for count in ([200] if options.quick else [200, *options.bodies]) if count <= 100_000]
        phases = table_of("cores.py", "--bodies", *few, *repeat, "--kinds", "dots", "--phases")
        written.add("## Processors\n\n" + phases)
        if not options.quick:
            written.add("## Beside others\n\n" + table_of("cores.py", "--disturbed"))
    if importlib.util.find_spec("bpy") is not None:
        few = [str(count) for count in options.bodies if count <= 100_000] or ["10000"]
        written.add("## Blender's own distribution\n\n" + table_of("blender_poisson.py", *repeat, "--bodies", *few))
        all_of_them = table_of("blender_overhead.py", *repeat, "--bodies", *map(str, large))
        written.add("## Blender's side\n\n" + all_of_them)


class Sections:
    """What is printed and written, section by section: a long run that ends early leaves what it has."""

    def __init__(self, path: Path) -> None:
        self._path = path
        path.write_text("", encoding="utf-8")

    def add(self, text: str) -> None:
        """Print a section, and append it to the file."""
        print(text + "\n", flush=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(text + "\n\n")


def processor() -> str:
    """Name of this machine's processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"


if __name__ == "__main__":
    main()
