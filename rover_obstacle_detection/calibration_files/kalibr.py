"""Camera chains of Kalibr (``camchain.yaml``) and sensors of EuRoC (``sensor.yaml``)."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_obstacle_detection.calibration_files import values
from rover_obstacle_detection.calibration_files.numbers import Cameras
from rover_obstacle_detection.calibration_files.stereo_rectify import (
    FISHEYE,
    PINHOLE,
    Lens,
    rectified,
)
from rover_obstacle_detection.errors import CameraError

_MODELS = {
    'radtan': PINHOLE,
    'radial-tangential': PINHOLE,
    'plumb_bob': PINHOLE,
    'equidistant': FISHEYE,
    'equi': FISHEYE,
    'none': PINHOLE,
}


def camera_chain(content: Mapping[str, Any]) -> Cameras:
    """Read the cameras ``cam0``, the left one, and ``cam1`` of a Kalibr camera chain.

    Raises
    ------
    CameraError
        Naming the missing or invalid key.
    """
    left, right = (_lens(_camera(content, name), f'{name}: ') for name in ('cam0', 'cam1'))
    with _Key('cam1: '):
        pose = values.numbers(_camera(content, 'cam1'), 'T_cn_cnm1', (16,))
    return _posed(left, right, np.reshape(pose, (4, 4)), ('cam0', 'cam1'))


def sensors(left: Mapping[str, Any], right: Mapping[str, Any]) -> Cameras:
    """Read the two ``sensor.yaml`` of an EuRoC recording.

    Raises
    ------
    CameraError
        Naming the missing or invalid key.
    """
    poses = []
    for side, content in (('left', left), ('right', right)):
        with _Key(f'{side}: '):
            poses.append(np.reshape(values.numbers(content, 'T_BS', (16,)), (4, 4)))
    try:
        pose = np.linalg.inv(poses[1]) @ poses[0]
    except np.linalg.LinAlgError:
        raise CameraError('right: T_BS has no inverse: expected a pose') from None
    names = 'the first sensor', 'the second sensor'
    return _posed(_lens(left, 'left: '), _lens(right, 'right: '), pose, names)


class _Key:
    """Puts the name of the camera in front of an error."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, CameraError):
            raise CameraError(f'{self._name}{error}') from None


def _camera(content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    camera = content.get(name)
    if camera is None:
        raise CameraError(f'{name} is missing: expected cam0 and cam1')
    if not isinstance(camera, Mapping):
        raise CameraError(
            f'{name} is {reprlib.repr(camera)}: expected intrinsics, resolution, ...'
        )
    return camera


def _lens(content: Mapping[str, Any], name: str) -> Lens:
    with _Key(name):
        camera_model = content.get('camera_model', 'pinhole')
        if camera_model != 'pinhole':
            raise CameraError(f'camera_model is {camera_model!r}: expected pinhole')
        model = content.get('distortion_model', 'none')
        if model not in _MODELS:
            raise CameraError(
                f'distortion_model is {model!r}: expected one of {", ".join(_MODELS)}'
            )
        coefficients: tuple[float, ...] = ()
        if model != 'none':
            kalibr, euroc = 'distortion_coeffs', 'distortion_coefficients'
            key = euroc if euroc in content else kalibr
            coefficients = values.numbers(content, key, (4,))
        return Lens.pinhole(
            values.size(content, 'resolution'),
            values.numbers(content, 'intrinsics', (4,)),
            coefficients,
            _MODELS[model],
        )


def _posed(
    left: Lens,
    right: Lens,
    pose: np.ndarray[Any, np.dtype[np.float64]],
    names: tuple[str, str],
) -> Cameras:
    x, y, _ = -pose[:3, :3].T @ pose[:3, 3]
    if x < -abs(y):
        raise CameraError(
            f'{names[1]} lies left of {names[0]}: expected {names[0]} to be the left camera'
        )
    rotation = tuple(float(each) for each in pose[:3, :3].ravel())
    return rectified(left, right, rotation, tuple(float(each) for each in pose[:3, 3]))
