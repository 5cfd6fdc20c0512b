"""Recognise calibration files by their content and read them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rover_obstacle_detection.calibration_files import kalibr, kitti, opencv
from rover_obstacle_detection.calibration_files.numbers import Cameras, Size
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo, load_camera_info
from rover_obstacle_detection.yaml_file import read_small_file, read_yaml

ROS, KALIBR, EUROC, OPENCV, KITTI = 'ROS', 'Kalibr', 'EuRoC', 'OpenCV', 'KITTI'
_KIND = 'calibration file'
_ROS_KEYS = ('image_width', 'image_height', 'camera_matrix', 'projection_matrix', 'camera_name')


Read = TypeVar('Read')


class _File(NamedTuple):
    path: Path
    format: str
    content: Any


def load_cameras(
    files: Sequence[Path], size: Callable[[], Size], *, colour: bool, are_parts: bool = False
) -> Cameras:
    """Read the calibration files of a stereo camera, whatever tool has written them.

    Parameters
    ----------
    files : sequence of Path
        One file with both cameras, the files of the left and the right camera, or two files of
        OpenCV that complete each other.
    size : callable
        Returns the size of the images, for formats without it.
    colour : bool
        Take KITTI's colour cameras instead of the grey ones.
    are_parts : bool
        Refuse two files that do not complete each other.

    Raises
    ------
    CameraError
        Naming the file, the key and what was expected.
    """
    read = [_recognise(path) for path in files]
    if are_parts and len(read) == 2:
        _check_parts(*read)
    if all(each.format == EUROC for each in read) and len(read) == 2:
        return _named(files, lambda: kalibr.sensors(read[0].content, read[1].content))
    if all(each.format == OPENCV for each in read) and not _differing(
        read[0].content, read[-1].content
    ):
        # OpenCV's sample writes intrinsics.yml and extrinsics.yml.
        content = {**read[0].content, **read[-1].content}
        return _named(files, lambda: opencv.stereo_storage(content, size))
    if len(read) == 1:
        both = _both(read[0], size, colour=colour)
        if both is None:
            raise CameraError(
                f'{files[0]}: is the {read[0].format} calibration of one camera: expected both '
                'in one file, or two files given with --left-info and --right-info'
            )
        return both
    left, right = (_side(each, index, size, colour) for index, each in enumerate(read))
    return left, right


def _recognise(path: Path) -> _File:
    text = read_small_file(path, _KIND, CameraError).decode(errors='replace')
    start = text.lstrip('\ufeff \t\r\n')
    if start.startswith(('%YAML:', '<?xml', '<opencv_storage')) or '!!opencv-matrix' in text:
        return _File(path, OPENCV, _named([path], lambda: opencv.read_storage(text)))
    if kitti.is_kitti(text):
        return _File(path, KITTI, text)
    content = read_yaml(path, _KIND, CameraError)
    if isinstance(content, Mapping):
        for name, keys in ((KALIBR, ('cam0',)), (EUROC, ('T_BS',)), (ROS, _ROS_KEYS)):
            if any(key in content for key in keys):
                return _File(path, name, content)
    raise CameraError(
        f'{path}: is not a calibration: expected a ROS (image_width, ...), Kalibr (cam0, cam1), '
        'OpenCV (K1, D1, K2, D2, R, T), EuRoC (T_BS, ...) or KITTI (P0, P1, ...) file'
    )


def _check_parts(one: _File, other: _File) -> None:
    for file in (one, other):
        if file.format != OPENCV:
            raise CameraError(
                f'{file.path}: is a {file.format} calibration and one of two files: expected two '
                'of OpenCV that complete each other; give those of the two cameras with '
                '--left-info and --right-info'
            )
    differing = _differing(one.content, other.content)
    if differing:
        raise CameraError(
            f'{one.path} and {other.path}: differ in {", ".join(differing)}: expected files that '
            'complete each other'
        )


def _differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    return [key for key in one if key in other and one[key] != other[key]]


def _both(file: _File, size: Callable[[], Size], *, colour: bool) -> Cameras | None:
    """Read both cameras; None if the format has one camera in a file."""
    readers: dict[str, Callable[[], Cameras]] = {
        KALIBR: lambda: kalibr.camera_chain(file.content),
        OPENCV: lambda: opencv.stereo_storage(file.content, size),
        KITTI: lambda: kitti.projections(file.content, size, colour=colour),
    }
    return _named([file.path], readers[file.format]) if file.format in readers else None


def _side(file: _File, index: int, size: Callable[[], Size], colour: bool) -> CameraInfo:
    if file.format == ROS:
        return load_camera_info(file.path)
    both = _both(file, size, colour=colour)
    if both is None:
        raise CameraError(
            f'{file.path}: is a sensor of EuRoC, the other file is not: expected two'
        )
    return both[index]


def _named(files: Sequence[Path], read: Callable[[], Read]) -> Read:
    """Put the files in front of an error."""
    try:
        return read()
    except CameraError as error:
        raise CameraError(f'{" and ".join(map(str, files))}: {error}') from None
