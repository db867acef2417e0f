"""The forest: its parts, its own checks, and a whole run at low render settings."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCENES = Path(__file__).parents[2] / "demo_scenes"


@pytest.fixture
def forest(module):
    pytest.importorskip("bpy")
    return module("forest")


class TestTerrain:
    def test_points_of_the_elevation_model_keep_their_heights(self, module):
        land = module("terrain")
        terrain = land.load_terrain()
        with np.load(land.ELEVATION_FILE, allow_pickle=False) as data:
            elevation = data["elevation"].astype(float)
        (row, column), (rows, columns) = land.CROP_START, land.CROP_SHAPE
        cut = elevation[row : row + rows, column : column + columns]
        x = np.linspace(-0.5, 0.5, columns) * terrain.size[0]
        y = np.linspace(0.5, -0.5, rows) * terrain.size[1]
        at_x, at_y = np.meshgrid(x, y)
        height = terrain.height_at(at_x.ravel(), at_y.ravel()).reshape(cut.shape)
        # Only the roughness of a few decimeters may lie between.
        assert np.abs(height - (cut - cut.min()) / land.SHRINK).max() < 2.5

    def test_faces_look_up_and_span_the_rectangle(self, module):
        terrain = module("terrain").load_terrain()
        vertex, face = terrain.faces()
        a, b, _, d = vertex[face].transpose(1, 0, 2)
        assert (np.cross(b - a, d - a)[:, 2] > 0).all()
        assert np.ptp(vertex[:, :2], axis=0) == pytest.approx(terrain.size)

    def test_backdrop_meets_the_ground_at_its_rim(self, module):
        land = module("terrain")
        terrain, (vertex, face) = land.load_terrain(), land.load_backdrop()
        half = np.array(terrain.size) / 2
        used = vertex[np.unique(face)]
        assert not (np.abs(used[:, :2]) < half - 1e-6).all(axis=1).any(), "the backdrop reaches under the ground"
        on_rim = (np.abs(used[:, :2]) < half + 1e-6).all(axis=1)
        assert on_rim.sum() > 100
        rim = used[on_rim]
        assert np.abs(rim[:, 2] - terrain.height_at(rim[:, 0], rim[:, 1])).max() < 0.3

    def test_pines_stand_higher_and_steeper_than_beeches(self, module):
        land = module("terrain")
        terrain = land.load_terrain()
        texture = land.density_textures(terrain)
        for field in (terrain.height, terrain.slope()):
            pine, beech = (np.average(field, weights=texture[kind]) for kind in ("pine", "beech"))
            assert pine > beech

    def test_a_clearing_is_black_in_both_textures(self, module):
        land = module("terrain")
        terrain = land.load_terrain()
        x, y = np.meshgrid(terrain.x, terrain.y)
        inside = np.hypot(x - 40.0, y + 30.0) < 15.0
        for texture in land.density_textures(terrain, ((40.0, -30.0, 20.0),)).values():
            assert texture.min() >= 0.0 and texture.max() <= 1.0
            assert not texture[inside].any() and texture.any()


class TestTrees:
    @pytest.mark.parametrize("kind", ["pine", "beech"])
    def test_a_tree_has_its_height_reach_and_roots(self, module, kind):
        trees = module("trees")
        tree = trees.pine(20.0, 3.0, 20, 1) if kind == "pine" else trees.beech(15.0, 3.0, 9, 3000, 1)
        height = 20.0 if kind == "pine" else 15.0
        assert np.isfinite(tree.vertex).all()
        assert tree.vertex[:, 2].max() == pytest.approx(height)
        assert tree.vertex[:, 2].min() == pytest.approx(-trees.ROOT_DEPTH, abs=0.05)
        reach = np.hypot(tree.vertex[:, 0], tree.vertex[:, 1])
        assert 0.95 * 3.0 < np.percentile(reach, 99.5) < reach.max() < 1.2 * 3.0
        assert reach[tree.vertex[:, 2] < 0.0].max() < 3 * tree.trunk_radius

    def test_every_face_has_an_area_a_tint_and_a_material(self, module):
        trees = module("trees")
        for tree in (
            trees.pine(10, 2, 12, 3),
            trees.beech(9, 2.5, 6, 900, 3),
            trees.boulder(1, 3),
            trees.grass_tuft(1, 9, 3),
        ):
            a, b, c = tree.vertex[tree.face].transpose(1, 0, 2)
            assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0
            assert len(tree.tint) == len(tree.material) == len(tree.face)
            assert set(tree.material) <= {0, 1}
            assert tree.face.max() == len(tree.vertex) - 1

    def test_seeds_give_different_trees_and_the_same_twice(self, module):
        trees = module("trees")
        first, again, other = (trees.pine(10.0, 2.0, 10, seed).vertex for seed in (1, 1, 2))
        assert np.array_equal(first, again)
        assert first.shape != other.shape or not np.array_equal(first, other)


class TestChecks:
    """The scene's own checks find what they are there for."""

    def test_two_trunks_in_one_another_are_found(self, forest):
        place = np.array([[0.0, 0.0], [0.4, 0.0], [50.0, 0.0]])
        with pytest.raises(AssertionError, match="trunks"):
            forest._check_spacing(place, np.full(3, 0.1), np.full(3, 0.3))

    def test_a_tree_in_a_crown_is_found(self, forest):
        with pytest.raises(AssertionError, match="stands in another"):
            forest._check_spacing(np.array([[0.0, 0.0], [2.0, 0.0]]), np.full(2, 4.0), np.full(2, 0.3))

    def test_a_tree_on_black_and_a_texture_ignored_are_found(self, forest):
        terrain = forest.land.Terrain(np.zeros((130, 130)), (260.0, 260.0))
        texture = np.zeros((130, 130))
        texture[:, :65] = 255.0
        rng = np.random.default_rng(1)
        place = rng.uniform(-129.0, [-2.0, 129.0], (4000, 2))
        assert forest._check_texture("pine", texture, place, np.ones(4000), terrain) > 0.8
        with pytest.raises(AssertionError, match="black"):
            forest._check_texture("pine", texture, -place, np.ones(4000), terrain)
        with pytest.raises(AssertionError, match="not to be recognized"):
            forest._check_texture("pine", np.maximum(texture, 1.0), -place, np.ones(4000), terrain)


@pytest.mark.slow
def test_the_whole_scene_runs_and_checks_itself(tmp_path):
    pytest.importorskip("bpy")
    from PIL import Image

    command = [sys.executable, str(SCENES / "forest.py"), "--output", str(tmp_path), "--width", "192", "--samples", "2"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-2000:]
    assert "all checks passed" in run.stdout
    for word in ("asked", "placed", "overlaps", "coverage error"):
        assert word in run.stdout, "the report is not printed"
    picture = np.asarray(Image.open(tmp_path / "forest.png").convert("RGB"), float)
    assert picture.shape == (108, 192, 3)
    assert picture.std() > 15.0, "the picture is blank"
    assert Image.open(tmp_path / "forest-plan.png").size[0] > 800

    # Another process finds the instances in the file when nothing else of the run is left.
    (tmp_path / "forest-pine.png").unlink()
    script = (
        "import bpy, json, sys, collections\n"
        "bpy.ops.wm.open_mainfile(filepath=sys.argv[1])\n"
        "graph = bpy.context.evaluated_depsgraph_get()\n"
        "names = [i.object.name.rsplit(' ', 1)[0] for i in graph.object_instances if i.is_instance]\n"
        "image = next(i for i in bpy.data.images if 'pine' in i.name)\n"
        "brightest = max(value for i, value in enumerate(image.pixels[:]) if i % 4 < 3)\n"
        "print('FOUND', json.dumps([collections.Counter(names), brightest]))\n"
    )
    reopened = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "forest.blend")],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    line = next(line for line in reopened.stdout.splitlines() if line.startswith("FOUND"))
    counts, brightest = json.loads(line.removeprefix("FOUND "))
    assert sum(counts.values()) >= 3000
    assert {"pine large", "pine small", "beech large", "beech small"} <= set(counts)
    assert 0.9 < brightest <= 1.0, "the texture is not packed"
