"""A solve in a thread: progress comes out, a stop goes in, errors are kept for the main thread."""

import threading

from esh.esh_scatter.solving.background_run import BackgroundRun


def test_progress_and_the_end_are_seen_from_outside():
    said, may_end = threading.Event(), threading.Event()

    def solve(progress):
        assert progress("half way") is True
        said.set()
        assert may_end.wait(30)

    run = BackgroundRun(solve)
    assert said.wait(30)
    assert run.running and run.progress == "half way"
    may_end.set()
    run.join(30)
    assert not run.running and run.error is None and not run.stopped


def test_a_stop_reaches_the_solver_at_its_next_step():
    asked = threading.Event()

    def solve(progress):
        while progress("a step"):
            asked.set()

    run = BackgroundRun(solve)
    assert asked.wait(30)
    run.stop()
    run.join(30)
    assert not run.running and run.stopped and run.error is None


def test_what_is_abandoned_ends_at_its_next_step_without_an_answer():
    asked, answered = threading.Event(), []

    def solve(progress):
        while progress("a step"):
            asked.set()
        answered.append(1)

    run = BackgroundRun(solve)
    assert asked.wait(30)
    run.abandon()
    run.join(30)
    assert not run.running and run.stopped and run.error is None and not answered


def test_what_is_abandoned_ends_where_it_asks():
    asked, runs = threading.Event(), []

    def solve(_progress):
        while not runs:
            pass
        while True:
            runs[0].ask()
            asked.set()

    run = BackgroundRun(solve)
    runs.append(run)
    assert asked.wait(30)
    run.stop()
    run.join(0.05)
    assert run.running, "what is kept is worked out to the end"
    run.abandon()
    run.join(30)
    assert not run.running and run.error is None


def test_an_error_is_kept_and_not_printed(capfd):
    def solve(_progress):
        raise ValueError("no such thing")

    run = BackgroundRun(solve)
    run.join(30)
    assert isinstance(run.error, ValueError)
    assert capfd.readouterr().err == ""
