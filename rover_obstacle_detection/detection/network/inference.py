"""Runs an ONNX network: by ONNX Runtime if it is installed, by OpenCV otherwise."""

from __future__ import annotations

import logging
import os
import threading
from importlib.util import find_spec
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

Planes = NDArray[np.float32]

_logger = logging.getLogger(__name__)

_SILENT = 4
"""Severity of ONNX Runtime's log: only what ends the process."""


class Inference(Protocol):
    """A network with one input and one output. Threads may share it."""

    def run(self, planes: Planes) -> Planes:
        """Return the output for one input without a batch axis, as an array of its own.

        Parameters
        ----------
        planes : ndarray of float32, shape (channels, height, width)

        Returns
        -------
        ndarray of float32, shape (channels of the output, its height, its width)
        """
        ...


WITHOUT_ONNX_RUNTIME = (
    'the networks run in OpenCV, which takes twice as long as ONNX Runtime: '
    "pip install 'onnxruntime<1.29'"
)
"""What a user should know who has no ONNX Runtime."""


def load_inference(model: bytes) -> Inference:
    """Load a network, for as many threads as OpenCV may use now.

    By ONNX Runtime if it is installed and works: it takes about half the time of OpenCV. Both
    compute the same up to rounding.

    Parameters
    ----------
    model : bytes
        Content of an ONNX file.
    """
    if find_spec('onnxruntime') is None:
        return OpenCVInference(model)
    try:
        return OnnxRuntimeInference(model)
    except Exception as error:  # Whatever a broken or old installation raises.
        _logger.warning('ONNX Runtime cannot be used (%s): %s', error, WITHOUT_ONNX_RUNTIME)
        return OpenCVInference(model)


class OpenCVInference:
    """The network in ``cv2.dnn``."""

    def __init__(self, model: bytes) -> None:
        self._net = cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))
        # The net holds the input and intermediate results: one call at a time.
        self._lock = threading.Lock()

    def run(self, planes: Planes) -> Planes:
        """Return the output, see `Inference`."""
        with self._lock:
            self._net.setInput(np.ascontiguousarray(planes[np.newaxis]))
            return np.asarray(self._net.forward()[0].copy(), np.float32)


class OnnxRuntimeInference:
    """The network in ONNX Runtime."""

    def __init__(self, model: bytes) -> None:
        # Builds from 1.29 on send usage data to their maker, from a thread of their own.
        os.environ.setdefault('ORT_DISABLE_TELEMETRY', '1')
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.log_severity_level = _SILENT
        options.intra_op_num_threads = max(1, cv2.getNumThreads())
        # Threads that wait for the next window must not take a core from the rest.
        options.add_session_config_entry('session.intra_op.allow_spinning', '0')
        # Windows differ in size: memory planned for one does not suit the next.
        options.enable_mem_pattern = False
        self._session = onnxruntime.InferenceSession(
            model, options, providers=['CPUExecutionProvider']
        )
        self._input = self._session.get_inputs()[0].name

    def run(self, planes: Planes) -> Planes:
        """Return the output, see `Inference`."""
        given = np.ascontiguousarray(planes[np.newaxis])
        return np.asarray(self._session.run(None, {self._input: given})[0][0], np.float32)
