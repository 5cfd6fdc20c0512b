from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import resources
from importlib.util import find_spec

import numpy as np
import pytest

from rover_obstacle_detection.detection import rocks
from rover_obstacle_detection.detection.network import inference as module
from rover_obstacle_detection.detection.network.inference import (
    OnnxRuntimeInference,
    OpenCVInference,
    load_inference,
)
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES
from rover_obstacle_detection.detection.rocks.outline_model import MODEL_FILE

needs_onnx_runtime = pytest.mark.skipif(
    find_spec('onnxruntime') is None, reason='ONNX Runtime (extra fast) is not installed'
)

FORK = """
import os, signal, sys
import numpy as np
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES
from rover_obstacle_detection.detection.rocks.outline_model import outline_model

planes = np.random.default_rng(0).random((len(FEATURES), 128, 256), np.float32)
expected = outline_model().probability(planes)
child = os.fork()
if not child:
    signal.alarm(20)
    np.testing.assert_array_equal(outline_model().probability(planes), expected)
    sys.exit(7)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.fixture(scope='module')
def model() -> bytes:
    return (resources.files(rocks) / MODEL_FILE).read_bytes()


def planes(height: int, width: int, seed: int = 0) -> np.ndarray:
    shape = (len(FEATURES), height, width)
    return np.random.default_rng(seed).standard_normal(shape, np.float32)


@needs_onnx_runtime
@pytest.mark.parametrize('shape', [(16, 16), (80, 144), (256, 320)])
def test_onnx_runtime_computes_what_opencv_computes(model, shape):
    given = planes(*shape)
    expected = OpenCVInference(model).run(given)
    found = OnnxRuntimeInference(model).run(given)
    assert found.dtype == expected.dtype == np.float32
    assert np.abs(expected).max() > 1
    np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize(
    'kind', [OpenCVInference, pytest.param(OnnxRuntimeInference, marks=needs_onnx_runtime)]
)
def test_threads_may_share_it_and_results_stay(model, kind):
    inference = kind(model)
    given = [planes(64, 96, seed) for seed in range(12)]
    expected = [inference.run(each).copy() for each in given]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(inference.run, given))
    np.testing.assert_array_equal(found, expected)


@needs_onnx_runtime
def test_onnx_runtime_is_preferred(model):
    assert isinstance(load_inference(model), OnnxRuntimeInference)


def test_without_onnx_runtime_opencv_runs_the_network(model, monkeypatch):
    monkeypatch.setattr(module, 'find_spec', lambda name: None)
    assert isinstance(load_inference(model), OpenCVInference)


def test_a_broken_onnx_runtime_is_named_and_opencv_runs_the_network(
    model, tmp_path, monkeypatch, caplog
):
    broken = tmp_path / 'onnxruntime'
    broken.mkdir()
    (broken / '__init__.py').write_text("raise ImportError('DLL load failed')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, 'onnxruntime', raising=False)
    assert isinstance(load_inference(model), OpenCVInference)
    (text,) = caplog.messages
    assert text.startswith('ONNX Runtime cannot be used (DLL load failed): the networks run')


@needs_onnx_runtime
def test_onnx_runtime_sends_no_usage_data(model, monkeypatch):
    monkeypatch.delenv('ORT_DISABLE_TELEMETRY', raising=False)
    OnnxRuntimeInference(model)
    assert os.environ['ORT_DISABLE_TELEMETRY'] == '1'


@needs_onnx_runtime
@pytest.mark.parametrize(('opencv', 'expected'), [(0, 1), (1, 1), (3, 3)])
def test_onnx_runtime_uses_as_many_threads_as_opencv_may(model, monkeypatch, opencv, expected):
    monkeypatch.setattr(module.cv2, 'getNumThreads', lambda: opencv)
    options = OnnxRuntimeInference(model)._session.get_session_options()
    assert options.intra_op_num_threads == expected


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='no fork on this system')
def test_a_forked_process_loads_the_model_again():
    done = subprocess.run([sys.executable, '-c', FORK], check=True, capture_output=True, text=True)
    assert done.stdout == '7\n'
