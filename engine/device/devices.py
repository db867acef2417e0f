"""Which device a run uses, and how many threads and processes a machine has room for."""

from __future__ import annotations

import contextlib
import os
import re
import reprlib
from pathlib import Path

import warp as wp

from ..errors import DeviceError, Reason, Refusal
from .quiet_start import start_warp

__all__ = ["core_count", "gpu_environments", "processes_on_gpus", "resolve_device"]

# Of a GPU's memory so much is given to processes that share it; and what CUDA takes for each of them [bytes].
GPU_SHARE, GPU_PROCESS = 0.8, 0.8e9
# From so many processors on, one is left to whatever else runs: Blender's window, for one.
CORES_TO_SPARE_ONE = 4


def resolve_device(name: str = "auto") -> wp.Device:
    """Return the Warp device called ``name``.

    Args:
        name: ``"auto"`` (the first NVIDIA GPU, or the CPU where there is none), ``"cpu"``, ``"cuda"`` or ``"cuda:N"``.

    Raises:
        DeviceError: An unknown name, or a GPU that this machine lacks.
    """
    start_warp()
    gpu_names = [device.alias for device in wp.get_cuda_devices()]
    accepted = ", ".join(f'"{choice}"' for choice in ["auto", "cpu", *gpu_names])
    if not isinstance(name, str):
        raise DeviceError(f"`device` must be one of {accepted}; got {reprlib.repr(name)}")
    if name == "auto":
        name = gpu_names[0] if gpu_names else "cpu"
    if name == "cuda" and gpu_names:
        name = gpu_names[0]
    if name == "cpu" or name in gpu_names:
        return wp.get_device(name)
    number = name.removeprefix("cuda:")
    if name == "cuda" or number.isdigit():
        why = "this machine has no such NVIDIA GPU, or no driver for it"
        raise DeviceError(
            f"`device` {name!r} is not available: {why}; use one of {accepted}",
            Refusal(Reason.NO_SUCH_DEVICE, 1, len(gpu_names)),
        )
    raise DeviceError(f"`device` must be one of {accepted}; got {name!r}")


def gpu_environments(name: str) -> list[dict[str, str]]:
    """Environments of processes that are each to see one of the GPUs that ``name`` stands for, as "cuda:0" of its own.

    None where that is one GPU, or no GPU: such processes need nothing special.
    """
    start_warp()
    count = len(wp.get_cuda_devices())
    if name not in ("auto", "cuda") or count < 2:
        return []
    given = [entry.strip() for entry in os.environ.get("CUDA_VISIBLE_DEVICES", "").split(",") if entry.strip()]
    seen = given if len(given) == count else [str(number) for number in range(count)]
    return [{"CUDA_VISIBLE_DEVICES": entry} for entry in seen]


def processes_on_gpus(name: str, each: float) -> int:
    """Number of processes that the GPUs which ``name`` stands for have the memory and this machine the processors for, >= 1.

    Args:
        name: A device, as of :func:`resolve_device`, that is a GPU.
        each: What each process takes of a GPU's memory beside what CUDA takes [bytes].
    """
    device = resolve_device(name)
    # The GPUs of another machine are not known here: there is one process then.
    memory = device.total_memory if device.is_cuda else 0
    on_each = int(GPU_SHARE * memory / (GPU_PROCESS + each))
    return max(1, min(core_count(), max(1, len(gpu_environments(name))) * on_each))


def core_count() -> int:
    """Number of threads that a run on the CPU has.

    ``ESH_THREADS`` of the environment, or the processors that this process may use, less one for others where there are four or more.
    """
    wanted = os.environ.get("ESH_THREADS", "")
    if wanted:
        if not re.fullmatch(r"0*[1-9][0-9]{0,5}", wanted):
            raise DeviceError(
                f"the environment variable ESH_THREADS must be a whole number from 1 to 999999; got {reprlib.repr(wanted)}"
            )
        return int(wanted)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    cores = min(cores, _container_cores() or cores)
    return cores - 1 if cores >= CORES_TO_SPARE_ONE else cores


def _container_cores() -> int | None:
    """Processors that a Linux container (control groups, version 2) gives time on; more threads would be stopped in turns."""
    with contextlib.suppress(OSError, ValueError):  # no such file, or the word "max"
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        return max(1, int(quota) // int(period))
    return None
