"""Compile the kernels that tests launch, each once: ``python tools/warm_kernels.py``.

They go into Warp's own cache, where all processes of a run of tests find them. Those would otherwise compile the same ones at the
same time, each for itself.
"""

from __future__ import annotations

import importlib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import warp as wp
from build_kernels import kernel_modules
from esh.engine.device.devices import core_count
from esh.engine.device.quiet_start import start_warp


def compile_module(name: str) -> None:
    """Compile the kernels of a module for this processor, or find them in the cache."""
    start_warp()
    importlib.import_module(name)
    module = wp.get_module(name)
    if module.kernels:
        # The CPU's block has one thread.
        module.load(wp.get_device("cpu"), 1)


def main() -> None:
    """Compile what the cache lacks."""
    # New processes: what Warp has started does not survive a fork.
    with ProcessPoolExecutor(core_count(), mp_context=get_context("spawn")) as processes:
        list(processes.map(compile_module, kernel_modules()))


if __name__ == "__main__":
    main()
