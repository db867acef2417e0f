"""The compiled problem: flat tables of bodies, charges and groups, made once before anything is placed.

All code that runs over bodies reads these tables. Only this module loops over classes and sizes to make them.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..device.marked import numbers_up_to
from ..errors import ProblemError, Reason, Refusal
from ..problem.body_charges import BodyCharges, charges_of
from ..problem.body_footprints import BodyFootprints, footprints_of
from ..problem.interaction import Groups, group_bodies
from ..problem.line import Line
from ..problem.of_bodies import distinct, of_all, of_bodies
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.surface import Surface
from ..space.asked_counts import typical_spacing
from ..space.kernels_meeting import Meeting
from ..space.meeting import meeting_of
from ..space.space import Space
from .body_flags import BodyFlags
from .carried_over import CarriedInPlane, CarriedOver
from .supports import supports_of
from .tangling import may_tangle

__all__ = ["BodyTable", "LineKind", "Model"]

# Factor between groups times the square of a charge at most, before forces are scaled down: far above what ordinary problems have, far
# below what float32, and sums over all bodies in fixed point, can hold.
LARGEST_INTERACTION = 2.0**16
# Lines shorter than so many spacings of their class have their lengths by themselves within a natural border. Measured on 30 and 400
# lines, alone and among 2,000 dots: shorter ones had 0.44 to 1.1 of their lengths in the mean, and 0.01 to 2 of them each; longer
# ones have 0.99 to 1.02 and 0.89 to 1.2, and by themselves coverage errors that are up to twice as large.
SHORT_IN_BORDER = 0.85
# A unit of length on a surface that is kept differs from its own by up to this factor. Measured with 4,096 bodies and units of 0.87,
# 0.93, 1.07 and 1.15 times their own: coverage errors at 1 spacing are .0012, .0012, .0015 and .0016 on a sphere, where they are .0013
# with their own, .0023 to .0020 on a rock with a gradient (.0021), .0133 to .0124 on a checkerboard (.0125); smallest spacings differ
# by .02.
NEARLY = 1.15


@dataclass(frozen=True, eq=False)
class LineKind:
    """A kind of line: one size whose bodies are lines.

    Attributes:
        body_class: The class of that size.
        size_name: Name of the size within the class.
        line: Preferred direction and length, number of charges, and other settings of these lines.
    """

    body_class: PreparedClass
    size_name: str
    line: Line


@dataclass(frozen=True, eq=False)
class BodyTable:
    """All bodies, one row for each, in class, then size order. Arrays have shape ``[n]`` and dtype int32, unless said otherwise.

    Attributes:
        class_index: Index of the body's class.
        size_index: Index of its size within the class.
        group: Index of its group; see :mod:`~esh.engine.problem.interaction`.
        kind: Index of its kind of line, -1 for a dot.
        area: Its footprint [m²], float64.
        longest: Longest axis that it may be asked to have [m], float64; 0 for a dot.
        flags: See :class:`~.body_flags.BodyFlags`.
        identities: Its identity, which seeds all that is random about it, see :meth:`~.problem.Problem.body_ids`. A NumPy array, an
            array on the device, or a range that begins with 0.
        support: Index of the model's support that says where it may be.
    """

    class_index: np.ndarray
    size_index: np.ndarray
    group: np.ndarray
    kind: np.ndarray
    area: np.ndarray
    longest: np.ndarray
    flags: np.ndarray
    identities: np.ndarray | wp.array | range
    support: np.ndarray

    @cached_property
    def identity(self) -> np.ndarray:
        """The identities as a NumPy array, copied from the device if they are there, as after an edit in the plane."""
        given = self.identities
        if isinstance(given, range):
            return np.arange(len(given), dtype=np.int32)
        return given if isinstance(given, np.ndarray) else given.numpy()

    def identities_on(self, launcher: Launcher) -> wp.array:
        """The identities as an array on the device."""
        given = self.identities
        if isinstance(given, range):
            return numbers_up_to(launcher, len(given))
        return launcher.array(given, wp.int32) if isinstance(given, np.ndarray) else given

    def group_on(self, launcher: Launcher) -> wp.array:
        """The groups as an array on the device, which is shared: kernels may only read it."""
        if launcher not in self._groups_on:
            self._groups_on[launcher] = launcher.array(self.group, wp.int32)
        return self._groups_on[launcher]

    @cached_property
    def _groups_on(self) -> WeakKeyDictionary[Launcher, wp.array]:
        return WeakKeyDictionary()

    @cached_property
    def flagged(self) -> bool:
        """Whether any body has a flag."""
        return bool(distinct(self.flags).any())

    @property
    def count(self) -> int:
        """Number of bodies."""
        return len(self.class_index)


class Model:
    """A compiled problem.

    Args:
        problem: The problem to compile.
        flags: :class:`~.body_flags.BodyFlags` of every body, shape ``[body_count]``; None if no body has any.
        unit: Meters per unit of length. None chooses the unit in which charges have a mean number density of 1. On a surface a given
            unit is used only if it differs from that one by no more than the factor ``NEARLY``.
        groups: Groups of the bodies, if these are a part of a larger problem; None groups the bodies of this problem.

    Attributes:
        problem: The problem.
        body: Its bodies.
        charge: Their charges.
        footprints: Their outlines.
        groups: Their groups, and how these see each other.
        interaction: The groups' matrix, times a power of two that keeps forces within the range of float32.
        kinds: The kinds of lines among them.
        fixed: Whether each body is a fixed one of the problem, shape ``[n]``, bool.
        supports: Images that are above zero where bodies may be.
        unit: Meters per unit of length of the solver; charges have a mean number density of about 1 in it, on a surface the mean over
            all bodies of the density that each sees.
        size: Extent of the rectangle in units; 0 on a surface.
    """

    def __init__(
        self,
        problem: Problem,
        flags: np.ndarray | None = None,
        *,
        unit: float | None = None,
        groups: Groups | None = None,
    ) -> None:
        self.problem = problem
        sizes = [(c, size) for c in problem.classes for size in c.sizes]
        counts = [size.count or 0 for _, size in sizes]
        is_line = [size.line is not None for _, size in sizes]
        self.kinds = tuple(
            LineKind(c, size.name, _rules_of(size.line, c, problem)) for c, size in sizes if size.line is not None
        )
        kind = np.where(is_line, np.cumsum(is_line) - 1, -1)
        longest = np.array([size.kind.longest for _, size in sizes])
        self.groups: Groups = groups or group_bodies(problem)
        class_index, size_index = problem.body_indices()
        n = len(class_index)
        area = problem.shared_areas()
        self.fixed = problem.body_is_fixed()
        flags = of_all(np.int32(0), n) if flags is None else np.asarray(flags).astype(np.int32)
        if self.has_fixed:
            flags = np.where(self.fixed, flags | np.int32(BodyFlags.PINNED), flags)
        self.footprints: BodyFootprints = footprints_of(problem)
        supports = supports_of(problem, class_index, size_index, area, self.footprints)
        self.supports = supports.images
        self.body = BodyTable(
            class_index=class_index,
            size_index=size_index,
            group=self.groups.body_group,
            kind=of_bodies(kind, counts, np.int32),
            area=area,
            longest=of_bodies(longest, counts, np.float64),
            flags=flags,
            identities=self.given_identities(),
            support=supports.of_body.astype(np.int32, copy=False),
        )
        self.charge: BodyCharges = charges_of(problem)
        self.interaction = _within_range(self.groups.matrix, self.charge.charge)
        domain = problem.domain
        if isinstance(domain, Surface):
            self.unit = _typical_spacing(problem, domain)
            if unit is not None and 1.0 / NEARLY < self.unit / unit < NEARLY:
                self.unit = unit
        else:
            self.unit = unit or math.sqrt(domain.area / len(self.charge.charge))

    def in_unit(self, unit: float) -> Model:
        """The same in another unit of length [m]."""
        result = copy(self)
        result.unit = unit
        return result

    def carry(self, old: Model, carried: CarriedOver | CarriedInPlane) -> None:
        """Give bodies that were in another model before the identities and flags that they had there."""
        flags = self.body.flags
        if old.body.flagged:
            came = carried.source >= 0
            flags = flags.copy()
            # Whom the problem fixed before, it may have let go.
            kept = np.where(old.fixed, old.body.flags & ~int(BodyFlags.PINNED), old.body.flags)
            flags[came] |= kept[carried.source[came]]
        identity = carried.identity
        if isinstance(identity, np.ndarray):
            identity = identity.astype(np.int32, copy=False)
        self.body = replace(self.body, identities=identity, flags=flags)
        if self.footprints.has_outlines:
            self.take_outlines(_carried_outlines(old.footprints, self.footprints, carried.source))

    def take_outlines(self, footprints: BodyFootprints) -> None:
        """Give bodies other outlines, and those whose areas follow from their outlines their areas, charges and groups."""
        self.footprints = footprints
        before = self.body.area
        area = self.problem.areas_as_outlined(before, footprints.variant, footprints.scale)
        if area is before:
            return
        self.groups = group_bodies(self.problem, area=area)
        self.body = replace(self.body, area=area, group=self.groups.body_group)
        charge = self.charge.charge * (area / before)[self.charge.body]
        self.charge = replace(self.charge, charge=charge * (len(charge) / charge.sum()))
        self.interaction = _within_range(self.groups.matrix, self.charge.charge)

    def acts_as(self, other: Model) -> bool:
        """Whether there are as many bodies as in another model, which act on each other in the same ways."""
        return (
            self.problem.regularity == other.problem.regularity
            and self.problem.avoid_overlap == other.problem.avoid_overlap
            and np.array_equal(self.groups.matrix, other.groups.matrix)
            and np.array_equal(self.charge.charge, other.charge.charge)
            and np.array_equal(self.body.group, other.body.group)
        )

    def meeting(self, launcher: Launcher, order: np.ndarray | None = None, others: int = 0) -> Meeting:
        """Which bodies keep apart, in this order, for kernels; behind them there are ``others``, which all of them keep off.

        Lines whose footprints may overlap do not cross others all the same.
        """
        apart = self.problem.balance.classes_apart if self.problem.avoid_overlap else None
        class_index = self.body.class_index if order is None else self.body.class_index[order]
        if others and apart is not None:
            class_index = np.concatenate([class_index, np.full(others, len(apart))])
            apart = np.pad(apart, (0, 1), constant_values=True)
        return meeting_of(launcher, class_index, apart)

    @property
    def space(self) -> Space:
        """Where the bodies are, in the model's unit; for problems in a rectangle."""
        return Space.of(self.problem.rectangle, self.unit)

    @property
    def size(self) -> tuple[float, float]:
        """Extent of that space along x and y."""
        return self.space.size

    @property
    def body_count(self) -> int:
        """Number of bodies, ghosts among them."""
        return self.body.count

    @property
    def charge_count(self) -> int:
        """Number of charges."""
        return len(self.charge.charge)

    def given_identities(self) -> np.ndarray | range:
        """The identities that the problem gives to its bodies, shape ``[body_count]``."""
        problem = self.problem
        return problem.body_ids().astype(np.int32, copy=False) if self.has_fixed else range(problem.body_count)

    @property
    def has_fixed(self) -> bool:
        """Whether any body is a fixed one of the problem."""
        return len(self.problem.fixed.id) > 0

    @property
    def charge_group(self) -> np.ndarray:
        """Group of every charge, shape ``[charge_count]``, int32."""
        if self.charge_count == self.body_count:
            return self.body.group
        return self.body.group[self.charge.body]

    @property
    def may_tangle(self) -> bool:
        """Whether long bodies that keep apart are so crowded that soft ones would slip through each other."""
        domain = self.problem.domain
        return may_tangle(self.problem, self.unit if isinstance(domain, Surface) else typical_spacing(self.problem))

    @property
    def bends_any(self) -> bool:
        """Whether any body may bend."""
        return any(kind.line.straightness is not None for kind in self.kinds)

    @property
    def may_bend(self) -> np.ndarray:
        """Whether a body may bend, shape ``[n]``."""
        bends = np.array([kind.line.straightness is not None for kind in self.kinds] + [False])
        return bends[self.body.kind]

    @property
    def body_charge(self) -> np.ndarray:
        """Sum of the charges of every body, shape ``[n]``."""
        return np.bincount(self.charge.body, weights=self.charge.charge, minlength=self.body_count)

    @property
    def group_charge(self) -> np.ndarray:
        """Sum of the charges of every group, shape ``[group_count]``."""
        first, charge = self.groups.first_body, self.charge.charge
        if first is not None:
            begin = first if self.charge_count == self.body_count else self.charge.first[first]
            return np.array([charge[a:b].sum() for a, b in pairwise(begin.tolist())])
        return np.bincount(self.charge_group, weights=charge, minlength=self.groups.count)

    def widths(self, length: np.ndarray) -> np.ndarray:
        """Thickness of every body [m], shape ``[n]``, 0 for dots; see :meth:`.line.Line.thickness`.

        Args:
            length: Length of every body's axis [m], shape ``[n]``.
        """
        width = np.zeros(self.body_count)
        for number, kind in enumerate(self.kinds):
            own = np.flatnonzero(self.body.kind == number)
            width[own] = kind.line.thickness(self.body.area[own], float(length[own].mean()))
        return width


def _typical_spacing(problem: Problem, surface: Surface) -> float:
    """Spacing [m] of charges at the number density that the average body sees on a surface."""
    if not any(body_class.varies_on_surface for body_class in problem.classes):
        return math.sqrt(surface.area / problem.charge_count)
    points = surface.sample()
    number = np.zeros(len(points.triangle))
    for body_class in problem.classes:
        density = body_class.density_on(points)
        if not density.any():
            # A problem that was given another surface asks for what may lie nowhere on that.
            raise ProblemError(
                f'`density` of class "{body_class.name}" must be above 0 somewhere on the surface; it is 0 everywhere',
                Refusal(Reason.NO_DENSITY, 0, 0, (body_class.name, "")),
            )
        number += body_class.body_count * density / density.mean()
    crowding = float((number**2).mean() / number.mean() ** 2)
    return math.sqrt(surface.area / (crowding * problem.charge_count))


def _carried_outlines(old: BodyFootprints, new: BodyFootprints, source: np.ndarray) -> BodyFootprints:
    """Outlines of a new model in which bodies that were there before keep theirs, where their size still has the same variants."""
    came = np.flatnonzero((source >= 0) & new.is_outline)
    came = came[old.is_outline[source[came]]]
    variant, scale = new.variant.copy(), new.scale.copy()
    first, first_before = new.shape - new.variant, (old.shape - old.variant)[source]
    for start, before in np.unique(np.stack([first[came], first_before[came]], axis=1), axis=0).tolist():
        own = came[(first[came] == start) & (first_before[came] == before)]
        kept = old.variant[source[own]]
        shapes = [(start + k, before + k) for k in np.unique(kept).tolist()]
        if all(a < len(new.shapes) and new.shapes[a].same_as(old.shapes[b]) for a, b in shapes):
            variant[own], scale[own] = kept, old.scale[source[own]]
    return new.with_outlines(variant, scale)


def _within_range(matrix: np.ndarray, charge: np.ndarray) -> np.ndarray:
    """Scale interaction factors down where charges or emphases are large; a power of two alters no digit.

    Only ratios count: all moves are measured in the inverse of the energy's curvature, which is scaled as the forces are.
    """
    largest = float(matrix.max()) * float(distinct(charge).max()) ** 2
    return matrix * 2.0 ** -max(0, math.ceil(math.log2(largest / LARGEST_INTERACTION)))


def _rules_of(line: Line, body_class: PreparedClass, problem: Problem) -> Line:
    """What a line is to do: that of short ones within a natural border is to have a length that no force changes.

    Short lines are stretched by their own charges, and what holds against that is many times their length. Once those beyond the
    border are gone, forces are others for a few steps, and beside it they count for less.
    """
    domain = problem.domain
    if isinstance(domain, Surface) or not domain.natural or not body_class.body_count:
        return line
    density = np.asarray(body_class.density_image, np.float64)
    ground = domain.area * density.mean() ** 2 / (density**2).mean()
    spacing = math.sqrt(ground / body_class.body_count)
    if 0.5 * (line.shortest + line.longest) > SHORT_IN_BORDER * spacing:
        return line
    return replace(line, stretch_weights=(0.0, line.stretch_weights[1]))
