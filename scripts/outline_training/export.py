"""The trained network as the ONNX file that the package reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from onnx_export import read_weights, serialised, write_checked

from outline_training.crops import CROP_PX
from outline_training.network import OutlineNet
from outline_training.train import pixel_logits
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel
from rover_obstacle_detection.errors import ModelError

_MAX_DIFFERENCE = 1e-3
_CHECKED_SHAPES = ((CROP_PX, CROP_PX), (80, 144))
"""The second shows that the file takes other sizes than the one it was exported with."""


def read_network(path: Path) -> OutlineNet:
    """Read a network that `write_model` has written.

    Raises
    ------
    ModelError
        If the file holds another network.
    """
    net = OutlineNet()
    read_weights(net, path)
    return net


def write_model(net: OutlineNet, path: Path) -> OutlineModel:
    """Write the network as ONNX, check the written file, and move it into place.

    Returns
    -------
    OutlineModel
        As loaded from the file.

    Raises
    ------
    ModelError
        If the file does not load, or computes something else than the network. What was at `path`
        stays.
    """

    def checked(data: bytes) -> OutlineModel:
        model = OutlineModel(data)
        check_agreement(model, net)
        return model

    return write_checked(onnx_model(net), path, checked)


def onnx_model(net: OutlineNet) -> bytes:
    """Serialise the network for images of any size that is a multiple of sixteen."""
    return serialised(net, len(FEATURES), FEATURES_VERSION)


def check_agreement(model: OutlineModel, net: OutlineNet) -> None:
    """Compare what the package and PyTorch compute for random features.

    Raises
    ------
    ModelError
        If a probability differs by more than 0.001.
    """
    generator = np.random.default_rng(0)
    for shape in _CHECKED_SHAPES:
        features = generator.standard_normal((len(FEATURES), *shape), np.float32)
        with torch.no_grad():
            expected = torch.sigmoid(pixel_logits(net, torch.from_numpy(features)[None]))[0]
        difference = np.abs(model.probability(features) - expected.numpy()).max()
        if not difference <= _MAX_DIFFERENCE:
            msg = (
                f'the exported model differs from the trained network by {difference:.2g}: '
                f'expected at most {_MAX_DIFFERENCE:g}'
            )
            raise ModelError(msg)
