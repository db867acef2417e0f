"""One huge domain in tiles, on a GPU or the CPU, with writing: where its time goes.

    python benchmarks/huge_tiles.py                                    # 100,000,000 bodies on the first GPU
    python benchmarks/huge_tiles.py --bodies 1000000 --device cpu      # fewer, on processors
    python benchmarks/huge_tiles.py --tile 500 --workers 12            # tiles of 500 spacings, twelve processes
    python benchmarks/huge_tiles.py --bodies 1000000000 --device cuda  # on all GPUs of the machine
    python benchmarks/huge_tiles.py --ray local --gpus 0.1             # by Ray, ten processes on each GPU

First a small problem of the same kind is solved, which compiles the kernels and is not counted. Then a line says how long each stage
took by the wall, and another what the processes did meanwhile: reading what the pass before left, setting windows up, stepping,
writing parts and tiles, and waiting. Tiles are Parquet where pyarrow is installed, and .npz where it is not, which is said. Needs the
engine and what it needs itself, and no installation.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import os
import resource
import shutil
import sys
import tempfile
import threading
import time
import types
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Of the small problem: bodies along its sides, tiles along them, and steps.
SMALL_SIDE, SMALL_TILES, SMALL_STEPS = 400, 4, (3, 3, 3)


def import_engine() -> types.ModuleType:
    """The package, by its own name where it is installed or on the path, or else from this folder, under the name esh.

    Processes are started by name, so they find it by a link on their path.
    """
    if importlib.util.find_spec("esh") is None:
        folder = Path(tempfile.mkdtemp(prefix="esh-path-"))
        (folder / "esh").symlink_to(ROOT, target_is_directory=True)
        sys.path.insert(0, str(folder))
        os.environ["PYTHONPATH"] = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    import esh

    return esh


def problem_of(esh: types.ModuleType, case: str, bodies: int) -> object:
    """A problem of so many bodies, whose mean spacing is a meter."""
    import numpy as np

    side = math.sqrt(bodies)
    domain = esh.Domain((side, side))
    if case == "uniform":
        return esh.Problem(domain, [esh.BodyClass("dot", [esh.Size("one", area=1.0, count=bodies)])], seed=7)
    falls = np.broadcast_to(np.linspace(1.0, 0.05, 512, dtype=np.float32), (512, 512))
    sizes = [esh.Size("large", area=2.5, count=bodies // 10), esh.Size("small", area=0.6, count=bodies * 4 // 10)]
    classes = [esh.BodyClass("a", sizes, falls), esh.BodyClass("b", sizes, np.float32(1.05) - falls)]
    return esh.Problem(domain, classes, seed=7)


class GpuLoad:
    """How busy a GPU is, looked at now and then; nothing where nobody says it."""

    def __init__(self, device: str) -> None:
        self._shown: list[tuple[float, float]] = []
        self._over = threading.Event()
        self._index = device.removeprefix("cuda").removeprefix(":") or "0"
        command = shutil.which("nvidia-smi") if device != "cpu" else None
        self._thread = threading.Thread(target=self._look, args=(command,), daemon=True) if command else None

    def __enter__(self) -> GpuLoad:
        if self._thread:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._thread:
            self._thread.join()

    def _look(self, command: str) -> None:
        import subprocess

        what = ["--query-gpu=utilization.gpu,memory.used", "--format=csv,noheader,nounits", "-i", self._index]
        while not self._over.wait(1.0):
            found = subprocess.run([command, *what], capture_output=True, text=True, check=False)
            try:
                busy, used = (float(word) for word in found.stdout.split(","))
            except ValueError:
                return
            self._shown.append((busy, used))

    def __str__(self) -> str:
        if not self._shown:
            return "how busy the GPU was is not known: there is no nvidia-smi"
        busy, used = zip(*self._shown, strict=True)
        return f"GPU at work {sum(busy) / len(busy):.0f} % of the time, at most {max(used) / 1024:.1f} GiB in use"


class RayMemory:
    """How many processes a cluster has on this machine, and the most memory that one of them has taken; looked at now and then."""

    def __init__(self) -> None:
        self._most: dict[str, float] = {}
        self._next = 0.0

    def look(self) -> None:
        if time.perf_counter() < self._next:
            return
        self._next = time.perf_counter() + 2.0
        for process in Path("/proc").glob("[0-9]*"):
            try:
                # At work or idle, they are called after what they carry out; the cluster's own are called otherwise.
                if not (process / "cmdline").read_bytes().startswith((b"ray::_carry_out", b"ray::IDLE")):
                    continue
                fields = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
            except OSError:
                continue
            if "VmHWM" in fields:
                self._most[process.name] = int(fields["VmHWM"].split()[0]) / 1024

    def __str__(self) -> str:
        return f"{len(self._most)} processes of Ray were seen, of at most {max(self._most.values(), default=0.0):,.0f} MiB each"


def solve(
    esh: types.ModuleType,
    problem: object,
    options: argparse.Namespace,
    tile: float | None,
    steps: tuple[int, ...],
    tell: bool,
) -> float:
    """Solve in a folder that is removed, and return the seconds; tell how long each stage took where that is asked for."""
    folder = Path(tempfile.mkdtemp(prefix="esh-tiles-", dir=options.folder))
    stages: dict[str, float] = {}
    last = [time.perf_counter(), ""]
    memory = RayMemory() if options.ray is not None else None

    def look(now: object) -> None:
        if memory is not None:
            memory.look()
        moment = time.perf_counter()
        if last[1]:
            stages[last[1]] = stages.get(last[1], 0.0) + moment - last[0]
        last[:] = [moment, now.name]
        if tell and now.done in (0, now.parts):
            print(f"  {moment - start:7.1f} s  {now.name}: {now.done} of {now.parts}", flush=True)

    start = time.perf_counter()
    try:
        result = esh.solve_tiles(
            problem, folder / "out", tile=tile, steps=steps, ending=options.ending, device=options.device,
            workers=options.workers, ray=options.ray, gpus=options.gpus, progress=look,
        )  # fmt: skip
        seconds = time.perf_counter() - start
        if tell:
            written = sum(path.stat().st_size for path in (folder / "out").iterdir() if path.is_file())
            _report(result, stages, seconds, written, by_ray=memory is not None)
            if memory is not None:
                print(f"  {memory}")
        return seconds
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _report(result: object, stages: dict[str, float], seconds: float, written: int, *, by_ray: bool) -> None:
    columns, rows = result.tiles
    print(
        f"{result.bodies:,} bodies in {columns} x {rows} tiles: {seconds:.1f} s, {written / result.bodies:.1f} bytes a body"
    )
    print("  by the wall: " + ", ".join(f"{name} {spent:.1f} s" for name, spent in stages.items()))
    between = result.seconds.get("between", 0.0)
    inside = {name: spent for name, spent in result.seconds.items() if name != "between"}
    shares = ", ".join(f"{name} {spent:.1f} s" for name, spent in inside.items())
    if by_ray:
        print(f"  processes of Ray, seconds of all together: {shares}")
    else:
        workers = max(1, result.workers)
        waited = workers * (seconds - between) - sum(inside.values())
        print(f"  {workers} processes, seconds of all together: {shares}, waiting {waited:.1f} s")
    print(f"  between stages, while all wait: {between:.1f} s")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, default=100_000_000)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument(
        "--tile", type=float, default=None, help="length in mean spacings (default: what the program chooses)"
    )
    parser.add_argument("--workers", type=int, default=None, help="processes (default: what the program chooses)")
    parser.add_argument("--ray", default=None, help='address of a Ray cluster, or "local" for one of this machine')
    parser.add_argument("--gpus", type=float, default=0.0, help="GPUs that a window asks of Ray")
    parser.add_argument("--steps", type=int, nargs=3, default=None)
    parser.add_argument("--case", choices=["uniform", "classes"], default="uniform")
    parser.add_argument("--folder", default=None, help="where the tiles go for a while (default: the system's)")
    parser.add_argument("--no-warming", action="store_true", help="time with the compiling of kernels")
    options = parser.parse_args(arguments)
    esh = import_engine()
    from esh.engine.tiles.tiles import STEPS

    options.ending = ".parquet" if importlib.util.find_spec("pyarrow") else ".npz"
    if options.ending == ".npz":
        print("pyarrow is not installed: tiles are written as .npz, which are larger and take no packing")
    if not options.no_warming:
        small = argparse.Namespace(**{**vars(options), "workers": 0, "ray": None, "gpus": 0.0})
        problem = problem_of(esh, options.case, SMALL_SIDE**2)
        warming = solve(esh, problem, small, SMALL_SIDE / SMALL_TILES, SMALL_STEPS, tell=False)
        print(f"warming with {SMALL_SIDE**2:,} bodies, not counted: {warming:.1f} s", flush=True)
    with GpuLoad(options.device) as load:
        solve(
            esh, problem_of(esh, options.case, options.bodies), options, options.tile, options.steps or STEPS, tell=True
        )
    if options.device != "cpu":
        print(f"  {load}")
    own, others = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    if options.ray is None:
        print(f"  most memory of the largest worker: {others:,.0f} MiB")
    print(f"  most memory of this process: {own:,.0f} MiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
