"""Calls on the machines of a Ray cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ..errors import EshError
from ..files.extras import import_extra
from .worker import Failure, carry_out

__all__ = ["RayPool"]

# A call whose process or machine is lost is made again, so often at most.
RETRIES = 8


class RayPool:
    """A connection to a cluster.

    Args:
        address: ``"auto"`` (the cluster that this machine is part of), ``"local"`` (a new one on this machine), or an address that
            ``ray.init`` takes.
        gpus: GPUs that a call asks for; a fraction lets several share one.
        keep: Whether the connection stays for another :meth:`map`, until :meth:`close`.

    Raises:
        EshError: Ray is not installed, or there is no cluster at the address.
    """

    def __init__(self, address: str, gpus: float = 0.0, *, keep: bool = False) -> None:
        known = address not in ("auto", "local")
        if known:
            # How often Ray knocks, for half a minute each time; it reads this once. Clusters of its own take a while to start.
            os.environ.setdefault("RAY_NUM_REDIS_GET_RETRIES", "1")
        self._ray: Any = import_extra("ray", "ray", "--ray")
        self._gpus = gpus
        self._keep = keep
        self._started = not self._ray.is_initialized()
        if self._started:
            try:
                self._ray.init(address=address, log_to_driver=False, logging_level="error")
            except (ConnectionError, ValueError, RuntimeError, OSError) as error:
                text = " ".join(str(error).split())[:300]
                # Where a token is missing, too, Ray says no more than that it failed.
                hint = "; one that asks for a token needs RAY_AUTH_MODE=token" if known else ""
                raise EshError(f"there is no Ray cluster at {address!r}: {text}{hint}") from None

    def share(self, value: Any) -> Any:
        """Return what stands for a value that all calls get: it is sent to each machine once."""
        return self._ray.put(value)

    def map(
        self, function: Callable[..., Any], calls: Iterable[tuple[Any, ...]], *, first_alone: bool = True
    ) -> Iterator[tuple[int, Any]]:
        """Carry out a call for each tuple of arguments, in a process with one thread; as :meth:`.WorkerPool.map`.

        No call waits for another: each machine compiles what it needs.
        """
        ray = self._ray
        # Processes stay for other calls: Ray would start one for every call that asks for a GPU, to load the kernels once more.
        remote = ray.remote(num_cpus=1, num_gpus=self._gpus, max_retries=RETRIES, max_calls=0)(_carry_out)
        waiting = enumerate(calls)
        running: dict[Any, int] = {}
        try:
            while True:
                # As many as keep every processor busy while answers come back; the cluster may have grown since.
                most = 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))
                while len(running) < most:
                    call = next(waiting, None)
                    if call is None:
                        break
                    # Arguments that stand for shared values are looked up only at the top level.
                    running[remote.remote(function, *call[1])] = call[0]
                if not running:
                    return
                done, _ = ray.wait(list(running), num_returns=1, timeout=5.0)
                for reference in done:
                    number = running.pop(reference)
                    try:
                        answer = ray.get(reference)
                    except ray.exceptions.RayTaskError as error:
                        # Errors of the call itself are in its answer: the process did not even find what to call.
                        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
                        answer = Failure(f"a machine of the cluster cannot make it: {lines[-1][:300]}", False)
                    except ray.exceptions.RayError as error:
                        answer = Failure(f"its process was lost: {type(error).__name__}", False)
                    yield number, answer
        finally:
            for reference in running:
                ray.cancel(reference, force=False)
            if running or not self._keep:
                self.close()

    def close(self) -> None:
        """Leave the cluster."""
        if self._started and self._ray.is_initialized():
            self._ray.shutdown()


def _carry_out(function: Callable[..., Any], *arguments: Any) -> Any:
    os.environ["ESH_THREADS"] = "1"
    return carry_out(function, arguments)
