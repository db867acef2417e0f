"""What tests of Blender's side share."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest


@pytest.fixture
def empty_file() -> Iterator[None]:
    """An empty file, with the extension registered."""
    bpy = pytest.importorskip("bpy")
    from esh.esh_scatter import registration

    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    yield
    registration.unregister()


@pytest.fixture
def live_file(empty_file: None) -> Iterator[None]:
    """The same for tests of Live, of which nothing is left once the extension is unregistered."""
    from esh.esh_scatter import registration
    from esh.esh_scatter.solving import live

    yield
    registration.unregister()
    assert not live._followed and not any(hook in handlers for handlers, hook in live._hooks())
    registration.register()


@pytest.fixture
def bare_file() -> None:
    """An empty file, without the extension."""
    pytest.importorskip("bpy").ops.wm.read_homefile(use_empty=True)


@pytest.fixture
def follow() -> Callable[..., None]:
    """Let the timer of Live run until nothing is left to do, or until what is asked for holds."""
    from esh.esh_scatter.solving import live

    def run(until: Callable[[], bool] | None = None, seconds: float = 90.0) -> None:
        deadline = time.monotonic() + seconds
        still = 0
        while still < 3:
            assert time.monotonic() < deadline, "it does not come to rest"
            for one in live._followed.values():
                one._looked = 0.0
            if live._tick() is None:
                return
            still = 0 if any(one.busy for one in live._followed.values()) else still + 1
            if until is not None and until():
                return
            # Every look takes time from the solver that is waited for.
            time.sleep(0.01 if still else 0.02)

    return run
