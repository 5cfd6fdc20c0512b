"""Which images are raw, and how they are rectified: one rule, live and offline."""

from __future__ import annotations

import re

from rover_obstacle_detection.messages.calibration import StereoCalibration
from rover_obstacle_detection.messages.rectification import StereoRectification

BY_NAME, ALWAYS, NEVER = RECTIFY = ('by_name', 'always', 'never')
"""Which images are rectified: those whose names say that they are raw, all, none."""

_TRANSPORT = '/compressed'
# Folders that drivers put rectified images in, as in ZED's left/color/rect/image.
_RECTIFIED_FOLDERS = frozenset({'rect', 'rectified'})
# As words: direct and unrectified contain rect as well.
_RECTIFIED_WORD = re.compile(r'(?<![a-z])rect(ified)?(?![a-z])')
_RAW_WORD = re.compile(r'(?<![a-z])raw(?![a-z])')


def base_name(topic: str) -> str:
    """Return the last part of an image topic in lower case, without its transport."""
    return topic.removesuffix(_TRANSPORT).rpartition('/')[2].lower()


def is_named_rectified(topic: str) -> bool:
    """Return whether a topic's name says that its images are rectified.

    That is ROS's convention: the word ``rect`` or ``rectified`` in the last part of the name, as
    in RealSense's ``image_rect_raw``. A part before it that is one of these words counts too,
    unless the last part says ``raw`` or ``unrect``.
    """
    base = base_name(topic)
    if 'unrect' in base:
        return False
    if _RECTIFIED_WORD.search(base):
        return True
    folders = topic.removesuffix(_TRANSPORT).lower().split('/')[:-1]
    return not _RAW_WORD.search(base) and not _RECTIFIED_FOLDERS.isdisjoint(folders)


def are_raw(left_topic: str, right_topic: str, rectify: str = BY_NAME) -> bool:
    """Return whether the images of two topics are to be rectified.

    Parameters
    ----------
    left_topic, right_topic : str
    rectify : str
        One of `RECTIFY`.
    """
    if rectify == BY_NAME:
        return not (is_named_rectified(left_topic) and is_named_rectified(right_topic))
    return rectify == ALWAYS


def treatment(
    rectification: StereoRectification, calibration: StereoCalibration, images: str
) -> str:
    """Say what is done with raw images.

    Parameters
    ----------
    rectification : StereoRectification
        Made of the calibration.
    calibration : StereoCalibration
    images : str
        The two topics.
    """
    if rectification.is_needed:
        return (
            f'{images} are raw images: rectifying them with K, D, R and P of {calibration.source}'
        )
    return (
        f'{images} are raw images, but there is no distortion or rotation in '
        f'{calibration.source}: they are used as they are'
    )
