"""What the engine raises when it is asked for something that cannot be done.

Every message is one sentence for the person who made the input: it names the key and the value, and says what would
be accepted. Front ends (command line, Blender's operators) print it as it is.
"""

from __future__ import annotations

__all__ = ["DeviceError", "EshError", "InputFileError", "ProblemError"]


class EshError(ValueError):
    """Base of every error that a user's input can cause."""


class ProblemError(EshError):
    """A :class:`~esh.engine.problem.problem.Problem` that has no meaning: a count of 0, a density of zeros, ..."""


class DeviceError(EshError):
    """A device that does not exist or that this machine lacks."""


class InputFileError(EshError):
    """A file that cannot be read: missing, of another format, holding values that have no meaning."""
