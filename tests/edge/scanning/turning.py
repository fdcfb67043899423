"""A synthetic person that stands in front of a still camera and turns around once."""

import numpy as np

from enliven import rotation
from enliven.camera import world_from_level_camera
from enliven.frames import DepthFrame
from enliven_synthesis.body.body_sdf import BodyAnatomy
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.sensor.scene import cast_room

AWAY = -2.1
"""Position of the person along the camera's Z axis, metres."""
STEP_NS = 66_666_667


def posture(left_arm=0.35):
    """Returns a posture with legs apart and arms away from the trunk, the left arm by ``left_arm``
    radians.
    """
    right, left = ArmPose(abduct=0.35, elbow=0.1), ArmPose(abduct=left_arm, elbow=0.1)
    feet = FootPose(0.15, 0.0), FootPose(-0.15, 0.0)
    return PerformerPosture(left_arm=left, right_arm=right, left_foot=feet[0], right_foot=feet[1])


class TurningPerson:
    """Renders images of the person at a turning angle."""

    def __init__(self, width=320):
        profile = load_profile("kinect1")
        self.camera, self.performer = profile.intrinsics(width), Performer()
        self.pose = world_from_level_camera(1.0, np.radians(3.0))
        self._room = cast_room(self.camera, self.pose)
        self._renderer, self._anatomy = DepthRenderer(self.camera), BodyAnatomy(self.performer)
        self._noise = DepthNoise(profile, self.camera, 0)

    def joints(self):
        """Returns the (20, 3) joints before the turn, with the person at the origin."""
        return self.performer.pose(posture()).joints

    def frame(self, number, angle=0.0, left_arm=0.35, aside=0.0, seen=True):
        """Renders the image with a number. The person stands ``aside`` metres to the left, or is absent."""
        placed = np.eye(4)
        turn = rotation.from_rotation_vector([0.0, angle, 0.0])
        placed[:3, :3], placed[:3, 3] = rotation.to_matrix(turn), (aside, 0.0, AWAY)
        depth, material = (image.copy() for image in self._room)
        if seen:
            figure = self.performer.pose(posture(left_arm))
            self._renderer.draw(
                self._anatomy.place(figure, np.linalg.inv(self.pose) @ placed), depth, material
            )
        image = self._noise.add_noise(depth, material, number)
        return DepthFrame(image, self.camera, number * STEP_NS, "turning")
