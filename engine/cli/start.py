"""Where the command starts: answers Ctrl-C before anything else is loaded."""

import signal

from .first_signals import leave_on_signals


def main() -> int:
    """Run the command and return its exit status; see :func:`~esh.engine.cli.command_line.main`."""
    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    leave_on_signals()
    from .command_line import main as run

    try:
        return run()
    finally:
        # All is done: Python only has to leave.
        if not ignored:
            signal.signal(signal.SIGINT, signal.SIG_IGN)


if __name__ == "__main__":
    raise SystemExit(main())
