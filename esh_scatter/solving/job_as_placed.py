"""What a result holds, as a job of its own: the settings of now with the counts that are there. Live goes on from it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ..classes.scatter_class import ScatterClass
from ..result.kept_ground import KeptPlaces, kept_places
from ..result.pins import staying
from ..result.result import CLASS_NAMES
from .job import ScatterJob

__all__ = ["job_as_placed", "places_in_order"]


def places_in_order(result: bpy.types.Object) -> KeptPlaces | None:
    """Return what :func:`kept_places` does in the order of problems: by class and size, and of each what stays last."""
    places = kept_places(result)
    if places is None:
        return None
    order = np.lexsort((staying(result.data), places.size_index, places.class_index))
    chosen: dict[str, Any] = {name: None if value is None else value[order] for name, value in places._asdict().items()}
    return KeptPlaces(**chosen)


def job_as_placed(
    result: bpy.types.Object, places: KeptPlaces, positional: tuple[Any, ...], named: dict[str, Any]
) -> tuple[ScatterJob, KeptPlaces] | None:
    """Return the job that has placed as many of each size as there are, and where these are.

    What is of a class or a size that is no longer asked for is left out of both.

    Args:
        result: What is there.
        places: Where its bodies are.
        positional: Target and classes, as the job of now takes them.
        named: The other arguments of that job; ``pinned`` says by class of the result which class it is now.

    Returns:
        None where nothing is left.

    Raises:
        EshError: Something asked for is missing or has no meaning.
    """
    target, classes = positional
    class_now, size_now = _of_now(result, places, classes, named["pinned"])
    count = [
        [int(((class_now == c) & (size_now == s)).sum()) for s in range(len(asked.sizes))]
        for c, asked in enumerate(classes)
    ]
    kept = [c for c in range(len(classes)) if any(count[c])]
    if not kept:
        return None
    there = [
        replace(
            classes[c],
            count=None,
            sizes=[replace(size, count=n, share=None) for size, n in zip(classes[c].sizes, count[c], strict=True) if n],
        )
        for c in kept
    ]
    apart = named["non_overlap"]
    changed = {
        "pinned": [kept.index(c) if c in kept else None for c in named["pinned"]],
        "non_overlap": apart if apart is None else [[apart[i][j] for j in kept] for i in kept],
    }
    # Where classes and sizes are among those that are kept.
    new_class = np.array([kept.index(c) if c in kept else -1 for c in range(len(classes))])
    new_size = [np.cumsum(np.array(of_class) > 0) - 1 for of_class in count]
    own = np.flatnonzero((class_now >= 0) & (size_now >= 0))
    size = np.array([new_size[c][s] for c, s in zip(class_now[own], size_now[own], strict=True)])
    order = np.lexsort((size, new_class[class_now[own]]))
    chosen: dict[str, Any] = {
        name: None if value is None else value[own[order]] for name, value in places._asdict().items()
    }
    chosen |= {"class_index": new_class[class_now[own[order]]], "size_index": size[order]}
    return ScatterJob(target, there, prepare=False, **{**named, **changed}), KeptPlaces(**chosen)


def _of_now(
    result: bpy.types.Object, places: KeptPlaces, classes: Sequence[ScatterClass], now: Sequence[int | None]
) -> tuple[np.ndarray, np.ndarray]:
    """Return which class and which of its sizes every body is of by now, -1 where there is none; shapes ``[n]``."""
    _, sizes = json.loads(str(result.get(CLASS_NAMES, "[[], []]")))
    class_now, size_now = np.full((2, len(places.position)), -1)
    for number, (name_of_sizes, c) in enumerate(zip(sizes, now, strict=False)):
        if c is None:
            continue
        names = [size.name for size in classes[c].sizes]
        class_now[places.class_index == number] = c
        for s, name in enumerate(name_of_sizes):
            if name in names:
                size_now[(places.class_index == number) & (places.size_index == s)] = names.index(name)
    return class_now, size_now
