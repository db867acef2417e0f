"""What is worked out away from the main thread, and used again while it says the same."""

import threading

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.api import (  # noqa: E402
    EshError,
    ImageDensity,
    ScatterClass,
    ScatterJob,
    ScatterSize,
    VertexGroupDensity,
)
from esh.esh_scatter.classes import survey  # noqa: E402
from esh.esh_scatter.classes.survey import Survey  # noqa: E402
from esh.esh_scatter.densities.density_source import DensityReader  # noqa: E402

OPTIONS = {"device": "cpu", "max_steps": 5}


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_homefile(use_empty=True)


@pytest.fixture
def ground():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=10, y_subdivisions=10)
    item = bpy.context.object
    group = item.vertex_groups.new(name="here")
    for vertex in item.data.vertices:
        group.add([vertex.index], 0.5 + 0.04 * vertex.co.x, "REPLACE")
    return item


@pytest.fixture
def tree():
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(50, 0, 0))
    return bpy.context.object


def ramp():
    image = bpy.data.images.new("Ramp", 32, 32)
    pixels = np.ones((32, 32, 4), np.float32)
    pixels[..., :3] = np.linspace(0.2, 1.0, 32)[None, :, None]
    image.pixels.foreach_set(pixels.ravel())
    return image


def classes(tree, *densities):
    return [
        ScatterClass(f"class {k}", [ScatterSize("s", 40, tree)], density=density) for k, density in enumerate(densities)
    ]


def test_after_reading_nothing_is_asked_of_blender(ground, tree):
    image = ramp()
    named = classes(tree, ImageDensity(image), VertexGroupDensity("here"))
    expected = ScatterJob(ground, named, **OPTIONS)
    expected.solve()
    where = expected.instances()
    job = ScatterJob(ground, named, prepare=False, **OPTIONS)
    # What it was read from is gone, and another thread does the rest.
    bpy.data.images.remove(image)
    for item in (ground, tree):
        bpy.data.objects.remove(item)
    thread = threading.Thread(target=job.solve)
    thread.start()
    thread.join(60)
    np.testing.assert_array_equal(job.instances().position, where.position)
    np.testing.assert_array_equal(job.instances().rotation, where.rotation)


def test_what_is_wrong_with_values_is_said_when_they_are_prepared(ground, tree):
    job = ScatterJob(ground, classes(tree, np.zeros((2, 2))), prepare=False, **OPTIONS)
    with pytest.raises(EshError, match="above 0 somewhere"):
        job.prepare()
    with pytest.raises(EshError, match="above 0 somewhere"):
        ScatterJob(ground, classes(tree, np.zeros((2, 2))), **OPTIONS)


def test_only_what_changed_is_worked_out_again(ground, tree, monkeypatch):
    asked = {"chart": 0, "density": 0, "outline": 0}

    def counted(name, honest):
        def count(*arguments):
            asked[name] += 1
            return honest(*arguments)

        return count

    counting = [
        ("chart", survey, "chart_of"),
        ("density", DensityReader, "class_density"),
        ("outline", survey, "outline_of"),
    ]
    for name, owner, function in counting:
        monkeypatch.setattr(owner, function, counted(name, getattr(owner, function)))
    image, kept = ramp(), Survey()

    def prepared():
        asked.update(dict.fromkeys(asked, 0))
        densities = ImageDensity(image), VertexGroupDensity("here"), ImageDensity(image, mapping="UV")
        job = ScatterJob(ground, classes(tree, *densities), survey=kept, **OPTIONS)
        fresh = ScatterJob(ground, classes(tree, *densities), **OPTIONS)
        for mine, its in zip(job.problem.classes, fresh.problem.classes, strict=True):
            np.testing.assert_array_equal(mine.density_image, its.density_image)
        # Less what the fresh one asked for.
        return {"chart": asked["chart"] - 1, "density": asked["density"] - 3, "outline": asked["outline"] - 1}

    assert prepared() == {"chart": 1, "density": 3, "outline": 1}
    assert prepared() == {"chart": 0, "density": 0, "outline": 0}
    ground.vertex_groups["here"].add([3, 4, 5], 1.0, "REPLACE")
    assert prepared() == {"chart": 0, "density": 1, "outline": 0}
    image.pixels[4 * 100] = 1.0
    assert prepared() == {"chart": 0, "density": 2, "outline": 0}
    ground.data.uv_layers[0].uv[7].vector = (0.3, 0.3)
    ground.data.update()
    assert prepared() == {"chart": 0, "density": 1, "outline": 0}
    tree.scale.x = 2.0
    bpy.context.view_layer.update()
    assert prepared() == {"chart": 0, "density": 0, "outline": 1}
    ground.data.vertices[60].co.z = 1.0
    ground.data.update()
    assert prepared() == {"chart": 1, "density": 3, "outline": 0}


def test_a_target_that_was_moved_has_the_same_rectangle(ground, tree):
    kept = Survey()
    before = ScatterJob(ground, classes(tree, 1.0), survey=kept, **OPTIONS).problem.domain
    ground.location = (123.456, 7.89, 1.0)
    bpy.context.view_layer.update()
    assert ScatterJob(ground, classes(tree, 1.0), survey=kept, **OPTIONS).problem.domain == before
    ground.scale.x = 1.1
    bpy.context.view_layer.update()
    assert ScatterJob(ground, classes(tree, 1.0), survey=kept, **OPTIONS).problem.domain.size[0] == pytest.approx(22.0)
