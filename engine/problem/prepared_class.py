"""A class as it is placed: its density on the domain, and a whole count for every size.

What is asked is a :class:`~.body_class.BodyClass`. Here its density is sharpened and corrected, and its shares become counts.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from .apportionment import apportion
from .body_class import BodyClass, PlacingSettings
from .clearance import PIXELS_PER_SPACING, clearance, mask_shape
from .density_correction import correct_density
from .domain import Domain
from .given_values import show
from .image_filters import unsharp_mask
from .note import Note, NoteKind
from .obstacles import Obstacle
from .outlines_on_surface import OutlinesOnSurface
from .packing import packable_share, scale_to_fit, share_inside
from .settings import values_of
from .size import Size
from .surface import PointsOnSurface, Surface
from .surface_density import density_at
from .validation import MOST_BODIES

__all__ = [
    "PreparedClass",
    "PreparedDensity",
    "beside_counted",
    "beside_fixed",
    "count_sizes",
    "cut_out",
    "cut_out_on_surface",
    "prepare",
    "prepare_all",
    "prepare_density",
]

# Bodies that do not move leave gaps beside them: what fits falls by so much for each share of the ground that they take, down to this
# part of it, as where discs are strewn and none can move. Measured with 10 to 140 fixed discs on the ground of 400.
LOST_BESIDE_FIXED = 0.65
LEAST_BESIDE_FIXED = 0.63


class PreparedDensity(NamedTuple):
    """A density, sharpened and corrected.

    Attributes:
        image: Shape ``[height, width]``, float32 (``[1, 1]`` when it is uniform).
        notes: Sentences for the report on what happened to it, and on settings that did nothing.
    """

    image: np.ndarray
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class PreparedClass(PlacingSettings):
    """One class of bodies, ready to be placed. :class:`~esh.Problem` makes it from a :class:`~esh.BodyClass`.

    Beside the following it has that class's :class:`~.body_class.PlacingSettings`.

    Attributes:
        name: Unique within the problem.
        sizes: Every one with its whole count.
        density_image: The density that bodies follow, shape ``[height, width]``, float32 (``[1, 1]`` when it is uniform).
        notes: Sentences for the report on what happened to the density, and on settings that did nothing.
        asked: What it was made from; None where more than that went into it, such as the slopes of a surface.
        share: What a count of ``"cover"`` means of what the density adds up to; below 1 where several such classes share the ground.
        most: Largest density that is followed on a surface, where it is a share of the ground to cover.
        outlines: Obstacles that are outlines on the surface; None where there are none.
        edge: How wide the density's edge at these is [m].
        clumps: Diameter of the clumps that its density has got [m]; 0 where it has none.
        base: The class before its density got clumps, obstacles were cut out of it and fixed bodies added to its counts; None if
            it is that.
    """

    name: str
    sizes: tuple[Size, ...]
    density_image: np.ndarray
    notes: tuple[str, ...] = ()
    asked: BodyClass | None = None
    base: PreparedClass | None = None
    share: float = 1.0
    most: float = math.inf
    outlines: OutlinesOnSurface | None = None
    edge: float = 0.0
    clumps: float = 0.0

    def _key(self, name: str) -> str:
        return f'`{name}` of class "{self.name}"'

    @property
    def body_count(self) -> int:
        """Number of bodies in all sizes."""
        return sum(size.count or 0 for size in self.sizes)

    def called(self, size: Size) -> tuple[str, str]:
        """How a refusal names one of its sizes: by the class alone where that has no other."""
        return self.name, size.name if len(self.sizes) > 1 else ""

    @property
    def varies_on_surface(self) -> bool:
        """Whether the density is not the same at all points of a surface."""
        return self.outlines is not None or self.varies_beside_outlines

    @property
    def varies_beside_outlines(self) -> bool:
        """Whether it would not be without the obstacles that are outlines on it."""
        return self.asked is not None and callable(self.asked.density)

    def density_on(self, points: PointsOnSurface) -> np.ndarray:
        """The density that bodies follow at points of a surface, shape ``[n]``, float64."""
        density = self.density_beside_outlines(points)
        return density if self.outlines is None else density * self.outlines.free(points, self.edge)

    def density_beside_outlines(self, points: PointsOnSurface) -> np.ndarray:
        """The same without the obstacles that are outlines."""
        if self.asked is None or not callable(self.asked.density):
            return np.full(len(points.triangle), float(self.density_image[0, 0]))
        return np.minimum(density_on(self.asked, points), self.most)


def density_on(body_class: BodyClass, points: PointsOnSurface) -> np.ndarray:
    """Return the density of a class, corrected, at points of a surface, shape ``[n]``, float64; see :class:`PreparedClass`."""
    key = f'`density` of class "{body_class.name}"'
    assert callable(body_class.density)
    values = density_at(body_class.density, points, key)
    if (body_class.density_correction or body_class.count == "cover") and values.max(initial=0.0) > 1.0:
        raise ProblemError(
            f"{key} must be a covered share between 0 and 1; its largest value is {values.max():g}",
            Refusal(Reason.DENSITY_ABOVE_ONE, float(values.max()), 1, (body_class.name, "")),
        )
    return correct_density(values[None], key)[0] if body_class.density_correction else values


def prepare_on_surface(body_class: BodyClass, surface: Surface, most: float, share: float) -> PreparedClass:
    """Return a class as it is placed on a surface.

    Args:
        body_class: What is asked.
        surface: Where.
        most: Largest density that is followed, of a share of the ground to cover.
        share: What a count of ``"cover"`` means of what the density adds up to.

    Raises:
        ProblemError: An image, a density that is 0 everywhere or returns something else, or a share without a body.
    """
    image, notes = prepare_density(body_class)
    key = f'`density` of class "{body_class.name}"'
    if image.size > 1:
        raise ProblemError(
            f"{key} must be a number or a function of points on a surface, such as SurfaceImage(image); got an image"
        )
    image = np.minimum(image, np.float32(most))
    mean = float(image[0, 0])
    if callable(body_class.density):
        mean = float(np.minimum(density_on(body_class, surface.sample()), most).mean())
    if mean <= 0.0:
        raise ProblemError(
            f"{key} must be above 0 somewhere on the surface; it is 0 everywhere",
            Refusal(Reason.NO_DENSITY, 0, 0, (body_class.name, "")),
        )
    return PreparedClass(
        body_class.name,
        count_sizes(body_class, share * mean * surface.area),
        image,
        notes,
        body_class,
        share=share,
        most=most,
        **values_of(body_class, PlacingSettings),
    )


def prepare(
    body_class: BodyClass,
    domain: Domain | Surface | float,
    density: PreparedDensity | None = None,
    *,
    apart: bool = False,
    share: float = 1.0,
) -> PreparedClass:
    """Return a class as it is placed in a domain.

    Args:
        body_class: What is asked.
        domain: The domain, or its area [m²].
        density: Its density where it has been prepared already.
        apart: Whether bodies may not overlap: a count of ``"cover"`` then means no more of the ground than they can cover so.
        share: What such a count means of that.

    Raises:
        ProblemError: A sharpening that leaves nothing, a density that covers less than half a body, or a share without a body.
    """
    covering = apart and body_class.count == "cover"
    most = packable_share(body_class.sizes, body_class.room, body_class.gap) if covering else math.inf
    if isinstance(domain, Surface):
        return prepare_on_surface(body_class, domain, most, share)
    if callable(body_class.density):
        raise ProblemError(
            f'`density` of class "{body_class.name}" is a function of points, which needs a Surface as `domain`; got a Domain'
        )
    image, notes = density or prepare_density(body_class)
    area = domain if isinstance(domain, float) else domain.area
    if covering:
        image = np.minimum(image, np.float32(most))
        if isinstance(domain, Domain):
            mean = np.average(
                [size.mean_area for size in body_class.sizes], weights=[size.share or 1.0 for size in body_class.sizes]
            )
            share *= share_inside(domain, float(mean))
    sizes = count_sizes(body_class, share * float(image.mean(dtype=np.float64)) * area)
    return PreparedClass(
        body_class.name,
        sizes,
        image,
        notes,
        body_class,
        share=share,
        **values_of(body_class, PlacingSettings),
    )


def prepare_all(
    classes: Sequence[BodyClass | PreparedClass], domain: Domain | Surface, *, apart: bool
) -> tuple[PreparedClass, ...]:
    """Return classes as they are placed in a domain together; those that have been prepared as they were, alone.

    Args:
        classes: What is asked.
        domain: The domain.
        apart: Whether bodies may not overlap; see :func:`prepare`.
    """
    share = _share_of_cover(classes) if apart else 1.0
    # A class of another problem may have been cut and counted before.
    return tuple(
        (c.base or c) if isinstance(c, PreparedClass) else prepare(c, domain, apart=apart, share=share) for c in classes
    )


def _share_of_cover(classes: Sequence[BodyClass | PreparedClass]) -> float:
    """What classes that are to cover the ground, and keep apart on it, can have of what each of them alone could cover."""
    covering = [c for c in classes if isinstance(c, BodyClass) and c.count == "cover"]
    if not covering:
        return 1.0
    fits = [packable_share(c.sizes, c.room, c.gap) for c in covering]
    images = [np.minimum(prepare_density(c).image, np.float32(f)) for c, f in zip(covering, fits, strict=True)]
    return scale_to_fit(images, max(fits))


def cut_out(
    body_class: PreparedClass,
    domain: Domain,
    obstacles: Sequence[Obstacle],
    known: dict[Hashable, np.ndarray] | None = None,
) -> PreparedClass:
    """Return a class whose density is 0 on obstacles; its image may have more pixels.

    Args:
        body_class: The class.
        domain: Where.
        obstacles: The obstacles.
        known: What other classes have needed beside these obstacles, and is not made again: clearances by the shapes of their images,
            and what is left of images.

    Raises:
        ProblemError: Nothing of the density is left, or too little for a count of ``"cover"``.
    """
    image = body_class.density_image
    shape = mask_shape(obstacles, domain, (image.shape[0], image.shape[1]), body_class.body_count)
    pixel = math.sqrt(domain.area / (shape[0] * shape[1]))
    known = {} if known is None else known
    if shape not in known:
        known[shape] = clearance(obstacles, domain, shape, pixel)
    key = id(image), shape
    if key not in known:
        factors = [n // own for n, own in zip(shape, image.shape, strict=True)]
        fine = np.repeat(np.repeat(image, factors[0], axis=0), factors[1], axis=1)
        # The share of a pixel that an edge leaves.
        known[key] = fine * np.clip(0.5 + known[shape] / np.float32(pixel), 0.0, 1.0)
    fine = known[key]
    if not fine.any():
        raise ProblemError(
            f'`obstacles` must leave some ground where the density of class "{body_class.name}" is above 0',
            Refusal(Reason.OBSTACLES_EVERYWHERE, len(obstacles), 0, (body_class.name, "")),
        )
    # What is left says how many bodies cover it.
    sizes = body_class.sizes
    if body_class.asked is not None:
        sizes = count_sizes(body_class.asked, body_class.share * float(fine.mean(dtype=np.float64)) * domain.area)
    return replace(body_class, density_image=fine, sizes=sizes)


def cut_out_on_surface(
    body_class: PreparedClass, surface: Surface, obstacles: Sequence[Obstacle], outlines: OutlinesOnSurface
) -> PreparedClass:
    """Return a class whose density on a surface is 0 within the balls of obstacles, and within those that are outlines on it.

    Raises:
        ProblemError: Nothing of the density is left, or too little for a count of ``"cover"``.
    """
    assert body_class.asked is not None
    edge = math.sqrt(surface.area / max(body_class.body_count, 1)) / PIXELS_PER_SPACING
    balls = np.array(
        [(*obstacle.ball[:3], obstacle.ball[3] + obstacle.margin) for obstacle in obstacles if obstacle.ball]
    )

    def left(points: PointsOnSurface) -> np.ndarray:
        density = body_class.density_on(points)
        position = points.position
        for ball in balls:
            away = np.linalg.norm(position - ball[:3], axis=1) - ball[3]
            # Ends within an edge that is narrow beside the spacing.
            density = density * np.clip(0.5 + away / edge, 0.0, 1.0)
        return density

    # What was corrected or sharpened is so already.
    asked = replace(body_class.asked, density=left, density_correction=False, unsharp=None)
    cut = replace(
        body_class,
        asked=asked if len(balls) else body_class.asked,
        outlines=outlines if len(outlines) else None,
        edge=edge,
    )
    mean = float(cut.density_on(surface.sample()).mean())
    if mean <= 0.0:
        raise ProblemError(
            f'`obstacles` must leave some ground where the density of class "{body_class.name}" is above 0',
            Refusal(Reason.OBSTACLES_EVERYWHERE, len(obstacles), 0, (body_class.name, "")),
        )
    return replace(cut, sizes=count_sizes(asked, mean * surface.area))


def _to_cover(body_class: PreparedClass, domain: Domain | Surface) -> tuple[BodyClass, float, float, float]:
    """Of a class that is to cover its ground: what was asked, the area of its bodies and of that ground [m²], and what share fits."""
    asked = body_class.asked
    assert asked is not None
    wanted = sum((size.count or 0) * size.mean_area for size in body_class.sizes)
    here = body_class.density_image if isinstance(domain, Domain) else body_class.density_on(domain.sample())
    return asked, wanted, float(np.mean(here > 0.0)) * domain.area, packable_share(asked.sizes, asked.room, asked.gap)


def beside_fixed(body_class: PreparedClass, domain: Domain | Surface, taken: float) -> PreparedClass:
    """Return a class with a count of ``"cover"`` that covers what fixed bodies leave of its ground, without overlap.

    Args:
        body_class: As it covers all of the ground.
        domain: Where.
        taken: Area of the fixed bodies [m²].

    Raises:
        ProblemError: Less than half a body is left.
    """
    asked, wanted, ground, fits = _to_cover(body_class, domain)
    most = body_class.share * ground * max(fits - LOST_BESIDE_FIXED * taken / ground, LEAST_BESIDE_FIXED * fits)
    left = min(wanted, most) - taken
    if left < 0.5 * min(size.mean_area for size in body_class.sizes):
        raise ProblemError(
            f'`count` of class "{body_class.name}" is "cover", but its fixed bodies take the {min(wanted, most):.3g} m² that it can '
            "cover without overlap",
            Refusal(Reason.COVER_BESIDE_FIXED, taken, min(wanted, most), (body_class.name, "")),
        )
    return replace(body_class, sizes=count_sizes(asked, left))


def beside_counted(body_class: PreparedClass, domain: Domain | Surface, taken: float) -> PreparedClass:
    """Return a class with a count of ``"cover"`` that covers no more than other classes, whose counts are given, leave to fit.

    Args:
        body_class: As it covers all of the ground.
        domain: Where.
        taken: Its part of the area of bodies of those classes [m²]: of these, all counts as if it lay on the ground of this class.

    Raises:
        ProblemError: Less than half a body is left.
    """
    asked, wanted, ground, fits = _to_cover(body_class, domain)
    left = body_class.share * ground * fits - taken
    if left >= wanted:
        return body_class
    if left < 0.5 * min(size.mean_area for size in body_class.sizes):
        raise ProblemError(
            f'`count` of class "{body_class.name}" is "cover", but the counts of the classes beside it take all that fits without '
            "overlap",
            Refusal(Reason.COVER_BESIDE_COUNTED, taken, body_class.share * ground * fits, (body_class.name, "")),
        )
    return replace(body_class, sizes=count_sizes(asked, left))


def prepare_density(body_class: BodyClass) -> PreparedDensity:
    """Return the density of a class, sharpened and corrected.

    Raises:
        ProblemError: The sharpening leaves nothing.
    """
    where = f'class "{body_class.name}"'
    # A function of points says what it is where it is asked.
    image = np.ones((1, 1), np.float32) if callable(body_class.density) else np.asarray(body_class.density)
    notes: tuple[str, ...] = ()
    if body_class.unsharp is not None:
        image, notes = _sharpened(image, body_class, where)
    if body_class.density_correction or body_class.count == "cover":
        # What was sharpened may be above 1; a share that was asked for is not.
        image = np.minimum(image, np.float32(1.0))
    if body_class.density_correction:
        image = correct_density(image, f"`density` of {where}").astype(np.float32)
    return PreparedDensity(image, notes + _notes_on_clumps(body_class))


def _notes_on_clumps(body_class: BodyClass) -> tuple[str, ...]:
    """Say that a size of clumps does nothing where there are none."""
    if body_class.clump_size == 0.0 or body_class.clustering > 0.0:
        return ()
    text = f'`clump_size` of class "{body_class.name}" does nothing: there are no clumps while its `clustering` is 0'
    return (Note(text, NoteKind.IGNORED),)


def _sharpened(image: np.ndarray, body_class: BodyClass, where: str) -> tuple[np.ndarray, tuple[str, ...]]:
    assert body_class.unsharp is not None
    given = body_class.unsharp
    sharpened, clipped = unsharp_mask(image, given.amount, given.radius, given.overshoot)
    with np.errstate(over="ignore"):
        image = sharpened.astype(np.float32)
    if not np.isfinite(image).all():
        raise ProblemError(
            f"`unsharp` of {where} must leave a finite density; lower its amount",
            Refusal(Reason.SHARPENED_TOO_MUCH, math.inf, math.inf, (body_class.name, "")),
        )
    if not image.any():
        raise ProblemError(
            f"`unsharp` of {where} must leave a density above 0 somewhere; lower its amount",
            Refusal(Reason.SHARPENED_TOO_MUCH, 0, 0, (body_class.name, "")),
        )
    if clipped <= 0.0:
        return image, ()
    share = f"{clipped:.1%}" if clipped >= 5e-4 else "less than 0.1%"
    return image, (f"`unsharp` of {where} made {share} of its density negative, which counts as 0",)


def count_sizes(body_class: BodyClass, covered: float) -> tuple[Size, ...]:
    """Return the sizes of a class, every one with a whole count.

    Args:
        body_class: What is asked.
        covered: Area that its prepared density adds up to [m²]; for a count of ``"cover"``.

    Raises:
        ProblemError: The area is less than half a body, or a share of the count is.
    """
    sizes = tuple(body_class.sizes)
    if body_class.count is None:
        return sizes
    if isinstance(body_class.count, int):
        count = body_class.count
        if count > MOST_BODIES:
            raise ProblemError(
                f'`count` of class "{body_class.name}" is too large ({show(count)}): at most {MOST_BODIES} bodies can be placed',
                Refusal(Reason.TOO_MANY_BODIES, count, MOST_BODIES, (body_class.name, "")),
            )
    else:
        number = sum(covered * (size.share or 0.0) / size.mean_area for size in sizes)
        if number < 0.5:
            raise ProblemError(
                f'`count` of class "{body_class.name}" is "cover", but its density covers {covered:.3g} m², less than half a body',
                Refusal(
                    Reason.COVER_BELOW_ONE_BODY,
                    covered,
                    min(size.mean_area for size in sizes),
                    (body_class.name, ""),
                ),
            )
        if number > MOST_BODIES:
            raise ProblemError(
                f'`count` of class "{body_class.name}" is "cover", which takes about {number:.3g} bodies of these areas; at most '
                f"{MOST_BODIES} can be placed",
                Refusal(Reason.TOO_MANY_BODIES, number, MOST_BODIES, (body_class.name, "")),
            )
        count = max(round(number), 1)
    shares = np.array([size.share for size in sizes], dtype=np.float64)
    counts = apportion(count, shares / np.array([size.mean_area for size in sizes])).tolist()
    for size, number in zip(sizes, counts, strict=True):
        if number < 1:
            raise ProblemError(
                f'`share` of size "{size.name}" of class "{body_class.name}" must be larger: {size.share:g} of the area '
                f"that {count} bodies take is less than one body of this size",
                Refusal(Reason.SHARE_BELOW_ONE_BODY, count, size.share or 0.0, (body_class.name, size.name)),
            )
    return tuple(replace(size, count=number, share=None) for size, number in zip(sizes, counts, strict=True))
