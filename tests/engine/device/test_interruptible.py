"""What nobody wants any more ends before its next launch, and the launcher goes on with what is wanted."""

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher


class UnwantedError(Exception):
    pass


@wp.kernel
def add_one(first: int, values: wp.array(dtype=float)):
    i = first + wp.tid()
    values[i] = values[i] + 1.0


@pytest.fixture
def launcher():
    launcher = Launcher(resolve_device("cpu"))
    yield launcher
    launcher.close()


def test_a_block_ends_before_the_next_launch_and_others_are_not_asked(launcher):
    values, asked = launcher.zeros(5000, float), []

    def ask():
        asked.append(1)
        if len(asked) > 3:
            raise UnwantedError

    recording = launcher.record(lambda: launcher.launch(add_one, 5000, [], [values]))
    with pytest.raises(UnwantedError), launcher.interruptible(ask):
        launcher.launch(add_one, 5000, [], [values])
        recording.play(2)
        launcher.ask()
        launcher.launch(add_one, 5000, [], [values])
    assert np.array_equal(values.numpy(), np.full(5000, 3.0)) and len(asked) == 4
    recording.play()
    launcher.launch(add_one, 5000, [], [values])
    assert np.array_equal(values.numpy(), np.full(5000, 5.0)) and len(asked) == 4
