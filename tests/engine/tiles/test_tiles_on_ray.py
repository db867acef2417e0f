"""Tiles on a Ray cluster: the same bytes, also when a machine is lost on the way."""

from __future__ import annotations

import threading

import esh
import pytest

from .test_tiles import contents, recipe, solved  # noqa: F401 - a fixture

pytest.importorskip("ray")


def test_a_machine_that_is_lost_loses_no_tile(cluster, recipe, tmp_path):  # noqa: F811
    lost = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    solved(recipe, tmp_path / "here")
    removed: list[threading.Thread] = []

    def lose(state: esh.TileState) -> None:
        if state.name == "pass-1" and state.done == 2 and not removed:
            removed.append(threading.Thread(target=cluster.remove_node, args=(lost, False)))
            removed[0].start()

    solved(recipe, tmp_path / "there", ray=cluster.address, progress=lose)
    removed[0].join()
    assert contents(tmp_path / "there") == contents(tmp_path / "here")
