"""Borders that are mirrors: the field is that of the charges and all their images."""

import numpy as np
import pytest
import warp as wp
from esh import BodyClass, Domain, Problem, Size, solve
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.blur import LEAST_OF_SMALL
from esh.engine.field.direct_sum import direct_field
from esh.engine.field.field_targets import FieldTarget
from esh.engine.field.mirrored_field import MirroredField, mirror
from esh.engine.space.space import Space

SIZE = (24.0, 16.0)


def test_an_image_meets_its_images_at_the_borders():
    image = np.array([[1, 2, 3], [4, 5, 6]])
    expected = [[4, 5, 6, 6, 5, 4], [1, 2, 3, 3, 2, 1], [1, 2, 3, 3, 2, 1], [4, 5, 6, 6, 5, 4]]
    assert mirror(image).tolist() == expected


@pytest.fixture(scope="module")
def forces(variances_of):
    """Of a few hundred charges of two groups, some near the borders: fast, and by a direct sum over all images."""
    launcher = Launcher(resolve_device("cpu"))
    rng = np.random.default_rng(0)
    position = rng.random((192, 2)) * SIZE
    position = np.clip(position, 0.02, np.array(SIZE) - 0.02)
    position[:3] = [[0.02, 5.0], [23.97, 15.9], [3.0, 15.95]]
    group = np.arange(192) % 2
    charge = np.where(group == 0, 0.5, 1.5)
    images = [np.random.default_rng(1).random((5, 7)) + 0.2, np.ones((1, 1))]
    total = [charge[group == g].sum() for g in range(2)]
    interaction = np.array([[1.0, 0.5], [0.5, 1.0]])
    field = MirroredField(
        launcher,
        space=Space(SIZE),
        interaction=interaction,
        targets=[FieldTarget(image, q) for image, q in zip(images, total, strict=True)],
        spacing=1.0,
        charge=charge,
        charge_group=group,
    )
    at = wp.array(position.astype(np.float32), dtype=wp.vec2, device="cpu")
    found = wp.zeros_like(at)
    field.evaluate(at, found)
    x, y = position.T
    everywhere = np.concatenate([np.stack(p, axis=1) for p in ((x, y), (48 - x, y), (x, 32 - y), (48 - x, 32 - y))])
    of_place = variances_of(field.field)
    share = np.clip(charge, LEAST_OF_SMALL, 1.0)
    of_target = (charge * share).sum() / charge.sum()
    direct = direct_field(
        np.mod(everywhere, [48.0, 32.0]),
        space=Space((48.0, 32.0), periodic=True),
        interaction=interaction,
        targets=[FieldTarget(mirror(image), 4 * q) for image, q in zip(images, total, strict=True)],
        charge=np.tile(charge, 4),
        charge_group=np.tile(group, 4),
        blur=(field.field.blur.variance.numpy().min() * (share.min() + of_target)) ** 0.5,
        variance=lambda at: of_place(at) * (np.tile(share, 4) if len(at) == 4 * len(charge) else of_target),
        core=(field.field.core, field.field.core_end),
    )
    launcher.close()
    return position, found.numpy(), direct[:192]


def test_forces_agree_with_the_direct_sum_over_all_images(forces):
    _, found, direct = forces
    error = np.sqrt(((found - direct) ** 2).sum(axis=1).mean())
    # As for a domain without mirrors where the blur differs from place to place.
    assert error < 6e-3
    assert np.sqrt((direct**2).sum(axis=1).mean()) > 0.3


def test_a_charge_on_a_mirror_is_pushed_off_it():
    launcher = Launcher(resolve_device("cpu"))
    at = wp.array(np.array([[0.0, 8.0], [24.0, 8.0], [12.0, 16.0], [12.0, 0.0]]), dtype=wp.vec2, device="cpu")
    field = MirroredField(
        launcher,
        space=Space(SIZE),
        interaction=np.eye(1),
        targets=[FieldTarget(np.ones((1, 1)), 4.0)],
        spacing=1.0,
        charge=np.ones(4),
        charge_group=np.zeros(4, int),
    )
    found = wp.zeros_like(at)
    field.evaluate(at, found)
    force = found.numpy()
    launcher.close()
    assert force[0, 0] > 10.0
    assert force[1, 0] < -10.0
    assert force[2, 1] < -10.0
    assert force[3, 1] > 10.0


def near_border(boundary):
    """Number density within half a spacing and two of the border, over the mean one."""
    n = 1600
    problem = Problem(Domain((40.0, 40.0), boundary), [BodyClass("k", [Size("a", 0.3, n)])], seed=2)
    placement = solve(problem, device="cpu", max_steps=80)
    away = np.minimum(placement.position, 40.0 - placement.position).min(axis=1)
    assert away.min() >= 0.0
    assert len(placement.position) == n
    return [(away < width).sum() / (1600.0 - (40.0 - 2 * width) ** 2) for width in (0.5, 2.0)]


def test_bodies_neither_crowd_along_a_mirror_nor_shun_it():
    at_edge, behind = near_border("open")
    assert at_edge > 1.5
    assert behind < 0.95
    at_edge, behind = near_border("mirror")
    # The row of bodies next to a border stands where the count's width ends.
    assert at_edge < 1.6
    assert behind == pytest.approx(1.0, abs=0.05)
