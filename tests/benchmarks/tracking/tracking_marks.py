"""Joints marked by eye in the eight depth images of skeltrack_kinect1, which have no joint data.

Marks are (u, v) pixels, accurate to about 12 px, which is 25 mm at the distance of those people. The people
face the sensor, so their left is on the right of the image. Invisible joints are left out. The last image has
a second person in the background.
"""

from __future__ import annotations

from enliven.person.joints import Joint

_SEVEN = (
    Joint.HEAD, Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.HAND_LEFT,
    Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT, Joint.HAND_RIGHT,
)  # fmt: skip
Mark = tuple[int, int] | None


def _person(*marks: Mark) -> dict[Joint, tuple[int, int]]:
    return {joint: mark for joint, mark in zip(_SEVEN, marks, strict=True) if mark is not None}


MARKS: dict[str, list[dict[Joint, tuple[int, int]]]] = {
    "1028894671": [
        _person((305, 160), (390, 255), (455, 325), (498, 328), (225, 255), (165, 330), (112, 365))
    ],
    "1038901490": [
        _person((313, 160), (400, 255), (530, 255), (515, 105), (220, 260), (110, 285), (100, 415))
    ],
    "1045879925": [
        _person((315, 160), (400, 250), (530, 240), (510, 100), (215, 255), (100, 250), (100, 125))
    ],
    "1051883281": [_person((310, 165), (395, 235), (475, 150), (550, 50), (225, 240), (125, 155), (68, 52))],
    "1058893191": [
        _person((300, 160), (395, 255), (520, 270), (492, 190), (215, 265), (105, 300), (122, 215))
    ],
    "1064898470": [
        _person((315, 165), (400, 245), (515, 270), (505, 385), (220, 255), (105, 275), (100, 415))
    ],
    "1070905432": [_person((310, 160), (390, 250), (412, 290), (435, 330), (220, 245), (118, 175), (38, 60))],
    "1399145206": [
        _person((305, 150), (385, 250), (450, 275), (470, 185), (230, 245), (190, 345), None),
        _person(None, None, (512, 340), (522, 425), None, None, None),
    ],
}
"""By the number in the file name: one dictionary per person."""
