"""A natural border: bodies are placed beyond it, too, and those within are kept, as many as are asked for.

Charges that nothing faces beyond a border stand in a row along it, as a hedge does, with a gap behind. So densities go on beyond the
edges of the domain, and where they end within it: every place near them has the density of the nearest place that has any. Bodies are
placed there as well, as many more as that density says. Of each size those that lie deepest within the border are kept.

What is cut lacks charge here and has too much there along the border. A few steps by forces that see charge blurred over more than a
spacing even that out: they move neighbors together, so that the order of these stays what it was.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..device.launcher import Launcher
from ..problem.apportionment import apportion
from ..problem.body_footprints import footprints_of
from ..problem.domain import Domain
from ..problem.fixed_bodies import FixedBodies
from ..problem.footprints import Footprints
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..problem.size import Size
from ..space.density import move_into_support, sample_density
from ..space.images_beyond import AxisBeyond, DensityBeyond, KnownWays, density_beyond, image_beyond
from .even_cut import Ground, evened
from .model import Model

__all__ = [
    "STEPS_WITHIN",
    "Kept",
    "NaturalBorder",
    "smoothing",
]

# How far densities go on beyond an edge, in mean spacings of the class: rows along the outer edge, where it ends at last, have faded
# there. For rare classes no farther than this share of the domain, unless that is nearer than so many spacings of all bodies.
REACH = 5.0
MOST_OF_DOMAIN = 0.2
# Unless all ground, and what lies so far beyond its edges, is so many times as large as where bodies may be. Measured on 500 bodies in
# one of 200 x 200 pixels: a run takes 0.7 s instead of 93 s; in a spot of 8 pixels' radius smallest spacings are .81 instead of .64.
MOST_BEYOND = 25.0
# Width of the blur between two charges over their spacing while the cut is evened out, and steps of that. Measured on 4,096 bodies,
# uniform: errors at k = 1 and 2 are .0210 and .0106 as cut, .0029 and .0001 after ten steps (open: .0016 and .0003), and the largest
# number at any distance from the border 1.5 times even (open: 5.8). With 1.0 these are .0010, .0001 and 2.2, with 2.0 .0063, .0005 and
# 1.5. More steps bring close pairs, which such forces do not see: the smallest spacing is .64 after 10 and .29 after 20.
SMOOTH_OVER_SPACING = 1.4
SMOOTH_STEPS = 8
# Charges that are blurred over less than the spacing of the large ones see these one by one: small ones fill the gaps between them, so
# that along the border, too. So the blur follows that spacing, up to so many times that of all, and there are fewer steps, by this
# power of it. Measured on 255 discs of 0.28 m² and 681 of 0.04 m² on 20 m x 20 m: within 0.2 m of the border, where 10 and 27 would be
# even, are 7 and 23 of them, and 1 and 32 with eight steps. Errors of all at k = 1 and 2 are .019 and .0022, and .017 and .0020.
WIDEST_OF_LARGE = 2.0
FEWER_STEPS = 3.0
# Steps by the usual forces after that, which count only farther within: see :mod:`.held_border`.
STEPS_WITHIN = 12
# Where densities are everywhere the same, bodies come to stand in rows along the axes, and a border along these has a row at it or has
# not. So the domain is cut out turned by this angle [rad], half way between two ways of the rows.
TURN = math.pi / 12.0
# Unless it is so narrow that the rectangle around it, in which bodies are placed, is so many times as large. Measured on 3,000 bodies
# on 100 m x 1 m, turned and not: the largest number at any distance from the border is 1.8 and 2.3 times even, in 1.3 and 0.3 s; 351
# bodies on 10 km x 1 m were among 900,000.
MOST_TURNED = 50.0
# Parts of the ground that do not meet have the numbers that they ask for, if these are not below this.
FEWEST_OF_PART = 4.0
# Density over the largest of a class below which spacings grow no more.
THINNEST = 1e-6
# A domain that is longer than so many times its width is not joined to its other sides, which meshes would have to be fine for.
MOST_ELONGATED = 100.0


class Kept(NamedTuple):
    """What is kept of what was placed within and beyond a border.

    Attributes:
        position: Where the bodies of the problem that was asked for are [m], shape ``[body_count, 2]``, where each may be.
        source: Which of those that were placed each of them is, shape ``[body_count]``.
    """

    position: np.ndarray
    source: np.ndarray


class NaturalBorder:
    """What is placed instead of a problem, and what of it is kept.

    Args:
        launcher: Where to run.
        problem: In a rectangle.

    Attributes:
        problem: The problem that is placed instead, in a larger domain and without obstacles.
        turn: By how much that domain is turned: directions in it are larger by this angle [rad].
    """

    def __init__(self, launcher: Launcher, problem: Problem) -> None:
        self._asked = problem
        domain = problem.rectangle
        share = [_share_of_ground(c) for c in problem.classes]
        least = REACH * math.sqrt(domain.area / problem.body_count)
        if float(np.prod(np.add(domain.size, 2.0 * least))) > MOST_BEYOND * domain.area * max(share):
            # In a small spot bodies are so much closer that they would be placed by the million around it.
            least *= math.sqrt(max(share))
        most = max(least, MOST_OF_DOMAIN * min(domain.size))
        # Of few bodies spacings are wider than the domain.
        wanted = [
            min(REACH * math.sqrt(domain.area * own / c.body_count), most, max(domain.size))
            for own, c in zip(share, problem.classes, strict=True)
        ]
        reach = [max(own, min(least, max(domain.size))) for own in wanted]
        images = [c.density_image for c in problem.classes]
        uniform = all(image.min() == image.max() > 0.0 for image in images)
        across = np.array([[math.cos(TURN), math.sin(TURN)], [math.sin(TURN), math.cos(TURN)]]) @ domain.size
        turned = (float(across[0]) + 2.0 * max(reach), float(across[1]) + 2.0 * max(reach))
        is_wide = turned[0] * turned[1] <= MOST_TURNED * domain.area
        follows = any(_follows_images(size) for c in problem.classes for size in c.sizes)
        self.turn = TURN if uniform and is_wide and not follows else 0.0
        self._beyond: list[DensityBeyond] = []
        margin = (0.0, 0.0)
        if self.turn:
            self._size = turned
            more = self._size[0] * self._size[1] / domain.area
            self._beyond = [DensityBeyond(image, more, None) for image in images]
        else:
            along = [
                AxisBeyond.of([image.shape[axis] for image in images], domain.size[1 - axis], max(reach))
                for axis in range(2)
            ]
            margin = along[1].margin, along[0].margin
            self._size = (domain.size[0] + 2.0 * margin[0], domain.size[1] + 2.0 * margin[1])
            made: dict[tuple[int, float], DensityBeyond] = {}
            known: KnownWays = {}
            for image, own in zip(images, reach, strict=True):
                if (id(image), own) not in made:
                    made[id(image), own] = density_beyond(launcher, image, along, own, self._size, known)
                self._beyond.append(made[id(image), own])
        classes = [
            self._larger(number, c, beyond, margin)
            for number, (c, beyond) in enumerate(zip(problem.classes, self._beyond, strict=True))
        ]
        # A border that is joined to the other side has no rows along it, either.
        elongated = max(self._size) > MOST_ELONGATED * min(self._size)
        self.problem = Problem(
            Domain(self._size, "open" if elongated else "periodic"),
            classes,
            problem.balance,
            fixed=self._fixed(),
            seed=problem.seed,
            avoid_overlap=problem.avoid_overlap,
            regularity=problem.regularity,
        )

    def _larger(
        self, number: int, body_class: PreparedClass, beyond: DensityBeyond, margin: tuple[float, float]
    ) -> PreparedClass:
        """A class of as many more bodies as its density goes on; fixed ones are not among them."""
        sizes = []
        for s, size in enumerate(body_class.sizes):
            fixed = self._asked.fixed.number_of(number, s)
            count = size.count or 0
            free = max(count, round(count * beyond.more)) - fixed
            sizes.append(self._with_more(size, count - fixed, free, margin))
        look = body_class.look_at
        if look is not None:
            x, y = self._to_larger(np.array([look.point[:2]]))[0].tolist()
            look = replace(look, point=(x, y, look.point[2]))
        # Its clumps and obstacles are in its density, and go on with it.
        return replace(
            body_class, base=None, clustering=0.0, density_image=beyond.image, sizes=tuple(sizes), look_at=look
        )

    def _with_more(self, size: Size, count: int, more: int, margin: tuple[float, float]) -> Size:
        """A size of more bodies than ``count``; what is listed is drawn from as densely, and images go on as densities do."""
        changes: dict[str, Any] = {}
        if isinstance(size.distribution, np.ndarray):
            changes["distribution"] = np.quantile(size.distribution, (np.arange(more) + 0.5) / max(more, 1))
        beyond = [m / length for m, length in zip(margin, self._asked.rectangle.size, strict=True)]
        if size.line is not None:
            line = size.line
            told: dict[str, Any] = {}
            for name in ("length", "direction"):
                value = getattr(line, name)
                if isinstance(value, np.ndarray):
                    told[name] = image_beyond(value, beyond)
                elif name == "direction" and not isinstance(value, str):
                    told[name] = value + self.turn
            changes["line"] = replace(line, **told)
        if isinstance(size.footprint, Footprints):
            own = size.footprint
            given: dict[str, Any] = {
                name: np.resize(value[:count] if count else value, more)
                for name in ("variant", "scale", "turn")
                if isinstance(value := getattr(own, name), np.ndarray)
            }
            # That of a line is told from its axis.
            if size.line is None and not isinstance(own.turn, str):
                given["turn"] = given.get("turn", own.turn) + self.turn
            if own.slope is not None:
                given["slope"] = image_beyond(own.slope, beyond)
            changes["footprint"] = replace(own, **given)
        return replace(size, count=more, share=None, **changes)

    def _fixed(self) -> list[FixedBodies]:
        """Those of the problem that was asked for, where they are in the larger domain."""
        fixed = self._asked.fixed
        if not len(fixed.id):
            return []
        return [
            FixedBodies(
                self._to_larger(fixed.position),
                fixed.class_index,
                fixed.size_index,
                fixed.angle + self.turn,
                fixed.length,
                fixed.area,
                variant=fixed.variant,
                scale=fixed.scale,
            )
        ]

    def _to_larger(self, position: np.ndarray) -> np.ndarray:
        """Where positions of the domain [m] are in the larger one, shape ``[n, 2]``."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        middle = 0.5 * np.array(self._asked.rectangle.size)
        return (position - middle) @ np.array([[c, s], [-s, c]]) + 0.5 * np.array(self._size)

    def _parts(
        self, body_class: PreparedClass, beyond: DensityBeyond, position: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """The part of a class's ground that each body is in, and the shares of its density that these have; None where it is one.

        Those that ask for few bodies are one with the largest.
        """
        if beyond.part is None or beyond.depth is None:
            return None
        inner = beyond.depth > 0.0
        charge = np.bincount(beyond.part[inner], beyond.image[inner])
        share = charge / charge.sum()
        number = np.where(share * body_class.body_count < FEWEST_OF_PART, int(share.argmax()), np.arange(len(share)))
        part = number[sample_density(beyond.part, position, self._size)]
        return part, np.bincount(number, share, len(share))

    def _ground(self, body_class: PreparedClass, count: int) -> Ground:
        """What ``count`` bodies of a class are to be as dense as."""
        domain = self._asked.rectangle
        spacing = math.sqrt(domain.area * _share_of_ground(body_class) / max(count, 1))
        return Ground(body_class.density_image, domain.size, spacing, count == self._asked.body_count)

    def _spacings(
        self, body_class: PreparedClass, beyond: DensityBeyond, count: int, position: np.ndarray
    ) -> np.ndarray:
        """Spacings of ``count`` bodies of a class at positions of the larger domain [m], shape ``[n]``."""
        density = sample_density(beyond.image, position, self._size).astype(np.float64)
        mean = float(body_class.density_image.mean(dtype=np.float64))
        thinnest = THINNEST * float(beyond.image.max())
        return np.sqrt(self._asked.rectangle.area * mean / (max(count, 1) * np.maximum(density, thinnest)))

    def cut(self, position: np.ndarray, model: Model) -> Kept:
        """Return which bodies are kept, and where.

        Args:
            position: Of those that were placed [m], shape ``[their number, 2]``.
            model: Of the problem that was asked for.
        """
        size = np.array(self._asked.rectangle.size)
        c, s = math.cos(self.turn), math.sin(self.turn)
        within = (position - 0.5 * np.array(self._size)) @ np.array([[c, -s], [s, c]]) + 0.5 * size
        result = np.empty((model.body_count, 2))
        source = np.empty(model.body_count, np.int64)
        first, taken = 0, 0
        areas, kept_areas = self.problem.shared_areas(), model.body.area
        across, kept_across = (footprints_of(problem).factor for problem in (self.problem, self._asked))
        for body_class, larger, beyond in zip(self._asked.classes, self.problem.classes, self._beyond, strict=True):
            for kept, placed in zip(body_class.sizes, larger.sizes, strict=True):
                fixed = int(model.fixed[first : first + (kept.count or 0)].sum())
                # Fixed ones come last.
                count, many = (kept.count or 0) - fixed, (placed.count or 0) - fixed
                own = np.arange(taken, taken + many)
                depth = np.minimum(within[own], size - within[own]).min(axis=1)
                if beyond.depth is not None:
                    depth = np.minimum(depth, sample_density(beyond.depth, position[own], self._size))
                # Those that lie deepest, in the order that they have, which is one of neighbors.
                parts = self._parts(body_class, beyond, position[own])
                chosen = _deepest(depth, count, parts)
                if not fixed and kept.has_one_area:
                    spacing = self._spacings(body_class, beyond, count, position[own])
                    part = None if parts is None else parts[0]
                    chosen = evened(chosen, self._ground(body_class, count), within[own], depth / spacing, part)
                chosen = own[np.sort(chosen)]
                to = np.arange(first, first + count)
                if not kept.has_one_area or kept.footprint is not None:
                    # The largest are the largest.
                    chosen = chosen[np.argsort(areas[chosen] * across[chosen], kind="stable")]
                    to = to[np.argsort(kept_areas[to] * kept_across[to], kind="stable")]
                result[to], source[to] = within[chosen], chosen
                first, taken = first + count, taken + many
                source[first : first + fixed] = np.arange(taken, taken + fixed)
                first, taken = first + fixed, taken + fixed
        # Where there were too few within, the nearest ones come in.
        result[model.fixed] = 0.0
        result = np.clip(np.where(result > size, 2.0 * size - result, np.abs(result)), 0.0, size)
        for number in np.unique(model.body.support).tolist():
            if not (model.supports[number] > 0.0).all():
                own = np.flatnonzero((model.body.support == number) & ~model.fixed)
                result[own] = move_into_support(model.supports[number], result[own], self._asked.rectangle.size)
        result[model.fixed] = self._asked.fixed.position
        return Kept(result, source)


def smoothing(charge: np.ndarray) -> tuple[float, int]:
    """How what was cut is evened out: the width of the blur between two of these charges over the spacing of all, and the steps."""
    # How many times as far apart as all do those stand that make up most of the charge.
    apart = math.sqrt(np.mean(charge**2)) / float(np.mean(charge))
    return SMOOTH_OVER_SPACING * min(apart, WIDEST_OF_LARGE), max(1, round(SMOOTH_STEPS / apart**FEWER_STEPS))


def _deepest(depth: np.ndarray, count: int, parts: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
    """Return which ``count`` bodies lie deepest; of several parts of the ground, as many in each as its share asks for.

    Args:
        depth: How deep bodies lie within the border, shape ``[n]``.
        count: How many, at most ``n``.
        parts: The part that each body is in, shape ``[n]``, and the share of each; None where there is one.
    """
    deepest = np.argsort(-depth, kind="stable")
    if parts is None:
        return deepest[:count]
    part, share = parts
    wanted = apportion(count, share)
    # Place of each body among those of its part, the deepest first.
    by_part = deepest[np.argsort(part[deepest], kind="stable")]
    there = np.bincount(part, minlength=len(share))
    place = np.empty(len(part), np.int64)
    place[by_part] = np.arange(len(part)) - np.repeat(np.cumsum(there) - there, there)
    # Where a part has too few, others make up for it.
    return deepest[np.argsort(place[deepest] >= wanted[part[deepest]], kind="stable")[:count]]


def _share_of_ground(body_class: PreparedClass) -> float:
    return float((body_class.density_image > 0.0).mean())


def _follows_images(size: Size) -> bool:
    """Tell whether bodies follow images of directions, lengths or slopes, which have pixels along the domain's axes."""
    line, footprint = size.line, size.footprint
    of_line = line is not None and any(isinstance(value, np.ndarray) for value in (line.length, line.direction))
    return of_line or (isinstance(footprint, Footprints) and footprint.slope is not None)
