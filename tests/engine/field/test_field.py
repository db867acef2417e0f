"""The fast field against the direct float64 sum, in units of the local force scale."""

import itertools

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.blur import (
    BLUR_OVER_SPACING,
    CORE,
    CORE_REACH,
    CORE_REACH_OF_UNIFORM,
    CORE_REACH_OF_WIDEST,
    EXPONENT,
    LEAST_OF_SMALL,
    USUAL_REGULARITY,
    WIDEST,
    BlurSettings,
    blur_over_spacing,
    core,
)
from esh.engine.field.direct_sum import direct_field
from esh.engine.field.field import Field
from esh.engine.field.field_targets import FieldTarget
from esh.engine.space.space import Space

SQUARE = (32.0, 32.0)


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("auto"))
    yield result
    result.close()


def random_points(rng, size, n):
    return rng.random((n, 2)) * size


def relaxed_points(rng, size, n):
    columns = round(np.sqrt(n * size[0] / size[1]))
    rows = n // columns
    lattice = np.stack(np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows), axis=-1)
    return np.clip(
        lattice.reshape(-1, 2) * size + rng.normal(0.0, 0.1, (rows * columns, 2)), 0.0, np.array(size) * 0.9999
    )


def fast_and_direct(launcher, variances_of, position, size, periodic, groups, image, chosen=None, **options):
    rng = np.random.default_rng(5)
    position = position.astype(np.float32).astype(np.float64)
    n = len(position)
    group = rng.integers(0, groups, n)
    # The mean charge is 1, the engine's unit.
    charge = np.array([0.5, 1.5, 1.0])[group % 3] if groups > 1 else np.ones(n)
    charge = charge / charge.mean()
    interaction = 0.5 + 0.5 * np.eye(groups)
    targets = [FieldTarget(image, charge[group == g].sum()) for g in range(groups)]
    arguments = {
        "space": Space(size, periodic),
        "interaction": interaction,
        "targets": targets,
        "charge": charge,
        "charge_group": group,
    }
    field = Field(launcher, spacing=1.0, **arguments, **options)
    at = wp.array(position.astype(np.float32), dtype=wp.vec2, device=launcher.device)
    result = wp.zeros_like(at)
    field.evaluate(at, result)
    share = np.clip(charge, LEAST_OF_SMALL, 1.0)
    of_place = variances_of(field)

    of_target = (charge * share).sum() / charge.sum()

    def variance(at):
        return of_place(at) * (share if at is position else of_target)

    # The narrowest that acts between a charge and a target; it sets how fine the reference's grid is.
    narrowest = field.blur.variance.numpy().min() * (share.min() + of_target)

    chosen = np.arange(n) if chosen is None else chosen
    return result.numpy()[chosen], direct_field(
        position,
        blur=narrowest**0.5,
        variance=variance,
        core=(field.core, field.core_end),
        chosen=chosen,
        **arguments,
    )


SIZES = {"square": (28.0, 28.0), "wide": (56.0, 14.0), "tall": (14.0, 56.0)}
POINTS = {"random": random_points, "relaxed": relaxed_points}
KINDS = [
    *itertools.product((1, 3), POINTS, SIZES, ("open", "periodic")),
    # Many groups are no other code, and the sum over all images takes its time for each of them.
    *((9, "random", "square", "open"), (9, "random", "tall", "open"), (9, "relaxed", "wide", "periodic")),
]


@pytest.mark.parametrize(("groups", "points", "size", "boundary"), KINDS)
def test_forces_agree_with_the_direct_sum(launcher, variances_of, groups, points, size, boundary):
    image = np.ones((1, 1)) if groups == 1 else np.random.default_rng(1).random((5, 7)) + 0.2
    position = POINTS[points](np.random.default_rng(2), SIZES[size], 784)
    # On a sample of them, in all places.
    chosen = np.random.default_rng(3).choice(len(position), 60, replace=False)
    fast, direct = fast_and_direct(
        launcher, variances_of, position, SIZES[size], boundary == "periodic", groups, image, chosen
    )
    error = np.sqrt(((fast - direct) ** 2).sum(axis=1).mean())
    # Where the blur differs from place to place, a pair's is not quite the sum of both, and targets know a few levels of it only.
    assert error < (3e-3 if groups == 1 else 6e-3)
    # The comparison means something: the forces themselves are far larger.
    assert np.sqrt((direct**2).sum(axis=1).mean()) > 0.3


def test_equal_densities_of_several_classes_are_worked_on_once(launcher):
    rng = np.random.default_rng(6)
    image, other = rng.random((5, 7)) + 0.2, rng.random((5, 7)) + 0.2

    def potentials(images):
        n = 90
        targets = [FieldTarget(image, 30.0, class_index=c) for c, image in enumerate(images)]
        field = Field(
            launcher,
            space=Space(SQUARE, False),
            interaction=0.5 + 0.5 * np.eye(3),
            targets=targets,
            spacing=1.0,
            charge=np.ones(n),
            charge_group=np.arange(n) % 3,
            family=np.arange(3),
        )
        result = wp.zeros(n, dtype=wp.vec2, device=launcher.device)
        position = np.random.default_rng(7).random((n, 2)) * SQUARE
        field.evaluate(wp.array(position.astype(np.float32), dtype=wp.vec2, device=launcher.device), result)
        correction = field._correction
        return len(correction.potential) // (field.fine_layout.node_count * len(field.blur.levels)), result.numpy()

    rows, _ = potentials([image, image + 1e-9, other])
    assert rows == 3
    one, forces = potentials([image, image.copy(), image.copy()])
    assert one == 1
    two, of_two = potentials([image, image.copy(), other])
    assert two == 2
    # What the classes see is their own image, not only the first.
    assert not np.allclose(forces, of_two)


@pytest.mark.parametrize("width", [0.4, 0.8])
def test_charges_and_targets_are_blurred_as_wide_as_is_asked(launcher, variances_of, width):
    """Near pairs, which the blur is about: random points have many."""
    fast, direct = fast_and_direct(
        launcher,
        variances_of,
        random_points(np.random.default_rng(6), SQUARE, 1024),
        SQUARE,
        False,
        1,
        np.ones((1, 1)),
        blur_settings=BlurSettings(over_spacing=width),
    )
    assert np.sqrt(((fast - direct) ** 2).sum(axis=1).mean()) < 4e-3


def test_blur_follows_the_local_spacing(launcher, variances_of):
    """Half of the domain is three times as dense as the other: there the blur is narrower, by the square root of its variance."""
    image = np.array([[3.0, 1.0]])
    targets = [FieldTarget(image, 1024.0)]
    field = Field(
        launcher, space=Space(SQUARE), interaction=np.eye(1), targets=targets, spacing=0.9, charge=np.ones(1024),
        charge_group=np.zeros(1024, np.int32),
    )  # fmt: skip
    dense, thin = variances_of(field)(np.array([[4.0, 16.0], [28.0, 16.0]]))
    # Densities of 1.5 and 0.5, where 1 / 0.9² is usual.
    usual = 0.5 * (BLUR_OVER_SPACING * 0.9) ** 2
    assert dense == pytest.approx(usual * (1.5 * 0.81) ** -EXPONENT, rel=0.02)
    assert thin == pytest.approx(usual * min(WIDEST, (0.5 * 0.81) ** -EXPONENT), rel=0.02)
    # Half way between them, near the border as well as inside, it is in between.
    for y in (0.1, 16.0):
        assert dense < variances_of(field)(np.array([[16.0, y]]))[0] < thin


def test_two_families_see_each_other_less_blurred(launcher, variances_of):
    """Two charges close to each other, far from any target: their force is (1 - exp(-q) + their core) / r, where q = r² / 2 B²."""
    distance = 0.4
    position = np.array([[10.0, 10.0], [10.0 + distance, 10.0]], np.float32)
    arguments = {
        "space": Space(SQUARE),
        "interaction": np.ones((2, 2)),
        "spacing": 1.0,
        "charge": np.ones(2),
    }
    image = np.zeros((32, 32))
    image[0, 31] = 1.0
    for family, sharper in (([0, 0], 1.0), ([0, 1], 4.0)):
        field = Field(
            launcher,
            **arguments,
            targets=[FieldTarget(image, 1e-6)] * 2,
            charge_group=np.array([0, 1]),
            family=np.array(family),
            blur_settings=BlurSettings(sharper=4.0),
        )
        at = wp.array(position, dtype=wp.vec2, device=launcher.device)
        result = wp.zeros_like(at)
        field.evaluate(at, result)
        variance = 2.0 * variances_of(field)(position.astype(float))[0] / sharper
        q = 0.5 * distance**2 / variance
        expected = (CORE * max(1.0 - q / field.core_end, 0.0) ** 2 - np.expm1(-q)) / distance
        assert result.numpy()[:, 0] == pytest.approx([-expected, expected], rel=5e-3)


@pytest.mark.parametrize("distance", [1e-3, 0.1, 2.5])
def test_close_pairs_are_pushed_apart_and_others_hardly(launcher, distance):
    """Blurred charges have no force at no distance; the core has, and ends at a spacing."""
    image = np.zeros((32, 32))
    image[0, 31] = 1.0
    field = Field(
        launcher, space=Space(SQUARE), interaction=np.eye(1), targets=[FieldTarget(image, 1e-6)], spacing=1.0,
        charge=np.ones(2), charge_group=np.zeros(2, np.int32),
    )  # fmt: skip
    at = wp.array(np.array([[10.0, 10.0], [10.0 + distance, 10.0]], np.float32), dtype=wp.vec2, device=launcher.device)
    result = wp.zeros_like(at)
    field.evaluate(at, result)
    if distance < 1.0:
        assert result.numpy()[1, 0] > 0.8 * CORE / distance
    else:
        assert result.numpy()[1, 0] == pytest.approx(1.0 / distance, rel=0.02)


@pytest.mark.parametrize(("uniform", "reach"), [(False, CORE_REACH), (True, CORE_REACH_OF_UNIFORM)])
def test_a_core_ends_at_a_spacing_and_earlier_where_the_blur_is_wide(uniform, reach):
    usual, widest = (blur_over_spacing(regularity, uniform) for regularity in (USUAL_REGULARITY, 0.0))
    for width, expected in ((usual, reach), (widest, CORE_REACH_OF_WIDEST), (0.6 * usual, reach)):
        strength, end = core(width, uniform)
        assert (2.0 * end) ** 0.5 * width == pytest.approx(expected)
        assert strength == pytest.approx(CORE if width >= usual else 0.6**4 * CORE)
    # What is all but a point has next to none.
    assert core(0.03, uniform)[0] < 1e-4


def test_direct_sum_of_two_charges_is_coulombs_law():
    """Repulsion along the line between them, 1/r; a target of no strength does not act."""
    position = np.array([[1.0, 2.0], [4.0, 6.0]])
    field = direct_field(
        position,
        space=Space((8.0, 8.0)),
        interaction=np.eye(1),
        targets=[FieldTarget(np.ones((1, 1)), 0.0)],
        charge=np.array([2.0, 3.0]),
        charge_group=np.zeros(2, dtype=int),
        blur=0.1,
    )
    np.testing.assert_allclose(field[0], -3.0 * np.array([3.0, 4.0]) / 25.0, rtol=1e-12)
    np.testing.assert_allclose(field[1], 2.0 * np.array([3.0, 4.0]) / 25.0, rtol=1e-12)


def test_periodic_field_does_not_change_when_everything_is_shifted(launcher):
    def forces(position):
        field = Field(
            launcher, space=Space(SQUARE, periodic=True), interaction=np.eye(1), spacing=1.0, charge=np.ones(500),
            targets=[FieldTarget(np.ones((1, 1)), 500.0)], charge_group=np.zeros(500, np.int32),
        )  # fmt: skip
        at = wp.array(position.astype(np.float32), dtype=wp.vec2, device=launcher.device)
        result = wp.zeros_like(at)
        field.evaluate(at, result)
        return result.numpy()

    position = np.random.default_rng(3).random((500, 2)) * SQUARE
    first, moved = forces(position), forces((position + [7.3, 21.9]) % 32.0)
    assert np.sqrt(((first - moved) ** 2).sum(axis=1).mean()) < 5e-3
    assert np.sqrt((first**2).sum(axis=1).mean()) > 0.3


def test_forces_are_minus_the_gradient_of_the_energy():
    """Numerically, of the energy that the module's docstring states, for two groups of unequal charge."""
    rng = np.random.default_rng(4)
    n, size, charge, group = 12, (4.0, 3.0), rng.random(12) + 0.5, np.arange(12) % 2
    interaction = np.array([[1.0, 0.4], [0.4, 2.0]])
    position = rng.random((n, 2)) * size
    blur = 0.3
    targets = [FieldTarget(np.ones((1, 1)), charge[group == g].sum()) for g in range(2)]
    columns, rows = 27, 20
    x, y = (np.arange(columns) + 0.5) / columns * size[0], (np.arange(rows) + 0.5) / rows * size[1]
    nodes = np.stack([np.tile(x, rows), np.repeat(y, columns)], axis=1)
    width2 = blur**2 + size[0] * size[1] / (columns * rows) / 12.0

    def smooth_potential(r2, variance):
        # -log r blurred by a Gaussian: integral of -(1 - exp(-r²/2w²)) / r, by quadrature.
        r = np.sqrt(r2)
        t = np.linspace(0.0, 1.0, 4001)[1:] * r[..., None]
        return -(-np.expm1(-(t**2) / (2.0 * width2)) / t).mean(axis=-1) * r

    def energy(p):
        total = 0.0
        for i, j in itertools.combinations(range(n), 2):
            strength = interaction[group[i], group[j]] * charge[i] * charge[j]
            total += strength * smooth_potential(((p[i] - p[j]) ** 2).sum(), blur**2)
        for i in range(n):
            pull = sum(interaction[group[i], g] * targets[g].charge for g in range(2)) / len(nodes)
            total -= charge[i] * pull * smooth_potential(((p[i] - nodes) ** 2).sum(axis=1), width2).sum()
        return total

    field = direct_field(
        position,
        space=Space(size),
        interaction=interaction,
        targets=targets,
        charge=charge,
        charge_group=group,
        blur=blur,
    )
    assert int(np.ceil(2.0 * size[0] / blur)) == columns
    for body, axis in ((0, 0), (5, 1)):
        step = np.zeros_like(position)
        step[body, axis] = 1e-4
        slope = (energy(position + step) - energy(position - step)) / 2e-4
        assert -slope == pytest.approx(charge[body] * field[body, axis], rel=2e-3, abs=2e-3)


def test_what_fades_is_blurred_as_if_it_did_not(launcher):
    """A window's charges and targets fade towards its cuts; that makes neither small bodies nor thin places of them."""
    rng = np.random.default_rng(3)
    position = random_points(rng, SQUARE, 900).astype(np.float32)
    fades = np.clip(position[:, 0] / 8.0, 1e-3, 1.0)
    ramp = np.clip((np.arange(64) + 0.5) / 16.0, 1e-3, 1.0)[None, :].astype(np.float32)

    def field_of(image, charge, **more):
        arguments = {
            "space": Space(SQUARE),
            "interaction": np.ones((1, 1)),
            "targets": [FieldTarget(image * more.pop("ramp", 1.0), charge.sum(), whole=more.pop("whole", None))],
            "spacing": np.sqrt(32.0 * 32.0 / 900),
            "charge": charge,
            "charge_group": np.zeros(900, np.int32),
        }
        field = Field(launcher, **arguments, **more)
        result = wp.zeros(900, dtype=wp.vec2, device=launcher.device)
        field.evaluate(wp.array(position, dtype=wp.vec2, device=launcher.device), result)
        order = field._sorted.order.numpy()[:900]
        variance = np.empty(900)
        variance[order] = field._blurred.variance.numpy()[:900]
        return field, variance

    even = np.ones((1, 64), np.float32)
    uneven = np.linspace(0.05, 1.0, 64, dtype=np.float32)[None, :]
    for image in (even, uneven):
        plain, expected = field_of(image, np.ones(900))
        faded, found = field_of(image, fades, ramp=ramp, whole=image, whole_charge=np.ones(900))
        assert len(faded.blur.levels) == len(plain.blur.levels)
        assert np.allclose(found, expected, rtol=1e-5)
    # Without being told, the blur takes faded charges for small ones.
    _, taken_for_small = field_of(even, fades, ramp=ramp)
    assert taken_for_small.min() < 0.5 * field_of(even, np.ones(900))[1].min()
