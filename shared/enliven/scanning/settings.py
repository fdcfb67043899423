"""Settings of a scan: resolution, range, and the depth noise of the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.settings import group, parameter, setting

MIN_OVERLAP_FRACTION = 0.25
"""Minimum fraction of an image's points in known space. Below it, tracking is lost."""
MIN_AGREEING_FRACTION = 0.6
"""Minimum fraction of the points in known space that lie on its surface. Below it, tracking is lost."""

_MIN_OBJECT_FRACTION = 0.01
"""Minimum fraction of an image that the object must fill if nothing else is in view. It is a hand's width at
one metre."""
_MAX_OBJECT_UNCERTAINTY_M = 0.25
"""Maximum camera position uncertainty, metres, if only the object is in view. A few images of an object
half a metre high leave its rotation uncertain by some degrees, and only more images can resolve it."""


@dataclass(frozen=True)
class DepthNoiseModel:
    """Standard deviation of a depth z: ``constant + quadratic (z - start)^2``, for a structured-light camera.

    Khoshelham and Elberink, Sensors 12 (2012); Nguyen, Izadi, Lovell, 3DIMPVT 2012, eq. 2.
    """

    constant: float = parameter(
        0.0012, "Standard deviation of the depth at the distance `start`.", unit="m", low=1e-5, high=0.1
    )
    quadratic: float = parameter(
        0.0019,
        "Increase of the standard deviation with the squared distance from `start`.",
        unit="1/m",
        low=0,
        high=0.1,
    )
    start: float = parameter(0.4, "Distance with the least noise.", unit="m", low=0, high=5)

    def sigma(self, z: float) -> float:
        """Returns the standard deviation (m) of a depth of ``z`` metres."""
        return self.constant + self.quadratic * (z - self.start) ** 2


@dataclass(frozen=True)
class VolumeSettings:
    """Settings of the fusion of depth images into a surface (TSDF)."""

    voxel: float = setting(
        0.004,
        "Edge length of the finest voxels: use 4 mm for an object, 1 cm for a room. Smaller voxels "
        "need more memory.",
        unit="m",
        low=0.001,
        high=0.1,
    )
    near: float = parameter(0.3, "Depth nearer than this is ignored.", unit="m", low=0, high=5)
    far: float = setting(5.0, "Depth farther than this is ignored.", unit="m", low=0.2, high=20)
    reach: float = setting(
        2.2,
        "Surfaces farther than this are stored only in coarse voxels, for the camera tracking.",
        unit="m",
        low=0.2,
        high=20,
    )
    memory: int = setting(
        1500,
        "Maximum memory for voxels, in megabytes. When this memory is full, the scan stops growing.",
        low=16,
        high=100_000,
    )
    colour: bool = parameter(True, "Stores colours too, if the camera has them.")
    noise: DepthNoiseModel = group(DepthNoiseModel, "Noise model of the camera's depth.")


@dataclass(frozen=True)
class TrackingSettings:
    """Settings of the alignment of a depth image with the surface."""

    fine_stride: int = parameter(
        2,
        "Step between sample points in the finest volume, in pixels of the half-size image.",
        low=1,
        high=32,
    )
    independent: float = parameter(
        0.02,
        "Fraction of the points that count as independent. Neighbouring pixels share their noise.",
        low=1e-4,
        high=1,
    )
    unsure: float = parameter(
        0.05,
        "Maximum standard deviation of the camera position. Above it, the position counts as unknown.",
        unit="m",
        low=1e-3,
        high=1,
    )


@dataclass(frozen=True)
class CutOutSettings:
    """Settings for cutting an object that stands on the floor out of a scan."""

    clearance: float = parameter(
        0.012,
        "Surfaces below this height above the floor are removed as noise.",
        unit="m",
        low=1e-3,
        high=0.2,
    )
    about: float = parameter(
        0.7,
        "Radius around the point that the camera looked at, within which objects are preferred.",
        unit="m",
        low=0.05,
        high=5,
    )
    least_area: float = parameter(0.02, "Minimum surface area of an object.", unit="m^2", low=1e-4, high=1)
    number: int = setting(
        1,
        "Number of the object on the floor to cut out. 1 is the object that the camera looked at most.",
        low=1,
        high=100,
    )
    hole: float = parameter(0.15, "Maximum rim length of holes that are closed.", unit="m", low=0, high=10)
    drawn: float = parameter(
        0.0, "Open rims below this height are extended down to the floor.", unit="m", low=0, high=1
    )


@dataclass(frozen=True)
class ObjectSettings:
    """Settings for separating an object that is moved during the scan from the room, and finding it again."""

    known_after: int = parameter(
        30,
        "Number of images after which the resting object is first segmented. The segmentation is "
        "repeated each "
        "time the number doubles.",
        low=5,
        high=1000,
    )
    followed: bool = parameter(False, "Tracks the object while it turns, for example on a turntable.")


@dataclass(frozen=True)
class ScanSettings:
    """All settings of a scan."""

    volume: VolumeSettings = group(VolumeSettings, "Fusion of images into a surface.")
    tracking: TrackingSettings = group(TrackingSettings, "Tracking of the camera.")
    cut_out: CutOutSettings = group(CutOutSettings, "Cutting the object out of the scan.")
    moved: ObjectSettings = group(ObjectSettings, "An object that is moved during the scan.")
    least_depth: float = parameter(0.05, "Minimum fraction of an image that shows a surface.", low=0, high=1)


def settings_within(volume: VolumeSettings, within: float) -> ScanSettings:
    """Returns the settings for scanning an object that may be turned, with all depth beyond ``within``
    metres ignored.
    """
    near = replace(volume, reach=min(volume.reach, within), far=within)
    tracking = TrackingSettings(unsure=_MAX_OBJECT_UNCERTAINTY_M)
    return ScanSettings(volume=near, tracking=tracking, least_depth=_MIN_OBJECT_FRACTION)
