"""A closed mesh that is inside out is noticed; what is open, and the inner wall of a hollow body, is not taken for one."""

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

import esh  # noqa: E402
from esh.engine.quality.measurement import INWARDS  # noqa: E402

BALL = trimesh.creation.icosphere(subdivisions=2)
OUT, IN = BALL.faces, BALL.faces[:, ::-1]


def ball(faces, size=1.0, x=0.0):
    return esh.SurfaceMesh(size * BALL.vertices + (x, 0.0, 0.0), faces)


@pytest.mark.parametrize(
    ("meshes", "expected"),
    [
        ([ball(OUT)], False),
        ([ball(IN)], True),
        ([ball(IN, x=1e4)], True),
        ([ball(IN[:-1])], False),
        ([ball(OUT), ball(IN, 0.8)], False),
        ([ball(OUT), ball(IN, x=3.0)], True),
        ([ball(IN), ball(OUT, 0.8)], True),
        ([ball(np.concatenate([OUT, IN]))], False),
        ([ball(np.where(np.arange(len(OUT))[:, None] % 3 == 0, IN, OUT))], False),
    ],
)
def test_a_mesh_that_is_inside_out_is_told_from_others(meshes, expected):
    assert esh.Surface(meshes).looks_inwards == expected


@pytest.mark.parametrize("faces", [OUT, IN])
def test_the_report_says_so(faces):
    problem = esh.Problem(esh.Surface(ball(faces)), [esh.BodyClass("moss", [esh.Size("tuft", 0.01, 60)])])
    assert (INWARDS in esh.solve(problem, device="cpu", max_steps=2).report.notes) == (faces is IN)
