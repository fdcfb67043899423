"""Sensor profiles: the properties of real depth cameras, read from ``firmware_configs/sensors/*.toml``."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.settings import data_field, group, load_settings
from enliven_edge.sensors import profile_names, profiles_folder


@dataclass(frozen=True)
class CameraProfile:
    """The properties of the lens and the image."""

    width: int = data_field(doc="Width of the depth image.", unit="px", low=16, high=4096)
    height: int = data_field(doc="Height of the depth image.", unit="px", low=16, high=4096)
    fx: float = data_field(doc="Horizontal focal length.", unit="px", low=10, high=10000)
    fy: float = data_field(doc="Vertical focal length.", unit="px", low=10, high=10000)
    cx: float = data_field(
        doc="Horizontal principal point, measured from the centre of the left column.",
        unit="px",
        low=0,
        high=4096,
    )
    cy: float = data_field(
        doc="Vertical principal point, measured from the centre of the top row.", unit="px", low=0, high=4096
    )
    distortion: tuple[float, float, float, float, float] = data_field(
        (0.0, 0.0, 0.0, 0.0, 0.0),
        "Brown-Conrady distortion coefficients k1, k2, p1, p2, k3. Zero: the image is already rectified.",
    )
    fps: float = data_field(30.0, "Frame rate of the depth images.", unit="Hz", low=1, high=240)


@dataclass(frozen=True)
class RangeProfile:
    """The sensor's measuring range and depth resolution."""

    near: float = data_field(doc="Minimum distance that the sensor reports.", unit="m", low=0.01, high=10)
    far: float = data_field(doc="Maximum distance that the sensor reports.", unit="m", low=0.1, high=65)
    baseline: float = data_field(
        0.0,
        "Distance from the imager to the projector or second imager, positive to the image's right. 0 "
        "for a time-of-flight camera, which has no depth shadow.",
        unit="m",
        low=-1,
        high=1,
    )
    disparity_step: float = data_field(
        0.0,
        "Disparity resolution at full image size. 0 for a time-of-flight camera.",
        unit="px",
        low=0,
        high=1,
    )
    depth_step: float = data_field(0.001, "Resolution of the reported depth.", unit="m", low=0.0001, high=0.1)


@dataclass(frozen=True)
class NoiseProfile:
    """Depth noise: sigma(z) = constant + linear (z - from) + quadratic (z - from)^2."""

    constant: float = data_field(
        doc="Axial standard deviation at the reference distance.", unit="m", low=0, high=0.2
    )
    linear: float = data_field(
        0.0, "Linear increase of the standard deviation with distance.", unit="m/m", low=0, high=0.1
    )
    quadratic: float = data_field(
        0.0, "Quadratic increase of the standard deviation with distance.", unit="m/m^2", low=0, high=0.1
    )
    start: float = data_field(0.0, "Reference distance.", unit="m", low=0, high=5)
    slant: float = data_field(
        0.0,
        "Additional standard deviation at 45 degrees of slant and 1 m, scaled by tan^2 / sqrt(z).",
        unit="m",
        low=0,
        high=0.05,
    )
    lateral: float = data_field(
        0.8, "Standard deviation of the position of an edge.", unit="px", low=0, high=5
    )
    correlation: float = data_field(
        1.0, "Width of the window within which neighbouring pixels share noise.", unit="px", low=1, high=25
    )
    frozen: float = data_field(0.0, "Fraction of the variance that is constant over time.", low=0, high=0.99)


@dataclass(frozen=True)
class FaultProfile:
    """Missing and wrong depth of a sensor."""

    edge: float = data_field(
        2.0, "Distance from an edge within which faults occur.", unit="px", low=0, high=12
    )
    edge_holes: float = data_field(0.3, "Fraction of the pixels behind an edge without depth.", low=0, high=1)
    flying: float = data_field(
        0.0,
        "Fraction of the pixels at an edge with a depth between both sides (flying pixels).",
        low=0,
        high=1,
    )
    grazing: float = data_field(
        80.0, "Maximum slant at which a surface is measured.", unit="deg", low=30, high=90
    )
    dark: float = data_field(
        0.2,
        "Fraction of pixels lost on surfaces that absorb the light, such as hair or black shoes.",
        low=0,
        high=1,
    )
    mirror: float = data_field(
        0.8,
        "Fraction of pixels lost on surfaces that reflect the light away, such as screens.",
        low=0,
        high=1,
    )


@dataclass(frozen=True)
class SensorProfile:
    """A depth camera as described by its data sheet and published measurements."""

    name: str = data_field(doc="Common name of the sensor.")
    kind: Literal["structured light", "stereo", "time of flight"] = data_field(
        doc="Measuring principle of the sensor."
    )
    source: str = data_field(doc="Source of these figures.")
    camera: CameraProfile = data_field(doc="Intrinsics and image size.")
    range: RangeProfile = data_field(doc="Measuring range and resolution.")
    noise: NoiseProfile = data_field(doc="Noise of the depth.")
    faults: FaultProfile = group(FaultProfile, "Missing and wrong depth.")

    def intrinsics(self, width: int | None = None) -> Intrinsics:
        """Returns the camera intrinsics, scaled to ``width`` pixels if it is given."""
        c = self.camera
        full = Intrinsics(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.distortion)
        return full if width is None or width == c.width else full.scale(width / c.width)

    def sigma(self, z: float) -> float:
        """Returns the standard deviation in metres of the depth of a surface at ``z`` metres.

        The surface faces the sensor.
        """
        n = self.noise
        return n.constant + n.linear * max(z - n.start, 0.0) + n.quadratic * (z - n.start) ** 2

    def step(self, z: float) -> float:
        """Returns the difference in metres between neighbouring depth values near ``z`` metres.

        Only multiples of this step can be reported.
        """
        r = self.range
        if r.disparity_step == 0.0:
            return r.depth_step
        return max(r.depth_step, z * z * r.disparity_step / (self.camera.fx * abs(r.baseline)))


def load_profile(name_or_path: str | Path) -> SensorProfile:
    """Returns a shipped profile by name (such as "kinect1"), or any profile by the path of its TOML file.

    Raises:
        InputError: for an unknown name, an unreadable file, a wrong or missing key, or contradictory values.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        names = profile_names()
        if str(name_or_path) not in names:
            near = difflib.get_close_matches(str(name_or_path), names, n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise InputError(
                f"unknown sensor profile {str(name_or_path)!r}",
                where="sensor profile",
                remedy=f"{hint}Known profiles: {', '.join(names)}. You can also use the path of a .toml "
                "file.",
            )
        path = profiles_folder() / f"{name_or_path}.toml"
    return _check_profile(load_settings(SensorProfile, path), str(path))


def _check_profile(profile: SensorProfile, where: str) -> SensorProfile:
    """Returns the profile if its values are consistent."""
    r, c = profile.range, profile.camera
    if r.near >= r.far:
        raise InputError(f"range.near ({r.near} m) must be smaller than range.far ({r.far} m)", where=where)
    if not (c.cx < c.width and c.cy < c.height):
        raise InputError(f"the principal point ({c.cx}, {c.cy}) is outside the image", where=where)
    triangulates = profile.kind != "time of flight"
    if triangulates != (r.baseline != 0.0) or triangulates != (r.disparity_step > 0.0):
        raise InputError(
            f"range.baseline is {r.baseline} m and range.disparity_step {r.disparity_step} px "
            f"for a sensor of kind {profile.kind!r}",
            where=where,
            remedy="Set both for structured light and stereo. Set both to 0 for a time-of-flight camera.",
        )
    return profile
