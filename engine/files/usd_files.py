"""Bodies as a USD point instancer, with prototypes by reference; read from any stage that has one."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import EshError, InputFileError
from .bodies import Bodies, Prototype, bodies_from_columns, read_names
from .extras import import_extra
from .quaternions import multiply_xyzw

__all__ = ["read_usd", "read_usda", "write_usd", "write_usda"]

KEY = "esh:names"
# Of assets that can be referred to.
ENDINGS = (".usd", ".usdc", ".usda", ".usdz")
# Names of the primvars, and how they are kept.
PRIMVARS = {"class_index": "i4", "size_index": "i4", "area": "f4", "length": "f4", "width": "f4", "fixed": "i4"}
# The same where bodies have outlines.
OUTLINES = {"variant": "i4", "scale": "f4"}


def _pxr(module: str) -> Any:
    return import_extra(f"pxr.{module}", "usd", "a USD file")


def write_usd(file: BinaryIO, bodies: Bodies, folder: Path, ending: str = ".usdc") -> None:
    """Write a stage in meters, z up, with one point instancer.

    Args:
        file: Where to.
        bodies: What.
        folder: Where the file will lie; assets are referred to from there.
        ending: ``".usda"`` for text; anything else is binary.
    """
    gf, sdf, usd, geom, vt = (_pxr(name) for name in ("Gf", "Sdf", "Usd", "UsdGeom", "Vt"))
    layer = sdf.Layer.CreateAnonymous(ending)
    stage = usd.Stage.Open(layer)
    geom.SetStageUpAxis(stage, geom.Tokens.z)
    geom.SetStageMetersPerUnit(stage, 1.0)
    world = geom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    instancer = geom.PointInstancer.Define(stage, "/World/Scatter")
    targets, references, reach = _define_prototypes(stage, bodies.prototypes)
    instancer.CreatePrototypesRel().SetTargets(targets)
    origin = bodies.origin
    position = (bodies.position - origin).astype(np.float32)
    if origin.any():
        instancer.AddTranslateOp().Set(gf.Vec3d(*origin.tolist()))
    # USD keeps the imaginary part first. Halves are what every program reads; floats, where it knows them, turn long objects
    # to the millimeter.
    rotation = np.ascontiguousarray(bodies.rotation[:, [1, 2, 3, 0]])
    instancer.CreateProtoIndicesAttr(vt.IntArray.FromNumpy(bodies.prototype_index))
    instancer.CreatePositionsAttr(vt.Vec3fArray.FromNumpy(position))
    instancer.CreateOrientationsAttr(vt.QuathArray.FromNumpy(rotation.astype(np.float16)))
    instancer.GetPrim().CreateAttribute("orientationsf", sdf.ValueTypeNames.QuatfArray, False).Set(
        vt.QuatfArray.FromNumpy(rotation)
    )
    instancer.CreateScalesAttr(vt.Vec3fArray.FromNumpy(bodies.scale))
    instancer.CreateIdsAttr(vt.Int64Array.FromNumpy(bodies.id))
    primvars = geom.PrimvarsAPI(instancer)
    columns = bodies.columns()
    for key, dtype in (PRIMVARS | OUTLINES).items():
        if key not in columns:
            continue
        values = np.ascontiguousarray(columns[key], dtype)
        kind, array = (
            (sdf.ValueTypeNames.IntArray, vt.IntArray)
            if dtype == "i4"
            else (sdf.ValueTypeNames.FloatArray, vt.FloatArray)
        )
        primvars.CreatePrimvar(key, kind, geom.Tokens.vertex).Set(array.FromNumpy(values))
    instancer.GetPrim().CreateAttribute(KEY, sdf.ValueTypeNames.String, True).Set(bodies.names())
    if len(position):
        reach *= float(np.abs(bodies.scale).max())
        corners = position.min(axis=0) - reach, position.max(axis=0) + reach
        instancer.CreateExtentAttr([gf.Vec3f(*map(float, corner)) for corner in corners])
    # Where nothing follows references any more: they hold only from the folder of the file.
    del stage, world, instancer, primvars
    for path, asset in references.items():
        layer.GetPrimAtPath(path).referenceList.Prepend(sdf.Reference(_reference(asset, folder)))
    # USD writes to names only, and takes the format from them.
    with tempfile.TemporaryDirectory(prefix="esh-usd-") as beside:
        exported = Path(beside) / f"bodies{ending}"
        _export(layer, exported)
        file.write(exported.read_bytes())


def _define_prototypes(stage: Any, prototypes: tuple[Prototype, ...]) -> tuple[list[str], dict[str, Path], float]:
    """Define what bodies are: prisms, or assets, which are still to be referred to.

    Returns:
        The paths of all in the stage, the assets by the paths that are to refer to them, and how far the largest reaches [m].
    """
    geom = _pxr("UsdGeom")
    targets: list[str] = []
    references: dict[str, Path] = {}
    reach = 0.0
    for name, prototype in zip(_identifiers(prototypes), prototypes, strict=True):
        path = f"/World/Scatter/Prototypes/{name}"
        asset = prototype.asset(ENDINGS, "a USD file")
        if asset is None:
            _define_prism(stage, path, prototype)
            reach = max(reach, float(np.hypot(np.linalg.norm(prototype.outline, axis=1).max(), prototype.height)))
        else:
            turn, size = _measured(asset)
            reach = max(reach, size)
            # Without a type of its own, so that it has the asset's.
            inner = path if turn is None else f"{path}/Asset"
            if turn is not None:
                geom.Xform.Define(stage, path).AddTransformOp().Set(turn)
            stage.DefinePrim(inner)
            references[inner] = asset
        stage.GetPrimAtPath(path).SetMetadata("displayName", prototype.name)
        targets.append(path)
    return targets, references, reach


def _export(layer: Any, path: Path) -> None:
    """Write a layer; raise an OSError where USD cannot, which has errors of its own and says one for every block."""
    reason = "USD does not say why"
    try:
        written = layer.Export(str(path))
    except _pxr("Tf").ErrorException as error:
        written = False
        reason = next((str(getattr(one, "commentary", one)) for one in error.args), reason)
    if not written:
        raise OSError(f"USD could not write to the folder for temporary files: {reason}")


def write_usda(file: BinaryIO, bodies: Bodies, folder: Path) -> None:
    """Write the same as text."""
    write_usd(file, bodies, folder, ".usda")


def read_usd(path: Path) -> Bodies:
    """Read the point instancers of a stage, ours or any other, in meters and z up."""
    usd, geom, tf = (_pxr(name) for name in ("Usd", "UsdGeom", "Tf"))
    try:
        stage = usd.Stage.Open(str(path))
    except tf.ErrorException as error:
        raise InputFileError(f"{path} cannot be read as a USD file: {' '.join(str(error).split())[:200]}") from None
    instancers = [geom.PointInstancer(prim) for prim in stage.Traverse() if prim.IsA(geom.PointInstancer)]
    if not instancers:
        raise InputFileError(f"{path} must hold a point instancer; it has none")
    parts: list[dict[str, np.ndarray]] = []
    labels: list[str] = []
    names: dict[str, Any] = {}
    for instancer in instancers:
        place = np.array(geom.XformCache().GetLocalToWorldTransform(instancer.GetPrim()), np.float64)
        parts.append(_columns(instancer, place, len(labels)))
        labels += [str(target.name) for target in instancer.GetPrototypesRel().GetTargets()]
        written = instancer.GetPrim().GetAttribute(KEY)
        if written and len(instancers) == 1:
            names = read_names(str(written.Get()))
    shared = [key for key in parts[0] if all(key in part for part in parts)]
    columns = {key: np.concatenate([part[key] for part in parts]) for key in shared}
    meter = float(geom.GetStageMetersPerUnit(stage))
    up = (
        np.eye(3) if geom.GetStageUpAxis(stage) == geom.Tokens.z else np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    )
    position = meter * np.stack([columns[axis] for axis in "xyz"], axis=1) @ up.T
    columns |= dict(zip("xyz", position.T, strict=True))
    if up[1, 1] == 0.0:
        y, z = columns["rotation_y"], columns["rotation_z"]
        columns |= {"rotation_y": -z, "rotation_z": y, "scale_y": columns["scale_z"], "scale_z": columns["scale_y"]}
    return bodies_from_columns(columns, {"prototype": labels} | names, str(path))


read_usda = read_usd


def _columns(instancer: Any, place: np.ndarray, first: int) -> dict[str, np.ndarray]:
    """Return the columns of one instancer that stands at ``place``, shape ``[4, 4]``, rows first."""
    position = np.array(instancer.GetPositionsAttr().Get() or [], np.float64).reshape(-1, 3)
    count = len(position)
    rotation = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    for key in ("orientations", "orientationsf"):
        attribute = instancer.GetPrim().GetAttribute(key)
        values = attribute.Get() if attribute else None
        if values is not None and len(values) == count and count:
            rotation = np.array(values, np.float64) if not hasattr(values[0], "GetReal") else _quaternions(values)
    scales = instancer.GetScalesAttr().Get()
    scale = np.array(scales, np.float64) if scales is not None and len(scales) == count else np.ones((count, 3))
    # The instancer's own place: a rotation, a uniform scale and a shift.
    factor = float(np.cbrt(abs(np.linalg.det(place[:3, :3]))))
    if not np.allclose(place[:3, :3], np.eye(3)):
        rotation = multiply_xyzw(_quaternion_of(place[:3, :3].T / factor), rotation)
    rotation = rotation[:, [3, 0, 1, 2]]
    columns = {
        **dict(zip("xyz", (position @ place[:3, :3] + place[3, :3]).T, strict=True)),
        **{f"rotation_{axis}": values for axis, values in zip("wxyz", rotation.T, strict=True)},
        **{f"scale_{axis}": values for axis, values in zip("xyz", factor * scale.T, strict=True)},
        "prototype_index": np.array(instancer.GetProtoIndicesAttr().Get(), np.int64) + first,
    }
    ids = instancer.GetIdsAttr().Get()
    if ids is not None and len(ids) == count:
        columns["id"] = np.array(ids, np.int64)
    primvars = import_extra("pxr.UsdGeom", "usd", "a USD file").PrimvarsAPI(instancer)
    for key in PRIMVARS | OUTLINES:
        values = primvars.GetPrimvar(key).Get() if primvars.HasPrimvar(key) else None
        if values is not None and len(values) == count:
            columns[key] = np.array(values)
    return columns


def _quaternions(values: Any) -> np.ndarray:
    """Return x, y, z, w of an array of USD's quaternions, shape ``[n, 4]``."""
    raw = np.asarray(values)
    if raw.ndim == 2:
        return raw.astype(np.float64)
    return np.array([[*value.GetImaginary(), value.GetReal()] for value in values], np.float64)


def _quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Return x, y, z, w of a rotation matrix that acts on columns, shape ``[1, 4]``."""
    # The eigenvector of the largest eigenvalue: no case is special (Bar-Itzhack's method).
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    symmetric = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    return np.linalg.eigh(symmetric)[1][:, -1:].T


def _define_prism(stage: Any, path: str, prototype: Prototype) -> None:
    geom, vt = _pxr("UsdGeom"), _pxr("Vt")
    count = len(prototype.outline)
    mesh = geom.Mesh.Define(stage, path)
    low, high = (np.column_stack([prototype.outline, np.full(count, z)]) for z in (0.0, prototype.height))
    ring = np.arange(count)
    sides = np.stack([ring, np.roll(ring, -1), np.roll(ring, -1) + count, ring + count], axis=1)
    mesh.CreatePointsAttr(vt.Vec3fArray.FromNumpy(np.vstack([low, high]).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([count, count] + [4] * count)
    mesh.CreateFaceVertexIndicesAttr([*ring[::-1].tolist(), *(ring + count).tolist(), *sides.ravel().tolist()])
    mesh.CreateSubdivisionSchemeAttr(geom.Tokens.none)
    mesh.CreateDisplayColorAttr([prototype.color])
    mesh.CreateExtentAttr(mesh.ComputeExtent(mesh.GetPointsAttr().Get()))


def _measured(asset: Path) -> tuple[Any, float]:
    """Return what turns an asset into meters and z up, None where it is so; and how far it reaches from its origin [m].

    References bring no units along. What an asset does not say is taken to be as here.
    """
    gf, sdf, usd, geom = (_pxr(name) for name in ("Gf", "Sdf", "Usd", "UsdGeom"))
    layer = sdf.Layer.FindOrOpen(str(asset.resolve()))
    if not layer or not layer.defaultPrim:
        raise EshError(
            f"{asset} must be a USD file that has a default prim; " + ("it has none" if layer else "it is not one")
        )
    stage = usd.Stage.Open(layer)
    meter = float(geom.GetStageMetersPerUnit(stage)) if geom.StageHasAuthoredMetersPerUnit(stage) else 1.0
    lies = stage.HasAuthoredMetadata("upAxis") and geom.GetStageUpAxis(stage) == geom.Tokens.y
    turn = gf.Matrix4d().SetScale(meter)
    if lies:
        turn *= gf.Matrix4d().SetRotate(gf.Rotation(gf.Vec3d(1.0, 0.0, 0.0), 90.0))
    cache = geom.BBoxCache(usd.TimeCode.EarliestTime(), [geom.Tokens.default_, geom.Tokens.render, geom.Tokens.proxy])
    box = cache.ComputeWorldBound(stage.GetDefaultPrim()).ComputeAlignedRange()
    far = 0.0 if box.IsEmpty() else max(box.GetCorner(corner).GetLength() for corner in range(8))
    return (turn if lies or meter != 1.0 else None), meter * far


def _reference(asset: Path, folder: Path) -> str:
    try:
        relative = os.path.relpath(asset.resolve(), folder.resolve())
    except ValueError:  # on another drive
        return asset.resolve().as_posix()
    # A leading dot says that it lies beside the file, and is not to be searched for.
    text = Path(relative).as_posix()
    return text if text.startswith(".") else f"./{text}"


def _identifiers(prototypes: tuple[Prototype, ...]) -> list[str]:
    """Return names that every version of USD accepts, none twice."""
    found: list[str] = []
    for prototype in prototypes:
        name = re.sub(r"\W", "_", prototype.name, flags=re.ASCII)
        name = name if name and not name[0].isdigit() else f"_{name}"
        twins = sum(1 for other in found if other == name or re.fullmatch(re.escape(name) + r"_\d+", other))
        found.append(f"{name}_{twins + 1}" if name in found else name)
    return found
