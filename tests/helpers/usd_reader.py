"""Reads USD files by the library's own classes: validation errors, and the vertices of a mesh at a time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, UsdValidation, Vt


def validation_errors(path: Path) -> list[str]:
    """Returns what the validators of the library report about a file."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    context = UsdValidation.ValidationContext(validators)
    stage = Usd.Stage.Open(str(path))
    return [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]


def skinned_vertices(stage: Usd.Stage, mesh: UsdGeom.Mesh, code: float) -> np.ndarray:
    """Returns the vertices (V, 3) of a skinned mesh in the world, by UsdSkelSkinningQuery."""
    root = UsdSkel.Root.Find(mesh.GetPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(binding.GetSkeleton())
    (target,) = [t for t in binding.GetSkinningTargets() if t.GetPrim() == mesh.GetPrim()]
    points = Vt.Vec3fArray(mesh.GetPointsAttr().Get())
    transforms = query.ComputeSkinningTransforms(Usd.TimeCode(code))
    assert target.ComputeSkinnedPoints(transforms, points, Usd.TimeCode(code))
    # Skinned points are in the space of the skeleton.
    place = UsdGeom.Xformable(query.GetSkeleton()).ComputeLocalToWorldTransform(Usd.TimeCode(code))
    assert place == Gf.Matrix4d(1.0)
    return np.array(points)


def vertices_at(path: Path, name: str, code: float) -> np.ndarray:
    """Returns the vertices (V, 3) of a character in the world at a time code."""
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh.Get(stage, stage.GetDefaultPrim().GetPath().AppendPath(f"{name}/Mesh"))
    if UsdSkel.Root.Find(mesh.GetPrim()):
        return skinned_vertices(stage, mesh, code)
    return np.array(mesh.GetPointsAttr().Get(Usd.TimeCode(code)))
