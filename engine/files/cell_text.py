"""Names in the cells of tables, so that no spreadsheet takes one for a formula."""

from __future__ import annotations

__all__ = ["as_cell", "name_in_cell"]

# What formulas begin with in spreadsheets, those of East Asian keyboards among them.
FORMULAS = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")


def as_cell(name: str) -> str:
    """Return a name as a cell holds it: one that begins like a formula gets a quote in front."""
    # One that begins so after quotes of its own gets another, so that reading takes away no quote of its own.
    return f"'{name}" if name.lstrip("'").lstrip().startswith(FORMULAS) else name


def name_in_cell(cell: str) -> str:
    """Return the name that a cell stands for; see :func:`as_cell`."""
    return cell[1:] if cell[:1] == "'" and cell.lstrip("'").lstrip().startswith(FORMULAS) else cell
