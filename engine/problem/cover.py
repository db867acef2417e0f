"""How much of the ground footprints take, and whether so much of it can be taken; known before anything is placed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from .agreement import agreement_of
from .body_footprints import CAPSULE, BodyFootprints, footprints_of
from .body_kind import disc_radius
from .clearance import clearance, distance_to
from .domain import Domain
from .given_values import check_is
from .note import Note, NoteKind
from .packing import elongation_of, in_cells, packable, share_inside
from .problem import Problem
from .surface import Surface

__all__ = ["ABOUT", "Cover", "Room", "cover_of", "cover_of_images", "ground_on_surface", "share_of_ground"]

# Cells along the longer side of the domain in which what is asked for is compared with what fits; fewer where bodies are large.
CELLS = 128
# And those along either side in which the ground of several densities is looked at.
GROUND_CELLS = 256
# What is asked for beyond what fits in a region counts from this share of it on: bodies can move a little to where there is room.
CROWDED = 1.15
# Bodies that a region has at least: fewer are no region.
BODIES_PER_CELL = 16.0
# Pixels along the radius of a usual body in which obstacles are looked at, along the longer side of the domain at most.
PIXELS_PER_RADIUS = 8.0
PIXELS = 512
# Bodies are pressed by how densely this share of them is asked for, of those that are asked for the most densely.
PRESSED = 0.1
# What fits is known about: a count that was rounded up to a whole body is not too much.
ABOUT = 1.01
# Where fewer are crowded than this share of the bodies, nothing is said of it.
LEAST_CROWDED = 0.01
# What of the bodies is counted.
FOOTPRINTS = "footprints"


@dataclass(frozen=True)
class Cover:
    """How much of the ground footprints cover. Ground is where bodies may be, that is, where a density is above zero.

    Attributes:
        covered: Sum of the footprints, with the room that they keep, over the area of the ground.
        fits: Share of the ground that can be covered without overlap, as an estimate. It depends on how long bodies are, and on
            whether they may turn or are parallel.
        crowded: Share of the bodies that are asked for at places where more is asked for than fits; 0 if there are none.
        pressed: Share of the ground that the densest tenth of the bodies are asked to take where they are; ``covered`` on surfaces.
        densest: Share of the ground that those are asked to take that are ``crowded``; 0 if there are none.
        counted: What is counted, in the words of a sentence: footprints, and the room around them if they keep any.
    """

    covered: float
    fits: float
    crowded: float
    pressed: float = 0.0
    densest: float = 0.0
    counted: str = FOOTPRINTS

    @property
    def too_much(self) -> bool:
        """Whether the footprints cannot fit without overlap."""
        return self.covered > ABOUT * self.fits

    @property
    def warning(self) -> Note | None:
        """A sentence if the footprints cannot fit, or do not fit everywhere; None if they may fit."""
        fits = f"about {self.fits:.0%}"
        if self.too_much:
            share = f"{self.counted} would cover {self.covered:.0%} of the space where they may be"
            return Note(f"{share}, but at most {fits} fits; lower the counts or the areas", NoteKind.COVER)
        if self.crowded > LEAST_CROWDED:
            return Note(
                f"at the densest places, {self.counted} would cover {self.densest:.0%} of the ground, but only {fits} fits: the "
                f"{self.crowded:.0%} of the bodies that belong there spread out, and the density is evened out there; lower the "
                "counts or the areas, or use a density with less contrast",
                NoteKind.COVER,
            )
        return None


# A run and its report ask for it several times.
_known: WeakKeyDictionary[Problem, Cover] = WeakKeyDictionary()


def cover_of(problem: Problem) -> Cover:
    """Return how much of the ground the footprints of a problem take, before it is solved.

    Lines count with the lengths and widths that are asked of them.
    """
    check_is(problem, Problem, "`problem`")
    if problem not in _known:
        _known[problem] = _cover_of(problem)
    return _known[problem]


def _cover_of(problem: Problem) -> Cover:
    footprints = footprints_of(problem)
    area = _areas(problem, footprints)
    fits = _fits(footprints, area, agreement_of(problem, footprints, area))
    class_index = problem.body_indices()[0]
    of_class = np.bincount(class_index, weights=area, minlength=len(problem.classes))
    if isinstance(problem.domain, Surface):
        # Where on a surface it is crowded, only the run tells.
        share, loose = ground_on_surface(problem, problem.domain, 0.5 * float(disc_radius(float(area.mean()))))
        covered = float((_apart(problem) @ of_class).max()) / max(share * problem.domain.area, 1e-300)
        return Cover(covered, fits * loose / max(share, 1e-300), 0.0, covered, counted=_counted(problem))
    fits *= share_inside(problem.domain, float(area.mean())) * _share_beside_obstacles(
        problem, problem.domain, float(area.mean())
    )
    return cover_of_images(problem, [c.density_image for c in problem.classes], of_class, fits)


def ground_on_surface(problem: Problem, surface: Surface, away: float) -> tuple[float, float]:
    """Return what share of a surface any class may be on, and what share of it is farther from outlines that stand there [m].

    Along these bodies leave gaps like those along an edge; see :func:`_share_beside_obstacles`.
    """
    outlines = problem.outlines_on_surface
    if not len(outlines) and not all(c.varies_on_surface for c in problem.classes):
        return 1.0, 1.0
    sample = surface.sample()
    may = np.any([c.density_beside_outlines(sample) > 0.0 for c in problem.classes], axis=0)
    if not len(outlines):
        return float(may.mean()), float(may.mean())
    distance = outlines.distance(sample, away)
    return float((may & (distance >= 0.0)).mean()), float((may & (distance >= away)).mean())


def cover_of_images(problem: Problem, images: Sequence[np.ndarray], of_class: np.ndarray, fits: float) -> Cover:
    """Return how much of the ground footprints take that add up to so much.

    Args:
        problem: In a rectangle.
        images: Of every class, what its density is proportional to.
        of_class: Areas of the footprints of every class, added up [m²].
        fits: Share of the ground that can be taken.
    """
    apart, domain = _apart(problem), problem.rectangle
    shape = _cells(domain, float(of_class.sum()) / problem.body_count)
    share_of = {key: in_cells(image, shape) for key, image in _distinct(images).items()}
    shares = [share_of[id(image)] for image in images]
    free = np.clip(_where_any(images, shape), 0.0, 1.0)
    cell = domain.area / (shape[0] * shape[1])
    of_cells = [total * share / share.sum() for total, share in zip(of_class, shares, strict=True)]
    asked = np.max(np.tensordot(apart, np.stack(of_cells), axes=1), axis=0)
    covered = float((apart @ of_class).max()) / max(share_of_ground(images) * domain.area, 1e-300)
    ground = np.maximum(free, 1e-12) * cell
    too_much = asked > CROWDED * fits * ground
    crowded = float(asked[too_much].sum() / asked.sum())
    densest = float(asked[too_much].sum() / ground[too_much].sum()) if too_much.any() else 0.0
    local = (asked / ground).ravel()
    densest_first = np.argsort(-local, kind="stable")
    place = np.searchsorted(np.cumsum(asked.ravel()[densest_first]), PRESSED * asked.sum())
    pressed = float(local[densest_first[min(int(place), local.size - 1)]])
    return Cover(covered, fits, crowded, pressed, densest, _counted(problem))


def share_of_ground(images: Sequence[np.ndarray]) -> float:
    """Return the share of a rectangle where any class may be, that is, where one of these densities is above zero."""
    # Of a single image it is exact, whatever the cells are.
    found = list(_distinct(images).values())
    longest = max(max(image.shape) for image in found)
    return float(_where_any(found, (1, 1) if len(found) == 1 else (min(longest, GROUND_CELLS),) * 2).mean())


def _counted(problem: Problem) -> str:
    """Return what of the bodies counts where what they would cover is compared with what fits."""
    of_sizes = [(c.gap, c.room) for c in problem.classes] + [(s.gap, s.room) for c in problem.classes for s in c.sizes]
    counted = FOOTPRINTS + (" that keep apart" if problem.balance.classes_apart is not None else "")
    return counted + (" and the room around them" if any(gap > 0.0 or room != 1.0 for gap, room in of_sizes) else "")


def _apart(problem: Problem) -> np.ndarray:
    """1 for classes that share the ground, 0 for those that may lie on each other, shape ``[classes, classes]``."""
    kept, number = problem.balance.classes_apart, len(problem.classes)
    return np.ones((number, number)) if kept is None else kept.astype(np.float64)


def _distinct(images: Sequence[np.ndarray]) -> dict[int, np.ndarray]:
    """Images by their identity: classes may share one, which is looked at once."""
    return {id(image): image for image in images}


def _where_any(images: Sequence[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """Of every cell of a grid, the largest share in which one of the images is above 0."""
    result: np.ndarray = np.max([in_cells(image > 0.0, shape) for image in _distinct(images).values()], axis=0)
    return result


def _share_beside_obstacles(problem: Problem, domain: Domain, mean_area: float) -> float:
    """Part of what fits on free ground that fits beside obstacles: along them bodies leave gaps like those along an edge.

    There a quarter of a disc's width is lost; see :func:`.packing.share_inside`. And all of pockets into which no body gets.
    """
    if not problem.obstacles:
        return 1.0
    radius, narrowest = float(disc_radius(mean_area)), 0.5 * _narrowest(problem)
    shape = _pixels(domain, radius)
    free = _where_any([c.density_image for c in problem.classes], shape)
    away = clearance(problem.obstacles, domain, shape, max(0.5 * radius, narrowest))
    # What a lane is short of by less than a pixel is not known.
    reached = _reached(away, domain, max(narrowest - 0.5 * max(_pixel(domain, shape)), 0.0))
    return float(free[(away >= 0.5 * radius) & reached].sum() / max(float(free.sum()), 1e-300))


def _narrowest(problem: Problem) -> float:
    """Return the smallest width of any body that is asked for [m]; 0 where it is not known."""
    sizes = [size for body_class in problem.classes for size in body_class.sizes if size.count]
    return min((float(size.kind.narrowest(size.mean_area)) for size in sizes), default=0.0)


def _reached(away: np.ndarray, domain: Domain, radius: float) -> np.ndarray:
    """Tell which pixels discs of a radius [m] cover that keep off obstacles, from how far away these are, shape ``[n, m]`` each."""
    pixel = _pixel(domain, away.shape)
    covered: np.ndarray = distance_to(away >= radius, pixel, radius + max(pixel), domain.periodic) <= radius
    return covered


def _pixel(domain: Domain, shape: tuple[int, ...]) -> tuple[float, float]:
    """Return the width and height of a pixel [m], of an image of so many rows and columns."""
    return domain.size[0] / shape[1], domain.size[1] / shape[0]


class Room:
    """How much of the free ground bodies have room on between obstacles, which is looked at once.

    Large ones have less than small ones: what is left between trees takes gravel everywhere, and boulders only where it is wide. On a
    whole surface nothing is known of that.
    """

    def __init__(self, problem: Problem) -> None:
        """Look at the obstacles of a problem."""
        self._problem = problem
        self._radius = [
            float(
                disc_radius(float(np.average([s.mean_area for s in c.sizes], weights=[s.count or 1 for s in c.sizes])))
            )
            for c in problem.classes
        ]
        self._shape, self._clearance = (1, 1), np.zeros((1, 1), np.float32)
        domain = problem.domain
        if isinstance(domain, Domain) and problem.obstacles:
            self._shape = _pixels(domain, min(self._radius))
            self._clearance = clearance(problem.obstacles, domain, self._shape, 2.0 * max(self._radius))

    def share(self, class_index: int, scale: float = 1.0) -> float:
        """Part of the free ground of a class (density above zero) that discs as large as its bodies can cover.

        Args:
            class_index: Which class.
            scale: Factor on how long and wide its bodies are, 2 at most.
        """
        domain, away = self._problem.domain, self._clearance
        if not isinstance(domain, Domain) or not self._problem.obstacles:
            return 1.0
        radius = scale * self._radius[class_index]
        free = in_cells(self._problem.classes[class_index].density_image > 0.0, self._shape)
        reached = _reached(away, domain, radius)
        return float((free * reached).sum() / max(float(free.sum()), 1e-300))


def _pixels(domain: Domain, radius: float) -> tuple[int, int]:
    """Rows and columns in which obstacles are looked at for bodies of a radius [m]."""
    width, height = domain.size
    pixel = max(radius / PIXELS_PER_RADIUS, max(width, height) / PIXELS)
    return max(1, round(height / pixel)), max(1, round(width / pixel))


def _areas(problem: Problem, footprints: BodyFootprints) -> np.ndarray:
    length, width = np.zeros((2, problem.body_count))
    begin = 0
    for body_class in problem.classes:
        for size in body_class.sizes:
            own = slice(begin, begin + (size.count or 0))
            begin = own.stop
            length[own] = size.kind.mean_length
            width[own] = size.kind.thickness(np.array([size.mean_area]), size.kind.mean_length)
    return footprints.areas(length, width, apart=True)


def _fits(footprints: BodyFootprints, area: np.ndarray, agreement: float) -> float:
    """Mean over the ground that bodies take."""
    # Of every shape, not free and free; the last one is the capsule of a line.
    elongation = [elongation_of(outline) for outline in footprints.shapes] + [1.0]
    fraction = np.array([[packable(e, free, agreement) for free in (False, True)] for e in elongation])
    # Lines lie side by side.
    free = footprints.free | (footprints.shape == CAPSULE)
    return float(np.average(fraction[footprints.shape, free.astype(np.int64)], weights=area))


def _cells(domain: Domain, mean_area: float) -> tuple[int, int]:
    """Rows and columns that hold some bodies each where they cover the ground."""
    width, height = domain.size
    smallest = math.sqrt(BODIES_PER_CELL * mean_area)
    cell = max(max(width, height) / CELLS, smallest)
    return max(1, int(height / cell)), max(1, int(width / cell))
