"""Names in the cells of tables, so that no spreadsheet takes one for a formula."""

from __future__ import annotations

import re

__all__ = ["as_cell", "name_in_cell"]

# What formulas begin with in spreadsheets, those of East Asian keyboards among them; they may stand behind blanks and quotes.
FORMULA = "(?=[\\s'\"]*[=+\\-@\uff1d\uff0b\uff0d\uff20])"
# Where a cell may begin: with the name, and behind whatever else than a comma separates cells and lines. A spreadsheet that separates
# by one of these does not take a name's quotes for what holds it together.
BEGIN = r"(?:\A|(?<=[;\t\r\n]))"
BEFORE_FORMULAS = re.compile(BEGIN + FORMULA)
QUOTED_FORMULAS = re.compile(f"{BEGIN}'{FORMULA}")


def as_cell(name: str) -> str:
    """Return a name as a cell holds it: with a quote in front of whatever may be taken for a formula."""
    # What has quotes of its own there gets another, so that reading takes away no quote of its own.
    return BEFORE_FORMULAS.sub("'", name)


def name_in_cell(cell: str) -> str:
    """Return the name that a cell stands for; see :func:`as_cell`."""
    return QUOTED_FORMULAS.sub("", cell)
