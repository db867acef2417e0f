"""A process that carries out calls for another. Calls and answers are pickles on pipes."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..errors import EshError

__all__ = ["Failure", "carry_out", "main"]


@dataclass(frozen=True)
class Failure:
    """What a call that failed answers.

    Attributes:
        text: One sentence.
        expected: Whether it is about the input, rather than a mistake of ours or a process that was killed.
    """

    text: str
    expected: bool


def carry_out(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Return what a call returns, or the Failure that it ended in."""
    try:
        return function(*arguments)
    except EshError as error:
        return Failure(" ".join(str(error).split()), True)
    except MemoryError:
        return Failure("there is not enough memory; lower the counts, or use smaller density images", True)
    except Exception as error:  # whatever one scene stumbles over, the others go on
        return Failure(" ".join(f"{type(error).__name__}: {error}".split())[:500], False)


def main() -> None:
    """Answer calls until the pipe is closed."""
    answers = os.fdopen(os.dup(1), "wb")
    # Whatever a library prints must not get among the answers.
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    while True:
        try:
            function, arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(carry_out(function, arguments), answers, pickle.HIGHEST_PROTOCOL)
        answers.flush()
