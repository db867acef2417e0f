"""What tests of several rooms share."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# Surfaces are measured with what benchmarks measure them with: scripts, which are no package, and have plain names.
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))


@pytest.fixture
def overlap_count() -> Callable[..., int]:
    """Counts the pairs of discs and capsules that overlap, whatever they belong to."""
    from esh.engine.problem.body_footprints import CAPSULE, BodyFootprints
    from esh.engine.problem.body_kind import disc_radius
    from esh.engine.problem.footprint import Footprint
    from esh.engine.quality.overlaps import find_overlaps

    def count(position, area, domain, launcher, *, angle=None, length=None, width=None) -> int:
        """Position [m], area of discs [m²]; of capsules direction [rad], length of the axis and width [m], 0 for discs."""
        zero, one = np.zeros(len(position)), np.ones(len(position))
        capsule = zero > 0.0 if width is None else np.asarray(width) > 0.0
        footprints = BodyFootprints(
            (Footprint.disc(1.0),),
            np.where(capsule, CAPSULE, 0).astype(np.int32),
            disc_radius(area),
            zero,
            capsule,
            capsule,
            np.zeros(len(position), np.int32),
            one,
            zero,
        )
        given = [zero if values is None else np.asarray(values, dtype=np.float64) for values in (angle, length, width)]
        return find_overlaps(footprints, position, *given, domain, launcher).count

    return count


@pytest.fixture
def cluster() -> Iterator[Any]:
    """A Ray cluster on this machine with one processor, to which others can be added."""
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    # A machine that is lost is asked five times before it counts as such: every half a second, not every three. One that is only
    # slow has as long to answer as ever.
    settings = {"health_check_period_ms": 500}
    head = {"num_cpus": 1, "include_dashboard": False, "_system_config": settings}
    made = Cluster(initialize_head=True, head_node_args=head)
    yield made
    ray.shutdown()
    made.shutdown()
