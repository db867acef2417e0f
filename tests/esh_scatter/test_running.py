"""A run that has come to its end is let go, with all that the solver held."""

import gc
import threading
import weakref
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.solving import running  # noqa: E402
from esh.esh_scatter.solving.background_run import BackgroundRun  # noqa: E402


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


def test_compiling_is_said_only_where_it_can_be(monkeypatch):
    from esh.engine.device import prebuilt_gpu_kernels, prebuilt_kernels

    monkeypatch.setattr(running, "_ran_on", set())
    monkeypatch.setattr(prebuilt_kernels, "are_prebuilt", lambda: False)
    monkeypatch.setattr(prebuilt_gpu_kernels, "are_prebuilt_for_gpus", lambda: False)
    session = object.__new__(running.Session)
    session.keeps, session.bodies = False, SimpleNamespace(show=lambda: None)
    session.device, session.run, session._shown = "cpu", SimpleNamespace(progress=None, seconds=0.5), ""
    monkeypatch.setattr(running, "_set_status", lambda _text: None)
    monkeypatch.setattr(running, "redraw_sidebars", lambda: None)
    assert session.text == "Preparing"
    session.run.seconds = 9.0
    assert session.text == "Compiling (first run only)"
    monkeypatch.setattr(prebuilt_kernels, "are_prebuilt", lambda: True)
    assert session.text == "Preparing", "the extension's zip has what the processor needs"
    session.device = "cuda:0"
    assert session.text == "Compiling (first run only)"
    monkeypatch.setattr(prebuilt_gpu_kernels, "are_prebuilt_for_gpus", lambda: True)
    assert session.text == "Preparing", "and what a GPU needs"
    monkeypatch.setattr(prebuilt_gpu_kernels, "are_prebuilt_for_gpus", lambda: False)
    session.run.progress = SimpleNamespace(step=1, steps=5)
    session.show()
    assert session.text == "Step 1 of 5"
    session.run.progress = SimpleNamespace(step=5, steps=5)
    assert session.text == "Finishing", "what follows the last step may take long"
    session.run.progress = None
    assert session.text == "Preparing", "it did so in this process"


def test_a_screen_that_is_slow_to_draw_leaves_time_for_the_rest(monkeypatch):
    clock, drawn = [100.0], []
    monkeypatch.setattr(running.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(running, "_set_status", lambda _text: None)
    monkeypatch.setattr(running, "redraw_sidebars", lambda: None)

    def drawings_in_ten_seconds(seconds):
        """Whoever asks for a drawing is not called again before it is done."""
        session = object.__new__(running.Session)
        session.keeps, session.device, session._shown = False, "cpu", ""
        session.bodies = SimpleNamespace(show=lambda: drawn.append(clock[0]) or True)
        session.run = SimpleNamespace(progress=SimpleNamespace(step=1, steps=5))
        drawn.clear()
        end = clock[0] + 10.0
        while clock[0] < end:
            before = len(drawn)
            session.show()
            clock[0] += 0.05 + (seconds if len(drawn) > before else 0.0)
        return len(drawn)

    assert drawings_in_ten_seconds(0.001) > 150
    kept = object.__new__(running.Session)
    kept.keeps, kept.device, kept._shown = True, "cpu", ""
    kept.bodies = SimpleNamespace(show=lambda: drawn.append(-1.0) or True)
    kept.run = SimpleNamespace(progress=SimpleNamespace(step=1, steps=5))
    kept.show()
    assert kept._shown == "Keeping what is there" and -1.0 not in drawn, "nothing that is kept moves"
    assert 10 <= drawings_in_ten_seconds(0.25) <= 15, "about a third of the time"
