"""What must be true of what comes of a recipe, for :mod:`fuzz`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["MOST_STEPS", "check", "check_placement", "check_sentence"]

MOST_STEPS = 12
# Bodies up to which pairs are counted by brute force.
FEW_BODIES = 600


def check(text: str, folder: Path, device: str = "cpu") -> str:
    """Solve a recipe on a device; return "refused" or "placed", raise AssertionError where what came of it is neither."""
    import esh

    path = folder / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    before = _contents(folder)
    try:
        placement = esh.solve(esh.read_recipe(path), device=device, max_steps=MOST_STEPS)
    except esh.EshError as error:
        check_sentence(error)
        assert _contents(folder) == before, "a file was changed"
        return "refused"
    check_placement(placement)
    esh.write_placement(folder / "made.npz", placement)
    with np.load(folder / "made.npz", allow_pickle=False) as stored:
        assert (stored["position"] == placement.position).all(), "other positions were written"
    (folder / "made.npz").unlink()
    assert _contents(folder) == before, "a file was changed"
    return "placed"


def check_sentence(error: Exception) -> None:
    """Raise AssertionError unless an error says one sentence."""
    sentence = str(error)
    assert sentence and "\n" not in sentence and len(sentence) < 1000, f"not a sentence: {sentence!r}"


def check_placement(placement: Any) -> None:
    """Raise AssertionError unless a placement is what its problem asks for, and its report is true."""
    problem, report = placement.problem, placement.report
    assert np.isfinite(placement.position).all(), "a position is no number"
    is_surface = placement.normal is not None
    if is_surface:
        _check_on_surface(placement)
    else:
        _check_inside(placement)
    for c, body_class in enumerate(problem.classes):
        for s, entry in enumerate(body_class.sizes):
            own = (placement.class_index == c) & (placement.size_index == s)
            counted = report.classes[c].sizes[s]
            assert own.sum() == entry.count == counted.asked == counted.placed, "counts differ"
            areas = placement.area[own & ~placement.fixed]
            low, high = np.min(entry.area), np.max(entry.area)
            assert (areas >= low * (1 - 1e-9)).all() and (areas <= high * (1 + 1e-9)).all(), "an area is another"
            if entry.line is None:
                assert not placement.length[own].any(), "a dot has an axis"
                assert (
                    is_surface or body_class.look_at is not None or not placement.angle[own & ~placement.fixed].any()
                ), "a dot is turned for nothing"
                density = _density_at(placement, body_class, own & ~placement.fixed)
                assert (density > 0.0).all(), "a dot lies where there is no density"
            else:
                assert (placement.length[own] > 0.0).all() and (placement.width[own] > 0.0).all(), (
                    "a line has no extent"
                )
        assert 0.0 <= report.classes[c].coverage_error < math.inf, "a coverage error is no number"
    for values in (placement.angle, placement.length, placement.width, placement.area):
        assert np.isfinite(values).all(), "a pose is no number"
    # A line has no front; what looks at a point has.
    most = np.where(placement.width > 0.0, 0.5001, 1.0001) * math.pi
    assert (np.abs(placement.angle) <= most).all(), "a turn is more than it need be"
    assert 0.0 <= report.coverage_error < math.inf and 0.0 < report.covered < math.inf, "the report is no number"
    assert 1 <= report.steps <= MOST_STEPS and report.seconds > 0.0
    if not is_surface and 1 < len(placement.position) <= FEW_BODIES:
        _check_distances(placement)


def _check_inside(placement: Any) -> None:
    """Raise AssertionError unless all bodies are inside the domain."""
    domain, position = placement.problem.domain, placement.position
    size = np.array(domain.size)
    assert (position >= 0.0).all() and (position <= size).all(), "a body lies outside"
    assert not domain.periodic or (position < size).all(), "a body lies on the far edge of a periodic domain"


def _check_on_surface(placement: Any) -> None:
    """Raise AssertionError unless all bodies are where their triangles say, and directions are some."""
    meshes, position = placement.problem.domain.meshes, placement.position
    weight = placement.barycentric
    assert (weight >= 0.0).all() and np.abs(weight.sum(axis=1) - 1.0).max(initial=0.0) < 1e-6, "weights are none"
    for number, mesh in enumerate(meshes):
        own = placement.mesh == number
        corner = mesh.vertices[mesh.triangles[placement.triangle[own]]]
        there = np.einsum("nk,nkd->nd", weight[own], corner)
        extent = np.abs(corner).max(initial=0.0)
        assert np.abs(there - position[own]).max(initial=0.0) <= 1e-6 * extent, "a body is not on its triangle"
    for way in (placement.normal, placement.tangent):
        assert np.abs(np.linalg.norm(way, axis=1) - 1.0).max(initial=0.0) < 1e-6, "a direction has no length of 1"
    across = np.einsum("nd,nd->n", placement.normal, placement.tangent)
    assert np.abs(across).max(initial=0.0) < 1e-6, "a tangent is none"


def _density_at(placement: Any, body_class: Any, own: np.ndarray) -> np.ndarray:
    """The density where some bodies lie."""
    domain, position = placement.problem.domain, placement.position[own]
    if placement.normal is not None:
        return np.ones(len(position))
    image, size = body_class.density_image, np.array(domain.size)
    column = np.clip((position[:, 0] / size[0] * image.shape[1]).astype(int), 0, image.shape[1] - 1)
    row = np.clip(((1 - position[:, 1] / size[1]) * image.shape[0]).astype(int), 0, image.shape[0] - 1)
    return image[row, column]


def _check_distances(placement: Any) -> None:
    """Compare the smallest spacing, and the overlaps of discs, with those of all pairs."""
    problem, report = placement.problem, placement.report
    size = np.array(problem.domain.size)
    i, j = np.triu_indices(len(placement.position), 1)
    way = placement.position[j] - placement.position[i]
    if problem.domain.periodic:
        way -= size * np.rint(way / size)
    distance = np.hypot(*way.T)
    if report.smallest_spacing is None:
        assert distance.min() > 0.0, "two bodies lie on one another, and none are neighbors"
    if not placement.width.any() and not problem.avoid_overlap:
        radius = np.sqrt(placement.area / math.pi)
        touching = radius[i] + radius[j]
        # Of classes that may overlap nothing counts.
        matrix = problem.balance.non_overlap
        if matrix is not None:
            kept = np.asarray(matrix)[placement.class_index[i], placement.class_index[j]] > 0.0
            touching, i, j, distance = touching[kept], i[kept], j[kept], distance[kept]
        # Nor do pairs of fixed bodies, which no run can part.
        kept = ~(placement.fixed[i] & placement.fixed[j])
        touching, i, j, distance = touching[kept], i[kept], j[kept], distance[kept]
        # Positions are float32, in units of the spacing.
        rounding = 3e-5 * touching + 1e-6 * size.max()
        most = int((distance < touching + rounding).sum())
        # What counts lies in the other by more than 1e-3 of the narrower one's width.
        counted = touching - 2e-3 * np.minimum(radius[i], radius[j])
        least = int((distance < counted - rounding).sum())
        crowded = np.bincount(np.concatenate([i, j])[np.tile(distance < touching, 2)], minlength=1).max(initial=0) > 190
        # A body that reaches round the domain overlaps copies of itself, which are counted, too.
        around = problem.domain.periodic and 2.0 * radius.max() > size.min()
        assert around or report.overlaps <= most, (
            f"{report.overlaps} overlaps are reported, and there are {most} at most"
        )
        assert crowded or report.overlaps >= least, f"{report.overlaps} overlaps are reported of at least {least}"


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
