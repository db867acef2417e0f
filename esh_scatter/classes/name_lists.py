"""Lists of names in one text, separated by commas: names that hold any themselves stand in quotation marks, as in CSV files."""

import csv
from collections.abc import Iterable

__all__ = ["joined_names", "names_in"]


def joined_names(names: Iterable[str]) -> str:
    """Return names as one text, in the order of the alphabet."""
    return ", ".join(_quoted(name) for name in sorted(names))


def names_in(text: str) -> set[str]:
    """Return the names that a text lists."""
    # A name may have a line of its own; of a quotation mark that is never closed, the rest is the name.
    parts = next(csv.reader([text.replace("\n", " ")], skipinitialspace=True), [])
    return {part.strip() for part in parts} - {""}


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if "," in name or name.startswith('"') else name
