"""Recognise folders of stereo images and the stamps of their images."""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import partial
from pathlib import Path

from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.messages.header import NANOSECONDS_PER_SECOND
from rover_obstacle_detection.wording import counted, printable
from rover_obstacle_detection.yaml_file import read_small_file

_logger = logging.getLogger(__name__)

LAYOUTS = (
    'EuRoC (mav0/cam0/data, mav0/cam1/data), KITTI (image_00/data, image_01/data or image_0, '
    'image_1) or left and right'
)

IMAGE_SUFFIXES = frozenset({'.png', '.jpg', '.jpeg', '.pgm', '.ppm', '.bmp', '.tif', '.tiff'})
_PERIOD_NS = NANOSECONDS_PER_SECOND // 10
_SIDE = re.compile(r'left|right', re.IGNORECASE)
_SECONDS = re.compile(r'\d{1,10}\.\d{1,9}')
# The seconds of a stamp have 32 bits.
_MAX_STAMP_NS = 2**31 * NANOSECONDS_PER_SECOND - 1
# Names of fewer digits are frame numbers.
_UNIX_SECONDS, _NANOSECONDS = range(10**9, 2**31), range(10**17, _MAX_STAMP_NS + 1)
MAX_TABLE_BYTES = 50_000_000
"""Of a file of stamps; that of an hour at 200 Hz has 32 MB."""
_KITTI_CALIBRATIONS = ('calib.txt', 'calib_cam_to_cam.txt', '../calib_cam_to_cam.txt')


Stamps = Mapping[str, int]


@dataclass(frozen=True)
class Camera:
    """The images of one stereo camera.

    Parameters
    ----------
    name : str
        End of the topics' namespaces; empty for the only or the first camera.
    folders : tuple of Path
        Left and right folder.
    stamps_ns : tuple of mapping of str to int
        Stamp of each file name, left and right.
    rectified : bool
    calibration : tuple of Path
        Calibration files found beside; may be empty.
    """

    name: str
    folders: tuple[Path, Path]
    stamps_ns: tuple[Stamps, Stamps]
    rectified: bool
    calibration: tuple[Path, ...] = field(default=())


def find_cameras(path: Path) -> list[Camera]:
    """Find the stereo cameras of a folder; an empty list if it has no known layout.

    Raises
    ------
    BagError
        If a file of stamps cannot be read.
    """
    for layout in (_euroc, _kitti, _plain):
        if cameras := layout(path):
            return cameras
    return []


def _euroc(path: Path) -> list[Camera]:
    root = path / 'mav0' if (path / 'mav0').is_dir() else path
    left, right = root / 'cam0', root / 'cam1'
    folders = left / 'data', right / 'data'
    if not _are_folders(folders):
        return []
    stamps = _listed(left), _listed(right)
    sensors = left / 'sensor.yaml', right / 'sensor.yaml'
    has_calibration = all(each.exists() for each in sensors)
    return [Camera('', folders, stamps, False, sensors if has_calibration else ())]


def _listed(camera: Path) -> Stamps:
    """Read the stamps of ``data.csv``; those of the names if there is none."""
    table, names = camera / 'data.csv', _images(camera / 'data')
    if not table.is_file():
        return _named_stamps(camera / 'data', names)
    try:
        rows = [row for row in csv.reader(_lines(table)) if row and not row[0].startswith('#')]
        stamps = {row[1].strip(): int(row[0]) for row in rows}
    except (ValueError, IndexError, csv.Error):
        raise BagError(f'{table}: expected lines of a stamp in ns and a file name') from None
    _check_stamps(stamps.values(), table)
    lacking = [name for name in names if name not in stamps]
    if lacking:
        more = f' and {counted(len(lacking) - 1, "other")}' if len(lacking) > 1 else ''
        raise BagError(f'{table}: has no stamp for {lacking[0]}{more}')
    return stamps


def _kitti(path: Path) -> list[Camera]:
    cameras = []
    for name, numbers in (('', (0, 1)), ('color', (2, 3))):
        for form, below, table in (
            ('image_{}', '', 'times.txt'),
            ('image_0{}', 'data', 'image_0{}/timestamps.txt'),
        ):
            left, right = (path / form.format(each) / below for each in numbers)
            if not _are_folders((left, right)):
                continue
            times = path / table.format(numbers[0])
            files = (path / each for each in _KITTI_CALIBRATIONS)
            calibration = tuple(each for each in files if each.exists())[:1]
            stamps = _shared((left, right), partial(_timed, times))
            cameras.append(Camera(name, (left, right), stamps, True, calibration))
    return cameras


def _timed(table: Path, names: list[str]) -> Stamps:
    """Read a file with the time of each frame; the names number the frames."""
    if not table.is_file():
        return _regular_stamps(table.parent, names)
    times = [_time_ns(line, table) for line in _lines(table) if line.strip()]
    _check_stamps(times, table)
    shift = _shift_ns(times)
    stamps = {}
    for name in names:
        number = Path(name).stem
        if not number.isdecimal() or int(number) >= len(times):
            raise BagError(f'{table}: has {counted(len(times), "time")}: expected one for {name}')
        stamps[name] = times[int(number)] + shift
    return stamps


def _time_ns(line: str, table: Path) -> int:
    try:
        if ':' not in line:
            return round(float(line) * NANOSECONDS_PER_SECOND)
        whole, _, fraction = line.strip().partition('.')
        second = datetime.strptime(whole, '%Y-%m-%d %H:%M:%S').replace(tzinfo=timezone.utc)
        return int(second.timestamp()) * NANOSECONDS_PER_SECOND + int(f'{fraction:0<9}'[:9])
    except (ValueError, OverflowError):
        raise BagError(
            f'{table}: {line.strip()[:40]!r}: expected seconds or a date and time'
        ) from None


def _plain(path: Path) -> list[Camera]:
    for names in (('left', 'right'), ('Left', 'Right')):
        folders = path / names[0], path / names[1]
        if _are_folders(folders):
            stamps = _shared(folders, partial(_named_stamps, path))
            return [Camera('', folders, stamps, False)]
    return []


def _shared(
    folders: tuple[Path, Path], stamps_of: Callable[[list[str]], Stamps]
) -> tuple[Stamps, Stamps]:
    """Stamps of both sides, where equal names are of one moment."""
    left, right = (dict(zip(names, names, strict=True)) for names in map(_images, folders))
    if left and right and not left.keys() & right.keys():
        # Such as left_0001.png and right_0001.png.
        left, right = ({name: _SIDE.sub('', name) for name in side} for side in (left, right))
        if not {*left.values()} & {*right.values()}:
            raise BagError(
                f'{folders[0]} and {folders[1]}: no image is on both sides, as by '
                f'{next(iter(left))} and {next(iter(right))}: expected equal names, apart from '
                'left and right'
            )
    stamps = stamps_of(sorted({*left.values(), *right.values()}, key=_natural))
    return (
        {name: stamps[moment] for name, moment in left.items()},
        {name: stamps[moment] for name, moment in right.items()},
    )


def _natural(name: str) -> list[tuple[int, int | str]]:
    """Sort key by which 2.png comes before 10.png."""
    parts = re.split(r'(\d+)', name)
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]


def _named_stamps(path: Path, names: list[str]) -> Stamps:
    stamps = {name: _name_ns(Path(name).stem) for name in names}
    known = {name: stamp for name, stamp in stamps.items() if stamp is not None}
    if len(known) < len(names):
        return _regular_stamps(path, names)
    shift = _shift_ns(known.values())
    return {name: stamp + shift for name, stamp in known.items()}


def _shift_ns(stamps: Collection[int]) -> int:
    """Return what makes all stamps positive: a stamp of 0 means none in ROS."""
    first_ns = min(stamps, default=1)
    return NANOSECONDS_PER_SECOND - first_ns if first_ns <= 0 else 0


def _check_stamps(stamps: Collection[int], table: Path) -> None:
    if stamps and (last_ns := max(stamps)) > _MAX_STAMP_NS:
        raise BagError(f'{table}: {last_ns} ns: expected at most {_MAX_STAMP_NS}')


def _name_ns(stem: str) -> int | None:
    if _SECONDS.fullmatch(stem):
        seconds, _, fraction = stem.partition('.')
        stamp_ns = int(seconds) * NANOSECONDS_PER_SECOND + int(f'{fraction:0<9}')
        return stamp_ns if stamp_ns <= _MAX_STAMP_NS else None
    value = int(stem) if stem.isdecimal() and len(stem) < 20 else 0
    if value in _UNIX_SECONDS:
        return value * NANOSECONDS_PER_SECOND
    return value if value in _NANOSECONDS else None


def _regular_stamps(path: Path, names: list[str]) -> Stamps:
    if names:
        _logger.warning(
            '%s: the names of the images are no stamps (such as %s): taken as 10 images per '
            'second, from 1 s',
            path,
            printable(names[0]),
        )
    return {name: NANOSECONDS_PER_SECOND + index * _PERIOD_NS for index, name in enumerate(names)}


def _are_folders(folders: tuple[Path, Path]) -> bool:
    return all(each.is_dir() for each in folders)


def _images(folder: Path) -> list[str]:
    try:
        files = [each for each in folder.iterdir() if each.suffix.lower() in IMAGE_SUFFIXES]
        # A link to nothing is an image that is missing.
        return sorted(
            (each.name for each in files if each.is_file() or not each.exists()), key=_natural
        )
    except OSError as error:
        raise BagError(f'{folder}: cannot be read: {error.strerror}') from None


def _lines(table: Path) -> list[str]:
    data = read_small_file(table, 'file of stamps', BagError, MAX_TABLE_BYTES)
    try:
        return data.decode().splitlines()
    except UnicodeDecodeError:
        raise BagError(f'{table}: cannot be read: expected UTF-8 text') from None
