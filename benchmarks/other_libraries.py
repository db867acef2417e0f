"""Evaluate the forces of charges with fmm2dpy and finufft, in an environment of their own (they need NumPy 1).

    .venv-fmm/bin/python benchmarks/other_libraries.py POINTS.npz

Prints seconds of one warm evaluation each, as JSON. fmm2dpy is Flatiron's two-dimensional fast multipole method: all pairs, to 1e-3.
finufft has no forces: timed is what a far field by non-equispaced transforms takes (one of type 1 and one of type 2: the two
components of the force are its real and imaginary parts), without any near part.
"""

from __future__ import annotations

import json
import sys
import time

import finufft
import fmm2dpy
import numpy as np

ACCURACY = 1e-3


def main() -> None:
    """Time both on the points of a file."""
    with np.load(sys.argv[1]) as file:
        position, charge, modes = file["position"], file["charge"], int(file["modes"])
    sources = np.ascontiguousarray(position.T / position.max())
    seconds = {}
    for _ in range(2):
        start = time.perf_counter()
        fmm2dpy.rfmm2d(eps=ACCURACY, sources=sources, charges=charge, pg=2)
        seconds["fmm2dpy"] = time.perf_counter() - start
    x, y = (np.ascontiguousarray(axis * np.pi - 0.5 * np.pi) for axis in sources)
    strength = charge.astype(np.complex128)
    for _ in range(2):
        start = time.perf_counter()
        spectrum = finufft.nufft2d1(x, y, strength, (modes, modes), eps=ACCURACY)
        finufft.nufft2d2(x, y, spectrum, eps=ACCURACY)
        seconds["finufft"] = time.perf_counter() - start
    print(json.dumps(seconds))


if __name__ == "__main__":
    main()
