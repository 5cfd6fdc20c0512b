"""The calibration that a user asks for: files, numbers or both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from rover_obstacle_detection.calibration_files.kitti import is_colour
from rover_obstacle_detection.calibration_files.load import load_cameras
from rover_obstacle_detection.calibration_files.numbers import CameraNumbers, Cameras, Size
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import StereoCalibration
from rover_obstacle_detection.messages.rectification import needs_rectification

_OPTIONS = {'fx (or hfov)': '--fx or --hfov', 'baseline': '--baseline'}
_FILES = '--calibration, or --left-info and --right-info'

WAYS = f'{", ".join(_OPTIONS.values())}, or {_FILES}'


@dataclass(frozen=True)
class CalibrationRequest:
    """Where the calibration comes from; numbers replace the values of files.

    Parameters
    ----------
    files : tuple of Path
        A calibration file with both cameras, or those of the left and the right camera; may be
        empty.
    numbers : CameraNumbers
    are_parts : bool
        Whether two files are parts of one calibration, not those of the two cameras.
    """

    files: tuple[Path, ...] = ()
    numbers: CameraNumbers = field(default_factory=CameraNumbers)
    are_parts: bool = False

    @property
    def is_given(self) -> bool:
        """Whether anything is given."""
        return bool(self.files) or self.numbers.are_given

    @property
    def is_complete(self) -> bool:
        """Whether it gives a stereo camera without another calibration."""
        return bool(self.files) or not self.numbers.lacking

    @property
    def lack(self) -> str:
        """What is missing and how to give it, for an error message."""
        lacking = self.numbers.lacking
        options = ', '.join(_OPTIONS[name] for name in lacking)
        return f'the calibration lacks {" and ".join(lacking)}: expected {options}, or {_FILES}'

    def absolute(self) -> CalibrationRequest:
        """Return the same request for a process with another working directory."""
        return replace(self, files=tuple(file.absolute() for file in self.files))

    def arguments(self) -> list[str]:
        """Return the options of the command line that give it."""
        is_both = self.are_parts or len(self.files) == 1
        names = ('--calibration',) * 2 if is_both else ('--left-info', '--right-info')
        options: list[tuple[str, Path | float | None]] = [
            *zip(names, self.files, strict=False),
            ('--fx', self.numbers.fx),
            ('--fy', self.numbers.fy),
            ('--cx', self.numbers.cx),
            ('--cy', self.numbers.cy),
            ('--cx-right', self.numbers.cx_right),
            ('--baseline', self.numbers.baseline_m),
            ('--hfov', self.numbers.hfov_deg),
        ]
        return [
            text for name, value in options if value is not None for text in (name, str(value))
        ]

    def calibration(
        self,
        size: Callable[[], Size],
        images: str,
        recorded: Callable[[], tuple[Cameras, str]] | None = None,
    ) -> StereoCalibration:
        """Read the files and apply the numbers.

        Parameters
        ----------
        size : callable
            Returns width and height of the images.
        images : str
            Path or topic of the left images, which tells KITTI's colour cameras.
        recorded : callable, optional
            Returns the cameras of the recording and their source, if the numbers need them.

        Raises
        ------
        CameraError
            If something is missing, cannot be read or forms no stereo camera.
        """
        sources = []
        if self.files:
            cameras = load_cameras(
                self.files, size, colour=is_colour(images), are_parts=self.are_parts
            )
            sources.append(' and '.join(map(str, self.files)))
        elif self.is_complete:
            cameras = None
        elif recorded is not None:
            cameras, source = recorded()
            sources.append(source)
        else:
            raise CameraError(self.lack)
        if self.numbers.are_given:
            sources.insert(0, str(self.numbers))
        source = ', '.join(sources)
        try:
            if cameras is None:
                cameras = self.numbers.cameras(size())
            elif self.numbers.are_given:
                cameras = _applied(self.numbers, cameras)
        except CameraError as error:
            raise CameraError(f'{source}: {error}') from None
        return StereoCalibration(*cameras, source)


def _applied(numbers: CameraNumbers, cameras: Cameras) -> Cameras:
    left, right = numbers.applied(cameras)
    if any(map(needs_rectification, cameras)):
        return left, right
    # The numbers describe the images as they are, not images to make of them.
    return replace(left, k=_left_three(left.p)), replace(right, k=_left_three(right.p))


def _left_three(projection: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(value for index, value in enumerate(projection) if index % 4 < 3)
