"""Pairs of bodies on a surface that forces have left closer together than any should be are pushed apart.

Across a crease bodies see each other in straight lines, and not as far apart as they are along the surface: a few pairs of thousands
end up at .7 spacings. They are pushed apart along the surface, and so is whoever comes too close by that, until all keep a least
spacing.

Measured with 4,096 bodies on Suzanne's 968 triangles and five seeds, before and after: smallest spacings .70 and .78, coverage errors
at 1 spacing .0049 and .0050. Forces that are as strong so near, in every step, cost more: errors are .0054.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..contact.contact import contact_radii
from ..contact.surface_contact import SurfaceContact
from ..model.model import Model
from ..problem.of_bodies import of_all
from .surface_descent import SurfaceDescent

__all__ = ["keep_least_spacing"]

# Between nearest bodies in a hexagonal lattice of one body per square unit.
HEXAGONAL = math.sqrt(2.0 / math.sqrt(3.0))
# Over this, by regularity: a little less than the smallest spacings on a sphere, where no pair is to be pushed.
REGULARITIES, LEAST_SPACINGS = (0.0, 0.3, 0.6), (0.55, 0.70, 0.78)
# So often all are pushed for a few rounds, and sorted anew, at most.
MOST_PUSHES = 12


def keep_least_spacing(descent: SurfaceDescent, go_on: Callable[[], bool] | None = None) -> None:
    """Push bodies apart that are closer than any should be, where a class of alike bodies is spread evenly over all of a surface.

    Others stand as close as their densities let them, and footprints that reach farther than that have contact. Beside the foot of a
    part that stands on another one many bodies are a little too close, and pushing them all costs more than it is worth: errors there
    at 1 spacing rise by a twentieth, behind a wall and a carpet by a half.

    Args:
        descent: Where they are.
        go_on: Called now and then; returning False ends it.
    """
    model, charge = descent.model, descent.model.charge.charge
    alike = len(model.problem.classes) == 1 and not model.kinds and float(np.ptp(charge)) == 0.0
    stands = descent.ground.facets.relations != 0
    if not alike or stands or model.problem.classes[0].varies_on_surface:
        return
    radius = _radius(descent)
    if model.problem.avoid_overlap and (_farthest(model) > model.unit * radius).any():
        return
    contact = SurfaceContact(
        model, descent.launcher, descent.bodies, descent.ground_from_near, descent.poses, descent.motion, radius
    )
    with descent.launcher.phase("contact"):
        for _ in range(MOST_PUSHES):
            contact.push()
            if not contact.overlap_count() or (go_on is not None and not go_on()):
                break
        descent.place_charges()


def _farthest(model: Model) -> np.ndarray:
    """How far footprints reach as they keep apart [m], shape ``[body_count]``."""
    footprints = model.footprints
    outlined = footprints.circumradius * footprints.room + 0.5 * footprints.gap
    return np.where(footprints.is_outline, outlined, contact_radii(model, np.zeros(model.body_count)))


def _radius(descent: SurfaceDescent) -> np.ndarray:
    """Half of the least distance between bodies, in units, shape ``[body_count]``."""
    share, area = descent.share.sum(axis=0), descent.facets.tile_area
    density = descent.model.body_count * share.sum() / area[share > 0.0].sum()
    least = HEXAGONAL * float(np.interp(descent.model.problem.regularity, REGULARITIES, LEAST_SPACINGS))
    return of_all(0.5 * least / math.sqrt(density), descent.model.body_count)
