"""Lists of names in one text, separated by commas: names that hold any themselves stand in quotation marks, as in CSV files."""

import re
from collections.abc import Iterable

__all__ = ["joined_names", "names_in"]

# A name and the comma behind it: in quotation marks from its first character to its last, or as it is.
_NAME = re.compile(r'\s*(?:"((?:[^"]|"")*)"\s*(?=,|$)|([^,]*))(?:,|$)')


def joined_names(names: Iterable[str]) -> str:
    """Return names as one text, in the order of the alphabet."""
    return ", ".join(_quoted(name) for name in sorted(names))


def names_in(text: str) -> set[str]:
    """Return the names that a text lists."""
    found = _NAME.findall(text)
    return {quoted.replace('""', '"') or plain.strip() for quoted, plain in found} - {""}


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if "," in name or name.startswith('"') else name
