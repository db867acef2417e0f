"""What a run reached, as data, as a dictionary for JSON and as text for a terminal or a panel."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from .note import NoteKind, kind_of

__all__ = ["UNEVEN", "ClassReport", "Report", "SizeReport"]

# Peak of a signal over its mean: a dot on every pixel of an image with four times as many pixels as there are dots on average.
PEAK = 4.0
# Smallest spacings below this are explained: they come of uneven densities and of sizes that mix, and look like a flaw.
LOW_SPACING = 0.5
# Notes that explain all figures: without room for all, nothing else can be as it should.
FIRST = (NoteKind.COVER, NoteKind.CANNOT_FIT)
# Notes on coverage errors of classes, beside which they are printed.
BESIDE_CLASSES = (NoteKind.ERROR_OF_FEW, NoteKind.AROUND_LARGER)
# Coverage errors above this are seen, and somebody asks why. Half of it is hardly seen, and independent random points have 0.31.
UNEVEN = 0.15
# How the order is printed: between these two.
ORDER_OF = "random = 0.37, lattice = 1"


def _psnr(coverage_error: float) -> float | None:
    """Peak signal over the noise that a coverage error is [dB]; None where there is none."""
    return 20.0 * math.log10(PEAK / coverage_error) if coverage_error > 0.0 else None


@dataclass(frozen=True)
class SizeReport:
    """Counts of one size of one class.

    Attributes:
        name: Name of the size.
        area: Mean footprint that was asked for [m²].
        asked: Number of bodies asked for, fixed ones included.
        placed: Number of bodies placed, fixed ones included.
        fixed: Number of bodies that were fixed before the run.
    """

    name: str
    area: float
    asked: int
    placed: int
    fixed: int = 0


@dataclass(frozen=True)
class ClassReport:
    """Counts of one class, and how well it follows its density.

    Attributes:
        name: Name of the class.
        coverage_error: :func:`~esh.engine.quality.coverage.coverage_error` of the class alone, at k = 1. Where overlap is avoided,
            nothing is asked for on the ground of bodies that are at least nine times as large. If these are of the class as well,
            they are measured by themselves, and this is the mean of both errors, weighted by footprints.
        sizes: One entry for each size.
        smallest_spacing: Smallest distance between two of its bodies, over the hexagonal spacing of the class alone. None with fewer
            than two bodies, and on surfaces.
        order: Mean sixfold order of its bodies alone, see :attr:`Report.order`.
        kept_off: Whether much larger bodies keep it off part of the ground, which makes its coverage error large.
    """

    name: str
    coverage_error: float
    sizes: tuple[SizeReport, ...]
    smallest_spacing: float | None = None
    order: float | None = None
    kept_off: bool = False

    @property
    def psnr(self) -> float | None:
        """Peak signal-to-noise ratio of the class alone [dB]; see :attr:`Report.psnr`."""
        return _psnr(self.coverage_error)


@dataclass(frozen=True)
class Report:
    """What was reached.

    Attributes:
        steps: Relaxation steps taken.
        converged: Whether bodies came to rest, see :func:`~esh.solve`, and nothing overlaps that is to keep apart; False after a
            stop, or where the steps ran out before.
        seconds: Wall-clock time [s].
        device: Device the run was made on, e.g. ``"cpu"`` or ``"cuda:0"``.
        coverage_error: Coverage error of all bodies together, k = 1.
        smallest_spacing: Smallest distance between two bodies' centers, over the hexagonal spacing of as many bodies
            of the same mean density at that place; 1 is a perfect lattice. None with fewer than two bodies.
        overlaps: Number of pairs of bodies whose outlines (discs of their area where they were given none) overlap by more than 1e-3
            of the narrower one's width; at least so many, where a body overlaps more than 200 others. Pairs of fixed bodies and of
            classes that may overlap do not count, nor does what a ``room`` below 1 allows.
        covered: Sum of the footprints over the area where bodies may be (density above zero): of the outlines and lines that came to
            be, without the ``gap`` or ``room`` that they keep. What a note compares with what fits counts these, and what was asked.
        classes: One entry per class.
        deepest_overlap: How deep the deepest overlap is [m]: the shortest way that parts the two; 0 where nothing overlaps.
        deepest_pair: The two bodies, None where nothing overlaps.
        deepest_place: The middle between them [m]: x and y, and z on a surface.
        overlapping: Bodies that overlap others, those that lie deepest in another first; at most 10,000.
        in_obstacles: Bodies whose outlines lie in an obstacle or its margin by more than 1e-3 of the narrower one's width, where
            overlap is avoided. Fixed bodies do not count.
        deepest_in_obstacle: How deep the deepest of them does [m].
        beyond_border: Bodies whose outlines reach across the border of an ``inset`` domain, where overlap is avoided. Fixed bodies do
            not count.
        farthest_beyond_border: How far the farthest of them does [m].
        leaning: Number of pairs of objects whose convex hulls meet in space although their outlines on the ground do not overlap: they
            lean into each other. A scatter in Blender counts them where overlap is avoided, of objects with outlines of their own.
            None where nobody has looked, and where nothing leans.
        deepest_leaning: How deep the deepest of them lie in each other [m]: about the shortest way that parts them.
        leaning_pair: The two bodies, None where nothing meets so.
        leaning_bodies: Bodies that meet others so, those that lie deepest in another first; at most 10,000.
        notes: Sentences worth the user's attention, e.g. that the footprints cannot fit.
        closest: Smallest distance between two bodies' centers [m], in the plane of the domain; on a surface in a straight line, of two
            on one sheet of it. None with fewer than two bodies.
        usual: Median of every body's distance to its nearest neighbor [m].
        order: Mean sixfold order of bodies' neighbors (Q6): how far the six nearest of a body stand at multiples of 60°. 1 is a
            hexagonal lattice, 0.37 are random points; of more than 10,000 bodies some thousands are looked at. None with fewer than
            seven, and on surfaces.
    """

    steps: int
    converged: bool
    seconds: float
    device: str
    coverage_error: float
    smallest_spacing: float | None
    overlaps: int
    covered: float
    classes: tuple[ClassReport, ...]
    notes: tuple[str, ...] = ()
    closest: float | None = None
    usual: float | None = None
    order: float | None = None
    deepest_overlap: float = 0.0
    deepest_pair: tuple[int, int] | None = None
    deepest_place: tuple[float, ...] | None = None
    overlapping: tuple[int, ...] = ()
    in_obstacles: int = 0
    deepest_in_obstacle: float = 0.0
    beyond_border: int = 0
    farthest_beyond_border: float = 0.0
    fixed_overlaps: int = 0
    leaning: int | None = None
    deepest_leaning: float = 0.0
    leaning_pair: tuple[int, int] | None = None
    leaning_bodies: tuple[int, ...] = ()

    @property
    def clean(self) -> bool:
        """Whether nothing that is not fixed overlaps, lies in an obstacle or reaches across the border."""
        return not (self.overlaps or self.in_obstacles or self.beyond_border)

    @property
    def psnr(self) -> float | None:
        """Peak signal-to-noise ratio of all bodies together [dB], both blurred by a mean spacing; the peak is four times the mean.

        The coverage error in decibels, as halftones are compared; None for an error of 0.
        """
        return _psnr(self.coverage_error)

    def to_dict(self) -> dict:
        """Return the report as plain dictionaries and lists, ready for JSON."""
        result = asdict(self) | {"psnr": self.psnr}
        for entry, own in zip(result["classes"], self.classes, strict=True):
            entry["psnr"] = own.psnr
        return result

    def __str__(self) -> str:
        rows = [
            (
                "class",
                "size",
                "asked",
                "placed",
                "coverage error",
                "smallest spacing (lattice = 1)",
                f"order ({ORDER_OF})",
            )
        ]
        for entry in self.classes:
            for index, size in enumerate(entry.sizes):
                error = f"{entry.coverage_error:.4f}" if index == 0 else ""
                apart = _two_digits(entry.smallest_spacing) if index == 0 else ""
                name = entry.name if index == 0 else ""
                order = _two_digits(entry.order) if index == 0 else ""
                rows.append((name, size.name, str(size.asked), str(size.placed), error, apart, order))
        widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
        aligned = [
            "  ".join(
                cell.ljust(width) if column < 2 else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
        noise = "" if self.psnr is None else f" (peak signal-to-noise {self.psnr:.0f} dB)"
        lines = [
            *self._notes_of(*FIRST),
            *aligned,
            *self._notes_of(*BESIDE_CLASSES),
            f"all bodies: coverage error {self.coverage_error:.4f}{noise}, {self._regularity()}, "
            f"{self.overlaps} overlap{'' if self.overlaps == 1 else 's'}, {self.covered:.0%} of the space covered",
            *self._notes_of(NoteKind.ALL_TOGETHER),
            *self._leaning(),
            *self._distances(),
            f"{self.steps} steps, {self._state()}, {self.seconds:.2f} s on {self.device}",
        ]
        return "\n".join([*lines, *(note for note in self.notes if note not in lines)])

    def _notes_of(self, *kinds: NoteKind) -> list[str]:
        return [note for note in self.notes if kind_of(note) in kinds]

    def _state(self) -> str:
        """Whether bodies came to rest, why not, and what helps where that is seen."""
        if self.converged:
            return "converged"
        if self._notes_of(NoteKind.OVERLAPS) or self.in_obstacles or self.beyond_border:
            return "not converged (not all bodies are parted)"
        errors = [entry.coverage_error for entry in self.classes if not entry.kept_off]
        uneven = min(self.coverage_error, max(errors, default=0.0)) > UNEVEN
        if uneven and not self._notes_of(NoteKind.ERROR_OF_FEW):
            return "not converged (bodies still move: more steps would make them more even)"
        return "not converged (bodies still move)"

    def _regularity(self) -> str:
        """How near bodies are, what part of a lattice's spacing the smallest is, and order where that is measured."""
        parts = ["closest pair -" if self.closest is None else f"closest pair {self.closest:.3g} m"]
        if self.usual is not None:
            parts.append(f"typical spacing {self.usual:.3g} m")
        if self.smallest_spacing is not None:
            parts.append(f"smallest spacing {self.smallest_spacing:.2f} of a lattice's")
        if self.order is not None:
            parts.append(f"order {self.order:.2f} ({ORDER_OF})")
        return ", ".join(parts)

    def _leaning(self) -> list[str]:
        """How many objects lean into each other, and how far."""
        if not self.leaning:
            return []
        pairs = "1 pair of objects leans" if self.leaning == 1 else f"{self.leaning} pairs of objects lean"
        return [f"{pairs} into each other above or below the ground, the deepest by {self.deepest_leaning:.3g} m"]

    def _distances(self) -> list[str]:
        """What the smallest spacing is compared with, where it is low."""
        if (self.smallest_spacing or 1.0) >= LOW_SPACING:
            return []
        return [
            "the smallest spacing is compared with what the density asks for at the place: it is low where few bodies are asked for, "
            "where sizes differ, and where larger bodies push small ones together"
        ]


def _two_digits(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
