"""Color halftones (figure 13).

Figures are numbered as in Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

import numpy as np
from esh.engine.drawing.halftone import ink_coverage, render_halftone
from esh.engine.problem.color_separation import MODELS, halftone_problem, ink_colors, separate
from experiment_run import Run
from pictures import astronaut, sheet
from skimage.color import deltaE_ciede2000, rgb2lab

BLOCK = 16


def blocks(picture: np.ndarray, count: int) -> np.ndarray:
    """Mean stored values of ``count`` by ``count`` blocks."""
    side = picture.shape[0] // count
    return picture.reshape(count, side, count, side, 3).mean(axis=(1, 3))


def forbidden(problem, coverage: np.ndarray, dot_area: float, pixels_per_metre: float) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Share of the ground where inks lie on each other that must not: on others, and on themselves (ink that is lost)."""
    matrix = np.asarray(problem.balance.non_overlap)
    others = np.zeros(coverage.shape[1:], dtype=bool)
    for i in range(len(matrix)):
        for j in range(i):
            if matrix[i, j] == 1.0:
                others |= coverage[i] & coverage[j]
    laid = sum(c.body_count * dot_area for c in problem.classes)
    seen = coverage.sum() / pixels_per_metre**2
    return float(others.mean()), float((laid - seen) / problem.domain.area)


def color_models(run: Run) -> None:
    """Figure 13: every model gives back the picture's colors, and inks keep apart that must."""
    image = astronaut(256)
    pictures = [("original", np.kron(image, np.ones((3, 3, 1))))]
    for name in MODELS:
        problem = halftone_problem(image, name, rare_emphasis=0.0)
        placement = run.solve(problem)
        rendered = render_halftone(placement, pixels_per_metre=4.0, colors=ink_colors(problem, name))
        count = image.shape[0] // BLOCK
        difference = deltaE_ciede2000(rgb2lab(blocks(rendered, count)), rgb2lab(blocks(image, count))).mean()
        run.row(
            "13",
            f"{name}, {problem.body_count:,} dots: mean Delta E of 16 x 16 blocks",
            f"{difference:.2f}",
            "<= 3",
            difference <= 3.0,
        )
        others, itself = forbidden(problem, ink_coverage(placement, pixels_per_metre=4.0), 1.0, 4.0)
        # Dots thrown independently with density u cover 1 - exp(-u); all of it by chance upon what else lies there.
        channels = separate(image, name)[[[i.name for i in MODELS[name].inks].index(c.name) for c in problem.classes]]
        covered = 1.0 - np.exp(-channels)
        matrix = np.asarray(problem.balance.non_overlap)
        free = np.ones(channels.shape[1:])
        for i in range(len(matrix)):
            for j in range(i):
                if matrix[i, j] == 1.0:
                    free *= 1.0 - covered[i] * covered[j]
        chance = float(1.0 - free.mean()), float((channels - covered).sum(axis=0).mean())
        run.row(
            "13",
            f"{name}: ground where forbidden inks meet; ink lost upon itself",
            f"{others:.4f} (by chance {chance[0]:.4f}); {itself:.4f} (by chance {chance[1]:.4f})",
            "below chance",
            others <= chance[0] and itself < chance[1],
        )
        pictures.append((name, render_halftone(placement, pixels_per_metre=3.0, colors=ink_colors(problem, name))))
    sheet(run.output / "figure-13-color-models.png", pictures, 3)


EXPERIMENTS = {"13": color_models}
