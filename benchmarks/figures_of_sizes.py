"""Sizes: second and third order screening, continuous sizes, several classes (figures 4, 10, 11, 12, 14, 15).

Figures are numbered as in Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import numpy as np
from direct_summation import direct_solve
from esh.engine.drawing.halftone import render_halftone
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from experiment_run import Run
from pictures import camera, dark_word, face, gaussian, sheet
from quality import regularity

UNIFORM = np.ones((1, 1), dtype=np.float32)
SQUARE = Domain((64.0, 64.0))
# Steps for what is to end near a lattice.
PATIENT = 800
# Of a patch that is corrected: which defects a lattice freezes with is chance, and makes a thousandth of its gray.
GRAY_SEEDS = 3
RED, BLUE = (0.82, 0.2, 0.16), (0.13, 0.33, 0.7)


def pixels(image: np.ndarray) -> Domain:
    """A domain in which a pixel is a square meter."""
    return Domain((float(image.shape[1]), float(image.shape[0])))


def error(problem: Problem, position: np.ndarray, chosen: np.ndarray, k: float = 1.0) -> float:
    """Coverage error of some bodies against the density of the first class."""
    image = problem.classes[0].density_image
    return coverage_error(position[chosen], problem.body_areas()[chosen], image, problem.domain, k)


def colored(
    placement: Placement, key: np.ndarray, colors: list[tuple[float, float, float]], scale: float
) -> np.ndarray:
    """Draw bodies in colors by ``key``."""
    picture = 1.0
    for index, color in enumerate(colors):
        picture = picture * render_halftone(
            placement, pixels_per_metre=scale, colors=[color] * len(placement.problem.classes), chosen=key == index
        )
    return np.asarray(picture)


def second_order(run: Run) -> None:
    """Figure 4: with C = 2 the large bodies are evenly spread by themselves, at little cost for all."""
    found, pictures = {}, []
    for emphasis in (1.0, 2.0):
        sizes = [Size("small", 1.0, 1536), Size("large", 3.0, 256)]
        problem = Problem(SQUARE, [BodyClass("a", sizes)], Balance(size_emphasis=emphasis))
        placement = run.solve(problem)
        direct = direct_solve(problem, run.launcher)
        large = placement.size_index == 1
        everything = np.ones(len(large), dtype=bool)
        found[emphasis] = [
            (error(problem, placement.position, chosen), error(problem, direct, chosen))
            for chosen in (large, everything)
        ]
        pictures.append((f"C = {emphasis:g}", colored(placement, placement.size_index, [BLUE, RED], 8.0)))
    (large_1, large_1_direct), (all_1, all_1_direct) = found[1.0]
    (large_2, large_2_direct), (all_2, all_2_direct) = found[2.0]
    run.row(
        "4",
        "large alone, C = 1 / C = 2",
        f"{large_1:.4f} ({large_1_direct:.4f}) / {large_2:.4f} ({large_2_direct:.4f})",
    )
    factor = large_1 / large_2
    run.row(
        "4",
        "how many times lower with C = 2",
        f"{factor:.1f} ({large_1_direct / large_2_direct:.1f})",
        ">= 5",
        factor >= 5.0,
    )
    ratio = all_2 / all_1
    run.row(
        "4", "all bodies, C = 2 over C = 1", f"{ratio:.2f} ({all_2_direct / all_1_direct:.2f})", "<= 1.3", ratio <= 1.3
    )
    sheet(run.output / "figure-04-second-order.png", pictures, 2)


def gray_patch(darkness: float, correction: bool, seed: int = 0) -> Problem:
    """Dots on one gray, of 72 by 72 pixels: as many as its darkness asks for, which contact brings near a honeycomb.

    The correction is made for a honeycomb. Where overlap is avoided, a cover aims at what fits without it, so the count is that of a
    problem in which dots may overlap.
    """
    domain, density = Domain((72.0, 72.0), "periodic"), np.full((72, 72), darkness)
    cover = BodyClass("dot", [Size("dot", 1.0)], density, "cover", density_correction=correction)
    count = Problem(domain, [cover]).body_count
    return Problem(domain, [BodyClass("dot", [Size("dot", 1.0, count)], density)], avoid_overlap=True, seed=seed)


def gray_correction(run: Run) -> None:
    """Figure 10: dark grays come out as asked, and what they would be without the correction."""
    for gray in (0, 5, 10, 15, 20, 24):
        darkness = 1.0 - gray / 255.0
        rendered, counts = {}, {}
        for correction, seeds in ((True, GRAY_SEEDS), (False, 1)):
            grays = []
            for seed in range(seeds):
                problem = gray_patch(darkness, correction, seed)
                placement = run.solve(problem, max_steps=PATIENT)
                grays.append(float(render_halftone(placement, pixels_per_metre=4.0, supersampling=4).mean()))
            counts[correction], rendered[correction] = problem.body_count, float(np.mean(grays))
        with_it, without = (abs(rendered[c] - gray / 255.0) for c in (True, False))
        run.row(
            "10",
            f"gray {gray} of 255, {counts[True]:,} dots: error of the rendered gray, mean of {GRAY_SEEDS} runs",
            f"{with_it:.4f} (without the correction {without:.4f})",
            "<= 0.006",
            with_it <= 0.006,
        )
    pictures = []
    for name, correction in (("standard", False), ("with correction", True)):
        image = dark_word()
        classes = [BodyClass("dot", [Size("dot", 1.0)], image, "cover", density_correction=correction)]
        placement = run.solve(Problem(pixels(image), classes))
        pictures.append((name, render_halftone(placement, pixels_per_metre=4.0)))
    sheet(run.output / "figure-10-gray-correction.png", pictures, 1)


def third_order(run: Run) -> None:
    """Figure 11: a Gaussian with two sizes, a portrait with three; shares of charge, counts from the picture's ink."""
    cases = (
        ("Gaussian", gaussian(256), gaussian(96), {"S": (1.0, 2 / 3), "L": (3.0, 1 / 3)}),
        ("portrait", face(200), face(88), {"S": (1.0, 6 / 9), "M": (2.0, 2 / 9), "L": (4.0, 1 / 9)}),
    )
    for name, image, small_image, sizes in cases:
        for picture in (image, small_image):
            listed = [Size(size, area, share=share) for size, (area, share) in sizes.items()]
            problem = Problem(pixels(picture), [BodyClass("dot", listed, picture, "cover")])
            placement = run.solve(problem)
            direct = direct_solve(problem, run.launcher) if problem.body_count <= 4096 else None
            for first in reversed(range(len(sizes))):
                chosen = placement.size_index >= first
                reached = error(problem, placement.position, chosen)
                reference = None if direct is None else error(problem, direct, chosen)
                run.row(
                    "11",
                    f"{name}, {problem.body_count:,} dots: {'+'.join(reversed(list(sizes)[first:]))}",
                    f"{reached:.4f}" + ("" if reference is None else f" ({reference:.4f})"),
                    "< 0.04, or the direct sum's",
                    reached < max(0.04, reference or 0.0),
                )
            if picture is image:
                shown = [
                    (
                        "+".join(reversed(list(sizes)[first:])),
                        render_halftone(placement, pixels_per_metre=3.0, chosen=placement.size_index >= first),
                    )
                    for first in range(len(sizes))
                ]
                sheet(run.output / f"figure-11-{name.lower()}.png", shown, len(shown))


def continuous_sizes(run: Run) -> None:
    """Figure 12: every dot its own size, and the smallest left out."""

    def problem_of(width: int) -> Problem:
        image = camera(width)
        return Problem(pixels(image), [BodyClass("dot", [Size("any", (0.5, 2.0), share=1.0)], image, "cover")])

    small = problem_of(88)
    placement = run.solve(small)
    direct = direct_solve(small, run.launcher)
    area = small.body_areas()
    for dropped in (0.0, 0.25, 0.5, 0.75):
        chosen = area >= np.quantile(area, dropped)
        reached, reference = (error(small, position, chosen) for position in (placement.position, direct))
        run.row(
            "12",
            f"{small.body_count:,} dots, the smallest {dropped:.0%} left out",
            f"{reached:.4f} ({reference:.4f})",
            "<= 1.5 of the direct sum's",
            reached <= 1.5 * reference,
        )
    for levels in (4, 8, 16, 24, 48):
        quantized = direct_solve(small, run.launcher, levels=levels)
        errors = [error(small, quantized, area >= np.quantile(area, dropped)) for dropped in (0.0, 0.25, 0.5, 0.75)]
        run.row(
            "12",
            f"direct sum with {levels} levels instead of a matrix of all pairs",
            " / ".join(f"{e:.4f}" for e in errors),
        )
    large = problem_of(256)
    placement = run.solve(large)
    area = large.body_areas()
    pictures = []
    for dropped in (0.0, 0.25, 0.5, 0.75):
        chosen = area >= np.quantile(area, dropped)
        pictures.append((f"{dropped:.0%} left out", render_halftone(placement, pixels_per_metre=3.0, chosen=chosen)))
    sheet(run.output / "figure-12-continuous-sizes.png", pictures, 2)
    many = Problem(Domain((320.0, 320.0)), [BodyClass("dot", [Size("any", (0.5, 2.0), 100_000)], camera(256))])
    report = run.solve(many).report
    run.row(
        "12", "100,000 dots, each its own size", f"{report.coverage_error:.4f}, {report.seconds:.0f} s", "runs", True
    )


def report_order(run: Run, name: str, placement: Placement) -> None:
    """A row on a placement as its report and the table of quality measure it."""
    report = placement.report
    assert report is not None
    order = [regularity(placement, placement.class_index == c) for c in range(len(report.classes))]
    apart = " and ".join(f"{c.smallest_spacing or 0.0:.2f}" for c in report.classes)
    run.row(
        "14",
        f"{name}: PSNR; smallest spacing and sixfold order of each class, and order of all",
        f"{report.psnr or 0.0:.0f} dB; {apart}; {' and '.join(f'{value:.2f}' for value in order)}, "
        f"{regularity(placement, slice(None)):.2f}",
    )


def separation_sweep(run: Run) -> None:
    """Figure 14: alpha trades the union against the classes."""
    pictures = []
    for seed in range(3):
        unions, classes, direct_unions, direct_classes = [], [], [], []
        for sixths in (1, 3, 5):
            two = [BodyClass(name, [Size("dot", 1.0, 512)]) for name in "ab"]
            problem = Problem(SQUARE, two, Balance(class_separation=sixths / 6, rare_emphasis=0.0), seed=seed)
            # Not to the very end: there both classes and their union freeze in lattices of their own, which one being luck.
            placement = run.solve(problem)
            report_order(run, f"seed {seed}, alpha = {sixths}/6", placement)
            direct = direct_solve(problem, run.launcher, steps=400)
            everything, own = np.ones(1024, dtype=bool), placement.class_index == 0
            unions.append(error(problem, placement.position, everything, 0.5))
            classes.append(error(problem, placement.position, own))
            direct_unions.append(error(problem, direct, everything, 0.5))
            direct_classes.append(error(problem, direct, own))
            if seed == 0:
                pictures += [
                    (f"alpha = {sixths}/6", colored(placement, placement.class_index, [RED, BLUE], 5.0)),
                    ("one class", colored(placement, placement.class_index, [RED], 5.0)),
                ]
        for what, values, direct_values, rising in (
            ("union, k = 0.5", unions, direct_unions, False),
            ("one class", classes, direct_classes, True),
        ):
            ordered = sorted(values, reverse=not rising) == values
            run.row(
                "14",
                f"seed {seed}, {what}, alpha = 1/6, 3/6, 5/6",
                ", ".join(f"{v:.3f}" for v in values) + " (" + ", ".join(f"{v:.3f}" for v in direct_values) + ")",
                "rises" if rising else "falls",
                ordered,
            )
    sheet(run.output / "figure-14-class-separation.png", pictures, 2)


def second_order_classes(run: Run) -> None:
    """Figure 15: two classes of two sizes each; and what C does to the large ones."""
    pictures = []
    for emphasis in (1.5, 2.0, 4.0):
        sizes = [Size("small", 1.0, 600), Size("large", 3.0, 120)]
        problem = Problem(
            SQUARE, [BodyClass(name, sizes) for name in "ab"], Balance(size_emphasis=emphasis, rare_emphasis=0.0)
        )
        placement = run.solve(problem)
        direct = direct_solve(problem, run.launcher)
        red, large = placement.class_index == 0, placement.size_index == 1
        parts = {"all": red | ~red, "one class": red, "its large ones": red & large, "all large ones": large}
        values = {
            name: (error(problem, placement.position, chosen), error(problem, direct, chosen))
            for name, chosen in parts.items()
        }
        run.row(
            "15",
            f"C = {emphasis:g}: " + ", ".join(parts),
            ", ".join(f"{own:.3f} ({reference:.3f})" for own, reference in values.values()),
            "<= 1.5 of the direct sum's",
            all(own <= 1.5 * reference for own, reference in values.values()),
        )
        if emphasis == 2.0:
            key = placement.class_index
            pictures = [
                ("all", colored(placement, key, [RED, BLUE], 6.0)),
                ("red", colored(placement, key, [RED], 6.0)),
                ("blue", colored(placement, 1 - key, [BLUE], 6.0)),
                ("large", colored(placement, np.where(large, key, 9), [RED, BLUE], 6.0)),
                ("large red", colored(placement, np.where(large, key, 9), [RED], 6.0)),
                ("large blue", colored(placement, np.where(large, 1 - key, 9), [BLUE], 6.0)),
            ]
    sheet(run.output / "figure-15-second-order-classes.png", pictures, 3)


EXPERIMENTS = {
    "4": second_order,
    "10": gray_correction,
    "11": third_order,
    "12": continuous_sizes,
    "14": separation_sweep,
    "15": second_order_classes,
}
