"""What a run reached, as data, as a dictionary for JSON and as text for a terminal or a panel."""

from __future__ import annotations

from dataclasses import asdict, dataclass

__all__ = ["ClassReport", "Report", "SizeReport"]


@dataclass(frozen=True)
class SizeReport:
    """Counts of one size of one class: ``asked`` and ``placed`` are of all its bodies, ``fixed`` of those that were there before."""

    name: str
    area: float
    asked: int
    placed: int
    fixed: int = 0


@dataclass(frozen=True)
class ClassReport:
    """One class: its counts and how well it follows its density.

    ``coverage_error`` is :func:`~esh.engine.quality.coverage.coverage_error` at k = 1 of the class alone.
    """

    name: str
    coverage_error: float
    sizes: tuple[SizeReport, ...]


@dataclass(frozen=True)
class Report:
    """What was reached.

    Attributes:
        steps: Relaxation steps taken.
        converged: Whether the last steps were small; False after a stop, or where the steps ran out before.
        seconds: Wall-clock time [s].
        device: Device the run was made on, e.g. ``"cpu"`` or ``"cuda:0"``.
        coverage_error: Coverage error of all bodies together, k = 1.
        smallest_spacing: Smallest distance between two bodies' centers, over the hexagonal spacing of as many bodies
            of the same mean density at that place; 1 is a perfect lattice. None with fewer than two bodies.
        overlaps: Number of pairs of bodies whose outlines (discs of their area where they were given none) overlap by more than 1e-3
            of the narrower one's width; at least so many, where a body overlaps more than 200 others. Pairs of fixed bodies do not
            count.
        covered: Sum of the footprints over the area where bodies may be (density above zero).
        classes: One entry per class.
        deepest_overlap: How deep the deepest overlap is [m]: the shortest way that parts the two; 0 where nothing overlaps.
        deepest_pair: The two bodies, None where nothing overlaps.
        deepest_place: The middle between them [m].
        overlapping: Bodies that overlap others, those that lie deepest in another first; at most 10,000.
        notes: Sentences worth the user's attention, e.g. that the footprints cannot fit.
        closest: Smallest distance between two bodies' centers [m], in the plane of the domain; None with fewer than two bodies.
        usual: Median of every body's distance to its nearest neighbor [m].
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
    deepest_overlap: float = 0.0
    deepest_pair: tuple[int, int] | None = None
    deepest_place: tuple[float, float] | None = None
    overlapping: tuple[int, ...] = ()

    def to_dict(self) -> dict:
        """Return the report as plain dictionaries and lists, ready for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        rows = [("class", "size", "asked", "placed", "coverage error")]
        for entry in self.classes:
            for index, size in enumerate(entry.sizes):
                error = f"{entry.coverage_error:.4f}" if index == 0 else ""
                rows.append((entry.name if index == 0 else "", size.name, str(size.asked), str(size.placed), error))
        widths = [max(len(row[column]) for row in rows) for column in range(5)]
        aligned = [
            "  ".join(
                cell.ljust(width) if column < 2 else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
        spacing = "-" if self.smallest_spacing is None else f"{self.smallest_spacing:.2f}"
        state = "converged" if self.converged else "not converged"
        lines = [
            *aligned,
            f"all bodies: coverage error {self.coverage_error:.4f}, smallest spacing {spacing} (hexagonal = 1), "
            f"{self.overlaps} overlaps, {self.covered:.0%} of the space covered",
            f"{self.steps} steps, {state}, {self.seconds:.2f} s on {self.device}",
            *self.notes,
        ]
        return "\n".join(lines)
