"""The direct summation of the benchmarks against the engine's float64 reference and the paper's scheme."""

from pathlib import Path

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.field.direct_sum import direct_field
from esh.engine.field.field_targets import FieldTarget
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.space.space import Space

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


@pytest.fixture
def direct_summation(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import direct_summation

    return direct_summation


def two_classes():
    image = np.random.default_rng(3).random((6, 9)).astype(np.float32)
    sizes = [Size("s", 1.0, 200), Size("l", 3.0, 60)]
    classes = [BodyClass("a", sizes, image), BodyClass("b", [Size("s", 1.0, 150)])]
    return Problem(Domain((30.0, 20.0)), classes, Balance(0.5, size_emphasis=2.0))


def reference(sums, position, targets):
    return direct_field(
        position,
        space=Space(tuple(sums.size)),
        interaction=sums.groups.matrix,
        targets=targets,
        charge=sums.charge,
        charge_group=sums.group,
        # Charges are points, as in the paper.
        blur=0.1,
        variance=lambda at: np.zeros(len(at)),
    )


@pytest.mark.parametrize(("double", "accuracy"), [(True, 1e-12), (False, 3e-4)], ids=["float64", "float32"])
def test_repulsion_is_the_direct_sum(direct_summation, launcher, double, accuracy):
    sums = direct_summation.DirectSummation(two_classes(), launcher, double)
    position = np.random.default_rng(0).random((sums.count, 2)) * sums.size
    # Two bodies in one place must not push each other anywhere.
    position[1] = position[0]
    expected = reference(sums, position, [FieldTarget(np.ones((1, 1)), 0.0)] * sums.groups.count)
    error = np.abs(sums.repulsion(position) - expected).max()
    assert error < accuracy * np.sqrt((expected**2).sum(axis=1).mean())


def test_attraction_is_the_direct_sum_off_the_border(direct_summation, launcher):
    sums = direct_summation.DirectSummation(two_classes(), launcher)
    # At the border the density ends, which bilinear interpolation blurs by a node.
    position = np.random.default_rng(1).random((sums.count, 2)) * (sums.size - 4.0) + 2.0
    images = [sums.problem.classes[c].density_image for c in sums.groups.class_index]
    charge = np.bincount(sums.group, weights=sums.charge)
    pulled = [FieldTarget(image, total) for image, total in zip(images, charge, strict=True)]
    pushed_only = [FieldTarget(image, 0.0) for image in images]
    expected = reference(sums, position, pulled) - reference(sums, position, pushed_only)
    force, density = sums.attraction(position)
    assert np.sqrt(((force - expected) ** 2).mean() / (expected**2).mean()) < 0.01
    assert np.all(density > 0.0)


def test_both_step_lengths_even_out_what_is_placed(direct_summation, launcher):
    domain = Domain((8.0, 8.0))
    problem = Problem(domain, [BodyClass("a", [Size("s", 0.01, 400)])])
    uniform = np.ones((1, 1), np.float32)
    for paper_step, steps in ((False, 60), (True, 200)):
        start, end = (
            direct_summation.direct_solve(problem, launcher, steps=count, paper_step=paper_step) for count in (0, steps)
        )
        before, after = (coverage_error(at, np.ones(400), uniform, domain, 1.0) for at in (start, end))
        assert after < 0.25 * before
