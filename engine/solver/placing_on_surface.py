"""Placing on a surface: a start for rare bodies, and edits."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import ClassVar

import numpy as np

from ..descent.surface_descent import SurfaceDescent
from ..descent.surface_least_spacing import keep_least_spacing
from ..descent.surface_placement import points_of
from ..device.launcher import Launcher
from ..edits.surface_edit import carry_over_on_surface
from ..edits.surface_settling import settle_on_surface
from ..edits.surface_spreading import SpreadingOnSurface
from ..errors import ProblemError
from ..heat.heat_mesh import HeatMeshes
from ..model.carried_over import CarriedOver
from ..model.model import Model
from ..model.state import StateArrays, SurfaceState
from ..model.surface_places import PlacesOnSurface, spots_of_places
from ..problem.problem import Problem
from .placing import EditedBodies, GivenPlaces, Placing
from .surface_rare_start import rare_start_on_surface

__all__ = ["PlacingOnSurface"]


class PlacingOnSurface(Placing[SurfaceDescent]):
    """Places bodies on a surface."""

    STATE: ClassVar[type[StateArrays]] = SurfaceState

    def __init__(self, model: Model, launcher: Launcher) -> None:
        super().__init__(model, launcher)
        self._spreading = SpreadingOnSurface()

    def new_descent(self) -> SurfaceDescent:
        """A descent of the model whose bodies are where they start."""
        return SurfaceDescent(self.model, self.launcher)

    def start(self, *, afresh: bool) -> None:
        """Make a descent. Rare classes are spread first, if bodies start afresh."""
        start = rare_start_on_surface(self.launcher, self.model.problem) if afresh else None
        self._descent = SurfaceDescent(self.model, self.launcher, start)

    def start_at(self, places: GivenPlaces) -> None:
        """Make a descent whose bodies are at places."""
        self.let_go()
        n, position, triangle, barycentric = self.model.body_count, places.position, places.triangle, places.barycentric
        known = PlacesOnSurface(
            position,
            np.zeros(n, np.int64),
            np.full(n, -1) if triangle is None or barycentric is None else triangle,
            np.zeros((n, 3)) if barycentric is None else barycentric,
        )

        def start(new: SurfaceDescent) -> None:
            spots = spots_of_places(self.launcher, new.facets, known, "`position`")
            new.put_at(spots, places.angle, places.length)

        self._descent = SurfaceDescent(self.model, self.launcher, start)

    def edit(self, problem: Problem) -> EditedBodies:
        """Make the model and the descent of another problem on the same surface, with the bodies that are there."""
        before, before_edit, old = self.model, self.descent, self.descent.state
        model = Model(problem, unit=before.unit)
        self._name_fixed(model)
        points = points_of(self.launcher, before_edit.facets, old)
        rng = self._randomness(problem)
        made: list[tuple[CarriedOver, np.ndarray]] = []

        def start(new: SurfaceDescent) -> None:
            carried, spots = carry_over_on_surface(
                before, points, model, new.facets, new.share, self.next_identity, rng, self._spreading
            )
            model.carry(before, carried)
            made.append((carried, new.take_over(carried.source, spots, before, old)))

        descent = SurfaceDescent(model, self.launcher, start, before_edit)
        # Not before: what is refused leaves the solver as it is.
        self._take(model, descent)
        carried, stood = made[0]
        added, removed = model.body.identity[carried.source < 0], before.body.identity[carried.gone]
        return EditedBodies(added, removed, partial(settle_on_surface, descent, stood, carried.left))

    def check_domain(self, problem: Problem) -> None:
        """Raise ProblemError if an edit changes the surface."""
        if problem.domain is not self.model.problem.domain:
            raise ProblemError("`domain` must stay the same Surface in an edit; got another one")

    def keep_least_spacing(self, go_on: Callable[[], bool] | None) -> None:
        """Part bodies of a class that are too close, before outlines are parted."""
        keep_least_spacing(self.descent, go_on)

    @property
    def heat(self) -> HeatMeshes | None:
        """Meshes for smoothing along the surface, which the report can use again."""
        return self.descent.heat
