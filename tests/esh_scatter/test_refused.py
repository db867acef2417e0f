"""What the engine refuses is said in the words of the sidebar."""

import ast
import pickle
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.device.devices import resolve_device  # noqa: E402
from esh.engine.errors import EshError, ProblemError, Reason  # noqa: E402
from esh.engine.model import memory  # noqa: E402
from esh.engine.problem import clumps  # noqa: E402
from esh.engine.problem.balance import Balance  # noqa: E402
from esh.engine.problem.body_class import BodyClass, Unsharp  # noqa: E402
from esh.engine.problem.domain import Domain  # noqa: E402
from esh.engine.problem.fixed_bodies import FixedBodies  # noqa: E402
from esh.engine.problem.line import Line  # noqa: E402
from esh.engine.problem.obstacles import Obstacle  # noqa: E402
from esh.engine.problem.problem import Problem  # noqa: E402
from esh.engine.problem.size import Size  # noqa: E402
from esh.engine.problem.surface import Surface, SurfaceMesh  # noqa: E402
from esh.engine.solver.solver import Solver  # noqa: E402
from esh.engine.surface.chart import Chart  # noqa: E402
from esh.engine.surface.triangle_mesh import TriangleMesh  # noqa: E402
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


SQUARE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]])


def surface(corners=SQUARE):
    return Surface(SurfaceMesh(corners, [[0, 1, 2], [0, 2, 3]]))


def problem(
    *sizes, domain=(10.0, 4.0), avoid_overlap=True, fixed=(), obstacles=(), include=False, balance=None, **of_class
):
    balance = Balance() if balance is None else balance
    classes = [BodyClass("Pine", list(sizes), **of_class)]
    domain = domain if isinstance(domain, Surface) else Domain(domain)
    given = {"avoid_overlap": avoid_overlap, "fixed": fixed, "obstacles": obstacles, "include_fixed": include}
    return Problem(domain, classes, balance, **given)


def pinned(area, count=1):
    return [FixedBodies(position=np.array([[1.0, 1.0]] * count), area=area)]


def cover(density, **of_class):
    return problem(Size("s", 1.0, share=1.0), density=density, count="cover", **of_class)


def with_memory(amount, make):
    """What is made on a machine with so much memory."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (memory, clumps):
            patch.setattr(module, "machine_memory", lambda: amount)
        return make()


def check_memory(*sizes, amount=4 * 10**8, **of_class):
    return with_memory(amount, lambda: memory.check_memory(problem(*sizes, **of_class)))


def started(made):
    with Solver(made, device="cpu") as solver:
        return solver


def beside(area):
    classes = [BodyClass("Pine", [Size("s", 1.0, share=1.0)], 1.0, "cover"), BodyClass("Fir", [Size("s", area, 1)])]
    return Problem(Domain((10.0, 4.0)), classes, avoid_overlap=True)


def overflowing():
    with Solver(problem(Size("s", 0.1, 9)), device="cpu") as solver:
        solver.state.pose.fill_(float("nan"))
        solver.placement()


def standing_square():
    triangle = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    number = np.array([0, 0], np.int32)
    return TriangleMesh(
        'target "Wall"', SQUARE[:, [0, 2, 1]].copy(order="C"), triangle, triangle, number, np.zeros((0, 3), np.float32)
    )


# Where bodies can be so far only that obstacles leave a hole of 2 m.
RING = [Obstacle(polygon=np.array(corners)) for corners in (
    [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)], [(6.0, 0.0), (10.0, 0.0), (10.0, 4.0), (6.0, 4.0)]
)]  # fmt: skip
EVERYWHERE = [Obstacle(polygon=np.array([(-1.0, -1.0), (11.0, -1.0), (11.0, 11.0), (-1.0, 11.0)]))]
FINE = np.ones((3000, 3000), np.float32)

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
    Reason.DOMAIN_OUT_OF_RANGE: lambda: surface(SQUARE * 1e13),
    Reason.SURFACE_WITHOUT_AREA: lambda: surface(SQUARE * [1, 0, 0]),
    Reason.NOT_SEEN_FROM_ABOVE: lambda: Chart(standing_square()),
    Reason.MEMORY_FOR_BODIES: lambda: check_memory(Size("s", 1e-9, 10**7)),
    Reason.TOO_MANY_BODIES: lambda: with_memory(None, lambda: memory.check_memory(problem(Size("s", 1e-9, 2**31)))),
    Reason.MEMORY_FOR_GROUPS: lambda: check_memory(
        *[Size(str(n), (1e-3, 1e-2), 3000) for n in range(12)], domain=(3000.0, 1.0), amount=5 * 10**8
    ),
    Reason.MEMORY_FOR_DENSITIES: lambda: check_memory(Size("s", 1.0, 1), density=np.ones((9000, 9000), np.float32)),
    Reason.MEMORY_FOR_CLUMPS: lambda: with_memory(
        1000, lambda: problem(Size("s", 1.0, 1), clustering=1.0, clump_size=0.05)
    ),
    Reason.CLUMPS_ON_SURFACE: lambda: problem(Size("s", 1.0, 1), domain=surface(), clustering=1.0),
    Reason.SHARPENED_ON_SURFACE: lambda: problem(
        Size("s", 1.0, 1), domain=surface(), density=lambda points: np.ones(len(points.position)), unsharp=Unsharp()
    ),
    Reason.NO_DENSITY: lambda: problem(
        Size("s", 1.0, 1), domain=surface(), density=lambda points: np.zeros(len(points.position))
    ),
    Reason.DENSITY_ABOVE_ONE: lambda: cover(np.array([[0.5, 2.0]])),
    Reason.SHARPENED_TOO_MUCH: lambda: problem(Size("s", 1.0, 1), density=np.eye(9), unsharp=Unsharp(1e300, 1.0, 1.0)),
    Reason.COVER_BELOW_ONE_BODY: lambda: cover(0.001),
    Reason.COVER_BESIDE_FIXED: lambda: cover(1.0, fixed=pinned(40.0)),
    Reason.COVER_BESIDE_COUNTED: lambda: beside(39.0),
    Reason.SHARE_BELOW_ONE_BODY: lambda: problem(
        Size("Large", 9.0, share=0.01), Size("Small", 0.01, share=0.99), count=9
    ),
    Reason.OBSTACLES_EVERYWHERE: lambda: problem(Size("s", 1.0, 1), obstacles=EVERYWHERE),
    Reason.OBSTACLES_TOO_NEAR: lambda: started(problem(Size("s", 30.0, 1), obstacles=RING)),
    Reason.ALL_FIXED: lambda: problem(Size("s", 1.0, 2), fixed=pinned(1.0, 2), include=True),
    Reason.FEWER_THAN_FIXED: lambda: problem(Size("s", 1.0, 2), fixed=pinned(1.0, 3), include=True),
    Reason.FIXED_OFF_SURFACE: lambda: started(
        problem(
            Size("s", 0.1, 1), domain=surface(), fixed=[FixedBodies(position=np.array([[1.0, 1.0, 9.0]]), area=0.1)]
        )
    ),
    Reason.MIXED_TOO_MUCH: lambda: Balance(class_separation=0.9, non_overlap=[[1, 1, 0], [1, 1, 1], [0, 1, 1]]),
    Reason.FORCES_NOT_FINITE: overflowing,
    Reason.NO_SUCH_DEVICE: lambda: resolve_device("cuda:99"),
}

ENGINE = Path(__file__).resolve().parents[2] / "engine"
# Rooms that a run from the sidebar reaches.
REACHED = (
    "cascade",
    "contact",
    "descent",
    "device",
    "edits",
    "field",
    "model",
    "motion",
    "problem",
    "quality",
    "solver",
    "space",
    "surface",
    "transforms",
)
# Each of their values has a property of the sidebar that holds it in its range, or is made by Blender's side.
OF_SINGLE_VALUES = {
    f"problem/{name}.py"
    for name in (
        *(
            "color_separation",
            "fixed_bodies",
            "fixed_table",
            "footprint",
            "given_values",
            "footprints",
            "obstacles",
            "outlines_of_obstacles",
            "settings",
        ),
        *("size", "surface", "surface_density", "surface_directions", "validation"),
    )
}
# What only scripts and recipes can ask for, and how many errors say so.
OF_SCRIPTS = {
    "device/devices.py core_count": 1,
    "device/devices.py resolve_device": 2,
    "device/threads.py _bounds": 1,
    "field/field_meshes.py charge_mesh": 1,
    "problem/body_class.py BodyClass.__post_init__": 1,
    "problem/body_class.py BodyClass._with_shares": 3,
    "problem/density_correction.py correct_density": 1,
    "problem/direction_field.py direction_from_rg": 1,
    "problem/domain.py Domain.__post_init__": 1,
    "problem/feasibility.py _check_balance": 4,
    "problem/feasibility.py _check_inset": 2,
    "problem/feasibility.py _check_line_on_surface": 2,
    "problem/feasibility.py check_known_in_rectangles": 3,
    "problem/feasibility.py check_known_on_surfaces": 3,
    "problem/prepared_class.py prepare": 1,
    "problem/prepared_class.py prepare_on_surface": 1,
    "problem/problem.py Problem.__init__": 3,
    "problem/problem.py Problem._with_fixed": 2,
    "problem/problem.py Problem.rectangle": 1,
    "solver/bookmarks.py Bookmarks.check": 1,
    "solver/placing.py Placing.descent": 1,
    "solver/placing.py Placing.start_from": 1,
    "solver/placing.py Placing.check_domain": 1,
    "solver/placing_on_surface.py PlacingOnSurface.check_domain": 1,
    "solver/solver.py Solver.measured": 2,
    "solver/solver.py Solver._check_open": 1,
    "edits/given_places.py checked_places": 1,
    "edits/given_places.py checked_identities": 1,
    "model/body_flags.py checked_flags": 1,
    "model/state.py StateArrays.check": 1,
    "model/state.py StateArrays.load": 1,
}
# What Blender's side asks for by names, which these sentences say: UV maps, vertex groups, attributes.
IN_WORDS_OF_BLENDER = {
    "surface/surface_points.py SurfacePoints.attribute": 2,
    "surface/surface_points.py SurfacePoints.vectors": 1,
    "surface/surface_points.py SurfacePoints.uv": 2,
    "surface/surface_points.py SurfacePoints.vertex_group": 1,
}


def errors_without_a_refusal():
    """Where the engine makes errors whose sentences are all that is known of them, and how many; but not those of single values."""

    def count(node, name, where):
        for child in ast.iter_child_nodes(node):
            inner = isinstance(child, ast.FunctionDef | ast.ClassDef)
            own = f"{name}.{child.name}".lstrip(".") if inner else name
            if isinstance(child, ast.Call) and getattr(child.func, "id", "").endswith("Error"):
                given = [ast.unparse(argument) for argument in [*child.args[1:], *child.keywords]]
                if child.func.id in ("EshError", "ProblemError", "DeviceError") and not given:
                    found[f"{where} {own}"] += 1
            count(child, own, where)

    found = Counter()
    for room in REACHED:
        for path in sorted((ENGINE / room).rglob("*.py")):
            where = path.relative_to(ENGINE).as_posix()
            if where not in OF_SINGLE_VALUES:
                count(ast.parse(path.read_text(encoding="utf-8")), "", where)
    return dict(found)


def test_what_the_sidebar_can_meet_is_told_apart():
    assert errors_without_a_refusal() == OF_SCRIPTS | IN_WORDS_OF_BLENDER, (
        "An error that somebody can meet who sets each value of the sidebar well needs a Refusal, and words in refused.py"
    )


@pytest.mark.parametrize("reason", Reason)
def test_all_that_the_engine_tells_apart_has_words_of_the_sidebar(reason):
    with pytest.raises(EshError) as caught:
        REFUSED[reason]()
    error = caught.value
    assert error.refusal.reason is reason
    said = as_sentence(error)
    assert not said[0].islower() and not any(word in said for word in ENGINE_WORDS), said
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


def test_a_share_is_said_to_be_one_of_the_ground_not_of_the_count(empty_file):
    # "0.01 of 9 bodies" would be none of any size, small or large.
    with pytest.raises(
        ProblemError, match=r"0.01 of the area that 9 bodies take is less than one body of this size"
    ) as caught:
        REFUSED[Reason.SHARE_BELOW_ONE_BODY]()
    assert as_sentence(caught.value) == (
        'Class "Pine", size "Large": its share of the ground that the class takes is less than one of 9 objects: raise the share or '
        "the count"
    )
    kinds = bpy.context.scene.esh_scatter.add_scatter(None).add_class().bl_rna.properties["count_kind"].enum_items
    assert "share of the ground" in kinds["TOTAL"].description


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
