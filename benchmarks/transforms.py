"""One convolution of a step on the CPU: ours beside pocketfft (scipy.fft) and beside Warp's tiles (wp.tile_fft), in float32.

    python benchmarks/transforms.py --bodies 10000 100000 1000000

The meshes are those that so many bodies of one group get. Both put a mesh through its transform, the product with an
influence function, and back; what comes out is compared. pocketfft does it in two ways: with rfft2 and irfft2 of the
whole padded mesh, and, as we do, leaving out the rows that hold only padding; it has as many workers as we have threads.
Warp runs a launch on one thread, so its tiles are compared with ours on one; they are the engine's own transforms of a GPU,
and want powers of two. Medians of runs that alternate.

The engine has transforms of its own for CPUs only because they win: by 1.5 times or more, or they are to go.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable

import numpy as np
import scipy
import scipy.fft
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.solver.solver import Solver
from esh.engine.transforms.convolution import Convolution
from esh.engine.transforms.convolution_gpu import GpuTransforms
from problems import problem_of

# Runs of one case at least, and seconds of all ways together: short ones scatter.
FEWEST_RUNS, LEAST_SECONDS = 7, 2.0

Shape = tuple[int, int]


def whole_mesh(mesh: np.ndarray, padded: Shape, spectrum: np.ndarray, workers: int) -> np.ndarray:
    """Convolve with rfft2 and irfft2."""
    half = scipy.fft.rfft2(mesh, padded, workers=workers)
    half *= spectrum
    return scipy.fft.irfft2(half, padded, overwrite_x=True, workers=workers)[: mesh.shape[0], : mesh.shape[1]]


def without_padding(mesh: np.ndarray, padded: Shape, spectrum: np.ndarray, workers: int) -> np.ndarray:
    """Convolve by rows and columns: rows that hold only padding are not transformed, there and back."""
    rows, columns = mesh.shape
    half = scipy.fft.rfft(mesh, padded[1], axis=1, workers=workers)
    half = scipy.fft.fft(half, padded[0], axis=0, workers=workers)
    half *= spectrum
    half = scipy.fft.ifft(half, axis=0, overwrite_x=True, workers=workers)[:rows]
    return scipy.fft.irfft(half, padded[1], axis=1, overwrite_x=True, workers=workers)[:, :columns]


def timed(run: Callable[[], object]) -> float:
    """Seconds of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def on_one_thread() -> Launcher:
    """A launcher for the CPU that has no thread but this one."""
    before = os.environ.get("ESH_THREADS")
    os.environ["ESH_THREADS"] = "1"
    try:
        return Launcher(resolve_device("cpu"))
    finally:
        del os.environ["ESH_THREADS"]
        if before is not None:
            os.environ["ESH_THREADS"] = before


class Ours:
    """Our convolution, recorded as a step has it.

    Args:
        launcher: Says how many threads.
        mesh: What is convolved.
        padded: Extent of the transforms.
        kernel: What it is convolved with, of that extent.
    """

    def __init__(self, launcher: Launcher, mesh: np.ndarray, padded: Shape, kernel: np.ndarray) -> None:
        convolution = Convolution(launcher, mesh.shape, padded)
        # pocketfft divides by the number of elements on the way back, ours leaves it to the influence function.
        quarter = kernel[: padded[0] // 2 + 1].ravel() / kernel.size
        influence = convolution.influence_of(wp.array(quarter, dtype=float, device="cpu"))
        self.mesh = mesh
        self.values = wp.zeros(mesh.size, dtype=float, device="cpu")
        self._recording = launcher.record(lambda: convolution.apply(influence, self.values))

    def fill(self) -> None:
        self.values.assign(self.mesh.ravel())

    def run(self) -> np.ndarray:
        self._recording.play()
        return self.values.numpy().reshape(self.mesh.shape)


class Tiles:
    """Warp's tiles on the calling thread, with a kernel of the next powers of two.

    Args:
        mesh: What is convolved.
        padded: Extent that transforms have at least.
    """

    def __init__(self, mesh: np.ndarray, padded: Shape) -> None:
        rows, columns = (1 << (length - 1).bit_length() for length in padded)
        self.padded = rows, columns
        self.kernel = kernel_of(self.padded)
        spectrum = scipy.fft.rfft2(self.kernel).real / self.kernel.size
        # Pairs of rows are transformed at once.
        self._shape = mesh.shape[0] + mesh.shape[0] % 2, mesh.shape[1]
        device = wp.get_device("cpu")
        self._transforms = GpuTransforms(device, self._shape, self.padded)
        self._influence = wp.array(spectrum.T.astype(np.float32).ravel(), dtype=float, device=device)
        self.mesh = mesh
        self.values = wp.zeros(self._shape[0] * self._shape[1], dtype=float, device=device)

    def fill(self) -> None:
        even = np.zeros(self._shape, np.float32)
        even[: self.mesh.shape[0]] = self.mesh
        self.values.assign(even.ravel())

    def run(self) -> np.ndarray:
        self._transforms.apply(self._influence, self.values, self.values)
        return self.values.numpy().reshape(self._shape)[: self.mesh.shape[0]]


def kernel_of(padded: Shape) -> np.ndarray:
    """A Gaussian over a mesh that repeats itself, whose sum is 1."""
    y, x = (np.abs(np.fft.fftfreq(length)) for length in padded)
    kernel = np.exp(-200.0 * (x**2 + y[:, None] ** 2))
    return kernel / kernel.sum()


def spectrum_of(kernel: np.ndarray) -> np.ndarray:
    return scipy.fft.rfft2(kernel).real.astype(np.float32)


def alike(found: np.ndarray, expected: np.ndarray) -> bool:
    """Times are worth comparing only where the results are the same."""
    return bool(np.abs(found - expected).max() < 1e-5 * np.abs(expected).max())


def row_of(launcher: Launcher, single: Launcher, count: int, repeat: int) -> str:
    """Time the convolution of a mesh for so many bodies, as a row of the table."""
    with Solver(problem_of(count), device="cpu") as solver:
        layout = solver.descent.field.layout
    shape, padded, workers = layout.shape, layout.padded, launcher.thread_count
    mesh = np.random.default_rng(0).standard_normal(shape).astype(np.float32)
    kernel = kernel_of(padded)
    spectrum = spectrum_of(kernel)
    ours, alone, tiles = Ours(launcher, mesh, padded, kernel), Ours(single, mesh, padded, kernel), Tiles(mesh, padded)
    for made, extent, its_spectrum in (
        (ours, padded, spectrum),
        (alone, padded, spectrum),
        (tiles, tiles.padded, spectrum_of(tiles.kernel)),
    ):
        made.fill()
        assert alike(made.run(), whole_mesh(mesh, extent, its_spectrum, workers))

    ways: dict[str, Callable[[], object]] = {
        "ours": ours.run,
        "whole": lambda: whole_mesh(mesh, padded, spectrum, workers),
        "rows": lambda: without_padding(mesh, padded, spectrum, workers),
        "alone": alone.run,
        "tiles": tiles.run,
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    while len(seconds["ours"]) < max(FEWEST_RUNS, repeat) or sum(map(sum, seconds.values())) < LEAST_SECONDS:
        for made in (ours, alone, tiles):
            made.fill()
        for name, run in ways.items():
            seconds[name].append(timed(run))
    median = {name: statistics.median(values[1:]) for name, values in seconds.items()}

    def beside(name: str, other: str) -> str:
        return f"{1e3 * median[name]:.2f} ms ({median[name] / median[other]:.1f})"

    return (
        f"| {count:,} | {shape[0]} × {shape[1]} in {padded[0]} × {padded[1]} | {1e3 * median['ours']:.2f} ms | "
        f"{beside('whole', 'ours')} | {beside('rows', 'ours')} | {1e3 * median['alone']:.2f} ms | {beside('tiles', 'alone')} in "
        f"{tiles.padded[0]} × {tiles.padded[1]} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--repeat", type=int, default=FEWEST_RUNS, help="runs at least")
    options = parser.parse_args()
    launcher, single = Launcher(resolve_device("cpu")), on_one_thread()
    try:
        print(
            "| bodies | mesh in its padding | ours | rfft2, irfft2 (times ours) | without the padding's rows (times ours) | "
            "ours, one thread | Warp's tiles, one thread (times ours) |"
        )
        print("|---|---|---|---|---|---|---|", flush=True)
        for count in options.bodies:
            print(row_of(launcher, single, count, options.repeat), flush=True)
        print(
            f"\npocketfft of SciPy {scipy.__version__}, tiles of Warp {wp.__version__} on the CPU; threads and workers: "
            f"{launcher.thread_count}; float32; product included."
        )
    finally:
        launcher.close()
        single.close()


if __name__ == "__main__":
    main()
