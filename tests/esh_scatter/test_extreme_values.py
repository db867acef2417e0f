"""Numbers that neither float32 nor int32 holds, for everything that scripts can say: one sentence, or a result that is finite."""

import warnings

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.problem.look_at import LookAt  # noqa: E402
from esh.engine.problem.settings import settings_of  # noqa: E402
from esh.engine.surface.chart import RESOLUTION  # noqa: E402
from esh.esh_scatter.api import (  # noqa: E402
    AltitudeDensity,
    Amount,
    CameraDensity,
    DistanceDensity,
    EshError,
    FacingDensity,
    ImageDensity,
    InsideDensity,
    Line,
    NoiseDensity,
    ScatterClass,
    ScatterObstacle,
    ScatterSettings,
    ScatterSize,
    SlopeDensity,
    Standing,
    Unsharp,
    scatter,
)
from esh.esh_scatter.classes import lent_survey  # noqa: E402
from esh.esh_scatter.classes.survey import Survey  # noqa: E402

# All numbers are looked at before Blender hears of any.
pytestmark = [pytest.mark.once, pytest.mark.usefixtures("bare_file")]

EXTREMES = (-1e300, 1e39, 2**31, 10**30)


@pytest.fixture(autouse=True)
def small_charts(monkeypatch):
    """The ground is level and of one density: a finer chart says no more, and takes most of the time."""
    assert Survey().resolution == RESOLUTION
    monkeypatch.setattr(Survey.__init__, "__defaults__", (256,))
    # The survey that runs lend to each other is one of these, and no other test is to get it.
    lent_survey.detach()
    yield
    lent_survey.detach()


def quad(name, size):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (size, 0, 0), (size, size, 0), (0, size, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def numbers_of(cls):
    return [name for name, one in settings_of(cls).items() if one.kind in ("number", "whole")]


class Scene:
    """A ground with something to place on it, a camera and an image."""

    def __init__(self):
        self.ground, self.box = quad("Ground", 10.0), quad("Box", 0.6)
        bpy.context.scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        bpy.context.scene.collection.objects.link(bpy.context.scene.camera)
        bpy.context.scene.camera.location = (5.0, 5.0, 20.0)
        bpy.context.view_layer.update()
        self.image = bpy.data.images.new("Image", 4, 4)
        self.image.pixels = [1.0] * 64

    def scatter(self, size=None, of_class=None, **changes):
        given = {"name": "a", "count": 5, "source": self.box, **(size or {})}
        asked = ScatterClass(**{"name": "a", "sizes": [ScatterSize(**given)], **(of_class or {})})
        return scatter(self.ground, [asked], **{"device": "cpu", "max_steps": 3, **changes})

    def with_density(self, kind, name, value):
        needed = {
            DistanceDensity: {"source": self.box},
            InsideDensity: {"source": self.box},
            ImageDensity: {"image": self.image},
        }
        return self.scatter(of_class={"density": kind(**needed.get(kind, {}), **{name: value})})


# What is said with a number, and how.
ASKED = {
    **{
        f"scatter.{name}": (lambda s, v, name=name: s.scatter(**{name: v}))
        for name in numbers_of(ScatterSettings)
        if name != "max_steps"
    },
    **{
        f"standing.{name}": (lambda s, v, name=name: s.scatter(of_class={"standing": Standing(**{name: v})}))
        for name in numbers_of(Standing)
    },
    **{f"class.{name}": (lambda s, v, name=name: s.scatter(of_class={name: v})) for name in numbers_of(ScatterClass)},
    **{
        f"{kind.__name__}.{name}": (lambda s, v, kind=kind, name=name: s.with_density(kind, name, v))
        for kind in (
            AltitudeDensity,
            CameraDensity,
            DistanceDensity,
            FacingDensity,
            ImageDensity,
            InsideDensity,
            NoiseDensity,
            SlopeDensity,
        )
        for name in numbers_of(kind)
    },
    **{
        f"obstacle.{name}": (lambda s, v, name=name: s.scatter(obstacles=[ScatterObstacle(s.box, **{name: v})]))
        for name in numbers_of(ScatterObstacle)
    },
    **{
        f"amount.{name}": (lambda s, v, name=name: s.scatter({"count": None}, {"count": Amount(**{name: v})}))
        for name in ("per_area", "distance", "cover")
    },
    **{
        f"line.{name}": (lambda s, v, name=name: s.scatter({"line": Line(2.0, **{name: v})}))
        for name in numbers_of(Line)
    },
    **{
        f"unsharp.{name}": (lambda s, v, name=name: s.scatter(of_class={"unsharp": Unsharp(**{name: v})}))
        for name in numbers_of(Unsharp)
    },
    "settings.regularity of a whole surface": lambda s, v: s.scatter(surface="whole", regularity=v),
    "size.count": lambda s, v: s.scatter({"count": v}),
    "size.count of a whole surface": lambda s, v: s.scatter({"count": v}, surface="whole"),
    "size.count of discs that may overlap": lambda s, v: s.scatter({"count": v, "area": 0.3}, avoid_overlap=False),
    "size.area": lambda s, v: s.scatter({"area": v}),
    "size.area from": lambda s, v: s.scatter({"area": (v, 1.0)}),
    "size.area to": lambda s, v: s.scatter({"area": (1.0, v)}),
    "size.share": lambda s, v: s.scatter({"count": None, "share": v}, {"count": 5}),
    "size.weights": lambda s, v: s.scatter({"weights": {"Box": v}}),
    "size.line.length": lambda s, v: s.scatter({"line": Line(v)}),
    "size.distribution": lambda s, v: s.scatter({"area": (0.1, 2.0), "distribution": [v] * 5}),
    "class.count": lambda s, v: s.scatter({"count": None}, {"count": v}),
    "class.count of a whole surface": lambda s, v: s.scatter({"count": None}, {"count": v}, surface="whole"),
    "class.direction": lambda s, v: s.scatter({"line": True}, {"direction": v}),
    "class.density": lambda s, v: s.scatter(of_class={"density": v}),
    "class.color": lambda s, v: s.scatter(of_class={"color": (v, 0.0, 0.0)}),
    "class.look_at": lambda s, v: s.scatter(of_class={"look_at": LookAt((v, 0.0, 0.0))}),
    "class.gap": lambda s, v: s.scatter(of_class={"gap": v}),
    "ImageDensity.tiling": lambda s, v: s.scatter(of_class={"density": ImageDensity(s.image, tiling=(v, 1.0))}),
    "ImageDensity.offset": lambda s, v: s.scatter(of_class={"density": ImageDensity(s.image, offset=(v, 1.0))}),
    "size_emphasis": lambda s, v: s.scatter(size_emphasis=v),
    "pinned": lambda s, v: s.scatter(pinned=[v]),
}


def content_of(item):
    """All numbers of a result's points, by the names of the attributes."""
    found = {}
    for attribute in item.data.attributes:
        values = [
            getattr(entry, "vector", getattr(entry, "color", getattr(entry, "value", None))) for entry in attribute.data
        ]
        if attribute.data_type in ("FLOAT", "FLOAT_VECTOR", "FLOAT_COLOR", "QUATERNION", "INT"):
            found[attribute.name] = np.array([list(v) if hasattr(v, "__len__") else [v] for v in values], np.float64)
    return found


@pytest.mark.parametrize("asked", ASKED)
def test_what_no_number_holds_is_a_sentence_or_a_finite_result(asked):
    scene = Scene()
    before = content_of(scene.scatter().object)
    for value in EXTREMES:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            try:
                result = ASKED[asked](scene, value)
            except EshError as error:
                assert str(error) and "\n" not in str(error), (asked, value)
                left = content_of(bpy.data.objects["ESH Scatter"])
                assert left.keys() == before.keys() and all(np.array_equal(left[k], before[k]) for k in left), (
                    asked,
                    value,
                )
                continue
        assert np.isfinite(result.placement.position).all()
        before = content_of(result.object)
        assert len(before["position"]) and all(np.isfinite(values).all() for values in before.values()), (asked, value)


@pytest.mark.parametrize("seed", [2**31 - 1, 2**31, 2**63 - 1])
def test_every_seed_that_the_engine_takes_is_kept_with_the_result(seed):
    scene = Scene()
    result = scene.scatter(seed=seed, scale_jitter=0.3)
    assert int(result.object.data["esh_scatter_seed"]) == seed
    again = scene.scatter(seed=seed, scale_jitter=0.3)
    assert np.array_equal(again.placement.position, result.placement.position)


@pytest.mark.parametrize("count", [2**31, 10**12, 10**30])
@pytest.mark.parametrize("surface", ["above", "whole"])
@pytest.mark.parametrize("overlap", [True, False])
def test_counts_that_no_machine_holds_are_refused_before_anything_is_made_for_them(
    monkeypatch, count, surface, overlap
):
    scene = Scene()
    monkeypatch.setattr("esh.engine.model.memory.machine_memory", lambda: 10**11)
    with pytest.raises(EshError, match=r"is too large|cannot keep footprints apart"):
        scene.scatter({"count": count}, avoid_overlap=not overlap, surface=surface)


def test_the_counts_of_all_classes_together_are_foretold(monkeypatch):
    monkeypatch.setattr("esh.engine.model.memory.machine_memory", lambda: 10**9)
    scene = Scene()
    classes = [
        ScatterClass(name, [ScatterSize("s", count, scene.box, area=0.001)])
        for name, count in (("a", 10_000), ("b", 700_000))
    ]
    scatter(scene.ground, classes[:1], device="cpu", max_steps=1)
    with pytest.raises(EshError, match=r'of class "b" is too large \(700000\): 710000 bodies in all would take about'):
        scatter(scene.ground, classes, device="cpu", max_steps=1)


@pytest.mark.parametrize(
    "pinned",
    [float("nan"), float("inf"), 0, -1, None, np.array(3), object(), 1j, "0", [1], [-1], [0.5], [True], {0: 0}],
)
@pytest.mark.parametrize("after_another", [False, True])
def test_pinned_of_a_wrong_type_is_a_sentence(pinned, after_another):
    scene = Scene()
    if after_another:
        scene.scatter()
    with pytest.raises(
        EshError, match="`pinned` must be true, false, or for every class of the result a number from 0"
    ):
        scene.scatter(pinned=pinned)


@pytest.mark.parametrize("pinned", [True, np.False_, [0], (None,), [], np.array([0]), [0, None, None]])
def test_pinned_is_a_switch_or_numbers_of_classes(pinned):
    scene = Scene()
    scene.scatter()
    assert len(scene.scatter(pinned=pinned).placement.position) == 5
