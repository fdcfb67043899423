"""Settings of a scan: resolution, range, and the depth noise of the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.settings import setting

_MIN_OBJECT_FRACTION = 0.01
"""Minimum fraction of an image that the object fills if nothing else is in view: a hand's width at a
metre."""
_MAX_OBJECT_UNCERTAINTY_M = 0.25
"""Maximum camera position uncertainty, metres, if only the object is in view. A few images of an object
half a metre high leave its rotation uncertain by some degrees, and only more images can resolve it."""


@dataclass(frozen=True)
class DepthNoiseModel:
    """Standard deviation of a depth z: ``constant + quadratic (z - start)^2``, for a structured-light camera.

    Khoshelham and Elberink, Sensors 12 (2012); Nguyen, Izadi, Lovell, 3DIMPVT 2012, eq. 2.
    """

    constant: float = setting(
        0.0012, "Standard deviation of the depth at the distance `start`.", unit="m", low=1e-5, high=0.1
    )
    quadratic: float = setting(
        0.0019,
        "Increase of the standard deviation with the squared distance from `start`.",
        unit="1/m",
        low=0,
        high=0.1,
    )
    start: float = setting(0.4, "Distance with the least noise.", unit="m", low=0, high=5)

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
    truncation: float = setting(
        4.0,
        "Truncation distance of the TSDF in front of a surface. Raise it for noisy depth.",
        unit="voxels",
        low=2,
        high=16,
    )
    behind: float = setting(
        3.0,
        "Truncation distance behind a surface. Keep it below the thickness of thin parts.",
        unit="voxels",
        low=2,
        high=16,
    )
    near: float = setting(0.3, "Depth nearer than this is ignored.", unit="m", low=0, high=5)
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
        "Maximum memory for voxels, in megabytes. When it is full, the scan stops growing.",
        low=16,
        high=100_000,
    )
    colour: bool = setting(True, "Stores colours too, if the camera has them.")
    noise: DepthNoiseModel = setting(DepthNoiseModel, "Noise model of the camera's depth.")


@dataclass(frozen=True)
class TrackingSettings:
    """Settings of the alignment of a depth image with the surface."""

    coarse_steps: int = setting(
        6, "Maximum number of Gauss-Newton steps in each coarse volume.", low=1, high=100
    )
    fine_steps: int = setting(
        5, "Maximum number of Gauss-Newton steps in the finest volume.", low=1, high=100
    )
    close_steps: int = setting(
        15,
        "Maximum number of steps of the exact alignment, used if the normal one leaves the camera pose "
        "uncertain.",
        low=1,
        high=100,
    )
    coarse_stride: int = setting(
        4,
        "Step between sample points in the coarse volumes, in pixels of the half-size image.",
        low=1,
        high=32,
    )
    fine_stride: int = setting(
        2,
        "Step between sample points in the finest volume, in pixels of the half-size image.",
        low=1,
        high=32,
    )
    soft: float = setting(
        2.0,
        "Robust width: a point at this distance from the surface has a quarter of the full weight.",
        unit="voxels",
        low=0.1,
        high=16,
    )
    still: float = setting(
        3e-4,
        "The alignment stops when a step is smaller than this, in metres and radians.",
        low=1e-8,
        high=0.1,
    )
    damping: float = setting(
        1e-6, "Damping of the normal matrix, relative to the total weight of the points.", low=0, high=1
    )
    gravity: float = setting(
        0.1,
        "Weight of the up direction from the accelerometer, in squared metres.",
        unit="m^2",
        low=0,
        high=10,
    )
    agreeing: float = setting(
        0.6,
        "Minimum fraction of the points in known space that lie on its surface. Below it, tracking is lost.",
        low=0,
        high=1,
    )
    overlap: float = setting(0.25, "Minimum fraction of points that lie in known space.", low=0, high=1)
    unsure: float = setting(
        0.05,
        "Maximum standard deviation of the camera position. Above it, the position counts as unknown.",
        unit="m",
        low=1e-3,
        high=1,
    )
    fastest: float = setting(
        4.0,
        "Maximum speed of the camera. A faster match is rejected as a similar-looking place.",
        unit="m/s",
        low=0.1,
        high=100,
    )
    independent: float = setting(
        0.02,
        "Fraction of the points that count as having independent noise. Neighbouring pixels share theirs.",
        low=1e-4,
        high=1,
    )


@dataclass(frozen=True)
class LoopSettings:
    """Settings of loop closure: how a trajectory that returns to an earlier place is corrected."""

    history: int = setting(
        400,
        "Memory in megabytes for compressed images, which are fused again after a loop closure.",
        low=1,
        high=100_000,
    )
    piece_metres: float = setting(0.3, "Camera travel per submap.", unit="m", low=0.01, high=5)
    piece_radians: float = setting(0.35, "Camera rotation per submap.", unit="rad", low=0.01, high=3)
    tried: int = setting(
        2,
        "Maximum number of earlier submaps to test for loop closure, by position and by appearance each.",
        low=1,
        high=50,
    )
    shared: float = setting(
        0.4, "Minimum overlap of two images, as a fraction, for a loop closure by position.", low=0, high=1
    )
    unlike: float = setting(
        0.15,
        "Maximum difference in inverse depth for images that count as similar.",
        unit="1/m",
        low=0,
        high=5,
    )
    agreeing: float = setting(
        0.6, "Minimum fraction of points that lie on the other submap's surface.", low=0, high=1
    )
    agree_metres: float = setting(
        0.02,
        "Maximum distance between the two alignments of a submap pair (forward and backward).",
        unit="m",
        low=1e-4,
        high=1,
    )
    agree_radians: float = setting(
        0.015, "Maximum angle between these two alignments.", unit="rad", low=1e-4, high=1
    )
    metres: float = setting(
        0.003,
        "Minimum standard deviation of position assumed for a loop closure.",
        unit="m",
        low=1e-5,
        high=0.1,
    )
    radians: float = setting(
        0.002,
        "Minimum standard deviation of rotation assumed for a loop closure.",
        unit="rad",
        low=1e-5,
        high=0.1,
    )
    tracked_metres: float = setting(
        0.0015,
        "Standard deviation of the tracked position between successive submaps.",
        unit="m",
        low=1e-4,
        high=1,
    )
    tracked_radians: float = setting(
        0.001,
        "Standard deviation of the tracked rotation between successive submaps.",
        unit="rad",
        low=1e-4,
        high=1,
    )
    level: float = setting(
        0.01, "Standard deviation of the up direction from the accelerometer.", unit="rad", low=1e-4, high=1
    )
    doubt: float = setting(
        50.0,
        "Squared error, in standard deviations, at which a loop closure has half its weight.",
        low=1,
        high=1e6,
    )
    opened: float = setting(
        1.0, "Error of a loop, in standard deviations, above which its gap is reported.", low=0, high=100
    )
    middle: float = setting(
        1.2, "Depth at which displacements of images are measured.", unit="m", low=0.1, high=10
    )


@dataclass(frozen=True)
class CutOutSettings:
    """Settings for cutting an object that stands on the floor out of a scan."""

    thickness: float = setting(
        0.02, "Maximum distance of faces from a plane to belong to the floor.", unit="m", low=1e-3, high=0.2
    )
    clearance: float = setting(
        0.012,
        "Surfaces below this height above the floor are removed as noise.",
        unit="m",
        low=1e-3,
        high=0.2,
    )
    about: float = setting(
        0.7,
        "Radius around the point that the camera looked at, within which objects are preferred.",
        unit="m",
        low=0.05,
        high=5,
    )
    least_area: float = setting(0.02, "Minimum surface area of an object.", unit="m^2", low=1e-4, high=1)
    number: int = setting(
        1,
        "Number of the object on the floor to cut out. 1 is the one that the camera looked at most.",
        low=1,
        high=100,
    )
    hole: float = setting(0.15, "Maximum rim length of holes that are closed.", unit="m", low=0, high=10)
    drawn: float = setting(
        0.0, "Open rims below this height are extended down to the floor.", unit="m", low=0, high=1
    )


@dataclass(frozen=True)
class RegistrationSettings:
    """Settings for finding an object again that was put down elsewhere."""

    turns: int = setting(
        900,
        "Number of starting rotations to try; 900 are about 20 degrees apart. Lower it to save time.",
        low=24,
        high=100_000,
    )
    points: int = setting(
        300, "Number of surface points that are matched from each start.", low=50, high=10_000
    )
    looked_at: int = setting(24, "Number of candidates that are refined.", low=2, high=1000)
    fine_points: int = setting(2000, "Number of surface points for the refinement.", low=100, high=100_000)
    cell: float = setting(0.015, "Cell size of the nearest-point grid.", unit="m", low=1e-3, high=0.1)
    margin: float = setting(0.3, "Margin of this grid around the object.", unit="m", low=0.05, high=2)
    near: float = setting(
        0.01, "Maximum distance of a point that counts as on the surface.", unit="m", low=1e-3, high=0.1
    )
    clearance: float = setting(
        0.04,
        "Space at least this far in front of observed depth counts as free.",
        unit="m",
        low=5e-3,
        high=0.5,
    )
    agreeing: float = setting(0.5, "Minimum fraction of points on the surface.", low=0, high=1)
    through: float = setting(
        0.04, "Maximum fraction of points in space that the camera saw through.", low=0, high=1
    )
    doubt: float = setting(
        2.0, "Penalty for such a point, relative to the reward for a matching point.", low=0, high=100
    )
    clear: float = setting(0.2, "Minimum lead of the best score over the second best.", low=0, high=1)


@dataclass(frozen=True)
class ObjectSettings:
    """Settings for separating an object that is moved during the scan from the room, and finding it again."""

    known_after: int = setting(
        30,
        "Number of images after which the resting object is first segmented. This is repeated each "
        "time the number doubles.",
        low=5,
        high=1000,
    )
    lifted: float = setting(
        0.015,
        "Distance between floor and object motion above which the object counts as moved.",
        unit="m",
        low=1e-3,
        high=1,
    )
    tilted: float = setting(
        0.015,
        "Rotation between floor and object above which the object counts as moved.",
        unit="rad",
        low=1e-3,
        high=1,
    )
    agreeing: float = setting(
        0.8, "Minimum fraction of points on the surface while the object comes to rest again.", low=0, high=1
    )
    looks: int = setting(
        10, "Number of images of a new rest before the object is first searched in it.", low=2, high=1000
    )
    followed: bool = setting(False, "Tracks the object while it turns, for example on a turntable.")
    unsure: float = setting(
        0.25,
        "Maximum standard deviation of the camera position relative to the object. Above it, the "
        "rotation counts as unknown.",
        unit="m",
        low=1e-3,
        high=2,
    )
    missed: int = setting(
        15,
        "Number of consecutive images without the object after which it is searched at rest.",
        low=1,
        high=1000,
    )


@dataclass(frozen=True)
class ScanSettings:
    """A scan."""

    volume: VolumeSettings = setting(VolumeSettings, "Fusion of images into a surface.")
    tracking: TrackingSettings = setting(TrackingSettings, "Tracking of the camera.")
    loops: LoopSettings = setting(LoopSettings, "Loop closure.")
    cut_out: CutOutSettings = setting(CutOutSettings, "Cutting the object out of the scan.")
    moved: ObjectSettings = setting(ObjectSettings, "An object that is moved during the scan.")
    registration: RegistrationSettings = setting(RegistrationSettings, "Finding a moved object again.")
    least_depth: float = setting(0.05, "Minimum fraction of an image that shows a surface.", low=0, high=1)


def settings_within(volume: VolumeSettings, within: float) -> ScanSettings:
    """Returns the settings for scanning an object that may be turned, with all depth beyond ``within``
    metres ignored.
    """
    near = replace(volume, reach=min(volume.reach, within), far=within)
    tracking = TrackingSettings(unsure=_MAX_OBJECT_UNCERTAINTY_M)
    return ScanSettings(volume=near, tracking=tracking, least_depth=_MIN_OBJECT_FRACTION)
