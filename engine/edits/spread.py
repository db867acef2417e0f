"""Points spread evenly over densities, over each by themselves: where an edit takes bodies out, and where it sets new ones down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from ..descent.descent import Descent
from ..descent.final_placement import position_on_device
from ..device.launcher import Launcher
from ..model.model import Model
from ..motion.forces import FieldSettings
from ..problem.balance import Balance
from ..problem.domain import Domain
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.size import Size
from ..space.part import Part
from . import kernels_edit
from .few_points import few_points, with_strays_back

__all__ = ["Spreading", "spread_points"]

# Not many: what follows moves them once more. With 16, errors after an edit are larger by 0.03.
STEPS = 24
# A coarse mesh will do for what attracts points.
FEWEST_NODES = 2**14
# Fewer than the first number are spread by :func:`~.few_points.few_points`; of fewer than the second some may be strays.
FEW, MANY = 10, 500
# Fewer than these are spread as if a natural border was a mirror. More would stand in a row along it.
FEW_AT_BORDER = 100
# Density over the largest that is there everywhere: points may leave where there is none, and nobody has to look for the way back.
LEAST = 1e-7


def spread_points(
    launcher: Launcher,
    domain: Domain,
    densities: Sequence[np.ndarray],
    counts: Sequence[int],
    seed: int,
    part: Part | None = None,
) -> Callable[[], list[wp.array]]:
    """Begin to spread points, for arguments see :class:`Spreading`; return what returns them, see :meth:`Spreading.points`."""
    # A descent holds charges near a natural border. Not many points, far from each other, would hardly move within a tenth of the
    # domain, and one that is pushed there would not come back. Mirrors leave what is even even, too.
    enough = FEW_AT_BORDER if part is None and domain.natural else FEW
    whole = part or Part()
    origin, extent = whole.origin(domain.size), whole.extent(domain.size)

    def spread(within: Domain, least: int, below: float) -> Spreading:
        return Spreading(launcher, within, densities, [n if least <= n < below else 0 for n in counts], seed, part)

    many, some = spread(domain, enough, np.inf), spread(replace(domain, boundary="mirror"), FEW, enough)

    def point(k: int, found: wp.array) -> wp.array:
        density, count = densities[k], counts[k]
        if 0 < count < FEW:
            return launcher.own_array(few_points(density, count, extent, seed + k) + origin, wp.vec2d)
        if not FEW <= count < MANY or not density.any():
            return found
        given = found.numpy() - origin
        back = with_strays_back(density, given, extent)
        return found if back is given else launcher.own_array(back + origin, wp.vec2d)

    def points() -> list[wp.array]:
        pairs = zip(many.points(), some.points(), counts, strict=True)
        return [point(k, a if count >= enough else b) for k, (a, b, count) in enumerate(pairs)]

    return points


class Spreading:
    """Points that are being spread evenly over densities, over each by themselves: who comes does so where nobody goes.

    A GPU spreads them while the processor goes on, until somebody asks where they are.

    Args:
        launcher: Where to run.
        domain: Where.
        densities: Over the domain, or a part of it, each of shape ``[rows, columns]``, row 0 at the bottom.
        counts: How many points for each.
        seed: Decides what is random.
        part: That part; None for all of the domain.
    """

    def __init__(
        self,
        launcher: Launcher,
        domain: Domain,
        densities: Sequence[np.ndarray],
        counts: Sequence[int],
        seed: int,
        part: Part | None = None,
    ) -> None:
        self._launcher, self._counts = launcher, counts
        self._origin = (0.0, 0.0)
        if part is not None:
            self._origin, domain = part.origin(domain.size), Domain(part.extent(domain.size))
        self._asked = [i for i, count in enumerate(counts) if count > 0]
        self._descent: Descent | None = None
        if not self._asked:
            return
        classes = [PreparedClass(str(i), (Size("point", 1.0, counts[i]),), _image(densities[i])) for i in self._asked]
        # Points have no outlines that could lie inside.
        domain = replace(domain, inset=False)
        model = Model(Problem(domain, classes, Balance(class_separation=0.0), seed=seed))
        self._descent = Descent(
            model, launcher, field_settings=FieldSettings(fewest_nodes=FEWEST_NODES), whole_numbers=False
        )
        if model.body_count > 1:
            self._descent.step.play(STEPS)

    def points(self) -> list[wp.array]:
        """Return the points [m] of each density, ``wp.vec2d``, shape ``[count]``; once. Nobody waits for them."""
        result = [self._launcher.empty(0, wp.vec2d) for _ in self._counts]
        descent, self._descent = self._descent, None
        if descent is None:
            return result
        position = position_on_device(descent.model, descent.state, self._launcher)
        if self._origin != (0.0, 0.0):
            self._launcher.launch(kernels_edit.shift_points, len(position), [wp.vec2d(*self._origin)], [position])
        self._launcher.release(descent.step)
        # Bodies are in the order of their classes.
        ends = np.cumsum([self._counts[i] for i in self._asked]).tolist()
        for i, end in zip(self._asked, ends, strict=True):
            result[i] = position[end - self._counts[i] : end]
        return result


def _image(density: np.ndarray) -> np.ndarray:
    """A density with row 0 at the top, above 0 everywhere; the same everywhere where nothing is left of it."""
    largest = float(density.max())
    if not largest > 0.0:
        return np.ones((1, 1), np.float32)
    # Over the largest, so that what is faint does not add up to 0.
    return np.maximum(np.ascontiguousarray(density[::-1] / largest, dtype=np.float32), np.float32(LEAST))
