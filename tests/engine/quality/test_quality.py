"""The measures themselves, on arrangements whose values are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.cover import cover_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality import measurement
from esh.engine.quality.coverage import coverage_error
from esh.engine.quality.measured_bodies import measured_bodies
from esh.engine.quality.measurement import measure
from esh.engine.quality.spacing import HEXAGONAL_SPACING, measure_spacing, smallest_spacing
from esh.engine.solve import solve

UNIFORM = np.ones((1, 1))


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_independent_points_score_as_they_should(boundary):
    """White noise through a Gaussian of one spacing leaves 1 / sqrt(4 pi) = 0.28 (periodic), a little more at open edges."""
    domain = Domain((64.0, 64.0), boundary)
    scores = [
        coverage_error(np.random.default_rng(seed).random((4096, 2)) * 64.0, np.ones(4096), UNIFORM, domain)
        for seed in range(5)
    ]
    assert np.mean(scores) == pytest.approx(0.282 if boundary == "periodic" else 0.29, rel=0.12)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize(("size", "k"), [((3.0, 2.0), 1.0), ((3.0, 2.0), 0.4), ((1.0, 40.0), 2.0)])
def test_equals_what_scipys_blur_gives(boundary, size, k):
    """The definition written out: clouds in cells, the target's integrals, a Gaussian with zeros outside or wrapped, the RMS."""
    ndimage = pytest.importorskip("scipy.ndimage")
    from esh.engine.space.density import box_integrals
    from esh.engine.transforms.convolution import good_length

    domain = Domain(size, boundary)
    rng = np.random.default_rng(0)
    image = rng.random((3, 5)) + 0.1
    position, charge = rng.random((300, 2)) * size, rng.random(300) + 0.5
    cell = max(size) / 512
    columns, rows = (round(length / cell) for length in size)
    if boundary == "periodic":
        rows, columns = good_length(rows), good_length(columns)
    grid = np.zeros((rows, columns))
    u, v = position[:, 0] / size[0] * columns - 0.5, position[:, 1] / size[1] * rows - 0.5
    for dy in (0, 1):
        for dx in (0, 1):
            c, r = np.floor(u).astype(int) + dx, np.floor(v).astype(int) + dy
            weight = charge * (1 - np.abs(u - c)) * (1 - np.abs(v - r))
            if boundary == "periodic":
                np.add.at(grid, (r % rows, c % columns), weight)
            else:
                np.add.at(grid, (np.clip(r, 0, rows - 1), np.clip(c, 0, columns - 1)), weight)
    difference = grid - charge.sum() * box_integrals(image, (rows, columns))
    sigma = k * np.sqrt(domain.area / 300)
    blurred = ndimage.gaussian_filter(
        difference,
        (sigma / size[1] * rows, sigma / size[0] * columns),
        mode="constant" if boundary == "open" else "wrap",
        truncate=9.0,
    )
    expected = np.sqrt(np.mean(blurred**2)) / (charge.sum() / grid.size)
    assert coverage_error(position, charge, image, domain, k) == pytest.approx(expected, rel=2e-4)


def test_the_grid_is_fine_enough_for_many_bodies():
    """A lattice whose spacing is no multiple of the cells: on 512 of them their own pattern would be thrice as strong."""
    side = 300
    lattice = np.stack(np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5), -1).reshape(-1, 2) / side
    assert coverage_error(lattice, np.ones(side**2), UNIFORM, Domain((1.0, 1.0), "periodic")) < 4e-3


def test_a_lattice_covers_better_than_random_points():
    domain = Domain((8.0, 8.0), "periodic")
    lattice = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5), -1).reshape(-1, 2) / 8.0
    assert coverage_error(lattice, np.ones(4096), UNIFORM, domain) < 1e-4


def test_spacing_of_a_hexagonal_lattice_is_one(launcher):
    rows, columns = 20, 24
    x = np.arange(columns) + 0.5 * (np.arange(rows)[:, None] % 2)
    y = np.repeat(np.arange(rows)[:, None] * np.sqrt(3.0) / 2.0, columns, axis=1)
    domain = Domain((columns, rows * np.sqrt(3.0) / 2.0), "periodic")
    position = np.stack([x.ravel(), y.ravel()], axis=1)
    density = np.full(len(position), len(position) / domain.area)
    assert smallest_spacing(position, density, domain, launcher) == pytest.approx(1.0, abs=1e-4)
    assert smallest_spacing(position[:1], density[:1], domain, launcher) is None


def test_distances_are_those_of_neighbors_in_meters(launcher):
    """A lattice of 2.5 m in which one body is close to another."""
    x, y = np.meshgrid(np.arange(12) + 0.5, np.arange(8) + 0.5)
    position = 2.5 * np.stack([x.ravel(), y.ravel()], axis=1)
    position[40] = position[41] - [0.75, 0.0]
    bodies = measured_bodies(launcher, Domain((30.0, 20.0)), position)
    density = wp.array(np.full(96, 96 / 600.0 * bodies.unit**2), dtype=float, device=launcher.device)
    spacing = measure_spacing(bodies, density)
    assert spacing.closest == pytest.approx(0.75, rel=1e-5) and spacing.usual == pytest.approx(2.5, rel=1e-5)
    assert measure_spacing(measured_bodies(launcher, Domain((30.0, 20.0)), position[:1]), density[:1]) is None


def test_who_stands_alone_counts_among_usual_distances(launcher):
    """A row in which every body is farther from the next than those before, and a few that see nobody."""
    row = np.stack([0.2 * np.arange(41) ** 1.3, np.full(41, 2.0)], axis=1)
    alone = np.array([[5.0, 18.0], [14.0, 18.0], [23.0, 18.0], [29.0, 10.0], [2.0, 10.0]])
    position = np.concatenate([row, alone])
    bodies = measured_bodies(launcher, Domain((30.0, 20.0)), position)
    # Most of the ground asks for none: who is alone is so by many spacings.
    density = wp.array(np.full(46, 16.0 * 46 / 600.0 * bodies.unit**2), dtype=float, device=launcher.device)
    between = np.linalg.norm(position[:, None] - position, axis=2) + 1e9 * np.eye(46)
    assert measure_spacing(bodies, density).usual == pytest.approx(np.median(between.min(axis=1)), rel=1e-5)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("unasked", [1, 60, 96])
def test_bodies_where_nothing_is_asked_for_have_a_distance_but_no_spacing(launcher, unasked):
    """A lattice of 2.5 m with one body close to another, of which some stand where the density is 0, as fixed ones may."""
    x, y = np.meshgrid(np.arange(12) + 0.5, np.arange(8) + 0.5)
    position = 2.5 * np.stack([x.ravel(), y.ravel()], axis=1)
    position[0, 0] = position[1, 0] - 0.75
    bodies = measured_bodies(launcher, Domain((30.0, 20.0)), position)
    density = np.full(96, 96 / 600.0 * bodies.unit**2)
    density[:unasked] = 0.0
    spacing = measure_spacing(bodies, wp.array(density, dtype=float, device=launcher.device))
    assert spacing.closest == pytest.approx(0.75, rel=1e-5) and spacing.usual == pytest.approx(2.5, rel=1e-5)
    hexagonal = math.sqrt(2.0 / math.sqrt(3.0))
    # With one alone its partner asks for a spacing and has the same neighbor.
    expected = {1: 0.3 / hexagonal, 60: 1.0 / hexagonal, 96: None}[unasked]
    assert spacing.smallest == (expected if expected is None else pytest.approx(expected, rel=1e-5))


def error_by_hand(position: np.ndarray, domain: Domain, cells: int = 256) -> float:
    """:func:`coverage_error` for equal charges and a uniform target, from Gaussians that are evaluated, not convolved."""
    width, height = domain.size
    sigma = math.sqrt(domain.area / len(position))
    step = max(width, height) / cells
    x, y = ((np.arange(round(length / step)) + 0.5) * step for length in (width, height))

    def share(places: np.ndarray, length: float) -> np.ndarray:
        """What a blurred rectangle has left inside itself."""
        return np.array(
            [0.5 * (math.erf(p / sigma / 2**0.5) - math.erf((p - length) / sigma / 2**0.5)) for p in places]
        )

    target = np.outer(share(y, height), share(x, width))
    blurred = np.zeros_like(target)
    for px, py in position:
        blurred += np.outer(np.exp(-0.5 * ((y - py) / sigma) ** 2), np.exp(-0.5 * ((x - px) / sigma) ** 2))
    blurred *= domain.area / len(position) / (2.0 * math.pi * sigma**2)
    return math.sqrt(((blurred - target) ** 2).mean())


@pytest.mark.parametrize("count", [1, 2, 3, 10])
def test_the_coverage_error_of_a_few_bodies(count):
    domain = Domain((40.0, 30.0))
    position = np.array([[20.0, 15.0]]) if count == 1 else np.random.default_rng(count).random((count, 2)) * domain.size
    got = coverage_error(position, np.ones(count), np.ones((1, 1)), domain)
    assert got == pytest.approx(error_by_hand(position, domain), rel=1e-3)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_neighbors_are_found_in_a_long_and_narrow_domain(boundary):
    domain = Domain((2000.0, 1.0), boundary)
    position = np.stack([np.linspace(5.0, 1995.0, 200), np.full(200, 0.5)], axis=1)
    position[100, 0] += 5.0
    launcher = Launcher(resolve_device("cpu"))
    try:
        spacing = smallest_spacing(position, np.full(200, 0.1), domain, launcher)
    finally:
        launcher.close()
    assert spacing == pytest.approx(5.0 * math.sqrt(0.1) / math.sqrt(2.0 / math.sqrt(3.0)), rel=1e-2)


def test_a_report_measures_every_class_by_itself(launcher):
    """Two square lattices, one inside the other: each has its own spacing, and the two are nearer to each other than to themselves."""
    x, y = np.meshgrid(np.arange(8) + 0.25, np.arange(8) + 0.25)
    coarse = np.stack([x.ravel(), y.ravel()], axis=1)
    domain = Domain((8.0, 8.0), "periodic")
    problem = Problem(
        domain, [BodyClass(name, [Size("s", 0.1, 64)]) for name in "ab"] + [BodyClass("c", [Size("s", 0.1, 1)])]
    )
    position = np.concatenate([coarse, coarse + [0.5, 0.25], [[0.3, 0.9]]])
    index = np.repeat([0, 1, 2], [64, 64, 1])
    nothing = np.zeros(129)
    report = measure(Placement(problem, position, index, 0 * index, nothing, nothing, nothing), launcher)
    square = 1.0 / HEXAGONAL_SPACING
    assert [c.smallest_spacing for c in report.classes] == [pytest.approx(square, rel=1e-5)] * 2 + [None]
    assert report.smallest_spacing < 0.6 * square
    assert report.psnr == pytest.approx(20.0 * math.log10(4.0 / report.coverage_error))
    stored = report.to_dict()
    assert stored["psnr"] == report.psnr and stored["classes"][1]["psnr"] == report.classes[1].psnr
    assert f" (peak signal-to-noise {report.psnr:.0f} dB), " in str(report)
    rows = [line.split() for line in str(report).splitlines()]
    assert rows[1][-2] == f"{square:.2f}" and rows[3][-2:] == ["-", "-"]
    assert "is compared with" not in str(replace(report, smallest_spacing=0.8))
    low = str(replace(report, smallest_spacing=0.09))
    # Whoever reads 0.09 knows of what, and how far bodies are apart.
    assert f", closest pair {report.closest:.3g} m, typical spacing {report.usual:.3g} m, " in low
    assert (
        ", smallest spacing 0.09 of a lattice's, order" in low and "is compared with what the density asks for" in low
    )
    assert str(report).splitlines()[0].endswith("  smallest spacing (lattice = 1)  order (random = 0.37, lattice = 1)")
    alone = replace(problem, classes=[BodyClass("a", [Size("s", 0.1, 64)])])
    single = measure(Placement(alone, coarse, index[:64], index[:64], *[nothing[:64]] * 3), launcher)
    assert single.classes[0].smallest_spacing == single.smallest_spacing == pytest.approx(square, rel=1e-5)


def test_the_ground_that_is_covered_is_that_of_the_outlines_as_they_are_scaled():
    """Also where the area of their bodies is said beside them, as in Blender."""
    scale = np.linspace(0.5, 1.5, 40)
    footprints = Footprints(Footprint.rectangle(1.2, 0.5), scale=scale, turn="random")
    box = BodyClass("box", [Size("any", area=0.6, count=40, footprint=footprints)])
    disc = BodyClass("disc", [Size("any", area=0.2, count=30)])
    report = solve(Problem(Domain((20.0, 10.0)), [box, disc]), device="cpu", max_steps=1).report
    assert report.covered == pytest.approx((0.6 * (scale**2).sum() + 30 * 0.2) / 200.0)


def around_the_middle(shape, radius=0.4):
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]]
    return np.hypot((x + 0.5) / shape[1] - 0.5, (y + 0.5) / shape[0] - 0.5) < radius


@pytest.mark.parametrize("case", ["one island", "two islands", "lines", "outlines on a surface"])
def test_the_ground_that_is_covered_is_what_it_was_before_the_run(case):
    """The report and the sentence on what fits give the same figure of the same bodies."""
    square, size = Domain((20.0, 20.0)), [Size("s", 1.0, 60)]
    flat = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 20.0, 0.0], [0.0, 20.0, 0.0]]
    line = Line(2.0, 0.3, width=0.3, stretch_weights=(0.0, 0.1))
    island, two_islands = around_the_middle((100, 100)), [around_the_middle((100, 100)), np.eye(77)]
    box = Size("s", 2.0, 60, footprint=Footprint.rectangle(1.0, 0.5))
    problem = {
        "one island": lambda: Problem(square, [BodyClass("a", size, island)]),
        "two islands": lambda: Problem(square, [BodyClass(str(k), size, image) for k, image in enumerate(two_islands)]),
        "lines": lambda: Problem(square, [BodyClass("a", [Size("s", 0.6, 60, line=line)])]),
        "outlines on a surface": lambda: Problem(
            Surface([SurfaceMesh(flat, [[0, 1, 2], [0, 2, 3]])]), [BodyClass("a", [box])]
        ),
    }[case]()
    report = solve(problem, device="cpu", max_steps=60).report
    assert report.covered == pytest.approx(cover_of(problem).covered, rel=1e-3)


def sixfold_order(position, period=None):
    """The definition, by SciPy's nearest neighbors."""
    spatial = pytest.importorskip("scipy.spatial")
    near = spatial.cKDTree(position, boxsize=period).query(position, 7)[1][:, 1:]
    way = position[near] - position[:, None]
    if period is not None:
        way -= np.array(period) * np.round(way / np.array(period))
    return float(np.abs(np.exp(6j * np.arctan2(way[..., 1], way[..., 0])).mean(axis=1)).mean())


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("density", ["even", "uneven", "clustered"])
@pytest.mark.parametrize("count", [7, 40, 3000])
def test_order_is_that_of_the_six_nearest(launcher, boundary, density, count):
    """Wherever these are: in the thin regions of an uneven density many cells away."""
    size = (30.0, 20.0)
    rng = np.random.default_rng(count)
    position = rng.random((count, 2)) ** {"even": 1.0, "uneven": 4.0, "clustered": 9.0}[density] * size
    position = np.minimum(position, np.nextafter(size, 0.0))
    bodies = measured_bodies(launcher, Domain(size, boundary), position)
    number = wp.array(np.ones(count), dtype=float, device=launcher.device)
    measured = measure_spacing(bodies, number).order
    # float32 may tell two neighbors that are equally far in another order.
    assert measured == pytest.approx(sixfold_order(position, size if boundary == "periodic" else None), abs=2e-3)


def test_order_of_a_lattice_of_few_and_of_many(launcher):
    row, column = (values.ravel() for values in np.mgrid[0:40, 0:40])
    lattice = np.stack([(column + 0.5 * (row % 2) + 0.25), (row + 0.5) * math.sqrt(0.75)], axis=1)
    domain = Domain((40.0, 40.0 * math.sqrt(0.75)), "periodic")

    def order(position, domain):
        bodies = measured_bodies(launcher, domain, position)
        return measure_spacing(bodies, wp.array(np.ones(len(position)), dtype=float, device=launcher.device)).order

    assert order(lattice, domain) == pytest.approx(1.0, abs=1e-4)
    assert order(lattice[:6], domain) is None
    random = np.random.default_rng(0).random((60_000, 2)) * [30.0, 20.0]
    assert order(random, Domain((30.0, 20.0))) == pytest.approx(sixfold_order(random), abs=0.01)
    assert order(random, Domain((30.0, 20.0))) == pytest.approx(0.37, abs=0.01)


def test_the_report_has_the_order_of_all_and_of_each_class():
    classes = [BodyClass(name, [Size("s", 0.1, 400)]) for name in "ab"]
    placement = solve(Problem(Domain((30.0, 20.0)), classes, seed=1), device="cpu")
    report = placement.report
    for index, of_class in enumerate(report.classes):
        own = placement.position[placement.class_index == index]
        assert of_class.order == pytest.approx(sixfold_order(own), abs=2e-3)
    assert report.order == pytest.approx(sixfold_order(placement.position), abs=2e-3)
    assert report.to_dict()["order"] == report.order and report.to_dict()["classes"][0]["order"] > 0.3
    assert str(report).splitlines()[0].endswith("order (random = 0.37, lattice = 1)")
    assert f"order {report.order:.2f} (random = 0.37, lattice = 1), 1 overlap, " in str(replace(report, overlaps=1))
    few = replace(report, smallest_spacing=None, closest=None, usual=None, order=None, overlaps=2)
    assert "closest pair -, 2 overlaps, " in str(few)


def test_overlaps_of_discs_are_looked_for_only_where_some_are_closer_than_wide(monkeypatch):
    looked = []
    found = measurement.overlaps_of
    monkeypatch.setattr(measurement, "overlaps_of", lambda *given: looked.append(1) or found(*given))

    def reported(area):
        problem = Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", area, 100)])])
        return solve(problem, max_steps=60, device="cpu").report

    # A spacing is 1: discs are .8 wide, and then 1.2.
    assert reported(0.5).overlaps == 0
    assert not looked
    assert reported(1.13).overlaps > 100
    assert looked
