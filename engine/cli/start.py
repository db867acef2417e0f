"""Where the command starts: answers Ctrl-C before anything else is loaded."""

import os
import signal


def _leave(number: int, frame: object) -> None:
    os.write(2, b"esh-scatter: stopped by Ctrl-C; nothing was written\n")
    os._exit(130)


def main() -> int:
    """Run the command and return its exit status; see :func:`~esh.engine.cli.command_line.main`."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, _leave)
    from .command_line import main as run

    if ours:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return run()
    finally:
        # All is done: Python only has to leave.
        if ours:
            signal.signal(signal.SIGINT, signal.SIG_IGN)


if __name__ == "__main__":
    raise SystemExit(main())
