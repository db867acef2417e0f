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
from esh.esh_scatter.classes import lent_survey, survey  # noqa: E402
from esh.esh_scatter.classes.survey import Survey  # noqa: E402
from esh.esh_scatter.densities.density_source import DensityReader  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")

OPTIONS = {"device": "cpu", "max_steps": 5}


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
        fresh = ScatterJob(ground, classes(tree, *densities), survey=Survey(), **OPTIONS)
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


def test_the_next_run_uses_what_the_last_one_worked_out(ground, tree, monkeypatch):
    lent_survey.detach()
    called = []
    for name in ("chart_of", "outline_of"):
        made = getattr(survey, name)
        monkeypatch.setattr(survey, name, lambda *given, made=made, name=name: called.append(name) or made(*given))
    picture = ramp()

    def run():
        job = ScatterJob(ground, classes(tree, ImageDensity(picture), 1.0), **OPTIONS)
        job.solve()
        return job.placement.position.tobytes()

    first = run()
    assert called == ["chart_of", "outline_of"]
    assert run() == first and called == ["chart_of", "outline_of"]
    # What was changed is worked out again, and comes to the same as if nothing had been there before.
    tree.data.vertices[0].co.x += 0.1
    ground.data.vertices[0].co.z += 0.5
    changed = run()
    assert called == 2 * ["chart_of", "outline_of"] and changed != first
    lent_survey.detach()
    assert run() == changed and called == 3 * ["chart_of", "outline_of"]


def test_a_survey_is_lent_to_one_at_a_time():
    lent_survey.detach()
    with lent_survey.lent_survey() as one, lent_survey.lent_survey() as other:
        assert one is not other
    with pytest.raises(ValueError, match="anything"), lent_survey.lent_survey() as again:
        assert again is one
        raise ValueError("anything")
    with lent_survey.lent_survey() as last:
        assert last is one
