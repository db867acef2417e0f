"""Batches on a Ray cluster: the same bytes, also when a machine is lost on the way."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time

import pytest
from esh import EshError
from esh.engine.scenes.batch import Batch, run_batch
from esh.engine.scenes.ray_pool import RayPool

from .test_batch import SET, contents, make, recipe  # noqa: F401 - a fixture

pytest.importorskip("ray")


def test_a_machine_that_is_lost_loses_no_scene(cluster, recipe, tmp_path):  # noqa: F811
    lost = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    make(recipe, tmp_path / "here", range(16))

    removed = []

    def lose(state):
        if state.made == 4 and not removed:
            removed.append(threading.Thread(target=cluster.remove_node, args=(lost, False)))
            removed[0].start()

    state = run_batch(
        Batch(recipe, tmp_path / "there", range(16), SET, max_steps=5),
        device="cpu",
        ray=cluster.address,
        progress=lose,
    )
    removed[0].join()
    assert (state.done, state.made, dict(state.failed)) == (16, 16, {})
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_processes_that_ask_for_gpus_stay_for_other_calls(cluster):
    cluster.add_node(num_cpus=2, num_gpus=2)  # Ray is told so; there need be none
    cluster.wait_for_nodes()
    answers = [answer for _, answer in RayPool(cluster.address, gpus=1.0).map(os.getpid, [()] * 12)]
    assert len(answers) == 12
    # Now and then one more is started than can work at once.
    assert len(set(answers)) <= 4


def test_no_cluster_is_one_sentence():
    start = time.monotonic()
    with pytest.raises(EshError, match="there is no Ray cluster at 'auto'"):
        RayPool("auto")
    assert time.monotonic() - start < 60.0


@pytest.mark.slow
def test_an_address_at_which_nobody_answers_is_told_after_one_attempt():
    """Ray alone tries for more than five minutes. In a process of its own, since it reads how often once."""
    program = "from esh.engine.scenes.ray_pool import RayPool; RayPool('127.0.0.1:1')"
    outcome = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=150, check=False)
    said = outcome.stderr.strip().splitlines()[-1]
    assert re.search(r"there is no Ray cluster at '127\.0\.0\.1:1': .*; .* a token needs RAY_AUTH_MODE=token$", said)
