"""The command ``esh-scatter``, without Blender: its parser, and how it answers mistakes and signals.

Every command has a file of its own. What takes time to load (NumPy, Warp) is imported only once the arguments are known to be good.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, NoReturn

from ..errors import EshError
from ..version import __version__
from .batch_command import add_batch, batch
from .separate_command import add_separate, separate
from .signals import INTERRUPTED, Ended, answered_here, received
from .solve_command import add_solve, solve
from .streams import close_output, complain, open_standard_streams, say
from .tiles_command import add_tiles, tiles

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

__all__ = ["main"]

BAD_INPUT = 2
COMMANDS = {"solve": solve, "batch": batch, "tiles": tiles, "separate": separate}
# Commands that have parts which stay.
KEPT = {
    "batch": "the scenes that are done stay, and the same command continues",
    "tiles": "the windows that are done stay, and the same command continues",
}


class _Parser(argparse.ArgumentParser):
    """An argument parser that answers a mistake with one sentence, as every other mistake is answered."""

    def error(self, message: str) -> NoReturn:
        """Print the sentence and leave with status 2."""
        self.exit(BAD_INPUT, f"esh-scatter: {message}; see {self.prog} --help\n")

    def _print_message(self, message: str, file: SupportsWrite[str] | None = None) -> None:
        """Print the help or the version; what cannot be printed would be passed over."""
        if file is None or file is not sys.stdout:
            super()._print_message(message, file)
        else:
            say(message.removesuffix("\n"), lost="what was asked for could not be printed")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    Args:
        arguments: The words after the command's name; those of this process when None.
    """
    command = ""
    try:
        open_standard_streams()
        for stream in (sys.stdout, sys.stderr):
            # A name that the terminal cannot show is no reason to fail.
            if hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="replace")
        with answered_here():
            options = _parser().parse_args(arguments)
            command = options.command
            return COMMANDS[command](options)
    except Ended as ended:
        return _answer(ended.number, command)
    except KeyboardInterrupt as interruption:
        return _answer(signal.SIGINT, command, str(interruption))
    except Exception as error:
        # What a library makes of a signal that interrupted it.
        if received:
            return _answer(received[0], command)
        return _answer_error(error, command)


def _answer(number: int, command: str, reached: str = "") -> int:
    """Say which signal stopped a command, and return the exit status."""
    name = signal.Signals(number).name
    if number != signal.SIGINT:
        complain(f"ended by {name}; {KEPT.get(command, 'nothing was written')}")
        return 128 + number
    kept = "" if command in KEPT and reached else "; nothing was written"
    complain(f"stopped by Ctrl-C{reached}{kept}")
    return INTERRUPTED


def _answer_error(error: Exception, command: str) -> int:
    """Say what is wrong, and return the exit status; raise the error again where it is a mistake of ours."""
    if isinstance(error, EshError):
        complain(str(error))
    elif isinstance(error, MemoryError):
        complain("there is not enough memory; lower the counts, or use smaller density images")
    elif isinstance(error, BrokenPipeError):
        complain(f"a stream was closed that is still written to; {KEPT.get(command, 'nothing was written')}")
        close_output()
    else:
        raise error
    return BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="esh-scatter",
        description="Place objects by electrostatic sampling: exact counts, density images, several classes and sizes at once.",
    )
    parser.add_argument("--version", action="version", version=f"esh-scatter {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    add_solve(commands)
    add_batch(commands)
    add_tiles(commands)
    add_separate(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
