"""Reports as JSON."""

from __future__ import annotations

import json
import math
from typing import Any, BinaryIO

from ..problem.placement import Placement

__all__ = ["strict_json", "write_report"]


def write_report(file: BinaryIO, placement: Placement) -> None:
    """Write a placement's report."""
    assert placement.report is not None
    file.write(strict_json(placement.report.to_dict()))


def strict_json(value: Any) -> bytes:
    """Return JSON; what it has no number for (NaN, infinity) becomes null."""
    text = json.dumps(_plain(value), indent=2, ensure_ascii=False, allow_nan=False)
    return text.encode("utf-8") + b"\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if hasattr(value, "item"):  # a NumPy scalar
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
