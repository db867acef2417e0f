"""Arguments of a kernel that was launched before, without what Warp does to find out that they fit.

That is most of the time of a small kernel's launch: 45 microseconds of Python beside a GPU, a third of which is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import warp as wp
from warp._src.codegen import Struct as _Struct

__all__ = ["KernelArguments"]


class KernelArguments:
    """What a kernel's arguments were, and what Warp made of them.

    Args:
        kernel: The kernel.
        given: Its arguments in a launch by Warp.
        taken: The types that Warp passed on.
    """

    def __init__(self, kernel: wp.Kernel, given: Sequence[Any], taken: Sequence[type]) -> None:
        self._arguments = [
            (type(value), *_rule_of(argument.type, value, kind))
            for argument, value, kind in zip(kernel.adj.args, given, taken, strict=True)
        ]

    def passed(self, given: Sequence[Any]) -> list[Any] | None:
        """Return others as they are passed on: structures, vectors and numbers; None where Warp has to look at them.

        What is not of the type that it was before is left to Warp, which knows what else fits, and says what does not.
        """
        if len(given) != len(self._arguments):
            return None
        values: list[Any] = []
        for (before, rule, dtype, ndim), value in zip(self._arguments, given, strict=True):
            if type(value) is not before:
                return None
            if rule == _ARRAY:
                if value.dtype is not dtype or value.ndim != ndim:
                    return None
                values.append(value.__ctype__())
            elif rule == _STRUCTURE:
                values.append(value.__ctype__())
            elif rule == _AS_IS or (rule == _WHOLE and -(2**31) <= value < 2**31):
                values.append(value)
            else:
                return None
        return values


# How an argument is passed on.
_ARRAY, _STRUCTURE, _WHOLE, _AS_IS, _BY_WARP = range(5)


def _rule_of(kind: Any, value: Any, taken: type) -> tuple[int, Any, int]:
    """How an argument of a kind is passed on whose value was this, of which Warp made what is ``taken``; and an array's elements."""
    before = type(value)
    if before is wp.array:
        return _ARRAY, value.dtype, value.ndim
    if isinstance(kind, _Struct):
        return _STRUCTURE, None, 0
    if before is int and kind in (int, wp.int32):
        return _WHOLE, None, 0
    if before in (int, float) and kind in (float, wp.float32, wp.float64):
        return _AS_IS, None, 0
    # A vector is passed as it is.
    return (_AS_IS if before is taken else _BY_WARP), None, 0
