"""Whatever is set in the sidebar: the button places objects or says in one sentence why not."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
hypothesis = pytest.importorskip("hypothesis")

from esh.esh_scatter import registration  # noqa: E402
from hypothesis import HealthCheck, given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from sidebar_walk import KEPT, MOST

WORDS = st.sampled_from(["", "Pine", "weights", "UVMap", "nobody knows", "Ä, ö"])


def numbers(prop):
    low, high = prop.hard_min, prop.hard_max
    if prop.type == "INT":
        most = MOST if prop.identifier in ("count", "total") else min(high, 2**31 - 1)
        return st.integers(max(low, -(2**31)), most)
    near = st.floats(max(prop.soft_min, low, -1e4), min(prop.soft_max, high, 1e4), width=32)
    return st.one_of(near, near, st.sampled_from([prop.default, max(low, -1e30), min(high, 1e30), 0.0]))


@st.composite
def chosen(draw, group):
    """Values for some of the properties of a group, as what lies in lists of their own gets them by itself."""
    found = {}
    for prop in group.bl_rna.properties:
        if prop.identifier in KEPT or prop.type == "COLLECTION" or prop.is_readonly or not draw(st.booleans()):
            continue
        if prop.type == "BOOLEAN" and not prop.is_array:
            value = draw(st.booleans())
        elif prop.type == "ENUM":
            value = draw(st.sampled_from([item.identifier for item in prop.enum_items]))
        elif prop.type in ("INT", "FLOAT"):
            one = numbers(prop)
            value = [draw(one) for _ in range(prop.array_length)] if prop.is_array else draw(one)
        elif prop.type == "STRING":
            value = draw(WORDS)
        elif prop.type == "POINTER":
            value = draw(st.sampled_from([None, *things(prop.fixed_type.identifier)]))
        else:
            continue
        found[prop.identifier] = value
    return found


def things(kind):
    of_kind = {"Object": bpy.data.objects, "Collection": bpy.data.collections, "Image": bpy.data.images}
    return list(of_kind.get(kind, ()))


def put(group, values):
    for name, value in values.items():
        if name == "area_kind" and value == "RANGE":
            group.area_largest = max(group.area_largest, group.area)
        setattr(group, name, value)


def new_object(name, size, at=(0.0, 0.0, 0.0)):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (size, 0, 0), (size, 0.5 * size, 0), (0, size, 0)], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="UVMap")
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location = at
    item.vertex_groups.new(name="weights").add([0, 1], 1.0, "REPLACE")
    return item


@contextmanager
def filled_in():
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    try:
        ground = new_object("Ground", 20.0)
        new_object("Tree", 0.5, (40.0, 0.0, 0.0))
        kinds = bpy.data.collections.new("Kinds")
        bpy.context.scene.collection.children.link(kinds)
        kinds.objects.link(new_object("Reed", 0.3, (40.0, 0.0, 0.0)))
        bpy.data.images.new("Mask", 8, 8)
        made = bpy.context.scene.esh_scatter.add_scatter(ground)
        for name in ("Pine", "Beech"):
            body_class = made.add_class()
            body_class.name, body_class.sizes[0].source_object = name, bpy.data.objects["Tree"]
            body_class.sizes[0].count = 20
        made.device, made.max_steps = "CPU", 2
        yield made
    finally:
        registration.unregister()


def test_whatever_is_set_is_a_result_or_a_sentence(capfd):
    answers = {"placed": 0, "refused": 0}

    @settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(data=st.data())
    def tried(data):
        with filled_in() as scatter:
            layer = scatter.classes[0].add_layer("NOISE")
            groups = [scatter.classes[0], scatter.classes[1].sizes[0], layer, scatter.obstacles.add(), scatter]
            for number in data.draw(st.lists(st.integers(0, 4), min_size=1, max_size=3, unique=True)):
                put(groups[number], data.draw(chosen(groups[number])))
            answers[pressed(scatter)] += 1
            # Blender prints what its properties' own functions raise, and goes on.
            said = "".join(capfd.readouterr())
            assert "Traceback" not in said, said

    tried()
    print(answers)
    assert answers["placed"] > 5


def pressed(scatter):
    """Press the button; tell whether it has placed something."""
    assert isinstance(scatter.changes(), list)
    try:
        answer = bpy.ops.esh.scatter()
    except RuntimeError as error:
        # What a button reports as an error, or why it is gray.
        assert "Traceback" not in str(error), str(error)
        return "refused"
    if answer == {"CANCELLED"}:
        return "refused"
    place = np.array([vertex.co for vertex in scatter.result.data.vertices])
    assert np.isfinite(place).all() and scatter.report["steps"] <= 2
    assert isinstance(scatter.changes(), list)
    return "placed"
