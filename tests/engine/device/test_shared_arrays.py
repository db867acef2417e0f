"""Arrays that stay for the next launcher."""

import numpy as np
import pytest
from esh.engine.device import launcher as module
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher


@pytest.fixture(autouse=True)
def nothing_shared(monkeypatch):
    monkeypatch.setattr(module, "_shared", {})


def shared_by_a_new_launcher(key, size, made):
    launcher = Launcher(resolve_device("cpu"))

    def make():
        made.append(key)
        return launcher.own_array(np.full(size, len(made), np.float32), float)

    result = launcher.shared((key,), make)
    launcher.close()
    return result


def test_a_small_array_is_made_once_for_all_launchers():
    made = []
    first, second = (shared_by_a_new_launcher("a", 100, made) for _ in range(2))
    assert first is second
    assert made == ["a"]
    np.testing.assert_array_equal(second.numpy(), 1.0)


def test_a_large_one_goes_with_its_launcher():
    made = []
    count = module.LARGEST_SHARED // 4 + 1
    assert shared_by_a_new_launcher("a", count, made) is not shared_by_a_new_launcher("a", count, made)
    assert made == ["a", "a"]


def test_what_was_not_used_for_longest_goes():
    made = []
    for key in range(module.MOST_SHARED):
        shared_by_a_new_launcher(key, 1, made)
    shared_by_a_new_launcher(0, 1, made)
    shared_by_a_new_launcher("new", 1, made)
    assert len(module._shared) == module.MOST_SHARED
    shared_by_a_new_launcher(0, 1, made)
    assert made.count(0) == 1
    shared_by_a_new_launcher(1, 1, made)
    assert made.count(1) == 2


def test_things_of_one_kind_do_not_drive_out_others():
    launcher = Launcher(resolve_device("cpu"))
    first = launcher.kept(("one", 0), object)
    for number in range(2 * module.MOST_KEPT):
        launcher.kept(("another", number), object)
    assert launcher.kept(("one", 0), object) is first
    last = launcher.kept(("another", number), object)
    assert launcher.kept(("another", 0), object) is not last
    launcher.kept(("one", 1), object, 1)
    assert launcher.kept(("one", 0), object, 1) is not first
    launcher.close()
