"""Write the calibration of a recording with the rectification errors that it shows corrected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.errors import BagError, CameraError, OutputError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.raw_images import ALWAYS
from rover_obstacle_detection.messages.rectification import StereoRectification
from rover_obstacle_detection.offline.inspection.inspection import BagInspection, CameraInspection
from rover_obstacle_detection.offline.inspection.lens_correction import (
    difference,
    median_lenses,
    with_lens,
    without_border,
)
from rover_obstacle_detection.offline.inspection.pairs import (
    as_grey,
    measure_rectification,
    sample_images,
)
from rover_obstacle_detection.offline.output_file import atomic_write_text, check_output_file
from rover_obstacle_detection.wording import counted

MOST_PAIRS = 30
_MIN_PAIRS = 3
_MAX_SPREAD_PX = 0.5
_SPREAD_SHARE = 0.8
_SETTLED_PX = 0.02
_MAX_REMAINING_PX = 0.1
_MAX_ROUNDS = 6
# A larger share of the bend that most pairs do not share is not the lenses'.
_MAX_LENS_SPREAD = 0.5
# What the detector itself leaves uncorrected.
_MAX_MISFIT_PX = RectificationParameters().min_mean_bend_px


@dataclass(frozen=True)
class CorrectedCalibration:
    """The files that were written, and what they correct.

    Parameters
    ----------
    files : tuple of two Path
        Of the left and the right camera.
    pairs : int
        Measured pairs.
    rows_off_px, remaining_px : float
        Median rows by which the right image is off at the worst border, before and after.
    spread_px : float
        80 % of the pairs are within this distance of the median.
    lens_bend_px, remaining_lens_bend_px : float
        Mean bend of the lenses with the median distortion of the pairs, before and after.
    is_common_lens_corrected : bool
        Whether what both lenses have in common is corrected too, not only their difference.
    zoom : float
        Factor by which the rectified images are enlarged, so that no border turns black.
    lens_problem : str
        Why the lens distortion is not corrected; empty if it is, or if there is none.
    for_raw_images : bool
        Whether the files do not apply to the recorded images, since those are rectified already.
    rectify : str
        Which of the recorded images are to be rectified with the files, one of
        `messages.raw_images.RECTIFY`.
    """

    files: tuple[Path, Path]
    pairs: int
    rows_off_px: float
    remaining_px: float
    spread_px: float
    lens_bend_px: float
    remaining_lens_bend_px: float
    is_common_lens_corrected: bool
    zoom: float
    lens_problem: str
    for_raw_images: bool
    rectify: str


class _Calibrations(NamedTuple):
    """A calibration of the images as they are recorded, and the one to write.

    Both are the same for raw images.
    """

    recorded: StereoCalibration
    written: StereoCalibration


class _LensError(Exception):
    """The lens distortion cannot be corrected; its text says why."""


def write_corrected_calibration(
    bag: BagInspection, folder: Path, *, force: bool
) -> CorrectedCalibration:
    """Write ``left.yaml`` and ``right.yaml``, so that rectified images of the recording agree.

    The right camera gets another principal row in K, and another rotation about the optical axis
    in R. If most pairs show the same lens distortion, both cameras get another D: for the
    difference between the lenses, or, if that does not do, for all that they show.

    Parameters
    ----------
    bag : BagInspection
        With one stereo camera.
    folder : Path
        Is created if needed.
    force : bool
        Replace existing files.

    Raises
    ------
    ObstacleDetectionError
        If there is no valid calibration, the rows of the pairs differ too much to come from the
        calibration, or the files cannot be written.
    """
    inspected, calibration = _only_camera(bag)
    files = folder / 'left.yaml', folder / 'right.yaml'
    if folder.is_dir():
        for file in files:
            check_output_file(file, force=force)
    is_rectified = inspected.topics.is_rectified
    recorded = _of_rectified_images(calibration) if is_rectified else calibration
    camera = recorded.camera
    images = _images(bag.path, inspected)
    measured = _measure(images, recorded)
    spread_px = _checked_spread_px(measured, camera, bag.path)
    first, found = _median(measured, camera), _Calibrations(recorded, calibration)
    problem = ''
    for part in (difference, _all):
        try:
            corrected, remaining = _corrected(images, found, measured, part)
        except _LensError as error:
            problem = str(error)
        else:
            problem = ''
            break
    else:
        corrected, remaining = _corrected(images, found, measured, _none)
    written = corrected.written
    if not problem and first.lenses:
        written = without_border(written, calibration)
    remaining_px = remaining.rows.most_px(camera)
    if remaining_px > _MAX_REMAINING_PX:
        raise CameraError(
            f'{bag.path}: the rows are still off by {remaining_px:.2f} px with the corrected '
            f'calibration: expected at most {_MAX_REMAINING_PX} px'
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f'{folder}: cannot be created: {error.strerror}') from None
    for file, info in zip(files, (written.left, written.right), strict=True):
        atomic_write_text(file, camera_info_yaml(info, file.stem))
    for_raw_images = is_rectified and StereoRectification(calibration).is_needed
    applies = not for_raw_images and StereoRectification(written).is_needed
    return CorrectedCalibration(
        files,
        len(measured),
        first.rows.most_px(camera),
        remaining_px,
        spread_px,
        first.lenses.mean_bend_px(camera),
        remaining.lenses.mean_bend_px(camera),
        part is _all and not problem,
        written.camera.fx / calibration.camera.fx,
        problem,
        for_raw_images,
        ALWAYS if is_rectified and applies else inspected.topics.rectify,
    )


def _only_camera(bag: BagInspection) -> tuple[CameraInspection, StereoCalibration]:
    if len(bag.cameras) != 1:
        raise BagError(
            f'{bag.path}: has {len(bag.cameras)} stereo cameras: expected one to calibrate, give '
            '--left-topic and --right-topic'
        )
    (camera,) = bag.cameras
    calibration = camera.calibration.stereo
    if calibration is None:
        raise CameraError(f'{bag.path}: no calibration to correct: {camera.calibration.problem}')
    geometry = camera.sample.geometry
    if sum(each.swapped for each in geometry) > len(geometry) / 2:
        raise CameraError(f'{bag.path}: left and right images are swapped: exchange the topics')
    for side, info in (('left', calibration.left), ('right', calibration.right)):
        roi = info.roi
        is_cropped = roi is not None and any((roi.x_offset, roi.y_offset, roi.width, roi.height))
        if is_cropped or max(info.binning_x, info.binning_y) > 1:
            raise CameraError(
                f'{bag.path}: the {side} camera_info has a region of interest or binning, which '
                'calibration files cannot hold: expected full images'
            )
    return camera, calibration


def _of_rectified_images(calibration: StereoCalibration) -> StereoCalibration:
    def rectified(info: CameraInfo) -> CameraInfo:
        k = np.reshape(info.p, (3, 4))[:, :3]
        return replace(
            info,
            distortion_model='plumb_bob',
            d=(),
            k=_numbers(k),
            r=_numbers(np.identity(3)),
        )

    left, right = rectified(calibration.left), rectified(calibration.right)
    return StereoCalibration(left, right, calibration.source)


def _images(path: Path, camera: CameraInspection) -> list[GreyPair]:
    with open_bag(path) as bag:
        return [
            as_grey(*decoded)
            for _, decoded in sample_images(bag, camera.topics, camera.pairs, MOST_PAIRS)
            if not isinstance(decoded, Exception)
        ]


def _measure(images: Sequence[GreyPair], calibration: StereoCalibration) -> list[Correction]:
    rectify = StereoRectification(calibration)
    pairs = (as_grey(*rectify(*pair)) for pair in images)
    return [found for pair in pairs if (found := measure_rectification(pair, calibration.camera))]


def _all(lenses: Lenses) -> Lenses:
    return lenses


def _none(lenses: Lenses) -> Lenses:
    return STRAIGHT_LENSES


def _median(
    measured: Sequence[Correction],
    camera: StereoCamera,
    part: Callable[[Lenses], Lenses] = _all,
) -> Correction:
    shifts = [(each.rows.offset_px, each.rows.turn) for each in measured]
    offset_px, turn = np.median(shifts, axis=0)
    lenses = median_lenses([part(each.lenses) for each in measured], camera)
    return Correction(RowAlignment(float(offset_px), float(turn)), lenses)


def _checked_spread_px(measured: Sequence[Correction], camera: StereoCamera, path: Path) -> float:
    """Return how far most pairs stay within the median; refuse what no calibration explains."""
    if len(measured) < _MIN_PAIRS:
        raise CameraError(
            f'{path}: the rows can be measured in {counted(len(measured), "pair")}: '
            f'expected at least {_MIN_PAIRS}'
        )
    median = _median(measured, camera).rows
    off_px = [
        RowAlignment(each.rows.offset_px - median.offset_px, each.rows.turn - median.turn).most_px(
            camera
        )
        for each in measured
    ]
    spread_px = float(np.quantile(off_px, _SPREAD_SHARE))
    if spread_px > _MAX_SPREAD_PX:
        raise CameraError(
            f"{path}: the rows of {len(measured)} pairs scatter too much to be one camera's: "
            f'{_SPREAD_SHARE:.0%} are within {spread_px:.2f} px of the median: expected at most '
            f'{_MAX_SPREAD_PX} px; is a camera loose, or are the images not synchronised?'
        )
    return spread_px


def _check_lenses(lenses: Sequence[Lenses], camera: StereoCamera) -> None:
    """Raise `_LensError` unless most pairs show the median distortion."""
    median = median_lenses(lenses, camera)
    bend_px = median.mean_bend_px(camera)
    spread_px = float(
        np.quantile([each.change_px(camera, median) for each in lenses], _SPREAD_SHARE)
    )
    if spread_px > _MAX_LENS_SPREAD * bend_px:
        raise _LensError(
            f'it differs too much between the pairs: {_SPREAD_SHARE:.0%} are within '
            f'{spread_px:.2f} px of the median, {bend_px:.2f} px'
        )


def _corrected(
    images: Sequence[GreyPair],
    found: _Calibrations,
    measured: Sequence[Correction],
    part: Callable[[Lenses], Lenses],
) -> tuple[_Calibrations, Correction]:
    """Correct rows and part of the lenses in turn until nothing remains; return what remains."""
    camera = found.recorded.camera
    _check_lenses([part(each.lenses) for each in measured], camera)
    for _ in range(_MAX_ROUNDS):
        change = _median(measured, camera, part)
        if change.rows.most_px(camera) <= _SETTLED_PX and not change.lenses:
            break
        found = _Calibrations(*(_with(each, change) for each in found))
        measured = _measure(images, found.recorded)
    remaining = _median(measured, camera)
    if remaining.lenses and part is not _none:
        raise _LensError(
            f'with it corrected, the lenses still bend '
            f'{remaining.lenses.mean_bend_px(camera):.2f} px'
        )
    return found, remaining


def _with(calibration: StereoCalibration, change: Correction) -> StereoCalibration:
    """Take rectification errors into a calibration."""
    cameras = []
    for info, lens in (
        (calibration.left, change.lenses.left),
        (calibration.right, change.lenses.right),
    ):
        bent, off_px = with_lens(info, lens)
        if off_px > _MAX_MISFIT_PX:
            raise _LensError(
                f'no coefficients of {info.distortion_model or "plumb_bob"} express it: the best '
                f'are {off_px:.2f} px off'
            )
        cameras.append(bent)
    left, right = cameras
    return StereoCalibration(left, _with_rows(right, change.rows), calibration.source)


def _with_rows(info: CameraInfo, rows: RowAlignment) -> CameraInfo:
    """Take the rows by which the right image is off into its calibration."""
    k = np.reshape(info.k, (3, 3)).copy()
    k[1, 2] += rows.offset_px * k[1, 1] / info.p[5]
    cosine, sine = np.cos(rows.turn), np.sin(rows.turn)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return replace(info, k=_numbers(k), r=_numbers(turn @ np.reshape(info.r, (3, 3))))


def camera_info_yaml(info: CameraInfo, name: str) -> str:
    """Write a calibration as ROS's camera_calibration does."""

    def matrix(key: str, rows: int, values: Sequence[float]) -> str:
        data = ', '.join(repr(float(value)) for value in values)
        return f'{key}:\n  rows: {rows}\n  cols: {len(values) // rows}\n  data: [{data}]\n'

    return (
        f'image_width: {info.width}\n'
        f'image_height: {info.height}\n'
        f'camera_name: {name}\n'
        + matrix('camera_matrix', 3, info.k)
        + f'distortion_model: {info.distortion_model or "plumb_bob"}\n'
        + matrix('distortion_coefficients', 1, info.d or (0.0,) * 5)
        + matrix('rectification_matrix', 3, info.r)
        + matrix('projection_matrix', 3, info.p)
    )


def _numbers(matrix: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(value) for value in matrix.ravel())
