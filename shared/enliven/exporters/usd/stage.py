"""A USD stage under construction: skinned skeletons, meshes of points over time, and their surfaces."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdShade, UsdSkel, UsdUtils, Vt

from enliven import __version__
from enliven.arrays import Float, Float32
from enliven.document import Skeleton, unused
from enliven.exporters.joints import JointTracks, joint_tracks, normalize_float32, normalize_skin
from enliven.exporters.performance import Performance
from enliven.exporters.usd.materials import StageMaterials
from enliven.meshes import Mesh
from enliven.meshes.gltf.srgb import linear_from_srgb

_MAX_STILL_CHANGE = 1e-7
"""Maximum change of a static value over all frames. It is below the resolution of float32."""
_DEFAULT_RATE = 30.0
"""Frame rate of a stage without motion, in frames per second."""


class UsdStage:
    """Collects characters, and writes the stage.

    Args:
        title: name of the root prim and of the stage.
        image_folder: name of the folder of images, next to the file or in the package.
        scale: units of the file per metre.
        up: vertical axis, "y" or "z".
    """

    def __init__(self, title: str, image_folder: str, scale: float, up: str) -> None:
        self._stage = Usd.Stage.CreateInMemory()
        self._scale, self._rate, self._end = scale, 0.0, 0.0
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z if up == "z" else UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0 / scale)
        layer = self._stage.GetRootLayer()
        layer.documentation = f"{title}, written by enliven {__version__}"
        self._root = UsdGeom.Xform.Define(self._stage, f"/{make_valid_prim_name(title)}")
        Usd.ModelAPI(self._root).SetKind(Kind.Tokens.component)
        self._stage.SetDefaultPrim(self._root.GetPrim())
        self._names = {"Materials"}
        materials = self._root.GetPath().AppendChild("Materials")
        self._materials = StageMaterials(self._stage, materials, image_folder)

    @property
    def images(self) -> dict[str, bytes]:
        """The images of all materials by their file name."""
        return self._materials.images

    def add(self, performance: Performance, progress: Callable[[float], object]) -> None:
        """Adds a character.

        Args:
            progress: called with the finished fraction of the character.

        Raises:
            InputError: if the character has no mesh.
        """
        name = unused(make_valid_prim_name(performance.name), self._names, "_")
        self._names.add(name)
        path = self._root.GetPath().AppendChild(name)
        codes = self._time_codes(performance.times)
        if performance.skeleton is not None:
            self._add_skeleton(path, performance, performance.skeleton, codes)
            progress(1.0)
        else:
            self._add_points(path, performance, codes, progress)

    def save(self, folder: Path, kind: str) -> Path:
        """Writes the stage into an empty folder.

        Args:
            kind: "usda", "usdc" or "usdz".

        Returns:
            The path of the file.
        """
        stage, rate = self._stage, self._rate or _DEFAULT_RATE
        stage.SetStartTimeCode(0.0)
        stage.SetEndTimeCode(self._end)
        stage.SetTimeCodesPerSecond(rate)
        stage.SetFramesPerSecond(rate)
        stage_path = folder / f"stage.{kind if kind != 'usdz' else 'usdc'}"
        stage.GetRootLayer().Export(str(stage_path))
        if kind != "usdz":
            return stage_path
        # Packaging includes the images next to the stage file.
        for name, data in self.images.items():
            target = folder / self._materials.folder / name
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(data)
        package = folder / "stage.usdz"
        UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(stage_path)), str(package))
        return package

    def _time_codes(self, times: Float) -> Float:
        """Converts times (T,) in seconds to USD time codes: frame numbers at the rate of the first moving
        character."""
        if not self._rate and len(times) > 1:
            self._rate = round((len(times) - 1) / float(times[-1] - times[0]), 6)
        codes = np.round(times * (self._rate or _DEFAULT_RATE), 4)
        self._end = max(self._end, float(codes[-1]))
        return np.asarray(codes)

    def _add_skeleton(
        self, path: Sdf.Path, performance: Performance, skeleton: Skeleton, codes: Float
    ) -> None:
        """Adds a skeleton, its animation and the skinned mesh."""
        mesh, skin = performance.surface
        stage, scale = self._stage, self._scale
        tracks = joint_tracks(performance, skeleton, half_scales=True)
        UsdSkel.Root.Define(stage, path)
        bones = UsdSkel.Skeleton.Define(stage, path.AppendChild("Skeleton"))
        tokens = _joint_tokens(tracks)
        bones.CreateJointsAttr(tokens)
        bones.CreateBindTransformsAttr(_row_vector_matrices(tracks.axes, tracks.pivots * scale))
        local = _rotation_matrices(tracks)
        bones.CreateRestTransformsAttr(_row_vector_matrices(local, tracks.offsets * scale))
        animation = UsdSkel.Animation.Define(stage, bones.GetPath().AppendChild("Animation"))
        animation.CreateJointsAttr(tokens)
        places = (tracks.places * scale).astype(np.float32)
        _write_samples(animation.CreateTranslationsAttr(), codes, places, Vt.Vec3fArray)
        # OpenUSD stores quaternions with the real part last.
        rotations = np.ascontiguousarray(np.roll(normalize_float32(tracks.turns), -1, -1))
        _write_samples(animation.CreateRotationsAttr(), codes, rotations, Vt.QuatfArray)
        _write_samples(animation.CreateScalesAttr(), codes, tracks.scales.astype(np.float16), Vt.Vec3hArray)
        binding = UsdSkel.BindingAPI.Apply(bones.GetPrim())
        binding.CreateAnimationSourceRel().SetTargets([animation.GetPath()])

        surface = self._add_mesh(path.AppendChild("Mesh"), performance.name, mesh)
        self._store_points(surface, codes[:1], iter([mesh.vertices]), mesh, len(codes), lambda _: None)
        binding_api = UsdSkel.BindingAPI.Apply(surface.GetPrim())
        binding_api.CreateSkeletonRel().SetTargets([bones.GetPath()])
        indices, weights = normalize_skin(skin.indices, skin.weights)
        count = indices.shape[1]
        binding_api.CreateJointIndicesPrimvar(False, count).Set(
            Vt.IntArray.FromNumpy(indices.astype(np.int32).ravel())
        )
        binding_api.CreateJointWeightsPrimvar(False, count).Set(Vt.FloatArray.FromNumpy(weights.ravel()))
        binding_api.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))

    def _add_points(
        self,
        path: Sdf.Path,
        performance: Performance,
        codes: Float,
        progress: Callable[[float], object],
    ) -> None:
        """Adds a mesh with time-sampled points and normals."""
        mesh = performance.surface[0]
        UsdGeom.Xform.Define(self._stage, path)
        surface = self._add_mesh(path.AppendChild("Mesh"), performance.name, mesh)
        self._store_points(surface, codes, performance.surfaces(), mesh, len(codes), progress)

    def _store_points(
        self,
        surface: UsdGeom.Mesh,
        codes: Float,
        frames: Any,
        mesh: Mesh,
        count: int,
        progress: Callable[[float], object],
    ) -> None:
        """Stores points, normals and the bounding box at each time. A single frame is stored as default
        values without time samples."""
        points, normals, extent = surface.GetPointsAttr(), surface.GetNormalsAttr(), surface.GetExtentAttr()
        surface.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        for number, (code, frame) in enumerate(zip(codes, frames, strict=True)):
            time = Usd.TimeCode(float(code)) if len(codes) > 1 else Usd.TimeCode.Default()
            vertices = np.ascontiguousarray(frame * self._scale, np.float32)
            points.Set(Vt.Vec3fArray.FromNumpy(vertices), time)
            posed_mesh = Mesh(frame, mesh.faces)
            normals.Set(Vt.Vec3fArray.FromNumpy(_unit_normals(posed_mesh)), time)
            box = np.stack([vertices.min(0), vertices.max(0)])
            extent.Set(Vt.Vec3fArray.FromNumpy(box), time)
            progress((number + 1) / count)

    def _add_mesh(self, path: Sdf.Path, name: str, mesh: Mesh) -> UsdGeom.Mesh:
        """Adds a mesh with faces, colours, texture coordinates and materials, but without points."""
        surface = UsdGeom.Mesh.Define(self._stage, path)
        surface.GetPrim().SetDisplayName(name)
        surface.CreatePointsAttr()
        surface.CreateNormalsAttr()
        surface.CreateExtentAttr()
        surface.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        surface.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.faces), 3))
        surface.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel().astype(np.int32)))
        variables = UsdGeom.PrimvarsAPI(surface)
        if mesh.colours is not None:
            colours = variables.CreatePrimvar(
                "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex
            )
            linear = np.ascontiguousarray(linear_from_srgb(mesh.colours), np.float32)
            colours.Set(Vt.Vec3fArray.FromNumpy(linear))
        materials = mesh.materials
        if materials is None:
            surface.CreateDoubleSidedAttr(True)
            UsdShade.MaterialBindingAPI.Apply(surface.GetPrim()).Bind(self._materials.get_plain_material())
            return surface
        for number in range(materials.uvs.shape[2]):
            coordinates = variables.CreatePrimvar(
                _uv_name(number), Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
            )
            # USD counts texture rows from the bottom of the image, glTF from its top.
            uvs = materials.uvs[:, :, number].reshape(-1, 2) * [1.0, -1.0] + [0.0, 1.0]
            unique, indices = np.unique(uvs, axis=0, return_inverse=True)
            coordinates.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(unique, np.float32)))
            coordinates.SetIndices(Vt.IntArray.FromNumpy(indices.ravel().astype(np.int32)))
        self._bind(surface, mesh)
        return surface

    def _bind(self, surface: UsdGeom.Mesh, mesh: Mesh) -> None:
        """Binds the materials of a mesh. A single material is bound to the whole mesh, and several materials
        to subsets of the faces."""
        mesh_materials = mesh.materials
        assert mesh_materials is not None
        bound_materials = self._materials.add(mesh_materials)
        used_materials = np.unique(mesh_materials.of).tolist()
        surface.CreateDoubleSidedAttr(any(n < 0 or bound_materials[n].double_sided for n in used_materials))
        binding = UsdShade.MaterialBindingAPI.Apply(surface.GetPrim())
        materials = {
            n: self._materials.get_plain_material() if n < 0 else bound_materials[n].material
            for n in used_materials
        }
        if len(used_materials) == 1:
            binding.Bind(materials[used_materials[0]])
            return
        names = set[str]()
        for number, material in materials.items():
            name = unused(material.GetPrim().GetName(), names, "_")
            names.add(name)
            faces = np.flatnonzero(mesh_materials.of == number).astype(np.int32)
            subset = binding.CreateMaterialBindSubset(name, Vt.IntArray.FromNumpy(faces))
            UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)
        binding.SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)


def make_valid_prim_name(name: str) -> str:
    """Returns a valid prim name that is similar to the given name."""
    candidate = "".join(letter if letter.isalnum() or letter == "_" else "_" for letter in name)
    candidate = f"_{candidate}" if not candidate or candidate[0].isdigit() else candidate
    return candidate if Sdf.Path.IsValidIdentifier(candidate) else Tf.MakeValidIdentifier(name)


def _uv_name(number: int) -> str:
    """Returns the name of a set of texture coordinates."""
    return f"st{number}" if number else "st"


def _joint_tokens(tracks: JointTracks) -> list[str]:
    """Returns the path of each joint in the skeleton, which is its name in USD."""
    tokens, used_names = list[str](), set[str]()
    for name, parent in zip(tracks.names, tracks.parents, strict=True):
        unique_name = unused(make_valid_prim_name(name), used_names, "_")
        used_names.add(unique_name)
        tokens.append(unique_name if parent < 0 else f"{tokens[parent]}/{unique_name}")
    return tokens


def _rotation_matrices(tracks: JointTracks) -> Float:
    """Returns (J, 3, 3) rotations of the joints at rest, relative to their parents."""
    local = tracks.axes.copy()
    above = np.array(tracks.parents)
    local[1:] = tracks.axes[above[1:]].transpose(0, 2, 1) @ tracks.axes[1:]
    return local


def _row_vector_matrices(turns: Float, places: Float) -> Vt.Matrix4dArray:
    """Returns transforms for row vectors from rotations (J, 3, 3) and positions (J, 3)."""
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, :3], matrices[:, 3, :3] = turns.transpose(0, 2, 1), places
    return Vt.Matrix4dArray.FromNumpy(matrices)


def _write_samples(attribute: Usd.Attribute, codes: Float, values: Any, kind: Any) -> None:
    """Stores values (T, J, C) as time samples, or as a default value if they are constant."""
    if np.abs(values - values[0]).max() <= _MAX_STILL_CHANGE:
        attribute.Set(kind.FromNumpy(np.ascontiguousarray(values[0])))
        return
    for code, row in zip(codes, values, strict=True):
        attribute.Set(kind.FromNumpy(np.ascontiguousarray(row)), float(code))


def _unit_normals(mesh: Mesh) -> Float32:
    """Returns (V, 3) unit normals. Vertices without faces, or with faces of zero area, get a unit normal,
    too.
    """
    normals = mesh.vertex_normals().astype(np.float32)
    normals[np.linalg.norm(normals, axis=1) < 0.5] = [0.0, 1.0, 0.0]
    return normals
