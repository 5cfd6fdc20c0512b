"""The trained network as the ONNX file that the package reads."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx
import torch
from google.protobuf.message import DecodeError

from outline_training.crops import CROP_PX
from outline_training.network import OutlineNet
from outline_training.train import pixel_logits
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES, FEATURES_VERSION
from rover_obstacle_detection.detection.rocks.outline_model import VERSION_KEY, OutlineModel
from rover_obstacle_detection.errors import ModelError

# OpenCV 4.8 reads it.
_OPSET = 13
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
    try:
        graph = onnx.load(str(path)).graph
        # PyTorch does not take arrays that cannot be written.
        weights = {
            each.name: torch.from_numpy(onnx.numpy_helper.to_array(each).copy())
            for each in graph.initializer
        }
        net.load_state_dict(weights)
    except (DecodeError, RuntimeError) as error:
        msg = f'{path}: not a network that this script has trained ({error})'
        raise ModelError(msg) from error
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
    path = path.resolve()
    with TemporaryDirectory(prefix='.outline-model-', dir=path.parent) as folder:
        written = Path(folder) / path.name
        written.write_bytes(onnx_model(net))
        model = OutlineModel(written.read_bytes())
        check_agreement(model, net)
        written.replace(path)
    return model


def onnx_model(net: OutlineNet) -> bytes:
    """Serialise the network for images of any size that is a multiple of sixteen."""
    exported = io.BytesIO()
    with warnings.catch_warnings():
        # The newer exporter writes operators that OpenCV 4.8 does not know.
        warnings.filterwarnings('ignore', category=DeprecationWarning)
        torch.onnx.export(
            net,
            (torch.zeros(1, len(FEATURES), CROP_PX, CROP_PX),),
            exported,
            input_names=['features'],
            output_names=['logits'],
            dynamic_axes={
                'features': {2: 'height', 3: 'width'},
                'logits': {2: 'half_height', 3: 'half_width'},
            },
            opset_version=_OPSET,
            dynamo=False,
        )
    model = onnx.load_model_from_string(exported.getvalue())
    onnx.helper.set_model_props(model, {VERSION_KEY: FEATURES_VERSION})
    return model.SerializeToString()


def check_agreement(model: OutlineModel, net: OutlineNet) -> None:
    """Compare what OpenCV and PyTorch compute for random features.

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
