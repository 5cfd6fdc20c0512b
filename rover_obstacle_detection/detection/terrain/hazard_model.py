"""The network that judges the ground: free, too steep, or dropping away."""

from __future__ import annotations

from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.network.pixel_network import PixelNetwork, loaded_once
from rover_obstacle_detection.detection.terrain.cell_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.terrain.elevation_map import Grid

MODEL_FILE = 'hazard_model.onnx'

CLASSES = ('slope', 'drop', 'free')
"""What the network tells apart, in the order of its outputs."""


class HazardProbability(NamedTuple):
    """How likely the ground is too steep or drops away.

    Parameters
    ----------
    slope, drop : ndarray of float32
    """

    slope: Grid
    drop: Grid


class HazardModel:
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
    U-shaped (Ronneberger et al. 2015), with the cells of a map as its pixels. Its inputs,
    `FEATURES`, are relative to the rover's limits. ``scripts/train_hazards.py`` trains one.
    """

    def __init__(self, data: bytes | None = None) -> None:
        if data is None:
            data = (resources.files(__package__) / MODEL_FILE).read_bytes()
        self._network = PixelNetwork(
            data,
            outputs=len(CLASSES),
            version=FEATURES_VERSION,
            name='hazard',
            script='scripts/train_hazards.py',
            padding='constant',
        )

    def probability(self, features: NDArray[np.float32]) -> HazardProbability:
        """Return how likely each cell is a hazard.

        Parameters
        ----------
        features : ndarray of float32, shape (features, rows, columns)

        Returns
        -------
        HazardProbability
            Shape (rows, columns). With the probability of free ground, both add up to 1.
        """
        assert features.shape[0] == len(FEATURES)
        logits = self._network.values(features)
        logits -= logits.max(axis=0)
        odds = np.exp(logits, out=logits)
        slope, drop, _free = odds / odds.sum(axis=0)
        return HazardProbability(slope, drop)


@loaded_once
def hazard_model() -> HazardModel:
    """Load the model that comes with the package, once."""
    return HazardModel()
