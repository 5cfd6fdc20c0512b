"""Where the outline of an obstacle runs: a small filter over the planes of evidence."""

from __future__ import annotations

import threading
from functools import lru_cache
from importlib import resources

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.rocks.outline_features import PLANES

MODEL_FILE = 'outline_model.onnx'
_MULTIPLE = 8
_MOST_ROWS = 512
_REACH = 80


class OutlineModel:
    """The filter, loaded once; it keeps no state between calls.

    Notes
    -----
    Two U-shaped branches (Ronneberger et al. 2015) side by side, some 343,000 weights, trained
    on rendered scenes by ``scripts/train_outlines.py``. It sees numbers without units (`PLANES`).
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
        logit = np.empty(padded.shape[1:], np.float32)
        rows = padded.shape[1]
        if rows <= _MOST_ROWS:
            self._run(padded, logit)
        else:
            # In two halves, each seeing as far beyond as the filter looks: half the memory.
            middle = rows // 2 // _MULTIPLE * _MULTIPLE
            size = middle + _REACH
            part = np.empty((size, padded.shape[2]), np.float32)
            self._run(padded[:, :size], part)
            logit[:middle] = part[:middle]
            self._run(padded[:, rows - size :], part)
            logit[middle:] = part[middle - rows :]
        # The logistic function, in a form that does not overflow.
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * logit[:height, :width]), np.float32)

    def _run(self, planes: NDArray[np.float32], logit: NDArray[np.float32]) -> None:
        """Fill in the logit of each pixel; rows and columns are multiples of eight."""
        with self._turn:
            self._net.setInput(np.ascontiguousarray(planes[np.newaxis]))
            quarters = self._net.forward()[0].copy()
        # Four logits for each 2 x 2 pixels, row by row.
        for number, quarter in enumerate(quarters):
            logit[number // 2 :: 2, number % 2 :: 2] = quarter


@lru_cache(maxsize=1)
def outline_model() -> OutlineModel:
    """Load the filter that comes with the package, once."""
    return OutlineModel()
