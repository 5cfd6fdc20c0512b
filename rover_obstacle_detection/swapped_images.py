"""Detect swapped left and right images."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.detector import Detector, OnStage
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import ImageError, UnjudgeablePairError

# Width in pixels at which the pair is matched: 64 disparities then reach a quarter of the image.
WIDTH = 256
DISPARITIES = 64
BLOCK = 5
# In the correct order most pixels match. In the wrong order a few tenths match by chance.
SWAPPED_SHARE = 0.4
SWAPPED_RATIO = 2.0
# The check runs only if fewer pixels than this have a disparity.
SUSPICIOUS_SHARE = 0.5
# Disparities in OpenCV's fixed-point maps are in sixteenths of a pixel.
FIXED_POINT = 16


def detect_unswapped(
    detector: Detector,
    left: NDArray[Any],
    right: NDArray[Any],
    left_name: str,
    right_name: str,
    *,
    gravity: Gravity | None = None,
    on_stage: OnStage | None = None,
) -> Detection:
    """Run a detector on a pair, and refuse swapped images; errors begin with the pair's names.

    Parameters
    ----------
    detector : Detector
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    left_name, right_name : str
        Topics or files, for the error messages.
    gravity, on_stage : optional
        As for `Detector.detect`.

    Raises
    ------
    ImageError
        If left and right are swapped, or from the detector.
    UnjudgeablePairError
        From the detector.
    """
    try:
        detection = detector.detect(left, right, gravity=gravity, on_stage=on_stage)
    except ImageError as error:
        raise ImageError(f'{left_name}, {right_name}: {error}') from error
    except UnjudgeablePairError as error:
        # Swapped images cannot be judged either, but the cause can be named.
        if are_swapped(left, right, detector.camera):
            raise _swapped(left_name, right_name) from error
        raise UnjudgeablePairError(f'{left_name}, {right_name}: {error}') from error
    refuse_swapped_images(detection, left, right, left_name, right_name)
    return detection


def refuse_swapped_images(
    detection: Detection,
    left: NDArray[Any],
    right: NDArray[Any],
    left_name: str,
    right_name: str,
) -> None:
    """Raise an error if a pair with few matches would match in the opposite order.

    Parameters
    ----------
    detection : Detection
        The detection in this pair.
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    left_name, right_name : str
        Topics or files, for the error message.

    Raises
    ------
    ImageError
        If left and right are swapped.
    """
    matched_share = np.count_nonzero(detection.disparity > 0) / detection.disparity.size
    if matched_share < SUSPICIOUS_SHARE and are_swapped(left, right, detection.camera):
        raise _swapped(left_name, right_name)


def are_swapped(left: NDArray[Any], right: NDArray[Any], camera: StereoCamera) -> bool:
    """Whether a pair matches with negative but not with positive disparities.

    Parameters
    ----------
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR, of the camera's size.
    camera : StereoCamera

    Returns
    -------
    bool
        False if neither order matches, for example in the dark.
    """
    pair = grey_pair(left, right, camera)
    small = camera.resized(WIDTH, max(round(WIDTH * camera.height / camera.width), BLOCK))
    first, second = (
        cv2.resize(image, (small.width, small.height), interpolation=cv2.INTER_AREA)
        for image in pair
    )
    offset = round(small.disparity_offset)
    swapped = _matched_share(second, first, offset)
    return swapped > SWAPPED_SHARE and swapped > SWAPPED_RATIO * _matched_share(
        first, second, offset
    )


def _swapped(left_name: str, right_name: str) -> ImageError:
    return ImageError(
        f'{left_name}, {right_name}: disparities are negative: expected the left image from '
        f'{left_name}; are left and right swapped?'
    )


def _matched_share(left: NDArray[Any], right: NDArray[Any], offset: int) -> float:
    matcher = cv2.StereoSGBM.create(
        minDisparity=offset,
        numDisparities=DISPARITIES,
        blockSize=BLOCK,
        P1=8 * BLOCK**2,
        P2=32 * BLOCK**2,
        disp12MaxDiff=1,
        uniquenessRatio=15,
        speckleWindowSize=50,
        speckleRange=2,
        mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
    disparity = matcher.compute(left, right)
    visible = disparity[:, DISPARITIES + max(offset, 0) :]
    return float(np.mean(visible >= FIXED_POINT * offset))
