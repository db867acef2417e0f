"""The scenes on surfaces: their shapes, and their own checks on whole scenes without a picture."""

from dataclasses import replace

import numpy as np
import pytest


def volume(shape):
    vertex, face = shape
    if face.shape[1] == 4:
        face = np.concatenate([face[:, :3], face[:, [0, 2, 3]]])
    a, b, c = vertex[face].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6.0)


def test_closed_shapes_look_outwards(blender_module):
    shapes = blender_module("surface_shapes")
    assert volume(shapes.ball(4)) == pytest.approx(4.0 / 3.0 * np.pi, rel=0.02)
    assert volume(shapes.box((1.0, 2.0, 3.0))) == pytest.approx(6.0)
    assert volume(shapes.ring(0.04, 0.02, 1)) == pytest.approx(2.0 * np.pi**2 * 0.04 * 0.02**2 * 0.86, rel=0.1)
    for shape in (shapes.rock((1.0, 0.8, 0.6), 3, 4), shapes.sprinkle(0.006, 0.001), shapes.mussel(0.06, 1)):
        assert np.isfinite(shape[0]).all() and volume(shape) > 0.0
    # The hull is open above: its sides look away from its middle, and downwards at the keel.
    (vertex, face), below = shapes.hull(5.0, 1.8, 0.6, 0.6)
    a, b, c, _ = vertex[face].transpose(1, 0, 2)
    normal, middle = np.cross(b - a, c - a), vertex[face].mean(axis=1)
    assert (np.sign(normal[:, 1]) == np.sign(middle[:, 1])).mean() > 0.95
    keel = np.abs(middle[:, 1]) < 0.05
    assert np.isfinite(vertex).all() and (normal[keel & below][:, 2] <= 0.0).mean() > 0.95


@pytest.mark.parametrize("scene", ["doughnut", "boat"])
def test_a_scene_passes_its_own_checks(blender_module, monkeypatch, scene):
    surfaces = blender_module("surfaces")
    honest = surfaces.esh.scatter

    def hurried(target, classes, **options):
        """A third of the bodies, and few steps. Of fewer, each has more of the surface around it to be measured."""
        fewer = [
            replace(one, sizes=[replace(size, count=max(size.count // 3, 5)) for size in one.sizes]) for one in classes
        ]
        return honest(target, fewer, **{**options, "max_steps": 20})

    monkeypatch.setattr(surfaces.esh, "scatter", hurried, raising=False)
    scattered = surfaces.build(scene, "cpu")
    measured = surfaces.test_final(scattered)
    assert measured["placed"] > 50 and measured["overlaps"] == 0
    for one in scattered:
        height = one.result.placement.position[:, 2]
        if scene == "boat":
            # What is asked for ends a little below the water line.
            assert height.max() < 0.62 + 0.5
            assert set(np.unique(one.result.placement.mesh)) == {0}
        else:
            assert (one.result.placement.normal[:, 2] < 0.0).sum() < 0.3 * len(height)
