"""The cover is known before anything is placed, and counts by cover are those that fit."""

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.cover import Room, cover_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.fixed_bodies import FixedBodies
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.packing import in_cells
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.solve import solve

PLANK = Footprint.rectangle(2.0, 0.3)


def problem_of(footprint, count, density=1.0, side=20.0, **kwargs):
    size = Size("s", count=count, footprint=footprint)
    return Problem(Domain((side, side)), [BodyClass("a", [size], density)], avoid_overlap=True, **kwargs)


@pytest.mark.parametrize("shape", [(1, 1), (5, 20), (13, 7), (64, 3)])
def test_means_over_cells_are_those_of_pixels_cut_at_their_edges(shape):
    image = np.random.default_rng(3).random((7, 13), np.float32)
    image[:3], image[:, -4:] = 0.0, 0.0
    # All edges of cells and of pixels lie on the finer grid.
    fine = np.kron(image, np.ones(shape)).astype(np.float64)
    expected = fine.reshape(shape[0], 7, shape[1], 13).mean(axis=(1, 3))
    found = in_cells(image, shape)
    assert found == pytest.approx(expected, abs=1e-6) and np.all(found[expected == 0.0] == 0.0)


def test_the_cover_counts_the_ground_where_bodies_may_be():
    half = np.ones((4, 8))
    half[:, 4:] = 0.0
    assert cover_of(problem_of(PLANK, 200)).covered == pytest.approx(0.3)
    cover = cover_of(problem_of(PLANK, 200, half))
    assert cover.covered == pytest.approx(0.6)
    assert cover.warning is None
    lines = Size("s", 0.6, 100, line=Line(2.0, width=0.3))
    problem = Problem(Domain((20.0, 20.0)), [BodyClass("a", [lines])], avoid_overlap=True)
    assert cover_of(problem).covered == pytest.approx(100 * (0.6 + np.pi * 0.0225) / 400.0)


def test_what_cannot_fit_is_said_in_per_cent():
    cover = cover_of(problem_of(Footprint.disc(1.0), 170))
    assert cover.warning is not None
    space = "footprints would cover 134% of the space where they may be"
    assert cover.warning == f"{space}, but at most about 82% fits; lower the counts or the areas"
    assert cover_of(problem_of(Footprint.disc(1.0), 100)).warning is None


@pytest.mark.parametrize(
    ("settings", "more", "counted"),
    [
        ({"gap": 0.2}, {}, "footprints and the room around them would"),
        ({"room": 1.2}, {}, "footprints and the room around them would"),
        ({}, {"balance": Balance(non_overlap=np.eye(2))}, "footprints that keep apart would"),
    ],
)
def test_it_is_said_what_of_bodies_is_counted(settings, more, counted):
    size = Size("s", count=170, footprint=Footprint.disc(1.0))
    classes = [BodyClass(name, [size], **settings) for name in "ab"]
    assert cover_of(Problem(Domain((20.0, 20.0)), classes, avoid_overlap=True, **more)).warning.startswith(counted)


def test_bodies_that_may_not_turn_fit_less_than_those_that_may():
    free, fixed = (cover_of(problem_of(Footprints(PLANK, turn=turn), 100)).fits for turn in ("free", "random"))
    assert 0.55 < fixed < 0.66 < 0.75 < free < 0.85


def test_parallel_bodies_fit_like_squares():
    def fits(turn, count=100):
        return cover_of(problem_of(Footprints(PLANK, turn=turn), count)).fits

    square = cover_of(problem_of(Footprints(Footprint.rectangle(1.0, 1.0), turn=0.0), 100)).fits
    crossed = np.arange(100) % 2 * np.pi / 2
    assert fits(0.4) == pytest.approx(square, abs=0.01)
    assert fits(0.4 + crossed * 2) == pytest.approx(square, abs=0.01), "half a turn is none"
    assert fits("random") == pytest.approx(fits(crossed), abs=0.02)
    assert fits(0.4) > fits(np.linspace(-0.2, 0.2, 100)) > fits("random")
    assert cover_of(problem_of(Footprints(PLANK, turn=0.4), 467)).warning is None
    upright = Footprint.rectangle(0.3, 2.0)
    sizes = [Size(n, count=50, footprint=Footprints(o, turn=t)) for n, o, t in (("a", PLANK, 0.4), ("b", upright, 0.4))]
    both = Problem(Domain((20.0, 20.0)), [BodyClass("a", sizes)], avoid_overlap=True)
    assert cover_of(both).fits == pytest.approx(fits(crossed)), "their outlines lie across each other"


def test_a_crowded_region_is_told_from_too_little_space():
    peak = np.full((32, 32), 0.1)
    peak[12:20, 12:20] = 3.0
    cover = cover_of(problem_of(Footprint.disc(0.2), 1000, peak))
    assert cover.covered < 0.4
    assert cover.crowded == pytest.approx(64 * 3.0 / (64 * 3.0 + 960 * 0.1), abs=0.05)
    # Cells lie across its border.
    at_the_peak = 3.0 * 1024 / (64 * 3.0 + 960 * 0.1) * 1000 * np.pi * 0.04 / 400.0
    assert 0.7 * at_the_peak < cover.densest < at_the_peak
    assert cover.warning == (
        f"at the densest places, footprints would cover {cover.densest:.0%} of the ground, but only about 82% fits: the "
        f"{cover.crowded:.0%} of the bodies that belong there spread out, and the density is evened out there; lower the counts or "
        "the areas, or use a density with less contrast"
    )
    # On a gentle slope there is room enough beside.
    assert cover_of(problem_of(Footprint.disc(0.2), 1000, np.linspace(0.5, 1.5, 64)[None, :])).warning is None


def test_less_fits_between_obstacles_the_larger_the_bodies_are():
    posts = [
        Obstacle(polygon=[(x - 0.3, y - 0.3), (x + 0.3, y - 0.3), (x + 0.3, y + 0.3), (x - 0.3, y + 0.3)])
        for x in np.arange(1.0, 20.0, 2.0)
        for y in np.arange(1.0, 20.0, 2.0)
    ]

    def cover(radius, count, **kwargs):
        return cover_of(problem_of(Footprint.disc(radius), count, **kwargs))

    alone = cover(0.4, 100).fits
    # A strip of half a radius around every post is lost, of what they leave; its corners are round.
    lost = 100 * (4 * 0.6 * 0.2 + np.pi * 0.04) / (400.0 - 100 * 0.36)
    assert cover(0.4, 100, obstacles=posts).fits == pytest.approx(alone * (1.0 - lost), rel=0.02)
    assert alone > cover(0.1, 100, obstacles=posts).fits > cover(0.4, 100, obstacles=posts).fits
    # Nothing but the count tells these from what fits.
    assert cover(0.4, 520, obstacles=posts).too_much and not cover(0.4, 400, obstacles=posts).too_much


def test_pockets_that_no_body_gets_into_take_none():
    # Five lanes of 1 m between walls, and 9 m of open ground.
    walls = [Obstacle(polygon=[(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 20.0), (x, 20.0)]) for x in range(9, 21, 2)]
    wide, narrow = (cover_of(problem_of(Footprint.disc(radius), 9, obstacles=walls)).fits for radius in (0.55, 0.45))
    alone = cover_of(problem_of(Footprint.disc(0.55), 9)).fits
    assert wide == pytest.approx(alone * (9.0 - 0.275) / 14.0, rel=0.02)
    assert narrow == pytest.approx(alone * (9.0 - 0.225 + 5 * 0.55) / 14.0, rel=0.02)


def test_room_and_gap_count_as_covered():
    plain, roomy, apart = (
        cover_of(problem_of(f, 50)).covered for f in (PLANK, Footprints(PLANK, room=2.0), Footprints(PLANK, gap=0.2))
    )
    assert roomy == pytest.approx(4.0 * plain)
    grown = 0.6 + 4.6 * 0.1 + np.pi * 0.01
    assert apart == pytest.approx(plain * grown / 0.6)


def covering(classes, avoid_overlap):
    return Problem(Domain((40.0, 40.0)), classes, avoid_overlap=avoid_overlap)


def test_counts_by_cover_aim_at_what_can_be_packed():
    image = np.linspace(0.0, 1.0, 64)[None, :]
    size = Size("s", footprint=Footprint.disc(0.25))
    whole, fitting = (covering([BodyClass("a", [size], image, count="cover")], apart) for apart in (False, True))
    area = np.pi / 16
    assert whole.body_count == pytest.approx(0.5 * 1600 / area, abs=1)
    # Of the dark end, what is above 82 % is cut off.
    expected = np.minimum(image, 0.82).mean() * 1600 / area
    assert fitting.body_count == pytest.approx(expected, abs=1)
    assert fitting.classes[0].density_image.max() == pytest.approx(0.82)
    assert whole.classes[0].density_image.max() == 1.0
    # Two classes share the ground.
    both = covering([BodyClass(name, [size], 0.6, count="cover") for name in "ab"], True)
    assert both.body_count * area / 1600 == pytest.approx(0.82, abs=0.01)
    # Planks of given turns fit less.
    fixed = Size("s", footprint=Footprints(PLANK, turn="random"))
    planks = covering([BodyClass("a", [fixed], count="cover")], True)
    assert 0.55 < planks.body_count * 0.6 / 1600 < 0.66


@pytest.mark.parametrize(
    ("domain", "size", "message"),
    [
        (Domain((8.0, 4.0), inset=True), Size("s", 20.0, 1), "the domain that they are to lie in, 4 m; got 5.046"),
        (Domain((8.0, 4.0), inset=True), Size("s", footprint=Footprint.rectangle(5.0, 4.5), count=1), "got 4.5"),
    ],
)
def test_bodies_wider_than_the_domain_cannot_lie_in_it(domain, size, message):
    with pytest.raises(ProblemError, match=message):
        Problem(domain, [BodyClass("a", [size])], avoid_overlap=True)


def test_inset_needs_edges_and_contact():
    with pytest.raises(ProblemError, match="which has no edges"):
        Domain((1.0, 1.0), "periodic", inset=True)
    with pytest.raises(ProblemError, match="without `avoid_overlap`"):
        Problem(Domain((1.0, 1.0), inset=True), [BodyClass("a", [Size("s", 0.1, 1)])])


def test_the_cover_of_a_surface_counts_its_area_where_bodies_may_be():
    x = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], float)
    surface = Surface(SurfaceMesh(x, [[0, 1, 2], [0, 2, 3]]))

    def half(points):
        return (points.position[:, 0] < 2.0).astype(float)

    for density, covered in ((1.0, 0.25), (half, 0.5)):
        problem = Problem(surface, [BodyClass("a", [Size("s", area=0.02, count=100)], density)], avoid_overlap=True)
        assert cover_of(problem).covered == pytest.approx(covered, rel=0.02)
        assert cover_of(problem).warning is None


def strewn(count: int, distance: float) -> np.ndarray:
    """Places in 20 m x 20 m, no two nearer than this."""
    generator, places = np.random.default_rng(1), np.zeros((0, 2))
    while len(places) < count:
        place = generator.random(2) * 20.0
        if (np.hypot(*(places - place).T) > distance).all():
            places = np.vstack([places, place])
    return places


def beside(places: np.ndarray, density: float = 1.0, **changes) -> Problem:
    classes = [BodyClass("a", [Size("s", 1.0, share=1.0)], density, count="cover"), BodyClass("b", [Size("s", 1.0, 2)])]
    fixed = FixedBodies(places, body_class=changes.pop("of", "a"), size="s")
    return Problem(Domain((20.0, 20.0)), classes, avoid_overlap=True, fixed=fixed, **changes)


def count_of_a(problem: Problem) -> int:
    return problem.classes[0].body_count


def test_bodies_that_cover_the_ground_make_room_for_fixed_ones():
    alone = count_of_a(beside(np.zeros((0, 2))))
    counts = [count_of_a(beside(strewn(n, 1.13))) for n in (10, 60, 120)]
    # Counts of a class are of all of its bodies.
    assert alone > counts[0] > counts[1] > counts[2] > 0.6 * alone
    assert counts[1] < alone - 30
    # Of another class they are not bodies of this one.
    assert count_of_a(beside(strewn(60, 1.13), of="b")) == counts[1] - 60


def test_fixed_bodies_take_nothing_from_what_has_room_beside_them():
    assert count_of_a(beside(strewn(30, 1.13), 0.3)) == 120
    # Counts that include them say what there is to be.
    assert count_of_a(beside(strewn(60, 1.13), include_fixed=True, of="a")) == count_of_a(beside(np.zeros((0, 2))))


def test_fixed_bodies_that_leave_no_ground_are_a_sentence():
    with pytest.raises(
        ProblemError, match=r'class "a" is "cover", but its fixed bodies take the 2\d\d m² that it can cover'
    ):
        beside(np.random.default_rng(1).random((300, 2)) * 20.0)


def test_large_bodies_have_less_room_between_obstacles_than_small_ones():
    # Lanes between walls of 1 m: one of 1 m, one of 3 m, one of 12 m.
    walls = [Obstacle(polygon=[(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 20.0), (x, 20.0)]) for x in (0.0, 2.0, 6.0, 19.0)]
    sizes = [[Size("s", count=9, footprint=Footprint.disc(radius))] for radius in (0.2, 1.0, 3.0, 7.0)]
    classes = [BodyClass(str(number), size) for number, size in enumerate(sizes)]
    problem = Problem(Domain((20.0, 20.0)), classes, avoid_overlap=True, obstacles=walls)
    # As widths of lanes; in the last one large discs leave the corners.
    between = Room(problem)
    room = [16.0 * between.share(number) for number in range(4)]
    assert room[:3] == pytest.approx([16.0, 15.0, 12.0 - (4.0 - np.pi) * 9.0 / 20.0], abs=0.4) and room[3] == 0.0
    assert 16.0 * between.share(2, 1.0 / 3.0) == pytest.approx(15.0, abs=0.4)
    free = Problem(Domain((20.0, 20.0)), [BodyClass("a", sizes[0], np.eye(2))], avoid_overlap=True)
    assert Room(free).share(0) == 1.0


@pytest.mark.parametrize(("side", "most"), [(5.0, 16), (7.0, 34), (10.0, 73)])
def test_what_lies_inside_of_the_edges_wholly_covers_less(side, most):
    domain = Domain((side, side), inset=True)
    covering = BodyClass("a", [Size("s", 1.0, share=1.0)], count="cover")
    problem = Problem(domain, [covering], avoid_overlap=True)
    assert problem.body_count == most and cover_of(problem).warning is None
    crowd = BodyClass("a", [Size("s", 1.0, most + 5)])
    assert "at most about" in cover_of(Problem(domain, [crowd], avoid_overlap=True)).warning
    assert Problem(Domain((side, side)), [covering], avoid_overlap=True).body_count > most


def test_what_is_to_cover_the_ground_and_may_overlap_is_not_told_that_it_cannot_fit():
    sizes = [Size("s", 1.0, share=1.0)]
    covering, counted = BodyClass("a", sizes, count="cover"), BodyClass("a", sizes, count=101)
    notes = [
        solve(
            Problem(Domain((10.0, 10.0)), [c, BodyClass("b", [Size("s", 1.0, 5)])]), device="cpu", max_steps=3
        ).report.notes
        for c in (covering, counted)
    ]
    assert [any("cannot fit" in note for note in some) for some in notes] == [False, True]


@pytest.mark.parametrize("inks", [False, True])
def test_classes_that_are_to_cover_more_than_the_ground_together_are_told_so_unless_they_are_inks(inks):
    sizes, balance = [Size("s", 1.0)], Balance(non_overlap=np.eye(12)) if inks else Balance()
    classes = [BodyClass(str(k), sizes, 0.125, "cover") for k in range(12)]
    report = solve(Problem(Domain((20.0, 20.0)), classes, balance), device="cpu", max_steps=3).report
    assert report.covered == pytest.approx(1.5, abs=0.02)
    told = [note for note in report.notes if "cannot fit without overlap; lower the densities" in note]
    assert len(told) == (not inks) and str(report).startswith("the footprints add up to 150%") == (not inks)


@pytest.mark.parametrize(("density", "beside", "covering"), [(1.0, 40, 42), (0.3, 40, 30), (0.3, 70, 12)])
def test_bodies_that_cover_the_ground_make_room_for_classes_whose_counts_are_given(density, beside, covering):
    sizes = [Size("s", 1.0, share=1.0)]
    classes = [BodyClass("a", sizes, density, "cover"), BodyClass("b", [Size("s", 1.0, beside)])]
    problem = Problem(Domain((10.0, 10.0)), classes, avoid_overlap=True)
    assert [c.body_count for c in problem.classes] == [covering, beside]
    assert not cover_of(problem).too_much
    assert Problem(problem.domain, problem.classes, seed=1, avoid_overlap=True).classes[0].body_count == covering
    with pytest.raises(ProblemError, match="take all that fits"):
        Problem(Domain((10.0, 10.0)), [classes[0], BodyClass("b", [Size("s", 1.0, 82)])], avoid_overlap=True)
