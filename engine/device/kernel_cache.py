"""Where compiled kernels are kept: in Warp's folder, or in a temporary one where that cannot be written."""

from __future__ import annotations

import os
import tempfile
import warnings
from pathlib import Path

import warp as wp

__all__ = ["CacheWarning", "ensure_kernel_cache"]


class CacheWarning(UserWarning):
    """Compiled kernels are kept elsewhere than usual."""


def ensure_kernel_cache() -> None:
    """Give Warp, which is not yet started, a folder that can be written; warn where it is not its own."""
    usual = _usual_folder()
    problem = _why_not_writable(usual)
    if problem is None:
        return
    folder = _private_folder()
    wp.config.kernel_cache_dir = str(folder)
    warnings.warn(
        f"compiled kernels cannot be kept in {usual} ({problem}); they are kept in {folder}", CacheWarning, stacklevel=2
    )


def _usual_folder() -> Path:
    """The folder that Warp would choose."""
    if wp.config.kernel_cache_dir:
        return Path(wp.config.kernel_cache_dir)
    if os.environ.get("WARP_CACHE_PATH"):
        return Path(os.environ["WARP_CACHE_PATH"])
    from warp._src.thirdparty import appdirs

    return Path(appdirs.user_cache_dir(appname="warp", appauthor="NVIDIA", version=wp.config.version))


def _why_not_writable(folder: Path) -> str | None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return None
    except OSError as error:
        return (error.strerror or str(error)).lower()


def _private_folder() -> Path:
    """A folder that nobody else can put code into: the same in every run, or a new one where that is somebody else's."""
    user = str(os.getuid()) if hasattr(os, "getuid") else ""
    folder = Path(tempfile.gettempdir()) / f"esh-scatter-kernels-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        ours = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o077)
        if ours and folder.is_dir() and not folder.is_symlink() and _why_not_writable(folder) is None:
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="esh-scatter-kernels-"))
