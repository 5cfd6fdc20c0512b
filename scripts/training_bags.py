"""Recordings to train on, and their labels in the straightened image."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED
from rover_obstacle_detection.simulation.cache import cache_folder, cached_bag, simulated_bag
from rover_obstacle_detection.simulation.suite import load_suite


def bags_of_suite(
    suite: str, is_chosen: Callable[[str], bool], *, cached_only: bool = False
) -> Iterator[Path]:
    """Render the chosen scenes of a suite, unless the cache has them already.

    Parameters
    ----------
    suite : str
    is_chosen : callable
        Takes the name of a scene.
    cached_only : bool
        Leave out the scenes that the cache does not have.

    Raises
    ------
    MissingExtraError
        If a scene must be rendered, and the extra ``sim`` is not installed.
    """
    folder = cache_folder()
    for scene in load_suite(suite):
        if is_chosen(scene.name) and (not cached_only or cached_bag(scene, folder).exists()):
            yield simulated_bag(scene, folder)


def straightened_labels(
    labels: NDArray[np.uint8], camera: StereoCamera, correction: Correction
) -> NDArray[np.uint8]:
    """Labels of the straightened left image at another resolution: what the features show.

    Parameters
    ----------
    labels : ndarray of uint8, shape (height, width)
        Of the left image.
    camera : StereoCamera
        Of the resolution of the outlines.
    correction : Correction
    """
    labels = resized(labels, camera.shape)
    if not correction.lenses.left:
        return labels
    left, _ = correction.lenses.views(camera)
    labels = left.straightened(labels, cv2.INTER_NEAREST).copy()
    labels[~left.seen(0)] = NOT_COUNTED
    return labels
