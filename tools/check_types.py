"""Check the types of the whole package with mypy: ``python tools/check_types.py``.

Its modules import each other relatively, across the root. mypy must therefore see the root as a package with a name, wherever the
checkout lies and whatever its folder is called: a folder of links shows it what belongs to the package, as ``esh``.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINKS = ROOT / "build" / "types"
PARTS = ("__init__.py", "engine", "esh_scatter", "py.typed")


def main() -> int:
    """Make the links that are missing, run mypy, and return its status."""
    package = LINKS / "esh"
    package.mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        if not (package / part).is_symlink():
            (package / part).symlink_to(ROOT / part)
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--package", "esh"]
    return subprocess.run([*command, *sys.argv[1:]], cwd=LINKS).returncode


if __name__ == "__main__":
    sys.exit(main())
