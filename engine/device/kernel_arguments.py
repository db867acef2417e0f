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
            (argument.type, type(value), (value.dtype, value.ndim) if type(value) is wp.array else kind)
            for argument, value, kind in zip(kernel.adj.args, given, taken, strict=True)
        ]

    def passed(self, given: Sequence[Any]) -> list[Any] | None:
        """Return others as they are passed on: structures, vectors and numbers; None where Warp has to look at them.

        What is not of the type that it was before is left to Warp, which knows what else fits, and says what does not.
        """
        if len(given) != len(self._arguments):
            return None
        values: list[Any] = []
        for (kind, before, made), value in zip(self._arguments, given, strict=True):
            if type(value) is not before:
                return None
            if before is wp.array:
                if (value.dtype, value.ndim) != made:
                    return None
                values.append(value.__ctype__())
            elif isinstance(kind, _Struct):
                values.append(value.__ctype__())
            elif (before is int and kind in (int, wp.int32) and -(2**31) <= value < 2**31) or (
                before in (int, float) and kind in (float, wp.float32, wp.float64)
            ):
                values.append(value)
            elif before is made:
                # A vector, which is passed as it is.
                values.append(value)
            else:
                return None
        return values
