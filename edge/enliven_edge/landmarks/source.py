"""The landmarks of a person in a colour image: 33 points with BlazePose's names."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from enliven.arrays import Float, UInt8

NAMES: tuple[str, ...] = (
    "nose", "left eye inner", "left eye", "left eye outer", "right eye inner", "right eye", "right eye outer",
    "left ear", "right ear", "mouth left", "mouth right", "left shoulder", "right shoulder", "left elbow",
    "right elbow", "left wrist", "right wrist", "left pinky", "right pinky", "left index", "right index",
    "left thumb", "right thumb", "left hip", "right hip", "left knee", "right knee", "left ankle",
    "right ankle", "left heel", "right heel", "left foot index", "right foot index",
)  # fmt: skip
"""(33,) left and right are the performer's own."""
INDEX = {name: i for i, name in enumerate(NAMES)}


@dataclass(frozen=True)
class Landmarks:
    """One person in one colour image.

    Attributes:
        points: (33, 2) pixels of the image, x to the right and y down; may lie outside.
        visibility: (33,) in [0, 1]: how likely the landmark is in the image and not hidden.
        offsets: (33, 3) metres from the middle of the hips along the camera's axes (OpenCV's), as the source
            believes the person stands; their scale is a guess.
    """

    points: Float
    visibility: Float
    offsets: Float


class LandmarkSource(Protocol):
    """Finds people in colour images; a context manager that closes itself."""

    def find(self, colour: UInt8, time_ns: int) -> list[Landmarks]:
        """Returns the people in an (h, w, 3) uint8 sRGB image.

        Args:
            time_ns: the sensor's clock, rising from call to call.

        Raises:
            ResourceError: where the source has failed for good.
        """
        ...

    def close(self) -> None:
        """Releases everything; a second call does nothing."""
        ...

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
