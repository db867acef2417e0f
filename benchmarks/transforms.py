"""One convolution of a step on the CPU: ours beside pocketfft (scipy.fft) with as many workers as we have threads, in float32.

    python benchmarks/transforms.py --bodies 10000 100000 1000000

The meshes are those that so many bodies of one group get. Both put a mesh through its transform, the product with an
influence function, and back; what comes out is compared. pocketfft does it in two ways: with rfft2 and irfft2 of the
whole padded mesh, and, as we do, leaving out the rows that hold only padding. Medians of runs that alternate.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
import scipy
import scipy.fft
import warp as wp
from esh.engine.device.launcher import Launcher, resolve_device
from esh.engine.solver.descent import Descent
from esh.engine.solver.model import Model
from esh.engine.transforms.convolution import Convolution
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


def row_of(launcher: Launcher, count: int, repeat: int) -> str:
    """Time the convolution of a mesh for so many bodies, as a row of the table."""
    layout = Descent(Model(problem_of(count)), launcher).field.layout
    shape, padded, workers = layout.shape, layout.padded, launcher.thread_count
    mesh = np.random.default_rng(0).standard_normal(shape).astype(np.float32)
    y, x = (np.abs(np.fft.fftfreq(length)) for length in padded)
    kernel = np.exp(-200.0 * (x**2 + y[:, None] ** 2))
    kernel /= kernel.sum()
    spectrum = scipy.fft.rfft2(kernel).real.astype(np.float32)

    convolution = Convolution(launcher, shape, padded)
    # pocketfft divides by the number of elements on the way back, ours leaves it to the influence function.
    quarter = kernel[: padded[0] // 2 + 1].ravel() / kernel.size
    influence = convolution.influence_of(wp.array(quarter, dtype=float, device="cpu"))
    convolved = wp.zeros(mesh.size, dtype=float, device="cpu")
    # As a step does it: recorded once, then played.
    recording = launcher.record(lambda: convolution.apply(influence, convolved))

    ways: dict[str, Callable[[], object]] = {
        "ours": recording.play,
        "whole": lambda: whole_mesh(mesh, padded, spectrum, workers),
        "rows": lambda: without_padding(mesh, padded, spectrum, workers),
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    while len(seconds["ours"]) < max(FEWEST_RUNS, repeat) or sum(map(sum, seconds.values())) < LEAST_SECONDS:
        for name, run in ways.items():
            convolved.assign(mesh.ravel())
            seconds[name].append(timed(run))
            if name == "ours" and len(seconds["ours"]) == 1:
                # Times are worth comparing only where the results are the same.
                expected = whole_mesh(mesh, padded, spectrum, workers)
                assert np.abs(convolved.numpy().reshape(shape) - expected).max() < 1e-5 * np.abs(expected).max()
    ours, whole, rows = (statistics.median(values[1:]) for values in seconds.values())
    return (
        f"| {count:,} | {shape[0]} × {shape[1]} in {padded[0]} × {padded[1]} | {1e3 * ours:.2f} ms | "
        f"{1e3 * whole:.2f} ms ({whole / ours:.1f}) | {1e3 * rows:.2f} ms ({rows / ours:.1f}) |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--repeat", type=int, default=FEWEST_RUNS, help="runs at least")
    options = parser.parse_args()
    launcher = Launcher(resolve_device("cpu"))
    try:
        print(
            "| bodies | mesh in its padding | ours | rfft2, irfft2 (times ours) | without the padding's rows (times ours) |"
        )
        print("|---|---|---|---|---|", flush=True)
        for count in options.bodies:
            print(row_of(launcher, count, options.repeat), flush=True)
        print(
            f"\npocketfft of SciPy {scipy.__version__}; threads and workers: {launcher.thread_count}; float32; product included."
        )
    finally:
        launcher.close()


if __name__ == "__main__":
    main()
