"""The pizzas: their parts, their own checks, and a whole run of tiny pictures."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

SCENES = Path(__file__).parents[2] / "demo_scenes"
DOTS = {"ham": 0.02, "mushroom": 0.016, "salami": 0.015}
LINES = {"chilli": 0.05, "anchovy": 0.05}


@pytest.fixture
def pizza(module):
    pytest.importorskip("bpy")
    return module("pizza")


def triangles(piece):
    """Corners of every triangle, shape [n, 3, 3]."""
    face = piece.face
    if face.shape[1] == 4:
        face = np.concatenate([face[:, :3], face[:, [0, 2, 3]]])
    return piece.vertex[face]


def volume(piece):
    a, b, c = triangles(piece).transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6.0)


class TestToppings:
    @pytest.mark.parametrize("kind", [*DOTS, *LINES])
    @pytest.mark.parametrize("seed", [0, 3, 102])
    def test_a_piece_is_a_whole_body_that_lies_on_the_ground(self, module, kind, seed):
        size = {**DOTS, **LINES}[kind]
        piece = getattr(module("toppings"), kind)(size, seed)
        assert np.isfinite(piece.vertex).all()
        low, high = piece.vertex[:, 2].min(), piece.vertex[:, 2].max()
        assert -0.002 < low < 0.001 < high < 0.012
        # Faces look outwards, or the volume would be negative or next to nothing.
        box = np.ptp(piece.vertex, axis=0).prod()
        assert 0.08 * box < volume(piece) < box
        for value in piece.values.values():
            assert value.shape == (len(piece.vertex),)
            assert value.min() >= 0.0 and value.max() <= 1.0 and np.ptp(value) > 0.1
        assert set(np.unique(piece.face)) == set(range(len(piece.vertex)))

    @pytest.mark.parametrize(("kind", "radius"), DOTS.items())
    def test_a_flat_piece_fills_the_circle_that_it_is_given(self, module, kind, radius):
        toppings = module("toppings")
        for seed in range(4):
            piece = getattr(toppings, kind)(radius, seed)
            reach = np.hypot(*piece.vertex[:, :2].T).max()
            assert 0.93 * radius < reach < 1.07 * radius

    @pytest.mark.parametrize(("kind", "length"), LINES.items())
    def test_a_long_piece_is_long_enough_to_be_a_line_by_itself(self, module, kind, length):
        toppings = module("toppings")
        for seed in range(4):
            point = getattr(toppings, kind)(length, seed).vertex[:, :2]
            turned = (point - point.mean(axis=0)) @ np.linalg.svd(point - point.mean(axis=0), full_matrices=False)[2].T
            along, across = np.ptp(turned, axis=0)
            assert along > 2.5 * across
            assert 0.85 * length < along < 1.1 * length

    @pytest.mark.parametrize("kind", [*DOTS, *LINES])
    def test_seeds_give_different_pieces_and_the_same_twice(self, module, kind):
        model = getattr(module("toppings"), kind)
        first, again, other = (model(0.03, seed).vertex for seed in (1, 1, 2))
        assert np.array_equal(first, again)
        assert first.shape != other.shape or not np.allclose(first, other, atol=1e-5)

    def test_the_enclosing_circle_is_the_smallest(self, module):
        toppings = module("toppings")
        rng = np.random.default_rng(2)
        middle, radius = toppings.enclosing_circle(np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 1.0]]))
        assert middle == pytest.approx([2.0, 0.0], abs=0.01) and radius == pytest.approx(2.0, rel=1e-3)
        for _ in range(5):
            point = rng.normal(size=(200, 2)) * [3.0, 1.0] + 7.0
            middle, radius = toppings.enclosing_circle(point)
            assert np.hypot(*(point - middle).T).max() <= radius * (1 + 1e-9)
            around = middle + radius * 0.05 * rng.normal(size=(200, 2))
            others = np.hypot(*(point[None] - around[:, None]).transpose(2, 0, 1)).max(axis=1)
            assert others.min() > radius * 0.999

    def test_noise_is_smooth_without_a_mean_and_its_own_for_each_seed(self, module):
        perlin = module("toppings").perlin
        place = np.random.default_rng(0).uniform(-50, 50, (20_000, 3))
        value = perlin(place, 4)
        assert abs(value.mean()) < 0.02 and 0.15 < value.std() < 0.5 and np.abs(value).max() < 1.2
        assert np.abs(perlin(place + 1e-4, 4) - value).max() < 1e-3
        assert abs(np.corrcoef(value, perlin(place, 5))[0, 1]) < 0.05


class TestBase:
    def test_the_rim_stands_around_the_bed(self, module):
        base = module("pizza_base")
        dough, bed = base.dough(3), base.bed(3, points=90)
        r = np.hypot(*dough.vertex[:, :2].T)
        assert 0.95 * base.RADIUS < r.max() < 1.05 * base.RADIUS
        top = dough.vertex[:, 2].max()
        bed_r = np.hypot(*bed.vertex[:, :2].T)
        assert bed.vertex[bed_r < base.BED_RADIUS, 2].max() < top
        # Where ingredients may lie, the bed is above the dough.
        assert dough.vertex[r < 0.8 * base.BED_RADIUS, 2].max() < bed.vertex[bed_r < 0.8 * base.BED_RADIUS, 2].min()
        assert volume(dough) > 0

    def test_sauce_shows_between_the_cheese(self, module):
        cheese = module("pizza_base").bed(5, points=120).values["cheese"]
        assert 0.1 < (cheese < 0.3).mean() < 0.6
        assert (cheese > 0.7).mean() > 0.2

    def test_the_bed_faces_up(self, module):
        piece = module("pizza_base").bed(1, points=60)
        a, b, c = triangles(piece).transpose(1, 0, 2)
        assert (np.cross(b - a, c - a)[:, 2] > 0).mean() > 0.99


class TestTextures:
    def test_every_pizza_can_be_drawn_and_differs_from_the_others(self, module):
        textures = module("pizza_textures")
        assert len(textures.MENU) == 4
        drawn = []
        for pizza in textures.MENU:
            assert len(pizza.toppings) >= 3
            for kind, topping in pizza.toppings.items():
                assert len(topping.counts) == (2 if kind in LINES else 3)
                image = textures.draw(topping.density, 0.14, 0.13)
                assert np.isfinite(image).all() and image.min() >= 0.0 and image.max() > 0.0
            drawn.append(textures.draw(next(iter(pizza.toppings.values())).density, 0.14, 0.13))
        for i, one in enumerate(drawn):
            for other in drawn[i + 1 :]:
                assert np.corrcoef(one.ravel(), other.ravel())[0, 1] < 0.8

    def test_row_0_is_the_top(self, module):
        image = module("pizza_textures").draw(lambda x, y: y, 1.0, 1.0)
        assert image[0].mean() > 0.9 > -0.9 > image[-1].mean()

    def test_chillies_of_the_spiral_point_along_its_arms(self, module):
        textures = module("pizza_textures")
        spiral = textures.MENU[3].toppings["chilli"]
        half = 0.7
        density, angle = (textures.draw(f, half, 1.0) for f in (spiral.density, spiral.direction))
        step = 2.0 * half / textures.PIXELS
        down, right = np.gradient(np.log(np.maximum(density, 1e-9)), step)
        along = right * np.cos(angle) - down * np.sin(angle)
        x = (np.arange(textures.PIXELS) + 0.5) * step - half
        r = np.hypot(*np.meshgrid(x, -x))
        chosen = (r > 0.3) & (r < 0.65) & (density > 0.05)
        steep = chosen & (np.hypot(right, down) > 3.0)
        assert steep.sum() > 500
        assert np.median(np.abs(along[steep]) / np.hypot(right, down)[steep]) < 0.05

    def test_textures_are_black_within_reach_of_the_crust(self, pizza):
        reach = {"ham": 0.03, "mushroom": 0.02, "salami": 0.02, "chilli": 0.035, "anchovy": 0.04}
        ingredients = {
            (kind, size): pizza.Ingredient(None, 1.0, reach[kind])
            for kind, sizes in pizza.SIZES.items()
            for size in sizes
        }
        step = 2.0 * pizza.HALF / pizza.PIXELS
        edge = np.arange(pizza.PIXELS + 1) * step - pizza.HALF
        x, y = np.meshgrid(
            np.maximum(np.abs(edge[1:]), np.abs(edge[:-1])), np.maximum(np.abs(edge[1:]), np.abs(edge[:-1]))
        )
        farthest = np.hypot(x, y)
        for entry in pizza.MENU:
            for kind, image in pizza.densities(entry, ingredients).items():
                assert image.max() == 1.0
                # To the farthest corner of the pixel.
                assert farthest[image > 0].max() + reach[kind] <= pizza.base.BED_RADIUS


def square(name, x, y, half=0.01):
    corner = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * half + [x, y, 0.0]
    return name, corner, np.array([(0, 1, 2, 3)])


class TestChecks:
    """The scene's own checks find what they are there for."""

    def test_overlapping_pieces_are_found_and_near_ones_are_not(self, pizza):
        apart = [square("a", 0.0, 0.0), square("b", 0.0215, 0.0), square("c", 0.0, 0.05)]
        assert pizza.overlapping(apart) == []
        assert pizza.overlapping([*apart, square("d", 0.01, 0.06)]) == [("c", "d")]
        # One that lies wholly within another.
        assert pizza.overlapping([square("a", 0.0, 0.0), square("b", 0.001, 0.0, 0.002)]) == [("a", "b")]

    def test_a_missing_piece_is_found(self, pizza):
        menu = pizza.Pizza("Test", {"ham": SimpleNamespace(counts=(1, 2))})
        sizes = (SimpleNamespace(name="large", asked=1, placed=1), SimpleNamespace(name="small", asked=2, placed=2))
        report = SimpleNamespace(classes=(SimpleNamespace(name="ham", sizes=sizes),))
        found = ["ham large 1", "ham small 3", "ham small 1"]
        pizza._check_counts(menu, report, found)
        with pytest.raises(AssertionError, match="2 pieces of ham small asked, 2 placed, 1 in the scene"):
            pizza._check_counts(menu, report, found[:2])

    def test_a_failed_check_ends_with_a_sentence(self, pizza, monkeypatch, tmp_path):
        def fail(servings, blend):
            raise AssertionError("Test: 1 pairs of pieces overlap, first ham and salami")

        for name in ("render_plans", "render_table", "set_render", "save"):
            monkeypatch.setattr(pizza, name, lambda *arguments: None)
        monkeypatch.setattr(pizza, "build", lambda output: [])
        monkeypatch.setattr(pizza, "test_final", fail)
        with pytest.raises(SystemExit) as stopped:
            pizza.main(["--output", str(tmp_path), "--quick"])
        assert (
            stopped.value.code
            == "The pizzas are not as they should be: Test: 1 pairs of pieces overlap, first ham and salami"
        )

    def test_a_capsule_holds_its_points_tightly(self, pizza):
        rng = np.random.default_rng(1)
        point = rng.uniform(-1, 1, (3000, 2)) * [0.03, 0.004]
        axis, width = pizza.capsule_around(point)
        beyond = np.maximum(np.abs(point[:, 0]) - 0.5 * axis, 0.0)
        distance = np.hypot(beyond, point[:, 1])
        assert distance.max() <= 0.5 * width * (1 + 1e-9)
        assert axis * width + 0.25 * np.pi * width**2 < 1.35 * 0.06 * 0.008


def test_dots_of_the_densities_are_as_many_as_asked(pizza):
    half = np.zeros((pizza.PIXELS, pizza.PIXELS))
    half[:, : pizza.PIXELS // 2] = 1.0
    picture = pizza.density_picture({"ham": half, "salami": half[:, ::-1]}, {"ham": 2.0, "salami": 1.0}, 200)
    pixel = np.asarray(picture.convert("RGB"), float)[60:140]
    ham, white = 255 * np.array(pizza.COLORS["ham"]), np.full(3, 255.0)
    salami = 255 * np.array(pizza.COLORS["salami"])
    assert pixel[:, 20:90].mean(axis=(0, 1)) == pytest.approx(ham, abs=6)
    assert pixel[:, 110:180].mean(axis=(0, 1)) == pytest.approx(0.5 * (salami + white), abs=12)


@pytest.mark.slow
def test_the_whole_scene_runs_and_checks_itself(tmp_path):
    pytest.importorskip("bpy")
    from PIL import Image

    command = [sys.executable, str(SCENES / "pizza.py"), "--output", str(tmp_path), "--quick"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-2000:]
    assert "all checks passed" in run.stdout
    assert run.stdout.count(" 0 overlaps") == 4
    for name, size in (("pizza.png", (192, 120)), ("pizza-1.png", (120, 120)), ("pizza-4.png", (120, 120))):
        picture = Image.open(tmp_path / name).convert("RGB")
        assert picture.size == size
        assert np.asarray(picture, float).std() > 20.0, f"{name} is blank"
    # The middle of a pizza is far redder than it is blue; the inset is white somewhere.
    plan = np.asarray(Image.open(tmp_path / "pizza-2.png").convert("RGB"), float)
    assert plan[40:80, 40:80, 0].mean() > 1.5 * plan[40:80, 40:80, 2].mean()
    assert plan[95:, 95:].min(axis=2).max() > 240
    assert Image.open(tmp_path / "pizza-plans.png").width > 240
    assert (tmp_path / "pizza.blend").stat().st_size > 100_000
