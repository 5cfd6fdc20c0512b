"""Stereo cameras of the simulated rovers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rover_obstacle_detection.detection.geometry.camera import StereoCamera


@dataclass(frozen=True)
class Rig:
    """A stereo camera mounted on a rover.

    Parameters
    ----------
    name : str
    description : str
    horizontal_view_deg : float
        Horizontal field of view (deg). Pixels are square.
    baseline_m : float
    pitch_deg : float
        Angle of the optical axis below the horizon of a level rover.
    camera_height_m : float
        Height of the left camera above the ground.
    width, height : int
        Size of both images (px).
    colour : bool
        Whether images are rgb8 instead of mono8 or mono16.
    """

    name: str
    description: str
    horizontal_view_deg: float
    baseline_m: float
    pitch_deg: float
    camera_height_m: float
    width: int = 1024
    height: int = 768
    colour: bool = False

    @property
    def view_distance_m(self) -> float:
        """Distance ahead at which the optical axis meets level ground."""
        return self.camera_height_m / math.tan(math.radians(self.pitch_deg))

    def camera(self, width: int | None = None) -> StereoCamera:
        """Return the calibration, optionally scaled to another image width."""
        width = self.width if width is None else width
        height = round(self.height * width / self.width)
        focal = width / (2 * math.tan(math.radians(self.horizontal_view_deg) / 2))
        return StereoCamera(
            width=width,
            height=height,
            fx=focal,
            fy=focal,
            cx=(width - 1) / 2,
            cy=(height - 1) / 2,
            baseline_m=self.baseline_m,
        )


# The study specifies a vertical field of view of 60 degrees at an aspect of 4:3.
_STUDY_HORIZONTAL_DEG = math.degrees(2 * math.atan(4 / 3 * math.tan(math.radians(30))))

RIGS = {
    rig.name: rig
    for rig in (
        Rig(
            'study',
            'camera of the study: short baseline, steep pitch',
            horizontal_view_deg=_STUDY_HORIZONTAL_DEG,
            baseline_m=0.06,
            pitch_deg=46.0,
            camera_height_m=1.0,
            colour=True,
        ),
        Rig(
            'navcam',
            'mast camera: long baseline, high, far-looking',
            horizontal_view_deg=45.0,
            baseline_m=0.24,
            pitch_deg=20.0,
            camera_height_m=1.9,
        ),
        Rig(
            'hazcam',
            'hazard camera: low on the body, wide field of view',
            horizontal_view_deg=100.0,
            baseline_m=0.10,
            pitch_deg=30.0,
            camera_height_m=0.5,
        ),
        Rig(
            'vga',
            'off-the-shelf VGA stereo camera',
            width=640,
            height=480,
            horizontal_view_deg=70.0,
            baseline_m=0.12,
            pitch_deg=25.0,
            camera_height_m=0.8,
        ),
    )
}
