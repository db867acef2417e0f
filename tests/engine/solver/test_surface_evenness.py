"""How even 4,096 bodies on surfaces are after 100 steps, by code that shares nothing with the solver.

Each case is one of the table in ``docs/surfaces.md``, with a limit for every scale and both spacings.
"""

import esh
import numpy as np
import pytest
import surface_meshes as meshes
import surface_metric as metric

COUNT = 4096
SCALES = (0.5, 1.0, 2.0, 4.0)


def uniform(place):
    return np.ones(len(place))


def solved(mesh, classes, **settings):
    return esh.solve(esh.Problem(esh.Surface(esh.SurfaceMesh(*mesh)), classes, **settings), device="cpu")


def even(name, density=None):
    """A class of all bodies."""
    own = {} if density is None else {"density": lambda points: density(points.position)}
    return esh.BodyClass(name, [esh.Size("s", 1e-6, COUNT)], **own)


@pytest.mark.parametrize(
    ("make", "kind", "errors", "smallest", "mean"),
    [
        pytest.param(meshes.sphere, None, (0.025, 0.0010, 0.0002, 0.0001), 0.84, 0.94, id="sphere"),
        pytest.param(meshes.torus, None, (0.025, 0.0010, 0.0002, 0.0001), 0.84, 0.94, id="torus"),
        pytest.param(meshes.rock, None, (0.027, 0.0012, 0.0002, 0.0001), 0.82, 0.92, id="rock"),
        pytest.param(meshes.rock, meshes.gradient, (0.065, 0.0022, 0.0004, 0.0002), 0.82, 0.92, id="gradient"),
        pytest.param(meshes.square, None, (0.0285, 0.0017, 0.00022, 0.0001), 0.84, 0.94, id="square"),
        pytest.param(meshes.square, meshes.checker, (0.105, 0.0130, 0.0057, 0.0029), 0.0, 0.0, id="checker"),
    ],
)
def test_bodies_are_as_even_as_the_table_says(make, kind, errors, smallest, mean):
    mesh = make()
    density = kind(mesh[0]) if kind is meshes.gradient else kind
    placement = solved(mesh, [even("a", density)])
    measured = metric.SurfaceMetric(*mesh, COUNT)
    found = measured.coverage(placement.position, density or uniform, SCALES)
    assert (found < np.array(errors)).all(), found
    if smallest:
        asked = uniform(placement.position) if density is None else density(placement.position)
        whole = uniform if density is None else density
        total = (measured.areas * whole(measured.vertices[measured.faces].mean(axis=1))).sum()
        spacing = metric.spacing(placement.position, placement.normal, COUNT * asked / total)
        assert spacing[0] > smallest, spacing
        assert spacing[1] > mean, spacing


def test_two_classes_are_even_alone_and_together():
    mesh = meshes.torus()
    classes = [esh.BodyClass(name, [esh.Size("s", 1e-6, COUNT // 2)]) for name in "ab"]
    placement = solved(mesh, classes, balance=esh.Balance(0.5))
    together = metric.SurfaceMetric(*mesh, COUNT).coverage(placement.position, uniform, (0.5, 1.0, 2.0))
    assert (together < np.array([0.042, 0.0030, 0.0007])).all(), together
    of_class = metric.SurfaceMetric(*mesh, COUNT // 2)
    for k in range(2):
        alone = of_class.coverage(placement.position[placement.class_index == k], uniform, (0.5, 1.0, 2.0))
        assert (alone < np.array([0.040, 0.0070, 0.0020])).all(), alone
    assert metric.spacing(placement.position, placement.normal, COUNT / placement.problem.domain.area)[0] > 0.72


def test_the_forty_among_thousands_are_as_even_as_by_themselves():
    mesh = meshes.rock()
    classes = [esh.BodyClass(str(count), [esh.Size("s", 1e-6, count)]) for count in (4000, 400, 40)]
    placement = solved(mesh, classes)
    rare = placement.class_index == 2
    measured = metric.SurfaceMetric(*mesh, 400)
    assert measured.coverage(placement.position[rare], uniform, (1.0,))[0] < 0.005
    smallest, _ = metric.spacing(placement.position[rare], placement.normal[rare], 40 / placement.problem.domain.area)
    assert smallest > 0.80
