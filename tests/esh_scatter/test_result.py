"""Rotations lean by the strength asked for, whatever the turn."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.surface.instances import body_rotations, rotate  # noqa: E402
from mathutils import Quaternion, Vector  # noqa: E402


@pytest.mark.parametrize("strength", [0.0, 0.4, 1.0])
def test_up_leans_towards_the_normal_by_its_share(strength):
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(50, 3))
    normal[:, 2] = np.abs(normal[:, 2])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for q, n in zip(body_rotations(normal, strength, rng.uniform(0, 6, 50)), normal, strict=True):
        up = Quaternion(q) @ Vector((0, 0, 1))
        assert up.angle(Vector((0, 0, 1))) == pytest.approx(strength * np.arccos(n[2]), abs=1e-3)
        assert abs(n[0] * up.y - n[1] * up.x) < 1e-6, "it leans towards the normal, not aside"


def test_turn_is_about_the_body_s_own_axis():
    side = Quaternion(body_rotations(np.array([[0.0, 0.0, 1.0]]), 1.0, np.array([0.5]))[0]) @ Vector((1, 0, 0))
    assert np.arctan2(side.y, side.x) == pytest.approx(0.5)


def test_vectors_turn_as_blender_turns_them():
    rng = np.random.default_rng(1)
    quaternion = rng.normal(size=(20, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    vector = rng.normal(size=(20, 3))
    expected = [Quaternion(q) @ Vector(v) for q, v in zip(quaternion, vector, strict=True)]
    np.testing.assert_allclose(rotate(quaternion, vector), expected, atol=1e-6)
