"""From straightened images back to the left image as the camera took it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.result.detection import FREE, Detection


def in_left_image(detection: Detection, frame: Frame) -> Detection:
    """Return a detection in the straightened left image as one in the left image.

    Each pixel takes what was found at the nearest pixel of the straightened image.

    Parameters
    ----------
    detection : Detection
    frame : Frame
        The images before they were straightened.
    """
    remapped = detection.correction.to_left_image(frame.camera)
    if remapped is None:
        return detection
    grey = frame.pair[0]
    disparity = remapped(detection.disparity, 0)
    cues, mask = remapped(detection.cues, 0), remapped(detection.mask, FREE)
    known = remapped(detection.known, False)
    if frame.excluded is not None:
        for array in (cues, mask, known):
            array[frame.excluded] = 0
    return replace(
        detection,
        grey=grey,
        disparity=disparity,
        height=remapped(detection.height, np.nan),
        height_noise=remapped(detection.height_noise, np.inf),
        rock_probability=remapped(detection.rock_probability, np.nan),
        cues=cues,
        known=known,
        mask=mask,
        study=replace(detection.study, grey=grey, disparity=disparity),
        remapping=remapped,
    )
