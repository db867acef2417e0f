"""What many processors are worth, in one run of at most so many seconds: whole runs, the most important ones first.

    python benchmarks/many_cores.py --seconds 150

Every number of processors has a process of its own, which may use so many and no more; of four or more a run leaves one to others.
Times are medians of warm runs. Of 100,000 bodies every phase is shown, too, with the milliseconds in which one thread is at work at
most: more processors do not shorten these. Lines are printed as they come, so that a run that is stopped has said what it knows.
Needs the engine and what it needs itself, and no installation.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Steps of a run that loads all kernels, and of one of which the time of a whole run is told.
FEW_STEPS = 3
STEPS = 100
# Seconds after which a case is not repeated.
ENOUGH = 5.0


@dataclass(frozen=True)
class Case:
    """A problem, and whether its phases are shown."""

    bodies: int
    groups: int = 1
    contact: bool = False
    phases: bool = False
    # Chunks that a kernel is cut into for every thread; None for what is usual.
    chunks: int | None = None

    def __str__(self) -> str:
        return (
            f"{self.bodies:,} bodies, {self.groups} group{'s' * (self.groups > 1)}{', contact' * self.contact}"
            f"{f', {self.chunks} chunks a thread' if self.chunks else ''}"
        )


FIRST = [
    Case(100_000, phases=True),
    Case(100_000, contact=True, phases=True),
    Case(10_000),
    Case(10_000, contact=True),
    Case(1_000_000),
]
MORE = [Case(100_000, 6), Case(10_000, 6), Case(100_000, 6, contact=True), Case(10_000, 6, contact=True)]
LAST = [Case(1_000_000, 6)]
CHUNKS = [Case(100_000, contact=contact, chunks=chunks) for chunks in (4, 16) for contact in (False, True)]
FEW = [Case(100_000), Case(100_000, contact=True), Case(10_000), Case(10_000, contact=True)]


def plan(processors: int) -> list[tuple[int, list[Case]]]:
    """What is timed on how many processors, in this order."""
    some = [n for n in (8, 4) if n < processors]
    few = [2] if processors > 2 else []
    return [
        (processors, [*FIRST, *MORE]),
        *((n, FIRST[:4]) for n in few),
        *((n, FEW) for n in some),
        (processors, [*CHUNKS, *LAST]),
        *((n, [FIRST[4], *MORE]) for n in [*few, *some]),
        *((n, LAST) for n in [*some, *few]),
    ]


def run_cases(cases: list[Case], repeat: int, deadline: float) -> None:
    """Time cases in this process, warm, and print a line of JSON for each."""
    from esh.engine.device import threads
    from esh.engine.device.devices import core_count
    from esh.engine.device.profile import Profile
    from esh.engine.solve import solve
    from problems import problem_of

    usual = threads.CHUNKS_PER_THREAD
    for case in cases:
        problem = replace(problem_of(case.bodies, case.groups), avoid_overlap=case.contact)
        threads.CHUNKS_PER_THREAD = case.chunks or usual
        # The first run compiles; whoever has no time left for a whole run does not begin it.
        solve(problem, device="cpu", max_steps=FEW_STEPS)
        start = time.time()
        solve(problem, device="cpu", max_steps=FEW_STEPS)
        whole = (time.time() - start) * STEPS / (4.0 * FEW_STEPS)
        seconds: list[float] = []
        while len(seconds) < repeat and sum(seconds) < ENOUGH:
            if time.time() + max([whole, *seconds]) > deadline:
                break
            before = time.perf_counter()
            solve(problem, device="cpu")
            seconds.append(time.perf_counter() - before)
        if not seconds:
            return
        result = {"case": str(case), "seconds": statistics.median(seconds), "least": min(seconds), "most": max(seconds)}
        result["threads"] = core_count()
        if case.phases and time.time() + max(seconds) < deadline:
            profile = Profile()
            solve(problem, device="cpu", profile=profile)
            busy, serial = profile.busy_threads, profile.serial_seconds
            result["phases"] = {name: (spent, busy[name], serial[name]) for name, spent in profile.seconds.items()}
        print(json.dumps(result), flush=True)


def time_on(processors: list[int], cases: list[Case], repeat: int, deadline: float) -> list[dict]:
    """Time cases in a process that may use these processors only; it ends at the deadline in any case."""
    plain = json.dumps([vars(case) for case in cases])
    command = [sys.executable, __file__, "--inside", ",".join(map(str, processors)), "--cases", plain]
    command += ["--repeat", str(repeat), "--deadline", str(deadline)]
    results = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        late = threading.Timer(max(0.0, deadline - time.time()), process.kill)
        late.start()
        try:
            for line in process.stdout or []:
                if line.startswith("{"):
                    results.append(json.loads(line))
                    show(len(processors), results[-1])
        finally:
            late.cancel()
            process.kill()
    return results


def show(processors: int, result: dict) -> None:
    """Print what was found."""
    spread = f"{result['least']:.3g} to {result['most']:.3g}"
    print(
        f"| {processors} processors, {result['threads']} threads | {result['case']} | {result['seconds']:.3f} s | {spread} |",
        flush=True,
    )
    phases = result.get("phases", {})
    for name, (spent, busy, serial) in phases.items():
        print(f"|   | {name} | {spent:.3f} s, {busy:.1f} threads | {1e3 * serial:.1f} ms on one |")
    if phases:
        total, alone = (sum(entry[k] for entry in phases.values()) for k in (0, 2))
        print(f"|   | all phases | {total:.3f} s | {1e3 * alone:.1f} ms on one, {alone / total:.0%} |", flush=True)


def table(found: dict[int, list[dict]]) -> str:
    """Cases by numbers of processors."""
    numbers = sorted(found)
    cases = list(dict.fromkeys(result["case"] for results in found.values() for result in results))
    lines = ["| | " + " | ".join(f"{n} processors" for n in numbers) + " |", "|---" * (len(numbers) + 1) + "|"]
    for case in cases:
        by_number = {n: r["seconds"] for n, results in found.items() for r in results if r["case"] == case}
        cells = [f"{by_number[n]:.3g} s" if n in by_number else "" for n in numbers]
        lines.append(f"| {case} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def machine() -> str:
    """The processor's name, and which of the system's processors are one core's."""
    name, cores = platform.processor(), set()
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), name)
    for path in Path("/sys/devices/system/cpu").glob("cpu[0-9]*/topology/thread_siblings_list"):
        with contextlib.suppress(OSError):
            cores.add(path.read_text(encoding="ascii").strip())
    return f"{name}; cores of processors {', '.join(sorted(cores))}; {platform.platform()}, Python {platform.python_version()}"


def make_importable(folder: str) -> None:
    """Let this repository be the package `esh`, here and in processes that are started, where it is not installed."""
    os.symlink(ROOT, Path(folder) / "esh", target_is_directory=True)
    paths = [folder, str(Path(__file__).resolve().parent)]
    sys.path[:0] = paths
    os.environ["PYTHONPATH"] = os.pathsep.join([*paths, *filter(None, [os.environ.get("PYTHONPATH")])])


def main() -> None:
    """Print lines as they come, and the table at the end."""
    began = time.time()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=150.0, help="time to end after")
    parser.add_argument("--repeat", type=int, default=3, help="warm runs of each, of which the median counts")
    parser.add_argument("--bodies", type=int, help="no more bodies than so many")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    parser.add_argument("--cases", help=argparse.SUPPRESS)
    parser.add_argument("--deadline", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside is not None:
        os.sched_setaffinity(0, [int(processor) for processor in options.inside.split(",")])
        run_cases([Case(**case) for case in json.loads(options.cases)], options.repeat, options.deadline)
        return
    deadline = began + options.seconds
    processors = sorted(os.sched_getaffinity(0))
    print(machine(), flush=True)
    found: dict[int, list[dict]] = {}
    with tempfile.TemporaryDirectory() as folder:
        make_importable(folder)
        for number, cases in plan(len(processors)):
            few = [case for case in cases if case.bodies <= (options.bodies or case.bodies)]
            if few and time.time() < deadline:
                found.setdefault(number, []).extend(time_on(processors[:number], few, options.repeat, deadline))
    print(f"\n{time.time() - began:.0f} s\n\n{table(found)}", flush=True)


if __name__ == "__main__":
    main()
