"""What the engine refuses is said in the words of the sidebar."""

import pickle

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.errors import EshError, ProblemError, Reason  # noqa: E402
from esh.engine.problem.balance import Balance  # noqa: E402
from esh.engine.problem.body_class import BodyClass  # noqa: E402
from esh.engine.problem.domain import Domain  # noqa: E402
from esh.engine.problem.fixed_bodies import FixedBodies  # noqa: E402
from esh.engine.problem.line import Line  # noqa: E402
from esh.engine.problem.problem import Problem  # noqa: E402
from esh.engine.problem.size import Size  # noqa: E402
from esh.esh_scatter.result.refused import as_sentence  # noqa: E402

# Of scripts: names of arguments and classes, and what the engine calls things.
ENGINE_WORDS = (
    "_",
    "`",
    "domain",
    "Domain",
    "BodyClass",
    "Problem",
    "Size(",
    "got ",
    "bodies",
    "footprint",
    "line.",
    "fixed",
)


def problem(*sizes, domain=(10.0, 4.0), avoid_overlap=True, fixed=(), balance=None, **of_class):
    balance = Balance() if balance is None else balance
    classes = [BodyClass("Pine", list(sizes), **of_class)]
    return Problem(Domain(domain), classes, balance, avoid_overlap=avoid_overlap, fixed=fixed)


def pinned(area):
    return [FixedBodies(position=np.array([[1.0, 1.0]]), area=area)]


REFUSED = {
    Reason.LINE_TOO_LONG: lambda: problem(Size("s", 2.0, 1, line=Line(12.0, width=0.5))),
    Reason.LINE_TOO_SHORT: lambda: problem(Size("s", 1e-9, 1, line=Line(1e-7))),
    Reason.BODY_TOO_LONG: lambda: problem(Size("s", 1e17, 1), avoid_overlap=False),
    Reason.AREAS_TOO_DIFFERENT: lambda: problem(Size("Large", 9.0, 1), Size("Small", 1e-8, 1)),
    Reason.TOO_MUCH_GROUND: lambda: problem(Size("s", 1.0, 10_000)),
    Reason.TOO_MUCH_EMPHASIS: lambda: problem(
        Size("Large", (1e-6, 9.0), 1), balance=Balance(size_emphasis=1e6), avoid_overlap=False
    ),
    Reason.FIXED_AREA: lambda: problem(Size("s", 1e-6, 1), fixed=pinned(1e3)),
    Reason.FIXED_LENGTH: lambda: problem(Size("s", 1e10, 1), fixed=pinned(1e17), avoid_overlap=False),
    Reason.CLUMPS_TOO_SMALL: lambda: problem(Size("s", 1.0, 1), clustering=1.0, clump_size=1e-6),
    Reason.DOMAIN_TOO_NARROW: lambda: Domain((1e4, 0.5)),
    Reason.DOMAIN_OUT_OF_RANGE: lambda: Domain((1e13, 1.0)),
}


@pytest.mark.parametrize("reason", Reason)
def test_all_that_the_engine_tells_apart_has_words_of_the_sidebar(reason):
    with pytest.raises(ProblemError) as caught:
        REFUSED[reason]()
    error = caught.value
    assert error.refusal.reason is reason
    said = as_sentence(error)
    assert said[0].isupper() and not any(word in said for word in ENGINE_WORDS), said
    # Recipes may be solved in other processes.
    assert pickle.loads(pickle.dumps(error)).refusal == error.refusal


def test_a_class_is_named_by_itself_where_it_has_one_size():
    with pytest.raises(ProblemError) as caught:
        REFUSED[Reason.LINE_TOO_LONG]()
    assert as_sentence(caught.value) == (
        'Class "Pine": its objects are 12.5 m long, and the ground is only 10.0 m long: lower their Scale, or place shorter ones'
    )
    with pytest.raises(ProblemError) as caught:
        REFUSED[Reason.AREAS_TOO_DIFFERENT]()
    assert as_sentence(caught.value) == (
        'Class "Pine", size "Large": one object takes 9 m², and one of class "Pine", size "Small" only 1e-08 m²: make them more '
        "alike, or scatter one by itself"
    )


def test_names_of_settings_are_those_of_the_sidebar():
    error = EshError("`face_material`: Ground has no material; see `balance.size_emphasis` and `nothing`")
    assert as_sentence(error) == "Faces of Material: Ground has no material; see Favor Large and nothing"
    assert as_sentence("Nothing was changed") == "Nothing was changed"


def test_the_button_says_what_is_too_long_for_the_ground(empty_file):
    scene = bpy.context.scene
    items = {}
    for name, x, y in (("Ground", 4.0, 3.0), ("Pole", 5.0, 0.1)):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)], [], [(0, 1, 2, 3)])
        items[name] = bpy.data.objects.new(name, mesh)
        scene.collection.objects.link(items[name])
    made = scene.esh_scatter.add_scatter(items["Ground"])
    pole = made.add_class()
    pole.name, pole.sizes[0].source_object, pole.sizes[0].count = "Pole", items["Pole"], 1
    made.device = "CPU"
    scene.unit_settings.length_unit = "CENTIMETERS"
    with pytest.raises(
        RuntimeError, match='Class "Pole": its objects are 500 cm long, and the ground is only 400 cm long'
    ):
        bpy.ops.esh.scatter()
