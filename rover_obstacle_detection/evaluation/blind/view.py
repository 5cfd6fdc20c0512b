"""What a detector is given of a scene, next to what is true of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED
from rover_obstacle_detection.evaluation.true_disparity import true_disparity

Grey = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class View:
    """A stereo pair as a detector is given it, and the truth about its left image.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
        Grey.
    camera : StereoCamera
        The calibration that the detector is given.
    labels : ndarray of uint8, shape (height, width)
        True labels of the left image, as in `LabelledFrame`.
    depth_m : ndarray of float32, shape (height, width)
        True depth of the left image along the optical axis; NaN where it is not known.
    other : ndarray of uint8, shape (height, width)
        Right image of another moment.
    up : Gravity, optional
        True vertical.
    told_gravity : Gravity, optional
        The vertical that the detector is given; None: the detector estimates it.
    blind : ndarray of bool, shape (height, width), optional
        Pixels of the left image of which the pair says nothing. None: there are none, or which
        they are is not defined.
    """

    left: Grey
    right: Grey
    camera: StereoCamera
    labels: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    other: Grey
    up: Gravity | None = None
    told_gravity: Gravity | None = None
    blind: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, frame: LabelledFrame, other: NDArray[Any], up: Gravity | None = None) -> View:
        """Make the undamaged view of a labelled frame.

        Parameters
        ----------
        frame : LabelledFrame
        other : ndarray of uint8 or uint16
            Right image of another moment, of any size; grey or BGR.
        up : Gravity, optional
            Vertical to use where the frame has no true one.
        """
        left, right = grey_pair(frame.left, frame.right, frame.camera)
        depth_m = frame.depth_m
        if depth_m is None:
            depth_m = np.full(frame.camera.shape, np.nan, np.float32)
        return cls(
            left=left,
            right=right,
            camera=frame.camera,
            labels=frame.labels,
            depth_m=depth_m,
            other=_fitted(other, frame.camera),
            up=frame.gravity or up,
        )


def seen_from_the_right(view: View) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Move the truth of the left image into the right image.

    Returns
    -------
    labels : ndarray of uint8, shape (height, width)
        Not counted where the left image does not show the surface.
    depth_m : ndarray of float32, shape (height, width)
        NaN where the left image does not show the surface.
    """
    height, width = view.labels.shape
    disparity = true_disparity(view.depth_m, view.camera)
    rows, columns = np.nonzero(np.isfinite(disparity))
    # The nearest surface comes last, so that it stays where several fall on one pixel.
    order = np.argsort(disparity[rows, columns], kind='stable')
    rows, columns = rows[order], columns[order]
    place = columns - disparity[rows, columns] - view.camera.disparity_offset
    target = np.rint(place).astype(np.intp)
    inside = (target >= 0) & (target < width)
    rows, columns, target = rows[inside], columns[inside], target[inside]
    labels = np.full((height, width), NOT_COUNTED, np.uint8)
    depth_m = np.full((height, width), np.nan, np.float32)
    labels[rows, target] = view.labels[rows, columns]
    depth_m[rows, target] = view.depth_m[rows, columns]
    return labels, depth_m


def rotated_by_180(view: View) -> View:
    """Turn both images, the truth and the calibration by 180 degrees; do not exchange them."""
    camera = view.camera
    assert camera.cx_right is not None
    turned = replace(
        camera,
        cx=camera.width - 1 - camera.cx,
        cy=camera.height - 1 - camera.cy,
        cx_right=camera.width - 1 - camera.cx_right,
    )
    up = view.up
    if up is not None:
        up = Gravity((-up.up[0], -up.up[1], up.up[2]), up.height_m)
    return replace(
        view,
        left=_turned(view.left),
        right=_turned(view.right),
        camera=turned,
        labels=_turned(view.labels),
        depth_m=_turned(view.depth_m),
        up=up,
    )


def exchanged(view: View) -> View:
    """Exchange the images and move the truth along; the calibration stays."""
    labels, depth_m = seen_from_the_right(view)
    return replace(view, left=view.right, right=view.left, labels=labels, depth_m=depth_m)


def _turned(image: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(image[::-1, ::-1])


def _fitted(image: NDArray[Any], camera: StereoCamera) -> Grey:
    size = (camera.width, camera.height)
    if image.shape[:2] != camera.shape:
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    return grey_pair(image, image, camera)[0]
