"""Libraries that only some formats need."""

from __future__ import annotations

import importlib
from types import ModuleType

from ..errors import EshError

__all__ = ["import_extra"]


def import_extra(module: str, extra: str, what: str) -> ModuleType:
    """Import a library that an extra of the package brings.

    Args:
        module: Dotted name.
        extra: The extra that installs it.
        what: What needs it, for the message.

    Raises:
        EshError: It is not installed; the message names the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        if error.name not in (name, module):  # it is there, but something that it needs is not
            reason = " ".join(str(error).split())
            raise EshError(f"{what} needs the library {name}, which cannot be used: {reason}") from None
        raise EshError(
            f"{what} needs the library {name}, which is not installed: pip install 'esh-scatter[{extra}]'"
        ) from None
