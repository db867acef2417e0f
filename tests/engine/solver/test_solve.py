"""solve(): exact counts, quality at or below the direct sum's, determinism, and where bodies may be."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from esh.engine.descent.initial_placement import initial_placement
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.errors import DeviceError, ProblemError
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.fixed_bodies import FixedBody
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.quality.spacing import HEXAGONAL_SPACING
from esh.engine.solve import solve
from esh.engine.solver.rare_start import rare_starts
from esh.engine.space.density import sample_density

UNIFORM = np.ones((1, 1), dtype=np.float32)


def errors(placement, chosen, image):
    domain = placement.problem.domain
    area = placement.area[chosen]
    return [coverage_error(placement.position[chosen], area, image, domain, k) for k in (0.5, 1.0, 2.0)]


def spacings(position, area):
    """Smallest and mean distance to the nearest neighbor, over the hexagonal spacing."""
    from scipy.spatial import cKDTree

    nearest = cKDTree(position).query(position, 2)[0][:, 1] / (HEXAGONAL_SPACING * np.sqrt(area / len(position)))
    return nearest.min(), nearest.mean()


def picture():
    """An image with large bright and dark parts, fine detail and noise, as a photograph has."""
    y, x = np.mgrid[0:128, 0:128] / 128.0
    rng = np.random.default_rng(0)
    image = 0.5 + 0.35 * np.sin(5.0 * x + 3.0 * y) + 0.15 * np.sin(40.0 * x * y) + 0.1 * rng.standard_normal((128, 128))
    image[(x - 0.6) ** 2 + (y - 0.4) ** 2 < 0.04] *= 0.1
    return np.clip(image, 0.0, 1.0)


# Scores of the direct float64 sum with the paper's scheme, 1,000 steps; k = 0.5, 1, 2.
@pytest.mark.parametrize("seed", [0, 1])
def test_uniform_density_is_at_or_below_the_direct_sum(seed):
    placement = solve(Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 4096)])], seed=seed))
    assert placement.report.steps <= 100
    assert (np.array(errors(placement, slice(None), UNIFORM)) <= [0.0223, 0.0033, 0.0010]).all()
    smallest, mean = spacings(placement.position, 64.0**2)
    assert smallest >= 0.82
    assert mean >= 0.92


def test_a_photograph_is_at_or_below_the_direct_sum():
    data = pytest.importorskip("skimage.data")
    from skimage.transform import resize

    image = 1.0 - resize(data.camera(), (128, 128), anti_aliasing=True)
    placement = solve(Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 4096)], image)]))
    assert (np.array(errors(placement, slice(None), image)) <= [0.0663, 0.0053, 0.0013]).all()


def test_a_generated_picture_is_followed():
    image = picture()
    problem = Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 4096)], image)])
    placement = solve(problem)
    start = replace(placement, position=initial_placement(problem))
    reached, before = errors(placement, slice(None), image), errors(start, slice(None), image)
    assert reached[0] < 0.6 * before[0]
    assert reached[1] < 0.5 * before[1]
    assert reached[2] < 0.33 * before[2]


def test_two_classes_are_at_or_below_the_direct_sum():
    classes = [BodyClass(name, [Size("s", 1.0, 1024)]) for name in "ab"]
    placement = solve(Problem(Domain((64.0, 64.0)), classes, Balance(class_separation=0.5)))
    assert (np.array(errors(placement, slice(None), UNIFORM)) <= [0.070, 0.0069, 0.0017]).all()
    for k in range(2):
        chosen = placement.class_index == k
        assert (np.array(errors(placement, chosen, UNIFORM)) <= [0.076, 0.019, 0.0067]).all()
        assert spacings(placement.position[chosen], 64.0**2)[0] >= 0.65


def test_two_sizes_are_at_or_below_the_direct_sum():
    sizes = [Size("small", 1.0, 1536), Size("large", 3.0, 256)]
    placement = solve(Problem(Domain((64.0, 64.0)), [BodyClass("a", sizes)], Balance(size_emphasis=2.0)))
    assert (np.array(errors(placement, slice(None), UNIFORM)) <= [0.180, 0.020, 0.0055]).all()
    large = placement.size_index == 1
    assert (np.array(errors(placement, large, UNIFORM)) <= [0.091, 0.032, 0.017]).all()
    assert spacings(placement.position[large], 64.0**2)[0] >= 0.67


def small_problem(boundary="open", seed=0):
    image = np.zeros((40, 60))
    image[5:30, 10:55] = np.linspace(0.1, 1.0, 45)
    return Problem(
        Domain((6.0, 4.0), boundary),
        [
            BodyClass("a", [Size("s", 0.01, 150), Size("l", 0.04, 31)], image),
            BodyClass("b", [Size("s", 0.02, 77)], image[::-1, ::-1]),
        ],
        seed=seed,
    )


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_counts_order_and_places(boundary):
    problem = small_problem(boundary)
    placement = solve(problem)
    assert [s.placed for c in placement.report.classes for s in c.sizes] == [150, 31, 77]
    pairs = np.stack([placement.class_index, placement.size_index], axis=1).tolist()
    assert pairs == [[0, 0]] * 150 + [[0, 1]] * 31 + [[1, 0]] * 77
    assert (placement.position >= 0).all()
    assert (placement.position <= problem.domain.size).all()
    for k, body_class in enumerate(problem.classes):
        own = placement.position[placement.class_index == k]
        assert (sample_density(body_class.density_image, own, problem.domain.size) > 0).all()
    assert placement.angle.shape == placement.length.shape == (258,)


def test_same_seed_same_bytes_and_another_seed_another_result():
    first, again, other = (solve(small_problem(seed=s)).position for s in (3, 3, 4))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("kind", ["dots", "lines", "contact"])
def test_threads_do_not_change_the_bytes(monkeypatch, boundary, kind):
    """Also where a thread has few chunks, and where there are more threads than processors."""
    ramp = np.linspace(0.0, 1.0, 64)[None, :]
    line = Line(2.0, "density") if kind == "lines" else None
    # As dense as the ramp allows with contact, without being so dense that it ends at the limit of rounds.
    sizes = [Size("s", 0.2, 2000, line=line), Size("l", 0.8, 240)]
    problem = Problem(
        Domain((39.0, 39.0), boundary), [BodyClass("a", sizes, ramp)], avoid_overlap=kind == "contact", seed=4
    )
    monkeypatch.setenv("ESH_THREADS", "1")
    alone = solve(problem, device="cpu", max_steps=8)
    for threads in ("2", "13"):
        monkeypatch.setenv("ESH_THREADS", threads)
        several = solve(problem, device="cpu", max_steps=8)
        assert alone.position.tobytes() == several.position.tobytes()
        assert alone.angle.tobytes() == several.angle.tobytes()
        assert replace(alone.report, seconds=0.0) == replace(several.report, seconds=0.0)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_thin_features_hold_their_bodies(boundary):
    """A line one pixel wide, single pixels, and a footprint that cannot fit: nobody ends beside them."""
    image = np.zeros((200, 200))
    image[50, 20:180] = 1.0
    image[::7, 100] = 1.0
    problem = Problem(
        Domain((10.0, 10.0), boundary), [BodyClass("a", [Size("s", 1e-3, 700), Size("l", 1.0, 9)], image)]
    )
    placement = solve(problem, max_steps=60)
    assert (sample_density(image, placement.position, (10.0, 10.0)) > 0).all()


def test_progress_reports_every_step_and_stops_the_run():
    seen = []

    def stop_at_five(progress):
        seen.append(progress)
        return progress.step < 5

    placement = solve(small_problem(), progress=stop_at_five)
    assert [p.step for p in seen] == [1, 2, 3, 4, 5]
    assert placement.report.steps == 5
    assert not placement.report.converged
    assert seen[-1].position.shape == (258, 2)
    np.testing.assert_array_equal(seen[-1].position, placement.position)
    assert sum(s.placed for c in placement.report.classes for s in c.sizes) == 258


def test_footprints_that_cannot_fit_keep_their_counts_and_are_reported():
    placement = solve(Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.1, 30)])]))
    assert len(placement.position) == 30
    assert placement.report.covered == pytest.approx(3.0)
    assert placement.report.overlaps > 10
    assert any("cannot fit" in note for note in placement.report.notes)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize(
    ("size", "count"),
    [((1.0, 1.0), 1), ((1.0, 1.0), 2), ((1000.0, 1.0), 100), ((1.0, 3000.0), 40), ((1e-6, 1e-6), 300)],
)
def test_small_and_extreme_problems_end_with_finite_positions_inside(boundary, size, count):
    area = min(size) ** 2
    problem = Problem(
        Domain(size, boundary), [BodyClass("a", [Size("s", 1e-3 * area, count)]), BodyClass("b", [Size("s", area, 1)])]
    )
    placement = solve(problem, device="cpu", max_steps=30)
    assert len(placement.position) == count + 1
    assert np.isfinite(placement.position).all()
    assert (placement.position >= 0).all()
    assert (placement.position <= size).all()


def test_long_domains_are_as_even_as_square_ones():
    for size in ((256.0, 16.0), (16.0, 256.0)):
        placement = solve(Problem(Domain(size), [BodyClass("a", [Size("s", 1.0, 4096)])]))
        assert errors(placement, slice(None), UNIFORM)[1] < 0.008


@pytest.mark.parametrize("device", ["gpu", "cuda:77", "", "cpu:1", "CPU"])
def test_unknown_devices_are_named(device):
    with pytest.raises(DeviceError, match="device"):
        solve(small_problem(), device=device)


@pytest.mark.parametrize("max_steps", [0, -3, 1.5, True, "ten"])
def test_max_steps_must_be_a_whole_number(max_steps):
    with pytest.raises(ProblemError, match="max_steps"):
        solve(small_problem(), max_steps=max_steps)


def test_a_count_beyond_memory_says_how_much_it_would_take():
    with pytest.raises(ProblemError, match=r"[GTP]B"):
        solve(Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 1.0, 10**12)])]))


def tone(placement, image, cells=1024):
    """PSNR [dB] where placement and target are blurred by 1, 2 and 4 mean spacings and mirrored at the border; a dot is 4."""
    from scipy.ndimage import gaussian_filter

    low, share = np.divmod(placement.position / placement.problem.domain.size * cells - 0.5, 1.0)
    found = np.zeros((cells, cells))
    for corner in np.ndindex(2, 2):
        column, row = np.clip(low + corner, 0, cells - 1).astype(int).T
        np.add.at(found, (cells - 1 - row, column), np.abs(1.0 - np.array(corner) - share).prod(axis=1))
    off = found / found.mean() - np.kron(image / image.mean(), np.ones((cells // len(image),) * 2))
    spacing = cells / np.sqrt(len(placement.position))
    return [20.0 * np.log10(4.0 / gaussian_filter(off, k * spacing, truncate=6.0).std()) for k in (1, 2, 4)]


@pytest.mark.parametrize(
    ("name", "most", "least"),
    [("camera", 0.0024, (66, 86, 103)), ("chelsea", 0.0016, (69, 88, 103)), ("coffee", 0.0035, (65, 86, 102))],
)
def test_a_photograph_is_followed_better_than_point_charges_can(name, most, least):
    """Point charges and a smoothed target end at 0.0036, 0.0032 and 0.0052, however many steps they take.

    Of exact optimal transport the tone of the first is 64, 82 and 100 dB.
    """
    data = pytest.importorskip("skimage.data")
    from skimage.color import rgb2gray
    from skimage.transform import resize

    photograph = getattr(data, name)()
    gray = photograph / 255.0 if photograph.ndim == 2 else rgb2gray(photograph)
    image = 1.0 - resize(gray, (128, 128), anti_aliasing=True)
    problem = Problem(Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 4096)], image)], seed=1)
    placement = solve(problem, device="cpu", max_steps=150)
    assert errors(placement, slice(None), image)[1] <= most
    assert placement.report.smallest_spacing >= 0.38
    found = tone(placement, image)
    print(name, found)
    assert (np.array(found) > least).all()


def sixfold_order(position, period=None):
    """Mean |psi 6| over the six nearest neighbors of every body: 1 for a hexagonal lattice."""
    from scipy.spatial import cKDTree

    nearest = cKDTree(position, boxsize=period).query(position, 7)[1][:, 1:]
    way = position[nearest] - position[:, None]
    if period is not None:
        way -= np.round(way / period) * period
    return np.abs(np.exp(6j * np.arctan2(way[..., 1], way[..., 0])).mean(axis=1)).mean()


def test_regularity_goes_from_a_lattice_to_organic_and_keeps_densities():
    orders = []
    for regularity in (1.0, 0.6, 0.3, 0.0):
        domain = Domain((64.0, 64.0), "periodic")
        problem = Problem(domain, [BodyClass("a", [Size("s", 1.0, 4096)])], seed=1, regularity=regularity)
        placement = solve(problem, device="cpu")
        orders.append(sixfold_order(placement.position, 64.0))
        assert coverage_error(placement.position, placement.area, UNIFORM, domain) <= 0.0013
        assert placement.report.smallest_spacing >= 0.45
    assert orders == sorted(orders, reverse=True)
    assert orders[0] > 0.85 and orders[2] < 0.72 and orders[3] < 0.46


def test_regularity_acts_on_outlines_that_keep_apart():
    """Boxes whose discs would cover 65 % of the ground: organic ones overlap no more than those in rows do, and densities are kept."""
    side, found = 40.0, []
    box = Footprint.rectangle(0.68, 0.45)
    for regularity in (1.0, 0.3, 0.0):
        sizes = [Size("box", None, 2000, footprint=Footprints(box))]
        problem = Problem(
            Domain((side, side), "periodic"),
            [BodyClass("a", sizes)],
            avoid_overlap=True,
            seed=1,
            regularity=regularity,
        )
        placement = solve(problem, device="cpu")
        assert placement.report.overlaps == 0
        assert placement.report.coverage_error < 0.0025
        found.append(sixfold_order(placement.position, side))
    assert found[0] > 0.85 and found[1] < 0.72 and found[2] < 0.5


@pytest.mark.parametrize(("regularity", "order"), [(1.0, 0.83), (0.0, 0.52)])
def test_regularity_keeps_a_photograph(regularity, order):
    data = pytest.importorskip("skimage.data")
    from skimage.transform import resize

    image = 1.0 - resize(data.camera(), (128, 128), anti_aliasing=True)
    problem = Problem(
        Domain((64.0, 64.0)), [BodyClass("a", [Size("s", 1.0, 4096)], image)], seed=1, regularity=regularity
    )
    placement = solve(problem, device="cpu")
    assert abs(sixfold_order(placement.position) - order) < 0.07
    assert errors(placement, slice(None), image)[1] <= 0.0037


# All together over what they are with the paper's factors: means of six seeds are 0.96, 1.0 and 1.07. They were 1.08, 0.97 and 1.5
# before rare classes pushed each other more, too.
@pytest.mark.parametrize(
    ("counts", "smallest", "together"),
    [((4000, 400, 40), 0.84, 1.04), ((1000, 100), 0.82, 1.04), ((1000, 300, 100, 30), 0.79, 1.2)],
)
def test_rare_classes_are_as_even_as_if_they_were_alone_and_all_are_even_together(counts, smallest, together):
    found = {}
    for emphasis in (0.0, 1.0):
        classes = [BodyClass(str(count), [Size("s", 1e-4, count)]) for count in counts]
        problem = Problem(Domain((64.0, 64.0)), classes, Balance(rare_emphasis=emphasis), seed=1)
        placement = solve(problem, device="cpu")
        rare = placement.position[placement.class_index == len(counts) - 1]
        error = coverage_error(rare, np.ones(len(rare)), UNIFORM, problem.domain)
        found[emphasis] = spacings(rare, 64.0**2)[0], error, np.array(errors(placement, slice(None), UNIFORM))[:2]
    (spacing, error, union), (before, error_before, union_before) = found[1.0], found[0.0]
    assert spacing >= max(smallest, before + 0.04)
    assert error <= min(0.015, 0.8 * error_before)
    assert (union <= together * union_before).all()


def test_a_list_of_size_emphases_is_for_the_classes_that_have_as_many_sizes():
    """Rare ones, of fewer sizes, are spread before the others."""
    classes = [
        BodyClass("many", [Size(str(area), area, 100) for area in (0.1, 0.2, 0.3)]),
        BodyClass("rare", [Size("s", 0.1, 7)]),
    ]
    placement = solve(Problem(Domain((20.0, 20.0)), classes, Balance(size_emphasis=[2.0, 3.0])), max_steps=5)
    assert np.bincount(placement.class_index).tolist() == [300, 7]


def test_rare_bodies_start_where_they_may_be_and_are_placed_exactly():
    """With all that makes a class another one: obstacles, clumps, what is fixed, inks that may overlap, lines."""
    half = np.zeros((8, 8))
    half[:, 5:] = 1.0
    classes = [
        BodyClass("many", [Size("s", 1e-4, 600)]),
        BodyClass("few", [Size("s", 1e-3, 60), Size("l", 0.3, 9)], half, clustering=0.5),
        BodyClass("lines", [Size("s", 1e-3, 20, line=Line(0.5))]),
        BodyClass("fixed", [Size("s", 1e-3, 20)]),
        BodyClass("one", [Size("s", 1e-3, 1)], half),
        BodyClass("rare", [Size("s", 1e-3, 7)], half),
    ]
    problem = Problem(
        Domain((8.0, 8.0)),
        classes,
        Balance(non_overlap=np.eye(6)),
        fixed=[FixedBody((1.0, 1.0), "fixed")],
        obstacles=[Obstacle(disc=(6.5, 4.0, 1.0))],
    )
    launcher = Launcher(resolve_device("cpu"))
    try:
        start = rare_starts(launcher, problem)
    finally:
        launcher.close()
    class_index = problem.body_indices()[0]
    assert np.unique(class_index[~np.isnan(start[:, 0])]).tolist() == [1, 5]
    assert (start[~np.isnan(start[:, 0])][:, 0] > 4.9).all()
    placement = solve(problem, device="cpu")
    assert [s.placed for c in placement.report.classes for s in c.sizes] == [600, 60, 9, 20, 21, 1, 7]
    own = placement.position[np.isin(placement.class_index, [1, 5])]
    assert (own[:, 0] >= 5.0 - 1e-6).all()
    assert (np.hypot(*(own - (6.5, 4.0)).T) >= 1.0).all()


def test_nothing_is_spread_before_where_no_class_is_rare():
    launcher = Launcher(resolve_device("cpu"))
    try:
        for counts, balance in (((100, 30), None), ((100, 10), Balance(1.0)), ((100, 10), Balance(rare_emphasis=0.0))):
            classes = [BodyClass(str(count), [Size("s", 1e-4, count)]) for count in counts]
            assert rare_starts(launcher, Problem(Domain((8.0, 8.0)), classes, balance)) is None
    finally:
        launcher.close()


def test_classes_that_keep_apart_have_no_close_pairs():
    problem = Problem(Domain((64.0, 64.0)), [BodyClass(name, [Size("s", 1.0, 1024)]) for name in "ab"], seed=2)
    placement = solve(problem, device="cpu")
    assert errors(placement, slice(None), UNIFORM)[0] <= 0.0356
    assert spacings(placement.position, 64.0**2)[0] >= 0.65
    own = placement.class_index == 0
    assert spacings(placement.position[own], 64.0**2)[0] >= 0.62


def test_long_objects_and_discs_in_a_crowd_part():
    """With the blur that dots have, a third of such crowds keeps sticks that have slipped through each other: 11 overlaps in these."""
    image = np.ones((40, 60))
    image[:, :20] = 0.0
    line = Line(1.5, direction=0.7, width=0.2, stretch_weights=(0.0, 0.1))
    sizes = [Size("stick", 0.33, 60, line=line), Size("disc", 0.196, 80)]
    overlaps = 0
    for seed in range(10):
        domain = Domain((12.0, 8.0), "periodic")
        problem = Problem(domain, [BodyClass("a", sizes, image)], avoid_overlap=True, seed=seed)
        overlaps += solve(problem, device="cpu").report.overlaps
    assert overlaps <= 1


@pytest.mark.parametrize("wrong", [None, "forest.toml", 3])
def test_what_is_no_problem_is_named(wrong):
    with pytest.raises(ProblemError, match="`problem` must be a Problem; got "):
        solve(wrong)


def test_outlines_are_parted_for_a_moment_where_a_run_is_stopped_to_keep_what_is_there(monkeypatch):
    from esh.engine import solve as of_run

    box = Footprint([(-0.4, -0.1), (0.4, -0.1), (0.4, 0.1), (-0.4, 0.1)])
    domain = Domain((10.0, 10.0))
    problem = Problem(domain, [BodyClass("a", [Size("s", count=300, footprint=box)])], seed=2, avoid_overlap=True)

    def kept(seconds):
        with closing(Launcher(resolve_device("cpu"))) as launcher:
            return of_run.solve_on(launcher, problem, 50, lambda now: now.step < 4, seconds).report

    as_it_is = kept(0.0)
    assert as_it_is.steps == 4 and as_it_is.overlaps > 50
    parted = kept(60.0)
    assert parted.steps == 4 and parted.overlaps == 0 and not parted.converged
    monkeypatch.setattr(of_run, "MOST_PARTED_AFTER_STOP", 299)
    assert kept(60.0).overlaps == as_it_is.overlaps


def test_progress_must_be_something_to_call():
    with pytest.raises(ProblemError, match='`progress` must be a function, or None; got "x"'):
        solve(small_problem(), progress="x")
