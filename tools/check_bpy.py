"""Import bpy, and say in one sentence which system library is missing if it cannot be imported."""

import re
import sys

# Library -> the Debian and Ubuntu package that has it.
PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libICE.so.6": "libice6",
    "libSM.so.6": "libsm6",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libgomp.so.1": "libgomp1",
    "libxkbcommon.so.0": "libxkbcommon0",
}


def main() -> int:
    """Return 0 if bpy can be imported, else 1 after a sentence that says what to install."""
    try:
        import bpy  # noqa: F401
    except ImportError as error:
        found = re.match(r"(\S+): cannot open shared object file", str(error))
        if not found:
            print(f"Blender's Python module cannot be imported: {error}", file=sys.stderr)
            return 1
        library = found.group(1)
        print(
            f"Blender's Python module needs the system library {library}: on Debian and Ubuntu, "
            f"apt install {' '.join(sorted(PACKAGES.values()))}",
            file=sys.stderr,
        )
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
