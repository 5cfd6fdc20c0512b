"""The trained network as the ONNX file that the package reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from onnx_export import serialised, write_checked

from hazard_training.network import HazardNet, cell_logits
from hazard_training.train import CROP_CELLS
from rover_obstacle_detection.detection.terrain.cell_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.terrain.hazard_model import HazardModel
from rover_obstacle_detection.errors import ModelError

_MAX_DIFFERENCE = 1e-3
_CHECKED_SHAPES = ((CROP_CELLS, CROP_CELLS), (80, 144))


def write_model(net: HazardNet, path: Path) -> HazardModel:
    """Write the network as ONNX, check the written file, and move it into place.

    Raises
    ------
    ModelError
        If the file does not load, or computes something else than the network. What was at `path`
        stays.
    """

    def checked(data: bytes) -> HazardModel:
        model = HazardModel(data)
        check_agreement(model, net)
        return model

    return write_checked(serialised(net, len(FEATURES), FEATURES_VERSION), path, checked)


def check_agreement(model: HazardModel, net: HazardNet) -> None:
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
            expected = torch.softmax(cell_logits(net, torch.from_numpy(features)[None])[0], 0)
        found = np.stack(model.probability(features))
        difference = np.abs(found - expected[: len(found)].numpy()).max()
        if not difference <= _MAX_DIFFERENCE:
            msg = (
                f'the exported model differs from the trained network by {difference:.2g}: '
                f'expected at most {_MAX_DIFFERENCE:g}'
            )
            raise ModelError(msg)
