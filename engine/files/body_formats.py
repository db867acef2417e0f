"""The formats that other programs read and write, by ending. What takes time to load is imported where it is used."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from .extras import import_extra

if TYPE_CHECKING:
    from .bodies import Bodies

__all__ = ["FORMATS", "BodyFormat"]


@dataclass(frozen=True)
class BodyFormat:
    """How bodies are kept in files of one ending.

    Attributes:
        ending: ``".usd"``; small letters.
        what: What such a file is, for help texts.
        module: Module of this package that has ``write_…`` and ``read_…``.
        name: What stands for … there.
        library: A library that only some formats need; none, if empty.
        extra: The extra of the package that installs it.
    """

    ending: str
    what: str
    module: str
    name: str
    library: str = ""
    extra: str = ""

    def check(self) -> None:
        """Raise an EshError if the library is not installed."""
        if self.library:
            import_extra(self.library, self.extra, f"a {self.ending} file")

    def write(self, file: BinaryIO, bodies: Bodies, folder: Path) -> None:
        """Write bodies to an open binary file that will lie in ``folder``; equal bodies as equal bytes."""
        getattr(self._module(), f"write_{self.name}")(file, bodies, folder)

    def read(self, path: Path) -> Bodies:
        """Read bodies; raise an EshError if the file is something else."""
        self.check()
        bodies: Bodies = getattr(self._module(), f"read_{self.name}")(path)
        return bodies

    def _module(self) -> object:
        return importlib.import_module(f".{self.module}", __package__)


FORMATS: dict[str, BodyFormat] = {
    body_format.ending: body_format
    for body_format in (
        BodyFormat(".usd", "a USD point instancer", "usd_files", "usd", "pxr.Usd", "usd"),
        BodyFormat(".usdc", "the same", "usd_files", "usd", "pxr.Usd", "usd"),
        BodyFormat(".usda", "the same as text", "usd_files", "usda", "pxr.Usd", "usd"),
        BodyFormat(".glb", "glTF instances", "gltf_files", "glb"),
        BodyFormat(".ply", "points", "table_files", "ply"),
        BodyFormat(".parquet", "rows and columns", "table_files", "parquet", "pyarrow.parquet", "parquet"),
        BodyFormat(".geojson", "points as text", "table_files", "geojson"),
    )
}
