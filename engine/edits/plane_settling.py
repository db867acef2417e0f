"""Bodies in a rectangle that an edit holds near where they were; see :mod:`.settling`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import warp as wp

from ..descent.descent import Descent
from ..device.launcher import Recording
from ..model.carried_over import CarriedInPlane
from ..model.model import Model
from . import kernels_plane_settling
from .settling import Held, Schedule, most_free, reach, settle

__all__ = ["settle_in_plane"]

# Width of a cell in mean spacings; who is in a cell beside one with a change is near it, which is two to four spacings.
CELL_OVER_SPACING = 2.0
# How many may move far for each that came or went, where these are many. Measured on a stroke of three times the density that takes a
# tenth of all from elsewhere: errors are 1.9 times the later ones, and four fifths of the others stay; with 4 they are 1.5 times, and
# three fifths stay. Where a density of hills becomes an even one a quarter of all go, and errors are 1.5 times the later ones; with no
# more than a fifth that is free 2.7 to 3.4.
FREE_FOR_EACH = 2.2
# Up to so many bodies settle longer, up to the second number a little. Measured on a wavy stroke over a twentieth of a ramp, an even
# density and a photograph that leaves a fifth of it, and the count as it was, by the coverage error at a spacing after 5 more steps
# over that after 100 more: with 12 steps and 2 more for all 1.33 to 1.38 for 4,096 bodies, and 1.18 to 1.27 for 10,000; as here 1.24
# to 1.31, and 1.13 to 1.24. Discs: 1.03 to 1.26. Of those far from the stroke .80 to .83 stay.
FEW_BODIES, MANY_BODIES = 5_000, 200_000
OF_FEW, OF_SOME = Schedule(24, 6, 0.203), (3, 0.203)
OF_NO_CHANGE = Schedule(0, 0, 0.2)

CORNERS = 4


def settle_in_plane(descent: Descent, carried: CarriedInPlane, before: Model, steps: int) -> None:
    """Take the steps after an edit.

    Args:
        descent: Of the bodies after it.
        carried: Who they are.
        before: The model before it.
        steps: How many to take; where nobody came, went or was moved there are no others.
    """
    if any(len(places) for places in carried.changes):
        settle(descent.launcher, descent.step, _HeldInPlane(descent, carried), steps)
    elif descent.model.acts_as(before):
        # Who has been held by an edit before is not let go by one that changes nothing, such as pinning a body where it is.
        settle(descent.launcher, descent.step, _HeldInPlane(descent, carried, OF_NO_CHANGE), steps)
    else:
        descent.step.play(steps)


def _schedule(body_count: int) -> Schedule:
    if body_count <= FEW_BODIES:
        return OF_FEW
    return Schedule.usual(body_count, *(OF_SOME if body_count <= MANY_BODIES else ()))


class _HeldInPlane(Held):
    """Those of a descent of a rectangle before its first step; ``carried`` says who they are.

    Without a change all are as near to one as others.
    """

    def __init__(self, descent: Descent, carried: CarriedInPlane, schedule: Schedule | None = None) -> None:
        model = descent.model
        self._descent = descent
        self.body_count = model.body_count
        self.schedule = schedule or _schedule(model.body_count)
        changed = max(len(carried.came), len(carried.went))
        self.most_free = most_free(self.schedule.free, model.body_count, changed, FREE_FOR_EACH)
        _, (width, height) = descent.around
        where = kernels_plane_settling.Reach()
        where.mesh, where.limit = descent.field.mesh, descent.step_limit
        where.within, where.locally = reach(width * height, model.body_count)
        start = wp.clone(descent.state.pose)
        cells = self._near(carried.changes, CELL_OVER_SPACING * math.sqrt(width * height / model.body_count))
        self._where = [start, carried.sources, cells, where, model.space.for_kernels()]
        self._owner = descent.launcher.empty(CORNERS, wp.int32)
        self._has_corners = descent.has_dots and model.space.has_edges
        if self._has_corners:
            self._leave_corners()

    def take_steps(self, step: Recording, count: int) -> None:
        """See :meth:`.Held.take_steps`."""
        if not self._has_corners:
            step.play(count)
            return
        for _ in range(count):
            step.play()
            self._leave_corners()

    def _leave_corners(self) -> None:
        """Part dots that have come to the same corner: they would feel the same forces for good, and none of each other."""
        descent, launcher = self._descent, self._descent.launcher
        self._owner.fill_(self.body_count)
        *_, where, space = self._where
        launcher.launch(
            kernels_plane_settling.claim_corners,
            self.body_count,
            [descent.state.pose, space, descent.bodies],
            [self._owner],
        )
        launcher.launch(
            kernels_plane_settling.leave_corners,
            self.body_count,
            [self._owner, where, space, descent.bodies, descent.images],
            [descent.state.pose, descent.state.displacement, descent.charge_position],
        )

    def count_moved(self, moved: wp.array) -> None:
        """See :meth:`.Held.count_moved`."""
        self._descent.launcher.launch(
            kernels_plane_settling.count_moved,
            self.body_count,
            [*self._where, self._descent.state.pose],
            [moved],
            per_thread=True,
        )

    def bring_back(self, free_from: wp.array) -> None:
        """See :meth:`.Held.bring_back`."""
        descent = self._descent
        descent.launcher.launch(
            kernels_plane_settling.bring_back,
            self.body_count,
            [*self._where, free_from, descent.bodies, descent.images, descent.state.bend],
            [descent.state.pose, descent.state.displacement, descent.charge_position],
        )
        if descent.model.kinds:
            descent.place_charges()

    def _near(self, changes: Sequence[wp.array], width: float) -> kernels_plane_settling.Cells:
        """The cells of the domain, of about this width, that are beside one with a change."""
        launcher, model = self._descent.launcher, self._descent.model
        cells = kernels_plane_settling.Cells()
        origin, size = self._descent.around
        cells.rows, cells.columns = (max(1, math.ceil(length / width)) for length in size[::-1])
        cells.origin, cells.size = wp.vec2(*origin), wp.vec2(*size)
        cells.near = launcher.empty(cells.rows * cells.columns, wp.uint8)
        marked = launcher.zeros(cells.rows * cells.columns, wp.int32)
        if not any(len(places) for places in changes):
            marked.fill_(1)
        for places in changes:
            launcher.launch(kernels_plane_settling.mark_places, len(places), [places, cells], [marked])
        space = model.space.for_kernels()
        launcher.launch(kernels_plane_settling.mark_beside, len(marked), [marked, space], [cells])
        return cells
