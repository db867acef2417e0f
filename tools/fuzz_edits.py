"""Edits from one recipe to others, for :mod:`fuzz`: what comes of them keeps every promise that a solved recipe does."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from fuzz_checks import MOST_STEPS, check_placement, check_sentence
from fuzz_recipes import Choices, RecipeMaker, as_toml
from fuzz_surfaces import SurfaceRecipeMaker

if TYPE_CHECKING:
    from esh import Problem, Solver

__all__ = ["check_edits"]

EDITS = 3
# Recipes of more bodies are solved, and not edited: it is sequences that are looked for.
MOST_BODIES = 3_000


def check_edits(recipe: Path, choose: Choices, device: str = "cpu", begin: Callable[[], object] = lambda: None) -> int:
    """Edit what a recipe in its folder asks for a few times; raise AssertionError where what came of that is wrong.

    ``begin`` is called before each.

    Returns:
        How many edits were made; others were refused in a sentence.
    """
    import esh

    first, made = esh.read_recipe(recipe), 0
    if first.body_count > MOST_BODIES:
        return 0
    with esh.Solver(first, device=device) as solver:
        solver.run(choose.pick([1, MOST_STEPS]))
        for number in range(EDITS):
            begin()
            before = solver.placement()
            try:
                asked = _other_problem(solver, choose, recipe.parent / f"edit {number}")
                if asked.body_count > MOST_BODIES:
                    continue
                edit = solver.edit(asked, steps=choose.pick([0, 1, 5]))
            except esh.EshError as error:
                check_sentence(error)
                assert (solver.placement().position == before.position).all(), "an edit that was refused moved bodies"
                continue
            _check_edit(solver, set(before.id.tolist()), edit)
            made += 1
        solver.step()
    return made


def _other_problem(solver: Solver, choose: Choices, folder: Path) -> Problem:
    """What another recipe asks for in the same place, or what is there with something changed."""
    import esh

    now = solver.model.problem
    what = choose.pick(["recipe", "recipe", "counts", "pins"])
    if what == "counts":
        factor = choose.pick([0.5, 1.1, 2.0])
        return dataclasses.replace(now, classes=[_times(body_class, factor) for body_class in now.classes])
    if what == "pins":
        some = np.arange(0, len(solver.placement().position), choose.pick([2, 5]))
        pinned = esh.FixedBodies.of_placement(solver.placement(), some)
        return dataclasses.replace(now, fixed=pinned, include_fixed=True)
    folder.mkdir()
    maker = SurfaceRecipeMaker if isinstance(now.domain, esh.Surface) else RecipeMaker
    path = folder / "recipe.toml"
    path.write_text(as_toml(maker(choose, folder).recipe()), encoding="utf-8")
    return dataclasses.replace(esh.read_recipe(path), domain=now.domain)


def _times(body_class: Any, factor: float) -> Any:
    """A class of so many times as many bodies."""
    sizes = [dataclasses.replace(size, count=int((size.count or 0) * factor)) for size in body_class.sizes]
    return dataclasses.replace(body_class, sizes=tuple(sizes))


def _check_edit(solver: Solver, before: set[int], edit: Any) -> None:
    """Raise AssertionError unless bodies are who an edit says, and the placement is what is asked for."""
    from esh.engine.quality.measurement import measure

    after = solver.placement()
    identities = after.id.tolist()
    assert len(set(identities)) == len(identities), "two bodies have one identity"
    assert set(identities) == (before - set(edit.removed.tolist())) | set(edit.added.tolist()), "identities differ"
    report = dataclasses.replace(measure(after, solver.launcher), steps=1, seconds=1.0)
    check_placement(dataclasses.replace(after, report=report))
