"""The typical intrinsics and range of known depth cameras, from ``firmware_configs/sensors/*.toml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.settings import read_toml


@dataclass(frozen=True)
class TypicalCamera:
    """One camera model.

    Attributes:
        camera: the intrinsics for the camera's image size.
        near, far: metres, range of valid depth.
    """

    camera: Intrinsics
    near: float
    far: float


def profiles_folder() -> Path:
    """Returns the folder of the shipped profiles.

    It is inside an installed wheel, or next to the packages in a checkout.
    """
    package = Path(__file__).resolve().parent.parent
    places = [root / "firmware_configs" / "sensors" for root in (package, package.parent.parent)]
    for place in places:
        if place.is_dir():
            return place
    remedy = "Install the package enliven-edge again."
    raise InputError("the sensor profiles are missing", where=str(places[0]), remedy=remedy)


def profile_names() -> list[str]:
    """Returns the names of the shipped profiles, sorted."""
    return sorted(path.stem for path in profiles_folder().glob("*.toml"))


def typical_camera(profile: str) -> TypicalCamera:
    """Returns the camera model of a shipped profile, such as "kinect1"."""
    table = read_toml(profiles_folder() / f"{profile}.toml")
    lens, reach = table["camera"], table["range"]
    lens_values = {key: lens[key] for key in ("width", "height", "fx", "fy", "cx", "cy")}
    camera = Intrinsics(**lens_values, distortion=tuple(lens.get("distortion", (0.0,) * 5)))
    return TypicalCamera(camera, reach["near"], reach["far"])
