"""The problem: which bodies, how many, how large, following which density, in which domain.

Conventions used in the whole engine: meters, square meters and radians; x to the right, y up; the domain is the
rectangle ``[0, size[0]] x [0, size[1]]``. A density image has shape ``[height, width]``, row 0 is its top (largest y),
and it is stretched over the whole domain whatever its resolution or aspect.

Symbols are those of the paper, Schmaltz, Gwosdek and Weickert 2012, Multi-Class (Anisotropic) Electrostatic Halftoning.
"""

from __future__ import annotations

import copy
import zlib
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from . import validation
from .balance import Balance
from .body_class import BodyClass
from .clumps import clumps_kept, with_clumps
from .domain import Domain
from .feasibility import check_feasible, check_known_in_rectangles, check_known_on_surfaces
from .fixed_bodies import FixedBodies, FixedBody
from .fixed_table import FixedTable, fixed_table
from .given_values import as_tuple, check_unique, show
from .obstacles import Obstacle
from .of_bodies import of_bodies
from .outlines_of_obstacles import outlines_of_obstacles
from .outlines_on_surface import OutlinesOnSurface
from .prepared_class import PreparedClass, beside_counted, beside_fixed, cut_out, cut_out_on_surface, prepare_all
from .settings import Settings, belongs_to, described, setting, settle, takes, values_of, with_changes
from .size import with_count
from .surface import Surface

__all__ = ["Problem", "ProblemSettings", "SamplingSettings"]


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class SamplingSettings(Settings):
    """What the engine and Blender understand alike of a whole problem, beside its classes and their balance."""

    seed: int = field(
        default=0,
        metadata=setting(
            "The same settings, seed and device give the same result. Another seed gives another result",
            low=0,
            check=validation.check_seed,
        ),
    )
    avoid_overlap: bool = field(
        default=False,
        metadata=setting(
            "Push touching footprints apart. Counts do not change. The report says how many still overlap"
        ),
    )
    regularity: float = field(
        default=0.6,
        metadata=setting(
            "How regular the pattern is. 1: as regular as possible, close to a lattice. 0: organic, without rows. Counts and "
            "densities do not change",
            unit="share",
            low=0.0,
            high=1.0,
        ),
    )


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ProblemSettings(SamplingSettings):
    """Everything that a whole problem can be told, beside what it is made of."""

    include_fixed: bool = field(
        default=False,
        metadata=setting("Whether counts include fixed bodies. By default counts are those of new bodies, beside them"),
    )


@belongs_to("problem")
@takes(ProblemSettings)
@dataclass(frozen=True, eq=False, init=False)
class Problem(ProblemSettings):
    """Everything that :func:`~esh.engine.solve.solve` needs to know.

    Args:
        domain: Where bodies are placed: a rectangle, or a :class:`~.surface.Surface`.
        classes: The classes to place, at least one :class:`BodyClass`. They are kept as :class:`PreparedClass`, with the density that
            bodies follow, and a whole count for every size.
        balance: Weights of the aims against each other.
        fixed: Bodies that are there already. They act on all others, are part of the placement, and do not move. Where there are
            already as many as the density asks for, no more bodies of their class are placed. They are kept as a
            :class:`FixedTable`, in class, then size order. A size with fixed bodies may have a ``count`` of 0.
        obstacles: Shapes that bodies stay out of. They do not change counts, only the ground that is left.
        changes: Any of the following settings, by name.

    Raises:
        ProblemError: No class, two classes of one name, a seed that is not a whole number >= 0, a balance made for another
            number of classes, a line longer than the domain, fixed bodies that do not belong to it, nothing to place, or
            obstacles that leave a class no place.
    """

    domain: Domain | Surface
    classes: tuple[PreparedClass, ...]
    balance: Balance
    fixed: FixedTable
    obstacles: tuple[Obstacle, ...]

    def __init__(
        self,
        domain: Domain | Surface,
        classes: Sequence[BodyClass | PreparedClass],
        balance: Balance | None = None,
        *,
        fixed: FixedBodies | Sequence[FixedBody | FixedBodies] = (),
        obstacles: Sequence[Obstacle] = (),
        **changes: Any,
    ) -> None:
        settings = with_changes(ProblemSettings(), changes, ("balance", "fixed", "obstacles"), "problem")
        balance = Balance() if balance is None else balance
        if not isinstance(domain, Domain | Surface):
            raise ProblemError(f"`domain` must be a Domain or a Surface; got {show(domain)}")
        if not isinstance(balance, Balance):
            raise ProblemError(f"`balance` must be a Balance; got {show(balance)}")
        classes = as_tuple(classes, (BodyClass, PreparedClass), "`classes`")
        if not classes:
            raise ProblemError("a problem must have at least one class; got none")
        check_unique([body_class.name for body_class in classes], "class names")
        obstacles = as_tuple(obstacles, Obstacle, "`obstacles`")
        bases = prepare_all(classes, domain, apart=settings.avoid_overlap)
        prepared = bases
        if isinstance(domain, Surface):
            check_known_on_surfaces(bases, obstacles)
            outlines = outlines_of_obstacles(domain, obstacles)
            settle(self, outlines_on_surface=outlines)
            if obstacles:
                prepared = tuple(cut_out_on_surface(c, domain, obstacles, outlines) for c in bases)
        else:
            check_known_in_rectangles(bases, obstacles)
            known: dict[Hashable, np.ndarray] = {}
            prepared = tuple(with_clumps(c, index, domain, settings.seed) for index, c in enumerate(bases))
            if obstacles:
                prepared = tuple(cut_out(c, domain, obstacles, known) for c in prepared)
        prepared = _sharing_images(prepared)
        settle(self, **values_of(settings, ProblemSettings))
        settle(self, domain=domain, classes=prepared, balance=balance, obstacles=obstacles)
        settle(self, fixed=fixed_table(fixed, prepared, domain))
        beside = self._beside_fixed(self._beside_counted(prepared))
        counted = [self._with_fixed(index, c) for index, c in enumerate(beside)]
        settle(self, classes=tuple(c if c is b else replace(c, base=b) for c, b in zip(counted, bases, strict=True)))
        if self.body_count == len(self.fixed.id):
            raise ProblemError(
                "a problem must have at least one body to place; all of them are fixed",
                Refusal(Reason.ALL_FIXED, self.body_count, self.body_count - 1),
            )
        check_feasible(self)

    @cached_property
    def outlines_on_surface(self) -> OutlinesOnSurface:
        """Obstacles that are outlines on the surface, of a problem that lies on one."""
        assert isinstance(self.domain, Surface)
        return outlines_of_obstacles(self.domain, self.obstacles)

    def _beside_counted(self, classes: tuple[PreparedClass, ...]) -> tuple[PreparedClass, ...]:
        """Classes of which those that are to cover the ground, without overlap, leave room for those whose counts are given."""
        covers = np.array([c.asked is not None and c.asked.count == "cover" for c in classes])
        if not self.avoid_overlap or not covers.any() or covers.all():
            return classes
        area = np.array([float(sum((size.count or 0) * size.mean_area for size in c.sizes)) for c in classes])
        kept = self.balance.classes_apart
        apart = np.ones((len(classes), len(classes)), bool) if kept is None else kept.astype(bool)
        taken = np.zeros(len(classes))
        for index in np.flatnonzero(~covers):
            makers = covers & apart[index]
            taken += area[index] * area * makers / max(float(area[makers].sum()), 1e-300)
        return tuple(
            beside_counted(c, self.domain, own) if own > 0.0 else c
            for c, own in zip(classes, taken.tolist(), strict=True)
        )

    def _beside_fixed(self, classes: tuple[PreparedClass, ...]) -> list[PreparedClass]:
        """Classes of which those that are to cover the ground, without overlap, cover what fixed bodies leave of it."""
        covers = np.array([c.asked is not None and c.asked.count == "cover" for c in classes])
        if not self.avoid_overlap or self.include_fixed or not len(self.fixed.id) or not covers.any():
            return list(classes)
        wanted = np.array([sum((size.count or 0) * size.mean_area for size in c.sizes) for c in classes])
        kept = self.balance.classes_apart
        apart = np.ones((len(classes), len(classes)), bool) if kept is None else kept.astype(bool)
        taken = np.zeros(len(classes))
        for index, area in enumerate(
            np.bincount(self.fixed.class_index, weights=self.fixed.area, minlength=len(classes))
        ):
            # A class that covers its part of the ground makes room for its own; for others, all that keep apart from them.
            makers = np.arange(len(classes)) == index if covers[index] else covers & apart[index]
            taken += area * wanted * makers / max(float(wanted[makers].sum()), 1e-300)
        return [
            beside_fixed(c, self.domain, area) if area > 0.0 else c
            for c, area in zip(classes, taken.tolist(), strict=True)
        ]

    def _with_fixed(self, index: int, body_class: PreparedClass) -> PreparedClass:
        """A class whose sizes count all of their bodies, fixed ones among them."""
        sizes = []
        for number, size in enumerate(body_class.sizes):
            fixed = self.fixed.number_of(index, number)
            key = f'`count` of size "{size.name}" of class "{body_class.name}"'
            count = size.count or 0
            if self.include_fixed and count < fixed:
                raise ProblemError(
                    f"{key} must include its {fixed} fixed bodies; got {show(count)}",
                    Refusal(Reason.FEWER_THAN_FIXED, count, fixed, body_class.called(size)),
                )
            if fixed and self.include_fixed and isinstance(size.distribution, np.ndarray):
                raise ProblemError(
                    f"{key} must not include fixed bodies where areas are listed; set `include_fixed` to false"
                )
            total = count if self.include_fixed else count + fixed
            if total < 1:
                raise ProblemError(
                    f"{key} must be a whole number of at least 1, unless bodies of it are fixed; got {show(count)}"
                )
            sizes.append(size if total == count else with_count(size, total))
        return body_class if sizes == list(body_class.sizes) else replace(body_class, sizes=tuple(sizes))

    def with_clumps_of(self, before: Problem) -> Problem:
        """Return this problem in a rectangle with clumps as large as ``before`` where their chosen size would change little."""
        kept = {c.name: c for c in before.classes}
        known: dict[Hashable, np.ndarray] = {}
        classes = list(self.classes)
        for index, own in enumerate(self.classes):
            if own.name in kept and clumps_kept(own, kept[own.name]):
                again = with_clumps(own.base or own, index, self.rectangle, self.seed, kept[own.name].clumps)
                image = (
                    cut_out(again, self.rectangle, self.obstacles, known).density_image
                    if self.obstacles
                    else again.density_image
                )
                classes[index] = replace(own, density_image=image, clumps=again.clumps)
        if all(c is own for c, own in zip(classes, self.classes, strict=True)):
            return self
        result = copy.copy(self)
        settle(result, classes=_sharing_images(classes))
        return result

    @property
    def rectangle(self) -> Domain:
        """The domain, of a problem that lies in a rectangle.

        Raises:
            ProblemError: It lies on a surface.
        """
        if not isinstance(self.domain, Domain):
            raise ProblemError("`domain` must be a rectangle for this; it is a surface")
        return self.domain

    @property
    def body_count(self) -> int:
        """Number of bodies of all classes and sizes."""
        return sum(body_class.body_count for body_class in self.classes)

    @property
    def charge_count(self) -> int:
        """Number of charges on all bodies: one on a dot, several on a line."""
        sizes = [size for body_class in self.classes for size in body_class.sizes]
        return sum((size.count or 0) * size.kind.charges for size in sizes)

    def body_indices(self) -> tuple[np.ndarray, np.ndarray]:
        """Class and size index of every body, shapes ``[body_count]``, int32, in class, then size order; for reading only."""
        sizes = [(c, s, size.count or 0) for c, k in enumerate(self.classes) for s, size in enumerate(k.sizes)]
        class_index, size_index, count = zip(*sizes, strict=True)
        return of_bodies(class_index, count, np.int32), of_bodies(size_index, count, np.int32)

    def body_areas(self) -> np.ndarray:
        """Footprint of every body [m²], shape ``[body_count]``, float64, in the same order."""
        return np.array(self.shared_areas())

    def shared_areas(self) -> np.ndarray:
        """What :meth:`body_areas` returns, for reading only: one number where all bodies have the same, see :mod:`.of_bodies`."""
        sizes = [size for k in self.classes for size in k.sizes]
        if not len(self.fixed.id) and all(size.has_one_area for size in sizes):
            return of_bodies([size.area for size in sizes], [size.count or 0 for size in sizes], np.float64)
        areas = []
        for c, k in enumerate(self.classes):
            for s, size in enumerate(k.sizes):
                if not len(self.fixed.id):
                    areas.append(size.areas([self.seed, 2, c, s]))
                    continue
                own = (self.fixed.class_index == c) & (self.fixed.size_index == s)
                new = with_count(size, (size.count or 0) - int(own.sum()))
                areas += [new.areas([self.seed, 2, c, s]), self.fixed.area[own]]
        return np.concatenate(areas)

    def areas_as_outlined(self, area: np.ndarray, variant: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Footprints of bodies that have got other outlines than those that were drawn for them, as after an edit.

        Args:
            area: What :meth:`shared_areas` returned.
            variant: Outline of every body among those of its size, shape ``[body_count]``.
            scale: Factor on it, shape ``[body_count]``.

        Returns:
            The same but for sizes that take their areas from their outlines, of which fixed bodies keep theirs.
        """
        sizes = [size for k in self.classes for size in k.sizes]
        if all(size.area is not None for size in sizes):
            return area
        result, free, begin = np.array(area), ~self.body_is_fixed(), 0
        for size in sizes:
            own = begin + np.flatnonzero(free[begin : begin + (size.count or 0)])
            begin += size.count or 0
            if size.area is None:
                outlines = np.array([outline.area for outline in size.outlines])
                result[own] = outlines[variant[own]] * scale[own] ** 2
        return result

    def body_is_fixed(self) -> np.ndarray:
        """Whether each body is fixed, shape ``[body_count]``: of every size the new ones come first."""
        if not len(self.fixed.id):
            return np.zeros(self.body_count, bool)
        result = []
        for c, k in enumerate(self.classes):
            for s, size in enumerate(k.sizes):
                fixed = self.fixed.number_of(c, s)
                result.append(np.arange(size.count or 0) >= (size.count or 0) - fixed)
        return np.concatenate(result)

    def body_ids(self) -> np.ndarray:
        """Identity of every body, shape ``[body_count]``: fixed ones have their own, all others free ones in their order."""
        taken = self.fixed.id
        if not len(taken):
            return np.arange(self.body_count, dtype=np.int32)
        first = int(taken.max(initial=-1)) + 1
        unnamed = np.flatnonzero(taken < 0)
        named = taken.copy()
        named[unnamed] = first + np.arange(len(unnamed))
        fixed = self.body_is_fixed()
        result = np.empty(self.body_count, np.int64)
        result[fixed] = named
        result[~fixed] = first + len(unnamed) + np.arange(int((~fixed).sum()))
        return result


def _sharing_images(classes: Sequence[PreparedClass]) -> tuple[PreparedClass, ...]:
    """Let classes whose densities are equal share one image, so that whatever is made of an image is made once."""
    result: list[PreparedClass] = []
    seen: dict[tuple[tuple[int, ...], int], list[np.ndarray]] = {}
    for body_class in classes:
        image = body_class.density_image
        if any(image is other.density_image for other in result):
            result.append(body_class)
            continue
        alike = seen.setdefault((image.shape, zlib.crc32(np.ascontiguousarray(image).data)), [])
        shared = next((other for other in alike if other is image or np.array_equal(other, image)), None)
        if shared is None:
            alike.append(image)
        elif shared is not image:
            body_class = replace(body_class, density_image=shared)
        result.append(body_class)
    return tuple(result)
