"""Settings of a scan: resolution, range, and the depth noise of the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.settings import setting

_LEAST_ALONE = 0.01
"""Minimum fraction of an image that the object fills if nothing else is in view: a hand's width at a
metre."""
_UNSURE_ALONE = 0.25
"""Maximum camera position uncertainty, metres, if only the object is in view. A few images of an object
half a metre high leave its rotation uncertain by some degrees, and only more images can resolve it."""


@dataclass(frozen=True)
class DepthNoiseModel:
    """Standard deviation of a depth z: ``constant + quadratic (z - start)^2``, for a structured-light camera.

    Khoshelham and Elberink, Sensors 12 (2012); Nguyen, Izadi, Lovell, 3DIMPVT 2012, eq. 2.
    """

    constant: float = setting(
        0.0012, "Standard deviation of the depth at `start`.", unit="m", low=1e-5, high=0.1
    )
    quadratic: float = setting(0.0019, "How it grows with the distance squared.", unit="1/m", low=0, high=0.1)
    start: float = setting(0.4, "Where it is least.", unit="m", low=0, high=5)

    def sigma(self, z: float) -> float:
        """Returns the standard deviation (m) of a depth of ``z`` metres."""
        return self.constant + self.quadratic * (z - self.start) ** 2


@dataclass(frozen=True)
class VolumeSettings:
    """Settings of the fusion of depth images into a surface (TSDF)."""

    voxel: float = setting(
        0.004, "Side of the finest voxels: 4 mm for a thing, 1 cm for a room.", unit="m", low=0.001, high=0.1
    )
    truncation: float = setting(
        4.0, "Distances before a surface are kept up to so many voxels.", unit="voxels", low=2, high=16
    )
    behind: float = setting(
        3.0, "Distances behind it: less than the thickness of thin parts.", unit="voxels", low=2, high=16
    )
    near: float = setting(0.3, "Nearer depth is left out.", unit="m", low=0, high=5)
    far: float = setting(5.0, "Farther depth is left out.", unit="m", low=0.2, high=20)
    reach: float = setting(
        2.2, "Farther surfaces are kept in coarse voxels only, for the tracking.", unit="m", low=0.2, high=20
    )
    memory: int = setting(
        1500, "Megabytes of voxels; when full, nothing more is added.", low=16, high=100_000
    )
    colour: bool = setting(True, "Whether colours are fused where the camera has them.")
    noise: DepthNoiseModel = setting(DepthNoiseModel, "What the camera's depth is worth.")


@dataclass(frozen=True)
class TrackingSettings:
    """Settings of the alignment of a depth image with the surface."""

    coarse_steps: int = setting(6, "Steps of Gauss-Newton in each coarse volume.", low=1, high=100)
    fine_steps: int = setting(5, "Steps of it in the finest one.", low=1, high=100)
    close_steps: int = setting(
        15, "Steps at most where an image that leaves it open is looked at closely.", low=1, high=100
    )
    coarse_stride: int = setting(4, "Half-size pixels between the points of a coarse step.", low=1, high=32)
    fine_stride: int = setting(2, "Half-size pixels between the points of a fine step.", low=1, high=32)
    soft: float = setting(2.0, "Distance at which a point counts a quarter.", unit="voxels", low=0.1, high=16)
    still: float = setting(3e-4, "Moves (m) and turns (rad) below which it is done.", low=1e-8, high=0.1)
    damping: float = setting(1e-6, "Of the normal matrix, per weight of the points.", low=0, high=1)
    gravity: float = setting(
        0.1, "Weight of the felt direction up, in squared metres.", unit="m^2", low=0, high=10
    )
    agreeing: float = setting(
        0.6, "Share of points in known space that must lie at its surface.", low=0, high=1
    )
    overlap: float = setting(0.25, "Share of points that must lie in known space.", low=0, high=1)
    unsure: float = setting(
        0.05,
        "Standard deviation of the camera's place beyond which it is not known.",
        unit="m",
        low=1e-3,
        high=1,
    )
    fastest: float = setting(
        4.0,
        "Speed of the camera beyond which a place that fits is another one that looks alike.",
        unit="m/s",
        low=0.1,
        high=100,
    )
    independent: float = setting(
        0.02, "Share of the points whose noise counts as independent of their neighbours'.", low=1e-4, high=1
    )


@dataclass(frozen=True)
class LoopSettings:
    """Settings of loop closure: how a trajectory that returns to an earlier place is corrected."""

    history: int = setting(400, "Megabytes of packed images, to fuse again.", low=1, high=100_000)
    piece_metres: float = setting(0.3, "Way of the camera in one piece.", unit="m", low=0.01, high=5)
    piece_radians: float = setting(0.35, "Its turn in one piece.", unit="rad", low=0.01, high=3)
    tried: int = setting(
        2, "Earlier pieces that each is laid onto at most, by place and by look.", low=1, high=50
    )
    shared: float = setting(0.4, "Share of an image that another must look at.", low=0, high=1)
    unlike: float = setting(
        0.15, "Difference of inverse depths up to which images look alike.", unit="1/m", low=0, high=5
    )
    agreeing: float = setting(
        0.6, "Share of points that must lie at the other piece's surface.", low=0, high=1
    )
    agree_metres: float = setting(
        0.02, "How far two pieces laid onto one another, each way, may be apart.", unit="m", low=1e-4, high=1
    )
    agree_radians: float = setting(0.015, "How far they may be turned.", unit="rad", low=1e-4, high=1)
    metres: float = setting(0.003, "What no alignment is surer than.", unit="m", low=1e-5, high=0.1)
    radians: float = setting(0.002, "What no alignment is surer than.", unit="rad", low=1e-5, high=0.1)
    tracked_metres: float = setting(
        0.0015, "Standard deviation of the tracking from piece to piece.", unit="m", low=1e-4, high=1
    )
    tracked_radians: float = setting(0.001, "Standard deviation of it.", unit="rad", low=1e-4, high=1)
    level: float = setting(0.01, "Standard deviation of the felt way up.", unit="rad", low=1e-4, high=1)
    doubt: float = setting(50.0, "Squared deviations at which a loop is half doubted.", low=1, high=1e6)
    opened: float = setting(
        1.0, "Standard deviations of a loop beyond which it stands open.", low=0, high=100
    )
    middle: float = setting(
        1.2, "Depth at which it is said how far images moved.", unit="m", low=0.1, high=10
    )


@dataclass(frozen=True)
class CutOutSettings:
    """Settings for cutting an object that stands on the floor out of a scan."""

    thickness: float = setting(
        0.02, "Faces so near to a plane may be of the floor.", unit="m", low=1e-3, high=0.2
    )
    clearance: float = setting(
        0.012, "What is lower than this above the floor is the floor's noise.", unit="m", low=1e-3, high=0.2
    )
    about: float = setting(
        0.7, "How far what is meant may lie from where was looked.", unit="m", low=0.05, high=5
    )
    least_area: float = setting(0.02, "Surface of the smallest thing.", unit="m^2", low=1e-4, high=1)
    number: int = setting(
        1, "Which of the things on the floor is meant: 1 is the one that was looked at most.", low=1, high=100
    )
    hole: float = setting(0.15, "Longest rim of a hole that is closed.", unit="m", low=0, high=10)
    drawn: float = setting(
        0.0, "Height up to which the lowest rims are drawn down to the floor.", unit="m", low=0, high=1
    )


@dataclass(frozen=True)
class RegistrationSettings:
    """Settings for finding an object again that was put down elsewhere."""

    turns: int = setting(900, "Turns that are tried, 20 degrees from one to the next.", low=24, high=100_000)
    points: int = setting(300, "Points of the surface that are laid down from each.", low=50, high=10_000)
    looked_at: int = setting(24, "Answers that are looked at closely.", low=2, high=1000)
    fine_points: int = setting(2000, "Points that they are looked at with.", low=100, high=100_000)
    cell: float = setting(
        0.015, "Side of the cells that know their nearest point.", unit="m", low=1e-3, high=0.1
    )
    margin: float = setting(0.3, "How far about the object they reach.", unit="m", low=0.05, high=2)
    near: float = setting(
        0.01, "Distance within which a point lies on the surface.", unit="m", low=1e-3, high=0.1
    )
    clearance: float = setting(
        0.04, "How far before what was seen behind it a surface cannot be.", unit="m", low=5e-3, high=0.5
    )
    agreeing: float = setting(0.5, "Share of the points that must lie on the surface.", low=0, high=1)
    through: float = setting(0.04, "Share of points that may lie where it was seen through.", low=0, high=1)
    doubt: float = setting(
        2.0, "What such a point takes away, of what one that agrees brings.", low=0, high=100
    )
    clear: float = setting(0.2, "By how much the best answer must be better than the next.", low=0, high=1)


@dataclass(frozen=True)
class ObjectSettings:
    """Settings for separating an object that is moved during the scan from the room, and finding it again."""

    known_after: int = setting(
        30, "Images after which it is looked for what stands there; again at twice as many.", low=5, high=1000
    )
    lifted: float = setting(
        0.015,
        "How far floor and object may be apart before the object counts as moved.",
        unit="m",
        low=1e-3,
        high=1,
    )
    tilted: float = setting(
        0.015, "How far they may be turned against one another.", unit="rad", low=1e-3, high=1
    )
    agreeing: float = setting(
        0.8, "Share of an image's points that must lie at the surface where a new rest begins.", low=0, high=1
    )
    looks: int = setting(
        10, "Images of a rest with which the object is first sought in it.", low=2, high=1000
    )
    followed: bool = setting(False, "Whether it is followed while it turns, on a turntable.")
    unsure: float = setting(
        0.25,
        "Standard deviation of the camera's place about it beyond which it is not known how it is turned.",
        unit="m",
        low=1e-3,
        high=2,
    )
    missed: int = setting(
        15,
        "Images one after the other in which it is not found, before it is sought at rest.",
        low=1,
        high=1000,
    )


@dataclass(frozen=True)
class ScanSettings:
    """A scan."""

    volume: VolumeSettings = setting(VolumeSettings, "How images become a surface.")
    tracking: TrackingSettings = setting(TrackingSettings, "How the camera is found.")
    loops: LoopSettings = setting(LoopSettings, "How a way that comes back is closed.")
    cut_out: CutOutSettings = setting(CutOutSettings, "How what stands on the floor is taken out.")
    moved: ObjectSettings = setting(ObjectSettings, "How what is moved meanwhile is followed.")
    registration: RegistrationSettings = setting(RegistrationSettings, "How it is found again.")
    least_depth: float = setting(0.05, "Share of an image that must show a surface.", low=0, high=1)


def alone_within(volume: VolumeSettings, within: float) -> ScanSettings:
    """Returns the settings for scanning an object that may be turned, with all depth beyond ``within``
    metres ignored.
    """
    near = replace(volume, reach=min(volume.reach, within), far=within)
    tracking = TrackingSettings(unsure=_UNSURE_ALONE)
    return ScanSettings(volume=near, tracking=tracking, least_depth=_LEAST_ALONE)
