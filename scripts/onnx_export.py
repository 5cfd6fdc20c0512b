"""PyTorch networks as the ONNX files that the package reads."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import onnx
import torch
from google.protobuf.message import DecodeError
from torch import nn

from rover_obstacle_detection.detection.network.pixel_network import VERSION_KEY
from rover_obstacle_detection.errors import ModelError

Model = TypeVar('Model')

# OpenCV 4.8 reads it.
_OPSET = 13
_SIDE_PX = 160


def read_weights(net: nn.Module, path: Path) -> None:
    """Give a network the weights of a file that `write_checked` has written.

    Raises
    ------
    ModelError
        If the file holds another network.
    """
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


def write_checked(data: bytes, path: Path, checked: Callable[[bytes], Model]) -> Model:
    """Write an ONNX file, check what was written, and move it into place.

    Parameters
    ----------
    data : bytes
    path : Path
    checked : callable
        Loads the model from the content of the written file, or raises `ModelError`.

    Returns
    -------
    Model
        As loaded from the file.

    Raises
    ------
    ModelError
        If the file does not pass. What was at `path` stays.
    """
    path = path.resolve()
    with TemporaryDirectory(prefix='.model-', dir=path.parent) as folder:
        written = Path(folder) / path.name
        written.write_bytes(data)
        model = checked(written.read_bytes())
        written.replace(path)
    return model


def serialised(net: nn.Module, features: int, version: str) -> bytes:
    """Serialise a network for inputs of any size that is a multiple of sixteen.

    Parameters
    ----------
    net : Module
        Halves the resolution: it returns the values of each square of pixels together.
    features : int
        Number of its input planes.
    version : str
        Of the features.
    """
    exported = io.BytesIO()
    with warnings.catch_warnings():
        # The newer exporter writes operators that OpenCV 4.8 does not know.
        warnings.filterwarnings('ignore', category=DeprecationWarning)
        torch.onnx.export(
            net,
            (torch.zeros(1, features, _SIDE_PX, _SIDE_PX),),
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
    onnx.helper.set_model_props(model, {VERSION_KEY: version})
    return model.SerializeToString()
