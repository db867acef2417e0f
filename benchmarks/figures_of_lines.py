"""Hatching: lines, lines and dots, bent lines, colored lines (figures 16 and 17).

Figures are numbered as in Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import numpy as np
from esh.engine.drawing.halftone import render_halftone
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass, Unsharp
from esh.engine.problem.color_separation import MODELS, separate
from esh.engine.problem.direction_field import density_directions
from esh.engine.problem.domain import Domain
from esh.engine.problem.line import Line
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.quality.line_quality import angle_errors, crossing_lines
from experiment_run import Run
from pictures import astronaut, cat, face, sheet

# Bodies share the picture's ink: the area of one is the ink over their number, whatever it is.
INK = (0.08, 0.08, 0.1)


def area_for(image: np.ndarray, count: int) -> float:
    """Area of each of ``count`` bodies that together cover what ``image`` asks for, a pixel being a square meter."""
    return float(image.sum() / count)


def charges(placement: Placement, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and charges of the three charges of every line."""
    half = (
        0.5
        * placement.length[lines, None]
        * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)[lines]
    )
    middle = placement.position[lines]
    position = np.clip(np.concatenate([middle - half, middle, middle + half]), 0.0, placement.problem.domain.size)
    return position, np.repeat([1.0, 6.0, 1.0], int(lines.sum()))


def report_lines(run: Run, figure: str, name: str, placement: Placement, lines: np.ndarray, preferred: float) -> None:
    """Rows on length, direction, crossings and coverage of some lines."""
    problem = placement.problem
    image = problem.classes[int(placement.class_index[lines][0])].density_image
    directions = density_directions(image)
    height = problem.domain.size[1]
    column = np.clip(placement.position[lines, 0].astype(int), 0, image.shape[1] - 1)
    row = np.clip((height - placement.position[lines, 1]).astype(int), 0, image.shape[0] - 1)
    clear = directions.coherence[row, column] > 0.5
    angle = np.degrees(angle_errors(placement.angle[lines], directions.angle[row, column])[clear].mean())
    length = float(placement.length[lines].mean())
    count = int(lines.sum())
    crossing = (
        crossing_lines(placement.position[lines], placement.angle[lines], placement.length[lines], problem.domain)
        / count
    )
    position, charge = charges(placement, lines)
    # k = 2 in mean spacings of the lines, each of which is three charges.
    covered = coverage_error(position, charge, image, problem.domain, 2.0 * np.sqrt(3.0))
    run.row(
        figure,
        f"{name}: mean length",
        f"{length:.3f}",
        f"{preferred:g} within 10 %",
        abs(length / preferred - 1.0) <= 0.1,
    )
    run.row(
        figure,
        f"{name}: mean angle error where the coherence is over 0.5",
        f"{angle:.1f}°",
        "<= 8°",
        bool(angle <= 8.0),
    )
    most = 0.02 if preferred <= 2 else 0.05
    run.row(figure, f"{name}: lines that cross another", f"{crossing:.2%}", f"<= {most:.0%}", crossing <= most)
    run.row(figure, f"{name}: coverage error of the charges, k = 2", f"{covered:.4f}", "<= 0.03", covered <= 0.03)


def report_tone(run: Run, name: str, placement: Placement) -> None:
    """Rows on how dark a picture of lines is, where and in the mean, beside the density that they follow."""
    body_class = placement.problem.classes[0]
    asked = np.asarray(body_class.density_image, np.float64)
    asked = asked * (placement.area.sum() / (asked.mean() * placement.problem.rectangle.area))
    height, width = asked.shape
    drawn = 1.0 - render_halftone(placement, pixels_per_metre=4.0)[..., 0]
    drawn = drawn.reshape(height, 4, width, 4).mean(axis=(1, 3))
    off = float(drawn.mean() - np.minimum(asked, 1.0).mean())
    run.row("16", f"{name}: mean ink off by", f"{off:.4f}", "within 0.01", abs(off) <= 0.01)
    for tone, least in ((0.96, 0.93), (0.79, 0.77)):
        near = np.abs(asked - tone) <= 0.02
        found = float((drawn - asked)[near].mean() + tone)
        run.row("16", f"{name}: drawn where {tone:g} is asked", f"{found:.3f}", f">= {least:g}", found >= least)


def hatching(run: Run) -> None:
    """Figure 16: a portrait in 20,000 lines of 2 and of 4 pixels; then bent ones, and colored ones."""
    image = face(200)
    domain = Domain((200.0, 300.0))
    count = 20_000
    pictures = [("original", np.kron(1.0 - image, np.ones((3, 3))))]
    for length in (2.0, 4.0):
        size = Size("line", area_for(image, count), count, line=Line(length))
        placement = run.solve(Problem(domain, [BodyClass("ink", [size], image, unsharp=Unsharp(1.0, 2.0))]))
        report_lines(run, "16", f"length {length:g}", placement, np.ones(count, dtype=bool), length)
        report_tone(run, f"length {length:g}", placement)
        pictures.append((f"lines of {length:g} pixels", render_halftone(placement, pixels_per_metre=3.0)))
    size = Size("line", area_for(image, 8_000), 8_000, line=Line(8.0, charges=5, straightness=0.05))
    placement = run.solve(Problem(domain, [BodyClass("ink", [size], image, unsharp=Unsharp(1.0, 2.0))]))
    bends = placement.bends
    assert bends is not None
    chord = np.linalg.norm(bends[:, -1] - bends[:, 0], axis=1)
    path = np.linalg.norm(np.diff(bends, axis=1), axis=2).sum(axis=1)
    run.row("16", "8,000 lines of 8 pixels that may bend: path over chord, mean", f"{np.mean(path / chord):.4f}")
    pictures.append(("8,000 lines of 8 pixels that may bend", render_halftone(placement, pixels_per_metre=3.0)))
    sheet(run.output / "figure-16-hatching.png", pictures, 2)
    colored_hatching(run)


def colored_hatching(run: Run) -> None:
    """Colored lines in two sizes: one class per ink."""
    image = astronaut(256)
    model = MODELS["CMYK"]
    channels = separate(image, model)
    classes, colors = [], []
    for ink, channel in zip(model.inks, channels, strict=True):
        sizes = [
            Size("short", 0.9, share=0.5, line=Line(2.0)),
            Size("long", 1.8, share=0.5, line=Line(4.0)),
        ]
        classes.append(BodyClass(ink.name, sizes, channel, "cover"))
        colors.append(ink.rgb)
    problem = Problem(Domain((256.0, 256.0)), classes, Balance(0.5, 2.0, model.non_overlap, rare_emphasis=0.0))
    placement = run.solve(problem)
    rendered = render_halftone(placement, pixels_per_metre=4.0, colors=colors)
    off = np.abs(rendered.mean(axis=(0, 1)) - image.mean(axis=(0, 1))).max()
    run.row("16", f"colored lines of two sizes, {problem.body_count:,}: mean color off by", f"{off:.3f}")
    sheet(run.output / "figure-16-colored-lines.png", [("CMYK lines of two sizes", rendered)], 1)


def lines_and_dots(run: Run) -> None:
    """Figure 17: half lines, half dots; edges enhanced nowhere, everywhere, for the lines only."""
    image = cat()
    domain = Domain((463.0, 229.0))
    count = 10_000
    pictures = [("original", np.kron(1.0 - image, np.ones((3, 3))))]
    enhanced = Unsharp(1.5, 2.0)
    for name, of_lines, of_dots in (
        ("no edge enhancement", None, None),
        ("edge enhancement", enhanced, enhanced),
        ("for the lines only", enhanced, None),
        ("for the dots only", None, enhanced),
    ):
        area = area_for(image, 2 * count)
        classes = [
            BodyClass(
                "lines", [Size("line", area, count, line=Line(4.0, turn_weights=(0.25, 0.5)))], image, unsharp=of_lines
            ),
            BodyClass("dots", [Size("dot", area, count)], image, unsharp=of_dots),
        ]
        # One picture by both: all repel each other alike.
        placement = run.solve(Problem(domain, classes, Balance(class_separation=1.0, rare_emphasis=0.0)))
        report_lines(run, "17", name, placement, placement.class_index == 0, 4.0)
        pictures.append((name, render_halftone(placement, pixels_per_metre=3.0)))
    sheet(run.output / "figure-17-lines-and-dots.png", pictures, 2)


EXPERIMENTS = {"16": hatching, "17": lines_and_dots}
