"""The folder of a run that can be left and continued: it keeps what was asked for, and takes no other run."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from ..errors import EshError
from ..files.placement_files import write_files
from ..files.report_files import strict_json

__all__ = ["make_folder", "open_run_folder"]


def make_folder(folder: Path) -> None:
    """Make a folder, and those that it lies in.

    Raises:
        EshError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unusable(folder, error) from None


def open_run_folder(
    folder: Path, name: str, plan: dict[str, Any], what: str, beside: Collection[str] = (), growing: str = ""
) -> None:
    """Make the folder of a run, or find that it is of the same one.

    Args:
        folder: Where.
        name: Of the file that keeps the plan.
        plan: What was asked for, ready for JSON.
        what: What messages call a run.
        beside: Names of what may lie there before.
        growing: The entry of the plan, a dictionary, that may hold more than it did when the run began.

    Raises:
        EshError: It cannot be used, or holds something else.
    """
    path = folder / name
    make_folder(folder)
    try:
        other = any(not entry.name.startswith(".") and entry.name not in beside for entry in folder.iterdir())
        # Read after looking around: the same run may have begun elsewhere meanwhile.
        older = json.loads(path.read_bytes()) if path.is_file() else None
    except OSError as error:
        raise _unusable(folder, error) from None
    except ValueError:
        older = {}
    if older is None and other:
        raise EshError(f"-o {folder} must be empty or hold this {what}; it holds other files")
    grown = growing and isinstance(older, dict) and _has_grown(older.get(growing), plan[growing])
    if older is None or (grown and older | {growing: plan[growing]} == plan):
        write_files({path: lambda file: _write(file, strict_json(plan))})
    elif older != plan:
        differing = [key for key in plan if not isinstance(older, dict) or older.get(key) != plan[key]]
        raise EshError(
            f"-o {folder} holds another {what}, which differs in its {', '.join(differing)}; choose another folder"
        )


def _has_grown(older: object, newer: dict[str, Any]) -> bool:
    return isinstance(older, dict) and len(newer) > len(older) and older.items() <= newer.items()


def _unusable(folder: Path, error: OSError) -> EshError:
    return EshError(f"-o {folder} cannot be used: {(error.strerror or str(error)).lower()}")


def _write(file: Any, content: bytes) -> None:
    file.write(content)
