"""A trained network that returns values for each pixel of an image or cell of a map."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import lru_cache
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.network.inference import (
    OnnxRuntimeInference,
    load_inference,
)
from rover_obstacle_detection.detection.network.onnx_metadata import read_metadata
from rover_obstacle_detection.errors import ModelError

Planes = NDArray[np.float32]
Loaded = TypeVar('Loaded')

VERSION_KEY = 'features_version'
"""Entry of the ONNX metadata with the version of the features that a model was trained for."""

BLOCK_PX = 16
"""Inputs are padded to a multiple of it: networks reduce the resolution to a sixteenth at most."""

# Taller inputs are run in two halves, which takes half the memory. Each half extends this far
# beyond its end, as far as the networks look.
_MAX_ROWS = 640
_REACH_PX = 80


class PixelNetwork:
    """A network, loaded from ONNX. Thread-safe, and stateless between calls.

    Parameters
    ----------
    data : bytes
        Content of an ONNX file.
    outputs : int
        Values for each pixel.
    version : str
        Version of the features that the model must have been trained for.
    name, script : str
        What the model is, and what trains it: for error messages.
    padding : str
        What inputs are padded with, as in ``numpy.pad``.

    Raises
    ------
    ModelError
        If the model was trained for another version of the features.

    Notes
    -----
    The network returns the values of a square of pixels together, so that none of its layers has
    the resolution of the image.
    """

    def __init__(
        self,
        data: bytes,
        *,
        outputs: int,
        version: str,
        name: str,
        script: str,
        padding: Literal['edge', 'constant'] = 'edge',
    ) -> None:
        found = read_metadata(data).get(VERSION_KEY)
        if found != version:
            msg = (
                f'the {name} model is for features of version {found}: expected {version}; '
                f'train it again with {script}'
            )
            raise ModelError(msg)
        self._outputs, self._padding = outputs, padding
        self._inference = load_inference(data)

    @property
    def is_fast(self) -> bool:
        """Whether ONNX Runtime runs it."""
        return isinstance(self._inference, OnnxRuntimeInference)

    def values(self, features: Planes) -> Planes:
        """Run the network.

        Parameters
        ----------
        features : ndarray of float32, shape (features, height, width)

        Returns
        -------
        ndarray of float32, shape (outputs, height, width)
        """
        height, width = features.shape[1:]
        bottom, right = -height % BLOCK_PX, -width % BLOCK_PX
        padded = features
        if bottom or right:
            padded = np.pad(features, ((0, 0), (0, bottom), (0, right)), mode=self._padding)
        values = np.empty((self._outputs, *padded.shape[1:]), np.float32)
        rows = padded.shape[1]
        if rows <= _MAX_ROWS:
            self._run(padded, values)
        else:
            middle = rows // 2 // BLOCK_PX * BLOCK_PX
            size = middle + _REACH_PX
            part = np.empty((self._outputs, size, padded.shape[2]), np.float32)
            self._run(padded[:, :size], part)
            values[:, :middle] = part[:, :middle]
            self._run(padded[:, rows - size :], part)
            values[:, middle:] = part[:, middle - rows :]
        return values[:, :height, :width]

    def _run(self, features: Planes, values: Planes) -> None:
        """Fill in a contiguous array; rows and columns are multiples of a block."""
        squares = self._inference.run(features)
        outputs, rows, columns = values.shape
        side = rows // squares.shape[1]
        # The values of each square of pixels, row by row, one output after the other.
        places = values.reshape(outputs, rows // side, side, columns // side, side)
        places[:] = squares.reshape(outputs, side, side, *squares.shape[1:]).transpose(
            0, 3, 1, 4, 2
        )


def loaded_once(load: Callable[[], Loaded]) -> Callable[[], Loaded]:
    """Make a function load a model at the first call, and again in a forked process.

    A forked process inherits a model without its threads.
    """
    cached = lru_cache(maxsize=1)(load)

    def load_again() -> None:
        if cached.cache_info().currsize:
            # Never freed, not even at exit: that would wait for the threads.
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(cached()))
        cached.cache_clear()

    if hasattr(os, 'register_at_fork'):
        os.register_at_fork(after_in_child=load_again)
    return cached
