"""The network that outlines obstacles."""

from __future__ import annotations

from importlib import resources

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.network.pixel_network import PixelNetwork, loaded_once
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES, FEATURES_VERSION

MODEL_FILE = 'outline_model.onnx'


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
    no units. ``scripts/train_outlines.py`` trains one.
    """

    def __init__(self, data: bytes | None = None) -> None:
        if data is None:
            data = (resources.files(__package__) / MODEL_FILE).read_bytes()
        self._network = PixelNetwork(
            data,
            outputs=1,
            version=FEATURES_VERSION,
            name='outline',
            script='scripts/train_outlines.py',
        )

    @property
    def is_fast(self) -> bool:
        """Whether ONNX Runtime runs it."""
        return self._network.is_fast

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
        logit = self._network.values(features)[0]
        # The logistic function, in a form that does not overflow.
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * logit), np.float32)


@loaded_once
def outline_model() -> OutlineModel:
    """Load the model that comes with the package, once."""
    return OutlineModel()
