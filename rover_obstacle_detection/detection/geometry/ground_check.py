"""Contradictions between the ground that was found and what is known of the camera."""

from __future__ import annotations

import math

import numpy as np

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import GroundCheckParameters


def ground_warnings(
    ground: GroundPlane,
    unaided: GroundPlane | None,
    gravity: Gravity | None,
    known_height_m: float,
    parameters: GroundCheckParameters,
) -> tuple[str, ...]:
    """Compare the ground plane with the vertical, the known height and what is usual.

    Parameters
    ----------
    ground : GroundPlane
    unaided : GroundPlane, optional
        Found without the given vertical, where none was found with it.
    gravity : Gravity, optional
        The vertical, where it is known.
    known_height_m : float
        Height of the camera, metres; 0 if it is not known.
    parameters : GroundCheckParameters
    """
    if not ground.measured:
        return (_missing(unaided, gravity),)
    warnings = []
    if gravity is not None and ground.slope_deg > parameters.max_tilt_deg:
        warnings.append(
            f'the ground is tilted by {ground.slope_deg:.0f} degrees against the given vertical: '
            'check camera_pitch and camera_roll, the IMU or TF, unless it is a slope'
        )
    height_m = ground.height_m
    if known_height_m:
        if abs(math.log(height_m / known_height_m)) > math.log(parameters.max_height_ratio):
            warnings.append(
                f'the camera is {height_m:.2f} m above the ground by stereo, but camera_height is '
                f'{known_height_m:g} m: check baseline and focal length, and camera_height'
            )
    elif not parameters.min_usual_height_m < height_m < parameters.max_usual_height_m:
        warnings.append(
            f'the camera is {height_m:.2f} m above the ground by stereo, which is unusual for a '
            'rover: check baseline and focal length, or set camera_height'
        )
    return tuple(warnings)


def _missing(unaided: GroundPlane | None, gravity: Gravity | None) -> str:
    if gravity is None:
        return (
            'no ground in view, so everything in view is an obstacle: if the camera looks down '
            'steeply, raise max_camera_pitch or give the vertical (gravity_source)'
        )
    if unaided is None or not unaided.measured:
        return 'no ground in view, so everything in view is an obstacle'
    given = math.degrees(math.asin(float(np.clip(-gravity.up[2], -1, 1))))
    return (
        f'the vertical says that the camera looks down by {given:.0f} degrees, the ground says '
        f'{unaided.pitch_deg:.0f}: check camera_pitch and camera_roll, the IMU or TF'
    )
