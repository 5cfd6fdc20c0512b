"""Read camera calibrations from ROS YAML files and ``sensor_msgs/CameraInfo`` messages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rover_obstacle_detection.detection.geometry.camera import RegionOfInterest, StereoCamera
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.wording import counted
from rover_obstacle_detection.yaml_file import read_yaml

_PINHOLE = 'pinhole'


@dataclass(frozen=True)
class CameraInfo:
    """The content of a ``sensor_msgs/CameraInfo``, independent of the message library.

    Parameters
    ----------
    width, height : int
        Size of the full image, pixels.
    distortion_model : str
    d : tuple of float
        Distortion coefficients.
    k, r : tuple of 9 float
        Intrinsic and rectification matrices, row-major.
    p : tuple of 12 float
        Projection matrix of the rectified image, row-major.
    binning_x, binning_y : int
    roi : RegionOfInterest, optional
    """

    width: int
    height: int
    distortion_model: str
    d: tuple[float, ...]
    k: tuple[float, ...]
    r: tuple[float, ...]
    p: tuple[float, ...]
    binning_x: int = 0
    binning_y: int = 0
    roi: RegionOfInterest | None = None

    @classmethod
    def from_message(cls, message: Any) -> CameraInfo:
        """Read a ``sensor_msgs/CameraInfo`` of ROS 2 (``k``) or ROS 1 (``K``)."""

        def matrix(name: str) -> tuple[float, ...]:
            values = getattr(message, name, None)
            if values is None:
                values = getattr(message, name.upper())
            return tuple(float(value) for value in values)

        return cls(
            width=int(message.width),
            height=int(message.height),
            distortion_model=str(message.distortion_model),
            d=matrix('d'),
            k=matrix('k'),
            r=matrix('r'),
            p=matrix('p'),
            binning_x=int(message.binning_x),
            binning_y=int(message.binning_y),
            roi=message.roi,
        )


@dataclass(frozen=True)
class StereoCalibration:
    """The calibrations of both cameras and their source.

    Parameters
    ----------
    left, right : CameraInfo
    source : str
        The files or topics they come from, for error messages.

    Raises
    ------
    CameraError
        If the two calibrations do not form a stereo camera. The message starts with the source.
    """

    left: CameraInfo
    right: CameraInfo
    source: str

    def __post_init__(self) -> None:
        assert self.camera

    @cached_property
    def camera(self) -> StereoCamera:
        """The stereo camera of the rectified images."""
        try:
            return StereoCamera.from_camera_info(self.left, self.right)
        except CameraError as error:
            msg = f'{self.source}: {error}'
            raise CameraError(msg) from None


def load_camera_info(path: str | Path) -> CameraInfo:
    """Read a YAML file written by ROS's camera_calibration or camera_info_manager.

    Raises
    ------
    CameraError
        Naming the file and the missing or invalid key.
    """
    path = Path(path)
    content = read_yaml(path, 'calibration file', CameraError)
    if not isinstance(content, dict):
        msg = f'{path}: is not a ROS camera calibration file (YAML with image_width, ...)'
        raise CameraError(msg)
    model = content.get('camera_model', _PINHOLE)
    if model != _PINHOLE:
        msg = (
            f'{path}: camera_model is {model!r}: expected {_PINHOLE}; ROS names a fisheye lens '
            'by distortion_model: equidistant'
        )
        raise CameraError(msg)
    return CameraInfo(
        width=_size(content, 'image_width', path),
        height=_size(content, 'image_height', path),
        distortion_model=str(content.get('distortion_model', '')),
        d=_numbers(content, 'distortion_coefficients', None, path),
        k=_numbers(content, 'camera_matrix', 9, path),
        r=_numbers(content, 'rectification_matrix', 9, path),
        p=_numbers(content, 'projection_matrix', 12, path),
    )


def load_stereo_calibration(left_yaml: str | Path, right_yaml: str | Path) -> StereoCalibration:
    """Read the two calibration files of a stereo camera.

    Raises
    ------
    CameraError
        Naming the file and key, or the values in which the two files disagree.
    """
    return StereoCalibration(
        load_camera_info(left_yaml),
        load_camera_info(right_yaml),
        f'{left_yaml} and {right_yaml}',
    )


def _size(content: dict[str, Any], key: str, path: Path) -> int:
    value = content.get(key)
    if isinstance(value, bool) or not isinstance(value, int):
        msg = f'{path}: {key} is {value!r}: expected a number of pixels'
        raise CameraError(msg)
    return value


def _numbers(
    content: dict[str, Any], key: str, count: int | None, path: Path
) -> tuple[float, ...]:
    matrix = content.get(key)
    data = matrix.get('data') if isinstance(matrix, dict) else None
    if not isinstance(data, list):
        msg = f'{path}: {key} is missing or has no data: expected a list of numbers'
        raise CameraError(msg)
    try:
        numbers = tuple(float(value) for value in data)
    except (TypeError, ValueError):
        msg = f'{path}: {key} contains a value that is not a number: {data}'
        raise CameraError(msg) from None
    if count is not None and len(numbers) != count:
        msg = f'{path}: {key} has {counted(len(numbers), "number")}: expected {count}'
        raise CameraError(msg)
    return numbers
