"""Kernels that list the marked ones of many elements (see :mod:`.marked`)."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def list_marked(
    first: int,
    marked: wp.array(dtype=wp.int32),
    place: wp.array(dtype=wp.int32),
    begin: int,
    # outputs
    number: wp.array(dtype=wp.int32),
):
    """Write the number of an element that is marked to its place in the list; elements are numbered from ``begin`` on."""
    i = first + wp.tid()
    if marked[i] != 0:
        number[place[i]] = begin + i


@wp.kernel
def list_all(
    first: int,
    # outputs
    number: wp.array(dtype=wp.int32),
):
    """Number all elements."""
    i = first + wp.tid()
    number[i] = i
