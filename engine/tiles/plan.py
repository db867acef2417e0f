"""The plan of a run in tiles: the same wherever it is made, from the recipe and a few numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..errors import ProblemError
from ..files.window_images import Georeference
from ..files.windowed_recipe import WindowedRecipe, read_windowed_recipe
from ..problem.clumps import clump_size_of, crowding_of, occupied, pushed_out_at, share_at_large
from ..problem.cover import Cover, cover_of_images
from ..problem.direction_field import direction_field
from ..problem.domain import Domain
from ..problem.ground_of_large import LARGE
from ..problem.line import Line
from ..problem.notes_on_settings import note_on_fit, notes_on_settings
from ..problem.packing import packable_share
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem
from ..space.density import box_integrals
from .clump_blocks import ClumpedSource, Clumps
from .coarse import CoarseGrid
from .density_windows import ArraySource, Source, WrappedSource, units_along
from .groups import TileGroups, group_tiles
from .layout import Layout
from .reach import largest_reach

__all__ = ["Pass", "Plan", "TileRun", "choose_tiles", "cover_of_tiles", "make_plan", "read_tiled_recipe"]

# Tiles are so many typical spacings long, and so many of the rarest group's, but never longer than for so many bodies; by device.
SPACINGS_PER_TILE = {"cpu": 100.0, "cuda": 1000.0}
SPACINGS_OF_RAREST = 30.0
MOST_IN_TILE = {"cpu": 90_000, "cuda": 2_000_000}
# Of shorter tiles, in spacings, the margins of all passes meet somewhere, and bodies there are never free; with contact and without.
FEWEST_SPACINGS = {True: 60.0, False: 30.0}
# Where large bodies keep others off, tiles are at least so many spacings and so many reaches of the largest long: bodies beside the
# cuts of both of the last two passes are a quarter of a tile from those of the one before, where they have to be free.
SPACINGS_AROUND_LARGE, REACHES = 20.0, 8.0
# Windows are shifted along the diagonal, so that every place is far from the cuts of one pass at least; the last pass is of the tiles
# themselves. Where contact parts footprints, one more pass comes after the last warp; the cuts of the last two are as far apart as can
# be, because nothing settles again what the last one pins.
SHIFTS = ((1.0 / 3.0, 1.0 / 3.0), (2.0 / 3.0, 2.0 / 3.0), (0.0, 0.0))
SHIFTS_OF_CONTACT = ((0.25, 0.25), (0.75, 0.75), (0.5, 0.5), (0.0, 0.0))
# Cells of the coarse grid over the spacing of all bodies, and how many there are at most of all groups.
CELL = 2.0
MOST_CELLS = 24_000_000
# Groups of fewer bodies to a tile are spread over the whole domain before all others start, if they are no more than so many.
RARE_PER_TILE, MOST_RARE = 100, 50_000
# Bodies that reach farther than this, in spacings, may reach others over a cut: free ones come no nearer to cuts than twice as far.
REACH_THAT_MATTERS = 1.25
# Units of a layout along a rim, at least.
UNITS_PER_RIM = 4.0
# The folder of clumps.
CLUMP_BLOCKS = "clump-blocks"
# Pixels along either side that densities are looked at with before anything is known.
SURVEY = 512


@dataclass(frozen=True)
class TileRun:
    """What every process knows of a run.

    Attributes:
        recipe: The recipe's file, absolute.
        folder: Where everything is written, absolute.
        seed: Instead of the recipe's.
        tiles: Columns and rows.
        steps: Of every pass.
        device: See :func:`~esh.solve`.
        ending: Of the tiles' files.
        contents: Hash of the recipe and its densities: processes that stay make another plan when these are others.
    """

    recipe: str
    folder: str
    seed: int | None
    tiles: tuple[int, int]
    steps: tuple[int, ...]
    device: str
    ending: str
    contents: str

    @property
    def work(self) -> Path:
        """Where the parts of a run lie that is not finished."""
        return Path(self.folder, ".work")


@dataclass(frozen=True)
class Pass:
    """One pass over all windows.

    Attributes:
        shift: Of its windows, in tiles.
        steps: Of the descent.
        warp: What is warped before it: ``"sizes"`` each by itself, ``"all"`` together, or nothing.
        part: Whether footprints are parted at its end.
    """

    shift: tuple[float, float]
    steps: int
    warp: str
    part: bool


@dataclass(frozen=True, eq=False)
class Plan:
    """Everything about a run but where its bodies are.

    Attributes:
        problem: What is to be placed; not with the densities that are read by window.
        sources: Density of every class.
        clumped: The same of those that have clumps, and nothing beyond the edges of the domain.
        groups: The groups of all bodies.
        layout: The tiles.
        grid: The coarse grid.
        spacing: Mean spacing of all bodies over the domain [m].
        fine: Typical spacing where bodies are [m].
        passes: The passes.
        directions: Of every line with directions that are an image: double-angle vectors, shape ``[height, width, 2]``.
        georeference: Where the domain lies.
        longest: Longest axis of a line [m].
        bending: Charges of the lines that bend, the most that any of these has; 0 where none does.
        reach: How far the largest body reaches from its position [m]; 0 where no footprints keep apart.
        rim: How far around windows others are seen and pinned [m], so that nobody who reaches over a cut is overlooked: as far as the
            largest body reaches; 0 where none reaches so far that it matters, or no footprints keep apart.
        among_large: Whether small bodies stand among large ones, from which footprints keep apart: how dense they stand is then
            corrected in windows as in one solve, which would else leave them in closed rows around large ones.
        rare: Groups that are spread as a whole, because tiles have too few of them to be even.
        notes: Sentences worth attention that are known without measuring.
    """

    problem: Problem
    sources: tuple[Source, ...]
    clumped: dict[int, ClumpedSource]
    groups: TileGroups
    layout: Layout
    grid: CoarseGrid
    spacing: float
    fine: float
    passes: tuple[Pass, ...]
    directions: dict[tuple[int, int], np.ndarray]
    georeference: tuple[Georeference, tuple[int, int]] | None
    longest: float
    bending: int
    reach: float
    rim: float
    among_large: bool
    rare: tuple[int, ...]
    notes: tuple[str, ...]


def read_tiled_recipe(recipe: str | Path, seed: int | None) -> WindowedRecipe:
    """Read a recipe that is to be solved in tiles.

    Raises:
        EshError: It cannot be read, or holds what tiles do not know.
    """
    scene = read_windowed_recipe(recipe, seed=seed)
    problem = scene.problem
    if not isinstance(problem.domain, Domain):
        raise ProblemError("`domain` must be a rectangle for tiles; it is a surface")
    return scene


def choose_tiles(scene: WindowedRecipe, length: float | None, on_gpu: bool) -> tuple[int, int]:
    """Return columns and rows of tiles.

    Args:
        scene: The recipe.
        length: Of a tile [m]; None for one that suits the bodies.
        on_gpu: Whether windows are solved on a GPU.

    Raises:
        ProblemError: A length that is no number above 0, or too short.
    """
    problem = scene.problem
    size = problem.rectangle.size
    fine = _typical_spacing(scene, [_survey(scene, c)[0] for c in range(len(problem.classes))])
    groups = group_tiles(problem)
    least, why = _least_length(problem, groups, fine)
    if length is None:
        kind = "cuda" if on_gpu else "cpu"
        rarest = math.sqrt(problem.rectangle.area / int(groups.count.min()))
        wide = min(SPACINGS_OF_RAREST * rarest, math.sqrt(MOST_IN_TILE[kind]) * fine)
        length = max(SPACINGS_PER_TILE[kind] * fine, wide, least)
    if not (math.isfinite(length) and length >= least) and length < max(size):
        raise ProblemError(f"`tile` must be at least {least:.4g} m long, {why}; got {length:g}")
    columns, rows = max(1, int(size[0] / length + 1e-9)), max(1, int(size[1] / length + 1e-9))
    if problem.rectangle.periodic and (columns == 1) != (rows == 1):
        # Windows do not wrap: along either axis there are cuts, or along none.
        columns, rows = max(2, columns), max(2, rows)
        if min(size[0] / columns, size[1] / rows) < least:
            raise ProblemError(
                f"a periodic `domain` must be at least {2.0 * least:.4g} m wide and high for tiles, each of which is at least "
                f"{why}; got {size[0]:g} by {size[1]:g} m"
            )
    return columns, rows


def _least_length(problem: Problem, groups: TileGroups, fine: float) -> tuple[float, str]:
    """Length of the shortest tiles [m], and what that is."""
    fewest = FEWEST_SPACINGS[problem.avoid_overlap]
    reach = largest_reach(problem, groups) if problem.avoid_overlap else 0.0
    around = SPACINGS_AROUND_LARGE * fine + REACHES * reach
    if around > fewest * fine:
        return around, f"{SPACINGS_AROUND_LARGE:g} spacings and {0.5 * REACHES:g} times the extent of the largest body"
    return fewest * fine, f"{fewest:g} spacings"


def cover_of_tiles(scene: WindowedRecipe) -> Cover:
    """Return how much of the ground footprints take, on a coarse look at the densities, and without a number for every body."""
    return _cover(scene.problem, [_survey(scene, c)[0] for c in range(len(scene.problem.classes))])


def _cover(problem: Problem, surveys: list[np.ndarray]) -> Cover:
    """What :func:`cover_of_tiles` returns, by what was seen of the densities."""
    of_class, fits = np.zeros(len(problem.classes)), []
    for c, body_class in enumerate(problem.classes):
        ground = [(size.count or 0) * size.mean_ground for size in body_class.sizes]
        of_class[c] = sum(ground)
        fits += [
            area * packable_share([size], body_class.room, body_class.gap)
            for area, size in zip(ground, body_class.sizes, strict=True)
        ]
    return cover_of_images(problem, surveys, of_class, sum(fits) / of_class.sum())


def _notes(problem: Problem, surveys: list[np.ndarray]) -> tuple[str, ...]:
    """What can be said of a run before it: whatever is measured on bodies needs all of them at once."""
    cover = _cover(problem, surveys)
    on_fit = cover.warning if problem.avoid_overlap else note_on_fit(problem, cover.covered)
    return tuple(([] if on_fit is None else [on_fit]) + notes_on_settings(problem))


def passes_of(problem: Problem, layers: int, tiles: tuple[int, int], steps: tuple[int, ...]) -> tuple[Pass, ...]:
    """Return the passes of a run."""
    if tiles == (1, 1):
        return (Pass((0.0, 0.0), sum(steps), "", problem.avoid_overlap),)
    warps: tuple[str, ...]
    if problem.avoid_overlap:
        warps = ("sizes" if layers > 1 else "", "sizes", "", "")
        many = (steps[0], steps[1], steps[1], steps[2])
        return tuple(Pass(shift, many[k], warps[k], k > 0) for k, shift in enumerate(SHIFTS_OF_CONTACT))
    warps = ("sizes", "sizes", "all") if layers > 1 else ("", "sizes", "sizes")
    return tuple(Pass(shift, steps[k], warps[k], False) for k, shift in enumerate(SHIFTS))


@lru_cache(maxsize=2)
def make_plan(run: TileRun) -> Plan:
    """Return the plan of a run; a process makes it once."""
    scene = read_tiled_recipe(run.recipe, run.seed)
    problem = scene.problem
    surveys = [_survey(scene, c) for c in range(len(problem.classes))]
    sources = _sources(scene)
    clumped = {c: ClumpedSource(sources[c], _clumps(run, scene, c, *surveys[c])) for c in scene.clumps}
    sources = tuple(clumped.get(c, source) for c, source in enumerate(sources))
    if problem.rectangle.periodic:
        sources = tuple(WrappedSource(source) for source in sources)
    groups = group_tiles(problem, [shares for shares, _ in surveys])
    size = problem.rectangle.size
    spacing = math.sqrt(problem.rectangle.area / groups.body_count)
    fine = _typical_spacing(scene, [shares for shares, _ in surveys])
    cell = max(CELL * spacing, math.sqrt(problem.rectangle.area * groups.number / MOST_CELLS))
    shape = tuple(max(4, round(length / cell)) for length in size[::-1])
    lines = {
        (c, s): member.line
        for c, body_class in enumerate(problem.classes)
        for s, member in enumerate(body_class.sizes)
        if member.line is not None
    }
    reach = largest_reach(problem, groups) if problem.avoid_overlap else 0.0
    rim = reach if reach > REACH_THAT_MATTERS * fine and run.tiles != (1, 1) else 0.0
    units = [units_along([s.shape[1 - axis] for s in sources], run.tiles[axis]) for axis in (0, 1)]
    if rim:
        # Windows are seen with little more around them than they have to.
        units = [n * max(1, math.ceil(UNITS_PER_RIM * size[axis] / (n * rim))) for axis, n in enumerate(units)]
    return Plan(
        problem,
        sources,
        clumped,
        groups,
        Layout(size, run.tiles, (units[0], units[1]), problem.rectangle.periodic),
        CoarseGrid(size, (shape[0], shape[1]), problem.rectangle.periodic),
        spacing,
        fine,
        passes_of(problem, int(groups.layer.max()) + 1, run.tiles, run.steps),
        _directions(problem, lines),
        scene.georeference,
        max((line.longest for line in lines.values()), default=0.0),
        max((line.charges for line in lines.values() if line.straightness is not None), default=0),
        reach,
        rim,
        _among_large(problem, groups),
        _rare(groups, run.tiles),
        _notes(problem, [shares for shares, _ in surveys]),
    )


def _among_large(problem: Problem, groups: TileGroups) -> bool:
    """See :attr:`Plan.among_large`."""
    return problem.avoid_overlap and float(groups.mean_area.max()) >= LARGE * float(groups.mean_area.min())


def _rare(groups: TileGroups, tiles: tuple[int, int]) -> tuple[int, ...]:
    """Groups that are too few for tiles; levels of a range are even together."""
    most = min(RARE_PER_TILE * tiles[0] * tiles[1], MOST_RARE)
    if tiles == (1, 1):
        return ()
    # Those that have fixed bodies find their places around them.
    with_fixed = set(groups.group_of(groups.fixed_identity).tolist())
    return tuple(
        g
        for g, count in enumerate(groups.count.tolist())
        if count < most and not groups.sizes[g].is_range and g not in with_fixed
    )


def uncut(body_class: PreparedClass) -> PreparedClass:
    """A class without what obstacles cut out of its density."""
    return body_class.base or body_class


def _sources(scene: WindowedRecipe) -> tuple[Source, ...]:
    """Densities of all classes, without clumps."""
    return tuple(
        scene.windowed[c] if c in scene.windowed else ArraySource(uncut(k).density_image)
        for c, k in enumerate(scene.problem.classes)
    )


def _clumps(run: TileRun, scene: WindowedRecipe, class_index: int, shares: np.ndarray, mean: float) -> Clumps:
    """Clumps of a class, of which a coarse look at its density is known."""
    problem, domain = scene.problem, scene.problem.rectangle
    clustering, asked = scene.clumps[class_index]
    count = problem.classes[class_index].body_count
    size = clump_size_of(asked, domain, count, occupied(shares))
    pixel = [length / many for length, many in zip(domain.size[::-1], shares.shape, strict=True)]
    return Clumps(
        size,
        clustering,
        domain.size,
        domain.periodic,
        (problem.seed, 8, class_index),
        share_at_large(shares, pixel, size),
        pushed_out_at(problem.regularity) / count * mean * domain.area,
        run.work / CLUMP_BLOCKS / f"{class_index:03d}",
    )


def _directions(problem: Problem, lines: dict[tuple[int, int], Line]) -> dict[tuple[int, int], np.ndarray]:
    result = {}
    for (c, s), line in lines.items():
        if isinstance(line.direction, np.ndarray) or line.direction == "density":
            image = uncut(problem.classes[c]).density_image
            pixel = (problem.domain.size[0] / image.shape[1], problem.domain.size[1] / image.shape[0])
            field = direction_field(line.direction, image, *line.tensor_scales, pixel_size=pixel)
            result[c, s] = field.double_angle_vectors()
    return result


def _typical_spacing(scene: WindowedRecipe, surveys: list[np.ndarray]) -> float:
    """Spacing [m] at the number density that the average body sees, on a coarse look at the densities."""
    problem = scene.problem
    number = np.zeros_like(surveys[0])
    crowded = 0.0
    for c, (body_class, shares) in enumerate(zip(problem.classes, surveys, strict=True)):
        own = body_class.body_count * shares
        number += own
        if c in scene.clumps:
            crowded += crowding_of(scene.clumps[c][0]) * float((own**2).sum())
    cell = problem.rectangle.area / number.size
    return math.sqrt(cell * number.sum() / ((number**2).sum() + crowded))


def _survey(scene: WindowedRecipe, class_index: int) -> tuple[np.ndarray, float]:
    """A coarse look at a density without clumps: shares of it in cells of the domain, and its mean."""
    body_class, source = scene.problem.classes[class_index], _sources(scene)[class_index]
    rows, columns = source.shape
    image = _thinned(source) if rows * columns > 4 * SURVEY**2 else source.read(0, rows, 0, columns)
    if not image.any():
        raise ProblemError(f'`density` of class "{body_class.name}" must be above 0 somewhere; it is 0 everywhere')
    return box_integrals(image, (SURVEY // 2, SURVEY // 2)), float(image.mean(dtype=np.float64))


def _thinned(source: Source) -> np.ndarray:
    """Some rows of an image, and means over its columns."""
    rows, columns = source.shape
    chosen = np.unique(((np.arange(SURVEY) + 0.5) * rows / SURVEY).astype(int).clip(0, rows - 1))
    edge = np.unique(np.linspace(0, columns, min(SURVEY, columns) + 1).astype(int))
    lines = [
        np.add.reduceat(source.read(row, row + 1, 0, columns)[0].astype(np.float64), edge[:-1]) / np.diff(edge)
        for row in chosen.tolist()
    ]
    return np.array(lines, np.float32)
