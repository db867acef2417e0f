"""Clumps of a class."""

import time

import numpy as np
import pytest
from esh import BodyClass, Domain, Obstacle, Problem, ProblemError, Size, Solver, Surface, SurfaceMesh, solve
from esh.engine.problem.note import NoteKind, kind_of
from esh.engine.problem.wave_filter import filter_waves
from esh.engine.quality.coverage import coverage_error
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

SQUARE = Domain((40.0, 40.0), "periodic")
UNIFORM = np.ones((1, 1))


def problem_of(clustering, clump_size=0.0, density=1.0, count=1500, domain=SQUARE, **more):
    size = Size("s", 0.02, count)
    return Problem(domain, [BodyClass("a", [size], density, clustering=clustering, clump_size=clump_size)], **more)


def density_of(problem):
    return problem.classes[0].density_image.astype(np.float64)


@pytest.mark.parametrize("domain", [SQUARE, Domain((40.0, 40.0)), Domain((60.0, 20.0), "mirror")])
@pytest.mark.parametrize("density", [1.0, np.linspace(0.2, 1.0, 7)[None, :]])
def test_a_density_is_the_same_at_large_and_in_clumps_of_the_size_that_was_asked(domain, density):
    means, at_large = [], []
    for seed in range(4):
        image = density_of(problem_of(1.0, 4.0, density, domain=domain, seed=seed))
        rows, columns = image.shape
        smooth = image / np.resize(np.repeat(np.ravel(density), columns // np.size(density)), columns)[None, :]
        if not domain.periodic:
            # What does not wrap goes on as in mirrors.
            smooth = np.concatenate([smooth, smooth[::-1]])
            smooth = np.concatenate([smooth, smooth[:, ::-1]], axis=1)
        power = np.abs(np.fft.rfft2(smooth - smooth.mean())) ** 2
        across = np.fft.rfftfreq(smooth.shape[1], domain.size[0] / columns)
        up = np.fft.fftfreq(smooth.shape[0], domain.size[1] / rows)
        wave = np.hypot(up[:, None], across[None, :])
        # Two clumps are 8 m apart.
        at_large.append(power[wave < 0.55 / 8.0].sum() / power.sum())
        near = (wave > 0.7 / 8.0) & (wave < 1.4 / 8.0)
        assert power[near].sum() > 0.5 * power.sum()
        assert smooth.min() > 0.0 and smooth.max() > 3.0
        means.append(smooth.mean())
    # Where the density is uneven, longer waves make up for what clumps and density beat.
    assert np.mean(at_large) < (2e-3 if np.size(density) == 1 else 1e-2)
    assert np.mean(means) == pytest.approx(1.0, abs=0.01 if np.size(density) == 1 else 0.03)


@pytest.mark.parametrize("domain", [SQUARE, Domain((40.0, 40.0)), Domain((60.0, 20.0), "mirror")])
def test_a_few_bodies_more_or_less_leave_clumps_where_they_are(domain):
    """The size that clumps have by default follows from the count. Noise that was drawn for a grid of it was another at every step."""
    fewer = density_of(problem_of(1.0, count=1500, domain=domain))
    for count, least in ((1501, 0.97), (1510, 0.97), (1650, 0.9), (2200, 0.4)):
        more = density_of(problem_of(1.0, count=count, domain=domain))
        rows, columns = (
            (np.arange(many) * 2 + 1) * own // (2 * many) for own, many in zip(more.shape, fewer.shape, strict=True)
        )
        assert np.corrcoef(fewer.ravel(), more[np.ix_(rows, columns)].ravel())[0, 1] > least


def blurred(image, width, domain):
    """An image, blurred by so many pixels; nothing is beyond its edges, unless they are joined."""
    return gaussian_filter(image, width, mode="wrap" if domain.periodic else "constant", truncate=6.0)


@pytest.mark.parametrize("domain", [SQUARE, Domain((40.0, 40.0)), Domain((40.0, 40.0), "mirror")])
@pytest.mark.parametrize("shape", ["even", "steps", "lake", "lake of many pixels"])
def test_blurred_over_clumps_a_density_is_the_one_that_was_asked_for(domain, shape):
    """At edges of the domain and of the density, too: without that, these were off by two hundredths of the mean.

    Where what lacks along edges is made up for by a Gaussian alone, they are off by a thousandth.
    """
    # Where there are many for a clump, blocks of them are compared.
    many = 420 if "pixels" in shape else 40
    row, column = (np.indices((many, many)) + 0.5) / many - 0.5
    asked = {
        "even": np.ones((many, many)),
        "steps": np.where((row + 0.7 * column) % 0.4 < 0.2, 1.0, 0.15),
        "lake": (np.hypot(row, column) > 0.25).astype(float),
    }[shape.removesuffix(" of many pixels")]
    deviations = []
    for seed in range(4):
        image = density_of(problem_of(1.0, 2.5, asked, domain=domain, seed=seed))
        times = image.shape[0] // many
        fine = np.kron(asked, np.ones((times, times)))
        # A wavelength is 5 m.
        off = blurred(image / image.mean() - fine / fine.mean(), 0.8 * 5.0 / 40.0 * len(image), domain)
        assert np.sqrt((off**2).mean()) < 8e-4
        assert ((image > 0.0) == (fine > 0.0)).all()
        factor = (image / np.maximum(fine, 1e-9))[fine > 0.0]
        deviations.append(factor.std() / factor.mean())
    assert np.mean(deviations) > 0.9


def test_bodies_stand_in_clumps_and_the_density_at_large_is_kept():
    placements = {strength: solve(problem_of(strength), device="cpu") for strength in (0.0, 0.5, 1.0)}
    errors = {
        k: [coverage_error(p.position, p.area, UNIFORM, SQUARE, k) for p in placements.values()] for k in (1.0, 4.0)
    }
    assert errors[1.0][1] > 50 * errors[1.0][0] and errors[1.0][2] > 1.3 * errors[1.0][1]
    assert errors[4.0][1] < 2.0 * max(errors[4.0][0], 4e-5)
    nearest = [cKDTree(p.position, boxsize=40.0).query(p.position, 2)[0][:, 1].mean() for p in placements.values()]
    assert nearest == sorted(nearest, reverse=True)
    assert all(len(p.position) == 1500 for p in placements.values())


@pytest.mark.parametrize(("count", "times", "deviation"), [(4096, 2.0, 0.9), (400, 3.0, 0.75)])
@pytest.mark.parametrize("shape", ["even", "patches", "disc", "squares"])
def test_bodies_in_the_strongest_clumps_are_at_most_twice_as_far_from_the_density_at_large(
    shape, count, times, deviation
):
    """In an open domain it was three times, half of it since bodies push each other out of clumps; on sharp shapes six times.

    Few bodies, for whose clumps there is little room, were off by seven to twenty-four times as much as without.
    """
    row, column = (np.indices((64, 64)) + 0.5) / 64.0
    patches = 0.15 + np.exp(np.sin(7.0 * row + 3.0 * column) + np.cos(9.0 * column - 2.0 * row))
    disc = np.hypot(row - 0.5, column - 0.5) < 0.35
    squares = (np.abs(row - 0.4) < 0.3) & (np.abs(column - 0.25) < 0.2) | (row > 0.6) & (column > 0.6)
    density = {"even": np.ones((1, 1)), "patches": patches, "disc": disc, "squares": squares}[shape].astype(np.float32)
    domain = Domain((64.0, 64.0))
    errors = {0.0: [], 1.0: []}
    for strength, found in errors.items():
        for seed in (2, 3):
            problem = problem_of(strength, density=density, count=count, domain=domain, seed=seed)
            placement = solve(problem, device="cpu")
            found.append(coverage_error(placement.position, placement.area, density, domain, 4.0))
    assert np.mean(errors[1.0]) < times * np.mean(errors[0.0])
    fine = np.kron(density, np.ones(np.array(density_of(problem).shape) // density.shape))
    factor = density_of(problem)[fine > 0.0] / fine[fine > 0.0]
    assert factor.std() > deviation * factor.mean()


def test_clumps_of_two_classes_and_two_seeds_differ_and_finer_densities_have_the_same():
    classes = [BodyClass(name, [Size("s", 0.02, 500)], clustering=1.0) for name in "ab"]
    first, second = (density_of_class.density_image for density_of_class in Problem(SQUARE, classes).classes)
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.3
    other = density_of(problem_of(1.0, count=500, seed=1))
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.3
    fine = density_of(problem_of(1.0, density=np.ones((4 * first.shape[0], 4 * first.shape[1])), count=500))
    coarse = fine.reshape(first.shape[0], 4, first.shape[1], 4).mean(axis=(1, 3))
    assert np.corrcoef(first.ravel(), coarse.ravel())[0, 1] > 0.99


def test_clumps_are_as_large_as_spacings_are_where_a_class_stands():
    y, x = np.mgrid[:80, :80] / 2.0
    disc = (np.hypot(x - 20.0, y - 20.0) < 9.0).astype(float)
    spacing = 40.0 * np.sqrt(disc.mean() / 1500)
    by_itself, asked = (density_of(problem_of(1.0, size, disc)) for size in (0.0, 2.5 * spacing))
    # It is chosen in steps.
    assert by_itself.shape == asked.shape and np.corrcoef(by_itself.ravel(), asked.ravel())[0, 1] > 0.9
    # In a spot no image would show them.
    spot = np.zeros((80, 80))
    spot[40, 40] = 1.0
    assert max(density_of(problem_of(1.0, 0.0, spot, count=20_000)).shape) <= 1200


def test_no_clumps_leave_a_density_as_it_is_and_a_problem_made_of_another_has_them_once():
    assert density_of(problem_of(0.0, 4.0)).shape == (1, 1)
    problem = problem_of(1.0)
    np.testing.assert_array_equal(density_of(Problem(SQUARE, problem.classes)), density_of(problem))


def test_a_stroke_leaves_clumps_far_from_it_as_they_are():
    y, x = (np.mgrid[:100, :100] + 0.5) * 0.4
    before = 0.5 + 0.3 * np.sin(x / 5.0)
    after = np.where(np.hypot(x - 8.0, y - 8.0) < 4.0, 1.5 * before, before)
    domain = Domain((40.0, 40.0))
    one, other = (density_of(problem_of(1.0, 0.0, density, domain=domain)) for density in (before, after))
    assert one.shape == other.shape
    times = len(one) // 100
    far = np.kron(np.hypot(x - 8.0, y - 8.0) > 15.0, np.ones((times, times))) > 0.0
    ratio = other[far] * (one[far].sum() / other[far].sum()) / one[far]
    assert np.abs(ratio - 1.0).max() < 0.1


def test_a_density_that_an_edit_leaves_gets_its_clumps_at_no_cost():
    density = np.linspace(0.2, 1.0, 64)[None, :]
    first, second = (problem_of(0.8, 0.0, density, regularity=regularity) for regularity in (1.0, 0.5))
    assert first.classes[0].density_image is second.classes[0].density_image


def test_what_cannot_have_clumps_is_named():
    with pytest.raises(
        ProblemError, match=r'`clump_size` of class "a" must be at least 0\.0781 m in a domain of 40 x 40 m'
    ):
        problem_of(0.5, 0.01)
    with pytest.raises(ProblemError, match="`clustering`"):
        problem_of(1.5)
    triangle = Surface(SurfaceMesh([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]))
    with pytest.raises(ProblemError, match=r'`clustering` of class "a" must be 0 on a surface; got 0\.5'):
        problem_of(0.5, domain=triangle)


@pytest.mark.parametrize("obstacles", [[], [Obstacle(disc=(30.0, 30.0, 4.0))]])
def test_an_edit_keeps_the_size_of_clumps_that_was_chosen_until_another_is_much_better(obstacles):
    """Another size by a step of eight percent moved a third of all bodies, where a tenth was added."""

    def asked(count):
        return problem_of(0.7, count=count, seed=1, obstacles=obstacles)

    few, more, many = asked(1600), asked(1800), asked(3200)
    assert many.classes[0].clumps < more.classes[0].clumps < few.classes[0].clumps
    with Solver(few, device="cpu") as solver:
        solver.run(60)
        before = solver.placement()
        edit = solver.edit(more)
        after = solver.placement()
        kept = solver.model.problem.classes[0]
        assert kept.clumps == few.classes[0].clumps
        np.testing.assert_array_equal(kept.density_image, few.classes[0].density_image)
        assert len(edit.added) == 200 and len(edit.removed) == 0
        _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
        way = np.linalg.norm((after.position[j] - before.position[i] + 20.0) % 40.0 - 20.0, axis=1)
        assert (way < 0.1).mean() > 0.7
        solver.edit(many)
        assert solver.model.problem.classes[0].clumps == many.classes[0].clumps


def test_an_edit_takes_the_size_of_clumps_that_is_asked_for():
    with Solver(problem_of(0.7, seed=1), device="cpu") as solver:
        chosen = solver.model.problem.classes[0].clumps
        solver.edit(problem_of(0.7, 1.1 * chosen, seed=1))
        assert solver.model.problem.classes[0].clumps == 1.1 * chosen
        # And the chosen one again, where none is asked for any more.
        solver.edit(problem_of(0.7, seed=1))
        assert solver.model.problem.classes[0].clumps == chosen


def test_very_many_clumps_do_not_take_minutes():
    """A side of 3,547 pixels, a prime number: two minutes went into its transforms."""
    from esh.engine.problem import clumps

    assert [clumps._length_of_transform(n) for n in (1, 97, 1024, 1031, 3547)] == [4, 97, 1024, 1080, 3600]
    began = time.perf_counter()
    image = density_of(problem_of(1.0, 0.0676, domain=Domain((1.0, 30.0))))
    assert time.perf_counter() - began < 60.0
    rows, columns = image.shape
    assert rows >= 3547 and image.min() > 0.0
    # No long waves, all the same.
    blocks = image[: rows // 50 * 50, : columns // 50 * 50].reshape(rows // 50, 50, columns // 50, 50).mean(axis=(1, 3))
    assert blocks.std() < 0.1 * image.mean() < 0.2 * image.std()


@pytest.mark.parametrize("shape", [(5, 8), (6, 7), (1, 2), (3, 1)])
def test_what_goes_on_as_in_mirrors_is_filtered_by_cosines_as_by_fourier_transforms_of_the_mirrored(shape):
    values = np.random.default_rng(1).random(shape)
    kept = np.random.default_rng(2).random(shape)
    mirrored = np.block([[values, values[:, ::-1]], [values[::-1], values[::-1, ::-1]]])
    # The share that is kept of a wave does not depend on its sign; the highest one of the mirrored is in neither.
    rows, columns = (np.minimum(np.arange(2 * n), 2 * n - np.arange(2 * n)) for n in shape)
    whole = np.pad(kept, ((0, 1), (0, 1)), mode="edge")[rows][:, columns]
    expected = np.fft.ifft2(np.fft.fft2(mirrored) * whole).real[: shape[0], : shape[1]]
    np.testing.assert_allclose(filter_waves(values, kept, wraps=False), expected, atol=1e-12)


def test_it_is_said_that_a_size_of_clumps_does_nothing_where_there_are_none():
    ground = Surface(SurfaceMesh(np.array([(0.0, 0, 0), (40, 0, 0), (0, 40, 0)]), np.array([(0, 1, 2)])))
    for domain in (SQUARE, ground):
        placement = solve(problem_of(0.0, 3.0, count=20, domain=domain), max_steps=5, device="cpu")
        told = [note for note in placement.report.notes if "clump_size" in note]
        assert told == ['`clump_size` of class "a" does nothing: there are no clumps while its `clustering` is 0']
        assert kind_of(told[0]) == NoteKind.IGNORED
    for problem in (problem_of(0.5, 3.0), problem_of(0.5), problem_of(0.0)):
        assert problem.classes[0].notes == ()
