"""Settings described once: what each means, its range and its unit, and how a value that was given is checked.

A setting is a field of a frozen dataclass.
"""

from __future__ import annotations

__all__ = ["settle"]


def settle(instance: object, **values: object) -> None:
    """Set attributes of a frozen instance that is still being made."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)
