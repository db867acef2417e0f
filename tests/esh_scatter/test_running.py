"""A run that has come to its end is let go, with all that the solver held."""

import gc
import threading
import weakref

import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import running  # noqa: E402
from esh.esh_scatter.background_run import BackgroundRun  # noqa: E402


class Solver:
    def __init__(self):
        self.may_end = threading.Event()

    def solve(self, progress):
        progress(self)
        assert self.may_end.wait(30)


def test_a_stopped_run_is_waited_for_and_then_let_go(monkeypatch):
    solver = Solver()
    run = BackgroundRun(solver.solve)
    monkeypatch.setattr(running, "_stopping", run)
    assert running.still_stopping()
    solver.may_end.set()
    run.join(30)
    assert not running.still_stopping()
    held = weakref.ref(solver)
    del run, solver
    gc.collect()
    assert held() is None
