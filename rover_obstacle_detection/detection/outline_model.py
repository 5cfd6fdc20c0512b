"""Where the outline of an obstacle runs: a small filter over the planes of evidence."""

from __future__ import annotations

import threading
from functools import lru_cache
from importlib import resources

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.outline_planes import PLANES

MODEL_FILE = 'outline_model.onnx'
_MULTIPLE = 8


class OutlineModel:
    """The filter, loaded once; it keeps no state between calls.

    Notes
    -----
    A U-shaped network (Ronneberger et al. 2015) of some thirty thousand weights, trained on
    rendered scenes by ``scripts/train_outlines.py``. It sees numbers without units (`PLANES`).
    """

    def __init__(self) -> None:
        data = (resources.files(__package__) / MODEL_FILE).read_bytes()
        self._net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))
        # OpenCV's net holds the input and what it computes: one call at a time.
        self._turn = threading.Lock()

    def probability(self, planes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Tell how likely each pixel is to be on an obstacle that stands up.

        Parameters
        ----------
        planes : ndarray of float32, shape (planes, height, width)

        Returns
        -------
        ndarray of float32, shape (height, width)
        """
        assert planes.shape[0] == len(PLANES)
        height, width = planes.shape[1:]
        bottom, right = -height % _MULTIPLE, -width % _MULTIPLE
        padded = planes
        if bottom or right:
            padded = np.pad(planes, ((0, 0), (0, bottom), (0, right)), mode='edge')
        with self._turn:
            self._net.setInput(np.ascontiguousarray(padded[np.newaxis]))
            quarters = self._net.forward()[0].copy()
        # Four logits for each 2 x 2 pixels, row by row.
        logit = np.empty(padded.shape[1:], np.float32)
        for number, quarter in enumerate(quarters):
            logit[number // 2 :: 2, number % 2 :: 2] = quarter
        return np.asarray(1 / (1 + np.exp(-logit[:height, :width])), np.float32)


@lru_cache(maxsize=1)
def outline_model() -> OutlineModel:
    """Load the filter that comes with the package, once."""
    return OutlineModel()
