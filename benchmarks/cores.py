"""What more processors are worth: whole runs on 1, 2, 4, 8, 16, ... of this machine's, and how many threads each phase keeps busy.

    python benchmarks/cores.py --bodies 200 10000 100000 --groups 1 6 --kinds dots contact lines

Every number of processors has a process of its own, which may use so many of them and no more; so a run leaves one of four or more to
others, as it always does. Times are medians of warm runs.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

KINDS = ("dots", "contact", "lines")


def machine_cores() -> list[int]:
    """Processors that this process may use."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []


def time_cases(bodies: list[int], groups: list[int], kinds: list[str], repeat: int, profiled: bool) -> list[dict]:
    """Time every case in this process, warm: bodies, groups, kind, seconds of every run and, of one more, the phases."""
    from esh.engine.device.profile import Profile
    from esh.engine.problem.line import Line
    from esh.engine.problem.size import Size
    from esh.engine.solve import solve
    from problems import problem_of

    def problem(count: int, group_count: int, kind: str):
        made = problem_of(count, group_count)
        if kind == "contact":
            return replace(made, avoid_overlap=True)
        if kind == "lines":
            classes = [
                replace(
                    c.asked,
                    sizes=[Size(s.name, s.area, s.count, line=Line(3.0 * s.area**0.5, "none")) for s in c.sizes],
                )
                for c in made.classes
            ]
            return replace(made, classes=classes)
        return made

    cases = []
    for count in bodies:
        for group_count in groups:
            if group_count > count:
                continue
            for kind in kinds:
                asked = problem(count, group_count, kind)
                solve(asked, device="cpu", max_steps=3)
                seconds = []
                while len(seconds) < repeat or (sum(seconds) < 0.3 and len(seconds) < 5 * repeat):
                    start = time.perf_counter()
                    solve(asked, device="cpu")
                    seconds.append(time.perf_counter() - start)
                case = {"bodies": count, "groups": group_count, "kind": kind, "seconds": statistics.median(seconds)}
                if profiled:
                    profile = Profile()
                    solve(asked, device="cpu", profile=profile)
                    case["phases"] = {
                        name: (spent, profile.busy_threads[name]) for name, spent in profile.seconds.items()
                    }
                cases.append(case)
                print(json.dumps(case), flush=True)
    return cases


def time_on(cores: list[int], arguments: list[str], environment: dict[str, str] | None = None) -> list[dict]:
    """Time every case in a process that may use these processors only."""
    command = [sys.executable, __file__, "--inside", ",".join(map(str, cores)), *arguments]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, **(environment or {})}
    ) as process:
        cases = []
        for line in process.stdout or []:
            if line.startswith("{"):
                cases.append(json.loads(line))
                # Who waits for a long table sees that it grows.
                print(f"{len(cores)} processors: {line.strip()[:100]}", file=sys.stderr, flush=True)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return cases


def disturbed(cores: list[int]) -> list[str]:
    """How much longer runs take where not all processors are theirs, as Markdown."""
    arguments = ["--bodies", "10000", "100000", "--groups", "1", "--kinds", "dots", "contact", "--repeat", "3"]
    half = max(1, len(cores) // 2)
    burn = [sys.executable, "-c", "while True: pass"]

    def beside_others(count: int) -> list[dict]:
        others = [subprocess.Popen(burn) for _ in range(count)]
        try:
            return time_on(cores, arguments)
        finally:
            for other in others:
                other.kill()
                other.wait()

    def twice() -> list[dict]:
        with ThreadPoolExecutor(2) as pool:
            first, _ = pool.map(lambda _: time_on(cores, arguments), range(2))
            return first

    situations = {
        "alone": time_on(cores, arguments),
        "two at once": twice(),
        f"beside {half} busy programs": beside_others(half),
        f"beside {len(cores)} busy programs": beside_others(len(cores)),
        f"{len(cores)} threads on {half} processors": time_on(
            cores[:half], arguments, {"ESH_THREADS": str(len(cores))}
        ),
    }
    alone = situations["alone"]
    lines = [f"| {len(cores)} processors | " + " | ".join(situations) + " |", "|---|" + "---|" * len(situations)]
    for k, case in enumerate(alone):
        cells = [f"{s[k]['seconds']:.3g} s ({s[k]['seconds'] / case['seconds']:.1f})" for s in situations.values()]
        lines.append(f"| {case['bodies']:,} bodies, {case['kind']} | {' | '.join(cells)} |")
    return lines


def tables(arguments: list[str], cores: list[int], numbers: list[int]) -> list[str]:
    """The whole comparison as Markdown."""
    results = {n: time_on(cores[:n], arguments) for n in numbers}
    lines = [
        "| bodies | groups | kind | " + " | ".join(f"{n} processors" for n in numbers) + " |",
        "|---|---|---|" + "---|" * len(numbers),
    ]
    for k, case in enumerate(results[numbers[0]]):
        times = " | ".join(f"{results[n][k]['seconds']:.3g} s" for n in numbers)
        lines.append(f"| {case['bodies']:,} | {case['groups']} | {case['kind']} | {times} |")
    lines += ["", "Seconds of every phase, and in brackets how many threads were at work in it:", ""]
    most = numbers[-1]
    for k, case in enumerate(results[most]):
        if "phases" not in case:
            continue
        lines += [
            f"{case['bodies']:,} bodies, groups: {case['groups']}, {case['kind']}",
            "",
            "| phase | " + " | ".join(f"{n} processors" for n in numbers) + " |",
            "|---|" + "---|" * len(numbers),
        ]
        for name in case["phases"]:
            cells = [results[n][k]["phases"].get(name, (0.0, 1.0)) for n in numbers]
            lines.append(f"| {name} | " + " | ".join(f"{spent:.3f} s ({busy:.1f})" for spent, busy in cells) + " |")
        lines.append("")
    return lines


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, nargs="+", default=[200, 10_000, 100_000])
    parser.add_argument("--groups", type=int, nargs="+", default=[1, 6])
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--phases", action="store_true", help="time the phases of every case, too")
    parser.add_argument("--disturbed", action="store_true", help="time runs beside others instead")
    parser.add_argument("--cores", type=int, nargs="+", help="numbers of processors; default: powers of two")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside is not None:
        if options.inside:
            os.sched_setaffinity(0, [int(core) for core in options.inside.split(",")])
        sys.path.insert(0, str(Path(__file__).resolve().parent))
        time_cases(options.bodies, options.groups, options.kinds, options.repeat, options.phases)
        return
    cores = machine_cores()
    if options.disturbed:
        print("\n".join(disturbed(cores)))
        return
    numbers = options.cores or sorted({n for n in (1, 2, 4, 8, 16, 32, 64) if n < len(cores)} | {len(cores)})
    print("\n".join(tables(sys.argv[1:], cores, numbers)))


if __name__ == "__main__":
    main()
