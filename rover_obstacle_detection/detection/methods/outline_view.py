"""What was measured, at the finer resolution at which outlines are drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.geometry.resolution import outline_camera
from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.images.texture import texture_level
from rover_obstacle_detection.detection.methods.measurement import Measurement
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.stereo.judged_range import within_range
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.terrain import Terrain

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class OutlineView:
    """Images at the resolution of the outlines, with what was measured at a lower one.

    Parameters
    ----------
    frame : Frame
        The given frame at this resolution; not smoothed, unless it is the one that was matched.
    correction : Correction
        Of the rectification, in pixels of that frame.
    stereo : Stereo
        In the straightened left image. Each pixel lies as far off the ground plane as the nearest
        one that was matched.
    terrain : Terrain
        Likewise; without layers.
    """

    frame: Frame
    correction: Correction
    stereo: Stereo
    terrain: Terrain

    def finer(self, mask: Mask) -> Mask:
        """Bring a mask of the measured pixels to this resolution."""
        return resized(mask, self.frame.camera.shape)


def outline_view(
    full: Frame, measured: Measurement, parameters: DetectorParameters
) -> OutlineView:
    """Bring what was measured to the resolution of the outlines.

    Parameters
    ----------
    full : Frame
        As it was recorded.
    measured : Measurement
    parameters : DetectorParameters
    """
    p, frame, stereo, terrain = parameters, measured.frame, measured.stereo, measured.terrain
    camera = outline_camera(full.camera, stereo.ground, p.resolution)
    if camera.shape == frame.camera.shape:
        # What was matched serves as it is, smoothed or not.
        return OutlineView(frame, measured.correction, stereo, terrain)
    finer = camera.width / frame.camera.width
    frame, correction = full.resized(camera), measured.correction.reduced(1 / finer)
    straight = correction.straightened(frame)
    stereo = _finer_stereo(stereo, straight, correction, p.images)
    stereo = within_range(stereo, p.stereo.min_range_m, p.terrain.max_range_m)
    return OutlineView(frame, correction, stereo, _finer_terrain(terrain, stereo))


def _finer_stereo(
    stereo: Stereo, frame: Frame, correction: Correction, parameters: ImageParameters
) -> Stereo:
    camera, matched = frame.camera, stereo.disparity > 0
    finer = np.float32(camera.width / stereo.frame.camera.width)
    expected = DisparityPlane.from_ground(stereo.ground, camera).disparity(camera)

    def fine(image: Image) -> Image:
        return resized(image, camera.shape) * finer

    # Off the plane by as much, a pixel beside the matched one lies on the same surface.
    disparity = expected + fine(stereo.disparity - stereo.expected)
    disparity[~resized(matched, camera.shape)] = 0
    return replace(
        stereo,
        frame=replace(frame, excluded=_excluded(frame, stereo.frame)),
        expected=expected,
        disparity=np.maximum(disparity, 0),
        noise_px=fine(stereo.noise_px),
        texture=texture_level(frame.pair[0], parameters),
        rows=correction.rows,
    )


def _excluded(frame: Frame, measured: Frame) -> Mask | None:
    """Pixels that are excluded at this resolution or at the measured one."""
    if measured.excluded is None:
        return frame.excluded
    excluded = resized(measured.excluded, frame.camera.shape)
    return excluded if frame.excluded is None else excluded | frame.excluded


def _finer_terrain(terrain: Terrain, stereo: Stereo) -> Terrain:
    camera = stereo.frame.camera
    height_m, noise_m, camera_m = (
        resized(each, camera.shape)
        for each in (terrain.height_m, terrain.noise_m, terrain.camera_m)
    )
    unmatched = stereo.disparity <= 0
    height_m[unmatched], noise_m[unmatched] = np.nan, np.inf
    pixels_per_metre = stereo.disparity / np.float32(camera.baseline_m)
    return Terrain(height_m, noise_m, camera_m, pixels_per_metre, ())
