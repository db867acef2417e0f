"""Placements as files, written so that none is half done. The ending of a file chooses its writer, in :data:`WRITERS`.

Writers import what takes time to load when they are called: the command line looks at the table before it loads anything.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from ..errors import EshError
from .body_formats import FORMATS, BodyFormat
from .placement_columns import is_marked, size_names

if TYPE_CHECKING:
    from ..problem.placement import Placement
    from ..problem.problem import Problem
    from .bodies import AssetFiles, Bodies

__all__ = [
    "WRITERS",
    "Assets",
    "PlacementWriter",
    "check_assets_fit",
    "check_ending",
    "check_writable",
    "one_of",
    "placement_writer",
    "write_bodies",
    "write_files",
    "write_placement",
]

Writer = Callable[[BinaryIO], None]


@dataclass(frozen=True)
class Assets:
    """Files that hold the objects themselves, for formats that can refer to them or take them in.

    Attributes:
        files: By ``"class"``, ``"class/size"`` or ``"class/size/variant"``, one or several; see :func:`~.bodies.bodies_of`.
        folder: Where the placement's file will lie.
    """

    files: AssetFiles
    folder: Path


@dataclass(frozen=True)
class PlacementWriter:
    """How placements are written as files of one ending.

    Attributes:
        what: What such a file is, for help texts.
        write: Writes a placement to an open binary file; equal placements as equal bytes.
        check: Finds out whether what it needs is installed, and raises an EshError if it is not.
    """

    what: str
    write: Callable[[BinaryIO, Placement, Assets], None]
    check: Callable[[], None] = lambda: None


def write_placement(path: str | Path, placement: Placement, *, assets: AssetFiles | None = None) -> None:
    """Write a placement; an older file is replaced only once the new one is complete.

    Args:
        path: Ends in ``.npz`` (``position`` [m], shape ``[n, 2]``; ``class_index``, ``size_index``, ``angle`` [rad], ``length`` and
            ``width`` [m], ``area`` [m²], ``variant`` and ``scale`` of the outline, shape ``[n]``; ``class_name``, shape ``[k]``;
            ``bends`` [m], shape ``[n, charges, 2]``, where lines may bend; ``id``, ``fixed`` and ``size_name``, shape ``[n]``, where
            bodies are fixed or were edited; on a surface these places have three columns, and ``normal``, ``tangent``, ``mesh``,
            ``triangle`` and ``barycentric`` are there; readable without pickle; equal placements give equal bytes), in ``.csv`` (one
            line per body, its columns named in the first; a name that a spreadsheet would take for a formula has a ``'`` in front),
            or in ``.usd``, ``.usdc``, ``.usda``, ``.glb``, ``.ply``, ``.parquet`` or ``.geojson`` (for other programs).
        placement: What to write.
        assets: For ``.usd…`` and ``.glb``: the files that hold the objects, by ``"class"``, ``"class/size"`` or, of a size with
            several outlines, ``"class/size/variant"``, counted from 0; a list, where several formats are written. An object's
            footprint is around its origin, and is its outline or has its size's mean area; its long axis lies along x, and it
            stands upright. Prisms stand in for objects without a file.

    Raises:
        EshError: Another ending, a file that cannot be written, or a library that the format needs and that is not installed.
    """
    from ..problem.given_values import as_path

    path = as_path(path)
    write_files({path: placement_writer(path, placement, assets=assets)})


def write_bodies(path: str | Path, bodies: Bodies) -> None:
    """Write bodies in space, for other programs; an older file is replaced only once the new one is complete.

    Args:
        path: Ends in ``.usd``, ``.usdc``, ``.usda``, ``.glb``, ``.ply``, ``.parquet`` or ``.geojson``.
        bodies: What to write.

    Raises:
        EshError: Another ending, a file that cannot be written, or a library that the format needs and that is not installed.
    """
    from ..problem.given_values import as_path, check_is
    from .bodies import Bodies

    path, bodies = as_path(path), check_is(bodies, Bodies, "`bodies`")
    body_format = FORMATS[check_ending(path, FORMATS)]
    body_format.check()
    write_files({path: lambda file: body_format.write(file, bodies, path.parent)})


def placement_writer(path: str | Path, placement: Placement, *, assets: AssetFiles | None = None) -> Writer:
    """Return what writes ``placement`` in the format that the ending of ``path`` names, for :func:`write_files`."""
    # Not with the module: the command waits for neither as long as it only reads what it was asked.
    from ..problem.given_values import check_is
    from ..problem.placement import Placement

    placement = check_is(placement, Placement, "`placement`")
    if assets is not None:
        assets = check_is(assets, dict, "`assets`")
    writer = WRITERS[check_ending(path, WRITERS)]
    writer.check()
    beside = Assets(assets or {}, Path(path).parent)
    return lambda file: writer.write(file, placement, beside)


def check_assets_fit(problem: Problem, assets: AssetFiles, paths: Iterable[Path]) -> None:
    """Find out before a run that some of these files cannot take the objects: they are written to nowhere.

    Raises:
        EshError: An asset for what is not there, or that does not exist, or that a file's format cannot refer to or take in.
    """
    from .bodies import trial_bodies

    bodies = trial_bodies(problem, assets)
    for path in paths:
        body_format = FORMATS.get(check_ending(path, WRITERS))
        if body_format is not None:
            with open(os.devnull, "wb") as nowhere:
                body_format.write(nowhere, bodies, path.parent)


def check_ending(path: str | Path, endings: Iterable[str], option: str = "") -> str:
    """Return which of ``endings`` (``".csv"``; small letters) a file has; the longest, where one is the end of another.

    Raises:
        EshError: None of them, or nothing before it. The sentence begins with ``option``.
    """
    path, endings = Path(path), tuple(endings)
    subject = f"{option} {path}" if option else str(path)
    name = path.name.lower()
    if name in endings:
        raise EshError(f"{subject} must have a name before its ending, for example plan{path.name}")
    found = [ending for ending in endings if name.endswith(ending)]
    if not found:
        raise EshError(f"{subject} must end in {one_of(endings)}; got the ending {path.suffix!r}")
    return max(found, key=len)


def one_of(words: Iterable[str]) -> str:
    """Return words as a sentence lists them: ``a, b or c``."""
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last


def check_writable(path: str | Path) -> None:
    """Find out, without writing anything, whether a file could be written.

    Raises:
        EshError: Its folder does not exist or may not be written to, or ``path`` is a folder.
    """
    path = Path(path)
    try:
        folder = path.resolve().parent
        if not folder.is_dir():
            raise EshError(f"{path} cannot be written: there is no folder {folder}")
        if path.exists() and not path.is_file():
            raise EshError(f"{path} cannot be written: it is {'a folder' if path.is_dir() else 'not a regular file'}")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise EshError(f"{path} cannot be written: no permission to write to the folder {folder}")
    except EshError:
        raise
    except (OSError, ValueError, RuntimeError) as error:  # a name that no file can have, a loop of links
        raise EshError(f"{path} cannot be written: {_reason(error)}") from None


def write_files(writers: Mapping[Path, Writer], still_wanted: Callable[[], None] | None = None) -> None:
    """Write several files, all of them or none.

    Each is written under another name in its own folder; when the last one is complete, all take their places. What lay there
    is kept until they have.

    Args:
        writers: What writes them.
        still_wanted: Called when all are complete, before the first takes its place; what it raises leaves everything as it was.

    Raises:
        EshError: One cannot be written; then no older file has been touched, and nothing new is left behind.
    """
    for path in writers:
        check_writable(path)
    staged: list[_Staged] = []
    path = Path()
    complete = False
    try:
        for path, writer in writers.items():
            staged.append(_Staged(path))
            staged[-1].write(writer)
        if still_wanted is not None:
            still_wanted()
        for item in staged:
            path = item.path
            item.take_place()
        complete = True
    except EshError:
        raise
    except (OSError, ValueError, MemoryError) as error:
        raise EshError(f"{path} cannot be written: {_reason(error)}") from None
    finally:
        for item in reversed(staged):
            item.finish(complete)


class _Staged:
    """A file that is written beside its place, and what lay there before."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._target = path.resolve()  # a link stays a link: what it points to is replaced
        stem = f".{self._target.name[:40]}.{secrets.token_hex(4)}"
        self._beside = self._target.with_name(f"{stem}.part")
        self._kept = self._target.with_name(f"{stem}.kept")
        self._existed = False
        self._began = False

    def write(self, writer: Writer) -> None:
        """Write it, all of it, under another name."""
        with self._beside.open("xb") as file:
            guarded = _FirstErrorKept(file)
            writer(guarded)  # type: ignore[arg-type]
            guarded.flush()
            if guarded.error is not None:
                raise guarded.error
            os.fsync(file.fileno())
        if self._target.exists():
            shutil.copymode(self._target, self._beside)

    def take_place(self) -> None:
        """Put it where it belongs; what lies there keeps a second name."""
        self._existed = self._target.exists()
        if self._existed:
            try:
                os.link(self._target, self._kept)
            except OSError:  # no hard links on this file system
                shutil.copy2(self._target, self._kept)
        self._began = True
        self._beside.replace(self._target)

    def finish(self, complete: bool) -> None:
        """Leave one file: this one, or if something went wrong what was there before."""
        with contextlib.suppress(OSError):
            came = self._began and not self._beside.exists()
            self._beside.unlink(missing_ok=True)
            if came and not complete:
                if self._existed:
                    # Where this fails, the older file stays under its other name.
                    self._kept.replace(self._target)
                else:
                    self._target.unlink(missing_ok=True)
            self._kept.unlink(missing_ok=True)


class _FirstErrorKept:
    """A file that writes into nothing after its first error, and keeps that.

    Archives that break off in the middle write on from their destructors, where nobody can catch what is raised.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def _try(self, call: Callable[[], int | None], otherwise: int) -> int:
        if self.error is None:
            try:
                return call() or 0
            except OSError as error:
                self.error = error
        return otherwise

    def write(self, data: Any) -> int:
        """Write, or act as if."""
        size = memoryview(data).nbytes
        self._try(lambda: self._file.write(data), size)
        return size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go there, or act as if."""
        return self._try(lambda: self._file.seek(offset, whence), offset)

    def tell(self) -> int:
        """Tell the place, or anything."""
        return self._try(self._file.tell, 0)

    def flush(self) -> None:
        """Hand on what waits."""
        self._try(self._file.flush, 0)


def _write_npz(file: BinaryIO, placement: Placement, assets: Assets) -> None:
    import numpy as np

    # np.savez dates its members 1980-01-01, so equal arrays give equal bytes.
    np.savez(
        file,
        position=np.ascontiguousarray(placement.position, dtype=np.float64),
        class_index=np.asarray(placement.class_index, dtype=np.int32),
        size_index=np.asarray(placement.size_index, dtype=np.int32),
        angle=np.asarray(placement.angle, dtype=np.float64),
        length=np.asarray(placement.length, dtype=np.float64),
        width=np.asarray(placement.width, dtype=np.float64),
        area=placement.area,
        variant=placement.variant,
        scale=placement.scale,
        **({} if placement.bends is None else {"bends": np.asarray(placement.bends, dtype=np.float64)}),
        class_name=np.array(placement.class_name, dtype=np.str_),
        **{name: getattr(placement, name) for name in ON_SURFACE if placement.normal is not None},
        # Where nothing is fixed and nothing was edited they say nothing that the order does not.
        **({"id": placement.id, "fixed": placement.fixed} if is_marked(placement) else {}),
        **({"size_name": np.array(size_names(placement), dtype=np.str_)} if is_marked(placement) else {}),
    )


def _write_csv(file: BinaryIO, placement: Placement, assets: Assets) -> None:
    from .csv_files import write_csv

    write_csv(file, placement)


# What placements on surfaces have beside.
ON_SURFACE = ("normal", "tangent", "mesh", "triangle", "barycentric")


def _exchange_writer(body_format: BodyFormat) -> PlacementWriter:
    def write(file: BinaryIO, placement: Placement, assets: Assets) -> None:
        from .bodies import bodies_of

        body_format.write(file, bodies_of(placement, assets.files), assets.folder)

    return PlacementWriter(body_format.what, write, body_format.check)


# A new format is one entry here: the API, the command line, its help and its messages read this table.
WRITERS: dict[str, PlacementWriter] = {
    ".npz": PlacementWriter("NumPy arrays", _write_npz),
    ".csv": PlacementWriter("a table of text", _write_csv),
    **{ending: _exchange_writer(body_format) for ending, body_format in FORMATS.items()},
}


def _reason(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "not enough memory"
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split()).lower()
