"""The network that outlines obstacles."""

from __future__ import annotations

import ctypes
import math
import os
from functools import lru_cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.rocks.inference import OnnxRuntimeInference, load_inference
from rover_obstacle_detection.detection.rocks.onnx_metadata import read_metadata
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.rocks.tiles import BLOCK_PX
from rover_obstacle_detection.errors import ModelError

MODEL_FILE = 'outline_model.onnx'
VERSION_KEY = 'features_version'
"""Entry of the ONNX metadata with the version of the features that the model was trained for."""

# Taller windows are run in two halves, which takes half the memory. Each half extends this far
# beyond its end, as far as the network looks.
_MAX_ROWS = 640
_REACH_PX = 80


class OutlineModel:
    """The network, loaded from ONNX. Thread-safe, and stateless between calls.

    Parameters
    ----------
    data : bytes, optional
        Content of an ONNX file; the model that comes with the package by default.

    Raises
    ------
    ModelError
        If the model was trained for another version of the features.

    Notes
    -----
    U-shaped (Ronneberger et al. 2015) and trained on rendered scenes. Its inputs, `FEATURES`, have
    no units. It returns the logits of a square of pixels together, so that none of its layers has
    the resolution of the image. ``scripts/train_outlines.py`` trains one.
    """

    def __init__(self, data: bytes | None = None) -> None:
        if data is None:
            data = (resources.files(__package__) / MODEL_FILE).read_bytes()
        version = read_metadata(data).get(VERSION_KEY)
        if version != FEATURES_VERSION:
            msg = (
                f'the outline model is for features of version {version}: expected '
                f'{FEATURES_VERSION}; train it again with scripts/train_outlines.py'
            )
            raise ModelError(msg)
        self._inference = load_inference(data)

    @property
    def is_fast(self) -> bool:
        """Whether ONNX Runtime runs it."""
        return isinstance(self._inference, OnnxRuntimeInference)

    def probability(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return how likely each pixel is on an obstacle that stands up.

        Parameters
        ----------
        features : ndarray of float32, shape (features, height, width)

        Returns
        -------
        ndarray of float32, shape (height, width)
        """
        assert features.shape[0] == len(FEATURES)
        height, width = features.shape[1:]
        bottom, right = -height % BLOCK_PX, -width % BLOCK_PX
        padded = features
        if bottom or right:
            padded = np.pad(features, ((0, 0), (0, bottom), (0, right)), mode='edge')
        logit = np.empty(padded.shape[1:], np.float32)
        rows = padded.shape[1]
        if rows <= _MAX_ROWS:
            self._run(padded, logit)
        else:
            middle = rows // 2 // BLOCK_PX * BLOCK_PX
            size = middle + _REACH_PX
            part = np.empty((size, padded.shape[2]), np.float32)
            self._run(padded[:, :size], part)
            logit[:middle] = part[:middle]
            self._run(padded[:, rows - size :], part)
            logit[middle:] = part[middle - rows :]
        # The logistic function, in a form that does not overflow.
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * logit[:height, :width]), np.float32)

    def _run(self, features: NDArray[np.float32], logit: NDArray[np.float32]) -> None:
        """Fill in the logit of each pixel; rows and columns are multiples of a block."""
        planes = self._inference.run(features)
        # The logits of each square of pixels, row by row.
        side = math.isqrt(len(planes))
        for number, plane in enumerate(planes):
            logit[number // side :: side, number % side :: side] = plane


@lru_cache(maxsize=1)
def outline_model() -> OutlineModel:
    """Load the model that comes with the package, once."""
    return OutlineModel()


def _load_again() -> None:
    """Forget the model in a forked process, which inherits it without its threads."""
    if outline_model.cache_info().currsize:
        # Never freed, not even at exit: that would wait for the threads.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(outline_model()))
    outline_model.cache_clear()


if hasattr(os, 'register_at_fork'):
    os.register_at_fork(after_in_child=_load_again)
