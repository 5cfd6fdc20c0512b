"""Any camera, images and parameters, drawn by hypothesis, and what must hold for each."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from hypothesis import strategies as st

from rover_obstacle_detection import Detection, Detector, DetectorConfig, Gravity, StereoCamera
from rover_obstacle_detection.detection.config import ParameterDescription
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

FACTORY = RosbagsFactory()
MAX_WIDTH, MAX_HEIGHT = 160, 120


class Case(NamedTuple):
    """What `outcome` needs; printed by hypothesis if it fails."""

    camera: dict[str, float]
    config: dict[str, Any]
    scene: dict[str, Any]


@st.composite
def cameras(draw: st.DrawFn) -> dict[str, float]:
    width, height = draw(st.integers(14, MAX_WIDTH)), draw(st.integers(14, MAX_HEIGHT))
    # From the widest to the narrowest view that a camera may have.
    fx = max(width, height) * 10 ** draw(st.floats(-1.3, 1.9))
    offset = draw(st.one_of(st.just(0.0), st.floats(-0.51, 0.51))) * width
    centre = st.one_of(st.floats(0.3, 0.7), st.floats(-1, 2))
    cx = width * draw(centre)
    return {
        'width': width,
        'height': height,
        'fx': fx,
        'fy': fx * draw(st.one_of(st.just(1.0), st.floats(0.2, 5))),
        'cx': cx,
        'cy': height * draw(centre),
        'baseline_m': 10 ** draw(st.floats(-3, 0.47)),
        'cx_right': cx - offset,
    }


def ends(parameter: ParameterDescription) -> list[Any]:
    """Return the extreme values of a parameter."""
    if parameter.choices:
        return list(parameter.choices)
    if isinstance(parameter.default, bool):
        return [False, True]
    kind = type(parameter.default)
    low, high = parameter.minimum, parameter.maximum
    assert low is not None
    assert high is not None
    step = parameter.step
    return [kind(low), kind(low + (high - low) // step * step if step else high)]


def _value(parameter: ParameterDescription) -> st.SearchStrategy[Any]:
    low, high = parameter.minimum, parameter.maximum
    chosen = st.sampled_from(ends(parameter))
    if low is None or high is None:
        return chosen
    if isinstance(parameter.default, float):
        return st.one_of(chosen, st.floats(low, high))
    step = parameter.step or 1
    steps = st.integers(0, int(high - low) // step)
    return st.one_of(chosen, steps.map(lambda count: int(low) + count * step))


def configs() -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries(
        {}, optional={each.name: _value(each) for each in DetectorConfig.parameters()}
    )


def _few(config: dict[str, Any]) -> dict[str, Any]:
    """Keep `method` and some others, so that most parameters have their default."""
    kept = sorted(config, key=lambda name: (name != 'method', hash(str(config[name])) % 97))
    return {name: config[name] for name in kept[:4]}


@st.composite
def scenes(draw: st.DrawFn) -> dict[str, Any]:
    return {
        'kind': draw(st.sampled_from(['ground', 'noise', 'flat', 'blocks', 'one side', 'wall'])),
        'seed': draw(st.integers(0, 1000)),
        'depth_m': 10 ** draw(st.floats(-1, 1.5)),
        'contrast': draw(st.sampled_from([1.0, 0.2, 0.02])),
        'noise': draw(st.sampled_from([0.0, 3.0, 30.0])),
        'dtype': draw(st.sampled_from(['uint8', 'uint16'])),
        'channels': draw(st.sampled_from([1, 3])),
        'pitch_deg': draw(st.one_of(st.none(), st.floats(-90, 90))),
        'rover': draw(st.sampled_from([None, 0.3, 1.0])),
    }


def cases() -> st.SearchStrategy[Case]:
    return st.builds(Case, cameras(), st.one_of(configs().map(_few), configs()), scenes())


def plain_case(config: dict[str, Any]) -> Case:
    """Return an ordinary view with the given parameters."""
    camera = {'width': 128, 'height': 96, 'fx': 110.0, 'fy': 110.0, 'cx': 63.5, 'cy': 47.5}
    scene = {'kind': 'ground', 'seed': 1, 'depth_m': 0.8, 'contrast': 1.0, 'noise': 1.0}
    plain = {'dtype': 'uint8', 'channels': 1, 'pitch_deg': None, 'rover': None}
    return Case({**camera, 'baseline_m': 0.1}, config, {**scene, **plain})


def pair(camera: StereoCamera, scene: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(scene['seed'])
    height, width = camera.shape
    texture = rng.integers(0, 256, (height, 2 * width), np.uint8)
    if scene['kind'] == 'blocks':
        texture = np.repeat(np.repeat(texture[::8, ::8], 8, 0), 8, 1)[:height, : 2 * width]
    elif scene['kind'] == 'flat':
        texture[:] = 90
    elif scene['kind'] != 'noise':
        texture = cv2.GaussianBlur(texture, (0, 0), 1.5)
    depth = np.full((height, 1), scene['depth_m'])
    if scene['kind'] == 'ground':
        depth = scene['depth_m'] / np.linspace(0.05, 1, height)[:, np.newaxis]
    disparity = np.clip(camera.disparity_at(1) / depth + camera.disparity_offset, -width, width)
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    left = texture[:, width // 2 : width // 2 + width]
    right = cv2.remap(
        texture,
        (columns + width // 2 + disparity).astype(np.float32),
        rows.astype(np.float32),
        cv2.INTER_LINEAR,
    )
    if scene['kind'] == 'one side':
        right = np.zeros_like(left)
    return _exposed(left, scene, rng), _exposed(right, scene, rng)


def _exposed(image: np.ndarray, scene: dict[str, Any], rng: np.random.Generator) -> np.ndarray:
    grey = 128 + scene['contrast'] * (image.astype(np.float64) - 128)
    grey = np.clip(grey + rng.normal(0, 1, image.shape) * scene['noise'], 0, 255)
    exposed = grey * 257 if scene['dtype'] == 'uint16' else grey
    exposed = exposed.astype(scene['dtype'])
    return np.dstack([exposed] * 3) if scene['channels'] == 3 else exposed


def outcome(case: Case) -> str:
    """Run the detector; return the name of a known error, or 'judged' for a valid detection.

    Anything else, and any Python warning that the caller turns into an error, is a failure.
    """
    try:
        camera = StereoCamera(**case.camera)
        config = DetectorConfig(**case.config)
        rover = None
        if case.scene['rover']:
            rover = np.zeros(camera.shape, bool)
            rover[-math.ceil(case.scene['rover'] * camera.height) :] = True
        gravity = None
        if case.scene['pitch_deg'] is not None:
            gravity = Gravity.from_angles(case.scene['pitch_deg'])
        left, right = pair(camera, case.scene)
        detection = Detector(camera, config, rover).detect(left, right, gravity=gravity)
    except ObstacleDetectionError as error:
        known = error
    else:
        check(detection, rover)
        return 'judged'
    assert len(str(known).splitlines()) == 1
    return type(known).__name__


def check(detection: Detection, rover: np.ndarray | None) -> None:
    """Assert that a detection is well-formed and agrees with itself."""
    shape = detection.camera.shape
    mask, known, disparity = detection.mask, detection.known, detection.disparity
    for array, dtype in ((mask, np.uint8), (known, np.bool_), (disparity, np.float32)):
        assert array.shape == shape
        assert array.dtype == dtype
    obstacle = mask == 255
    assert np.isin(mask, (0, 255)).all()
    assert known[obstacle].all()
    assert np.isfinite(disparity).all()
    assert (disparity >= 0).all()
    # What was not measured is never free.
    assert (disparity[known & ~obstacle] > 0).all()
    if rover is not None:
        assert not obstacle[rover].any()
        assert not known[rover].any()
    assert np.isfinite(detection.obstacle_points).all()
    assert np.isfinite(detection.ground_points).all()
    assert len(detection.ground_points) <= np.count_nonzero(known & ~obstacle)
    assert len(detection.obstacle_points) <= np.count_nonzero(obstacle)
    assert sum(each.pixels for each in detection.obstacles) == np.count_nonzero(obstacle)
    for each in detection.obstacles:
        assert 0 <= each.confidence <= 1
        assert 0 <= each.left < each.left + each.width <= shape[1]
        assert 0 <= each.top < each.top + each.height <= shape[0]
    assert all(isinstance(each, str) and each for each in detection.warnings)
    header = make_header(1, 'left', FACTORY)
    for output in OUTPUTS.values():
        message = output.encode(detection, header, FACTORY)
        assert len(FACTORY.typestore.serialize_cdr(message, output.type_name))
