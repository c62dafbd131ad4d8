"""Effects of the camera: where it really is, its scale, its delay, its gaps. None of them touches the motion."""

from __future__ import annotations

from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.effects.base import EffectSection
from r2s2r_cli.rig.section import Delay, Error, NonNegative, Share, Shift3, Vector3


class CameraPose(EffectSection):
    """The camera is knocked: moved, and turned about its own axes."""

    turn_rad: Vector3 = (0.0, 0.0, 0.0)
    """Angles about the axes of frame C [rad]."""
    by_m: Shift3 = (0.0, 0.0, 0.0)
    """In frame W [m]."""
    at_s: NonNegative = 0.0
    """When it happens [s]."""

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """A jump in time, where the catalogue has a constant."""
        return camera.model_copy(update={"turn_rad": self.turn_rad, "shift_m": self.by_m, "knocked_at_s": self.at_s})


class CameraScale(EffectSection):
    """Depth and focal length are not what the camera states."""

    depth_error: Error = 0.02
    """Depths are 1 + this of the true ones."""
    focal_error: Error = 0.0
    """Focal lengths are 1 + this of the stated ones."""

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """Depth and width can go wrong each on its own, where the catalogue has one factor."""
        return camera.model_copy(update={"depth_error": self.depth_error, "focal_error": self.focal_error})


class CameraDelay(EffectSection):
    """Stamps are late: a frame shows the scene as it was earlier than its stamp says."""

    delay_s: Delay = 0.08
    """How much later the stamp is than the picture [s]."""

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """Of the stamp alone; when a frame arrives stays as it is."""
        clock = camera.clock.model_copy(update={"stamp_delay_s": self.delay_s})
        return camera.model_copy(update={"clock": clock})


class Dropout(EffectSection):
    """Frames never come, and depth has more holes."""

    frames: Share = 0.2
    """Part of the frames that are lost."""
    pixels: Share = 0.2
    """Part of the pixels without depth, in blobs."""

    def seen(self, camera: CameraSettings) -> CameraSettings:
        """Loss in the camera; the catalogue loses caps."""
        clock = camera.clock.model_copy(update={"lost_share": self.frames})
        depth = camera.depth.model_copy(update={"hole_share": min(self.pixels, 0.9)})
        return camera.model_copy(update={"clock": clock, "depth": depth})
