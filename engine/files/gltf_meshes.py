"""What trimesh passes over in glTF files: coordinates of images where a mesh has no material."""

from __future__ import annotations

import json
import struct
from typing import Any

__all__ = ["with_materials"]

# The first chunk of a .glb file, of JSON, begins behind a head of 12 bytes and one of its own.
CHUNK = struct.Struct("<II")
HEAD = struct.Struct("<III")


def with_materials(content: bytes) -> bytes | None:
    """Return a glTF file whose meshes all have a material, as a text or in binary; None where nothing is to be changed.

    Args:
        content: Bytes of a .gltf or a .glb file.
    """
    binary = content.startswith(b"glTF")
    try:
        length = CHUNK.unpack_from(content, HEAD.size)[0] if binary else len(content)
        start = HEAD.size + CHUNK.size if binary else 0
        described = json.loads(content[start : start + length])
        bare = [own for mesh in described.get("meshes", []) for own in mesh["primitives"] if _is_bare(own)]
        materials = described.setdefault("materials", [])
        if not bare:
            return None
        for own in bare:
            own["material"] = len(materials)
        materials.append({})
    except (struct.error, ValueError, KeyError, TypeError, AttributeError):
        return None  # trimesh says what is wrong of it
    text = json.dumps(described).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    rest = content[start + length :]
    whole = HEAD.size + CHUNK.size + len(text) + len(rest)
    return content[:8] + struct.pack("<I", whole) + struct.pack("<I", len(text)) + content[16:20] + text + rest


def _is_bare(primitive: dict[str, Any]) -> bool:
    return "material" not in primitive and "TEXCOORD_0" in primitive["attributes"]
