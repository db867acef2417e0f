"""Influence functions of several blurs are made together, and those that are there are taken again."""

from contextlib import closing

import numpy as np
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.influence import convolution_of, rest_influences
from esh.engine.space.mesh_layout import open_mesh
from esh.engine.space.space import Space

CUTOFF = 3.0
VARIANCES = [0.3, 0.5, 0.3, 0.9]


def made(launcher, variances):
    layout = open_mesh(Space((40.0, 30.0)), 0.5, on_gpu=False, kernel_reach=4.0)
    return rest_influences(convolution_of(launcher, layout, 1), layout, variances, CUTOFF)


def test_one_launch_makes_all_that_are_not_there_yet():
    device = resolve_device("cpu")
    with closing(Launcher(device)) as launcher, closing(Launcher(device)) as other:
        before = launcher.python_launches
        together = made(launcher, VARIANCES)
        assert launcher.python_launches == before + 1
        assert together[0] is together[2]
        again = made(launcher, [0.9, 0.5])
        assert launcher.python_launches == before + 1
        assert again == [together[3], together[1]]
        alone = [made(other, [variance + 1e-9])[0].numpy() for variance in VARIANCES]
        for one, many in zip(alone, together, strict=True):
            np.testing.assert_allclose(one, many.numpy(), rtol=1e-5, atol=1e-7 * np.abs(one).max())
