"""The labelled bag ``bags/mars_yard`` and the script that creates it."""

import importlib.util
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import read_pairs
from rover_obstacle_detection.messages.image import decode_float_image, decode_image

ROOT = Path(__file__).parents[2]
BAG = ROOT / 'bags' / 'mars_yard'
SAMPLES = ROOT.parent / 'shared' / 'samples'
TRUTH = ('/truth/labels', '/truth/instances', '/truth/depth')


@pytest.fixture(scope='module')
def script():
    path = ROOT / 'scripts' / 'make_sample_bag.py'
    specification = importlib.util.spec_from_file_location('make_sample_bag', path)
    module = importlib.util.module_from_spec(specification)
    sys.modules['make_sample_bag'] = module
    specification.loader.exec_module(module)
    return module


def _frames(path):
    with open_bag(path) as bag:
        return list(read_pairs(bag, bag.stereo_topics(), extra_topics=TRUTH))


@pytest.fixture(scope='module')
def frames():
    return _frames(BAG)


def test_the_recordings_are_small():
    total = sum(path.stat().st_size for path in (ROOT / 'bags').rglob('*') if path.is_file())
    assert total < 12e6


def test_the_bag_has_three_labelled_pairs(frames):
    assert len(frames) == 3
    for frame in frames:
        assert set(frame.extras) == set(TRUTH)
        assert frame.frame_id == 'stereo_left_optical_frame'
        assert frame.left.shape == frame.camera.shape == (768, 1024)
        assert frame.camera.baseline_m == pytest.approx(0.06)


def test_labels_agree_with_instances(frames):
    for frame in frames:
        labels = decode_image(frame.extras['/truth/labels'], 'labels')
        instances = decode_image(frame.extras['/truth/instances'], 'instances')
        assert set(np.unique(labels)) <= {0, 1, 2, 3, 255}
        rocks = set(np.unique(instances[labels == 1]))
        assert rocks
        assert 0 not in rocks
        # Each rock is either labelled or excluded as a whole.
        assert not rocks & set(np.unique(instances[labels == 255]))
    assert {2, 3} <= set(np.unique(labels)), 'the crater has slopes and a drop'


def test_ground_truth_depth_aligns_the_two_images(frames):
    for frame in frames:
        depth = decode_float_image(frame.extras['/truth/depth'], 'depth')
        camera = frame.camera
        columns, rows = np.meshgrid(
            np.arange(camera.width, dtype=np.float32), np.arange(camera.height, dtype=np.float32)
        )
        shift = (camera.fx * camera.baseline_m / depth).astype(np.float32)

        def error(offset, frame=frame, columns=columns, rows=rows, shift=shift):
            seen = cv2.remap(frame.right, columns - shift + offset, rows, cv2.INTER_LINEAR)
            difference = seen[:, 100:].astype(float) - frame.left[:, 100:]
            return np.median(np.abs(difference))

        # The vertex of a parabola through three errors is the best alignment.
        before, here, after = error(-1), error(0), error(1)
        best = (before - after) / (2 * (before - 2 * here + after))
        assert best == pytest.approx(0, abs=0.1)


UP = np.array((0, -1, 0), np.float32)


def _block_on_flat_ground(top_m):
    """Return flat ground 1 m below the camera with a rock of 10 x 10 pixels in the middle."""
    points = np.zeros((80, 80, 3), np.float32)
    points[..., 0], points[..., 2] = np.meshgrid(np.linspace(-1, 1, 80), np.linspace(3, 1, 80))
    points[..., 1] = 1.0
    instances = np.zeros((80, 80), np.uint16)
    instances[35:45, 35:45] = 1
    points[instances == 1, 1] = 1.0 - top_m
    return instances, points


@pytest.mark.parametrize('top_m', [0.05, 0.3])
def test_visible_height_is_relative_to_the_surrounding_ground(script, top_m):
    instances, points = _block_on_flat_ground(top_m)
    measured_m = script.visible_height_m(instances, 1, points, UP)
    assert measured_m == pytest.approx(top_m, abs=1e-4)


def test_rocks_within_a_fifth_of_the_clearance_are_not_counted(script):
    instances = np.arange(6, dtype=np.uint16).reshape(1, 6)
    instances = np.pad(instances, 1)
    heights_m = np.array([0, 0.07, 0.08, 0.10, 0.12, 0.13])
    labels = np.where(heights_m[instances] > 0.1, 1, 0).astype(np.uint8)
    points = np.ones((*instances.shape, 3), np.float32)
    final = script.final_labels(labels, instances, points, UP, heights_m, 0.10)
    assert final[1, 1:-1].tolist() == [0, 0, 255, 255, 255, 1]


def test_an_ambiguous_rock_on_a_slope_remains_slope(script):
    instances = np.pad(np.ones((1, 2), np.uint16), 1)
    labels = np.pad(np.array([[2, 0]], np.uint8), 1)
    points = np.ones((*instances.shape, 3), np.float32)
    final = script.final_labels(labels, instances, points, UP, np.array([0, 0.1]), 0.10)
    assert final[1, 1:-1].tolist() == [2, 255]


@pytest.mark.parametrize(('top_m', 'label'), [(0.05, 255), (0.115, 255), (0.13, 1)])
def test_a_rock_cut_by_the_frame_is_judged_by_its_visible_part(script, top_m, label):
    instances, points = (each[:40] for each in _block_on_flat_ground(top_m))
    labels = instances.astype(np.uint8)
    heights_m = np.array([0, 0.3])
    final = script.final_labels(labels, instances, points, UP, heights_m, 0.10)
    assert set(final[instances == 1]) == {label}


@pytest.mark.skipif(not SAMPLES.exists(), reason='needs the rendered scenes')
def test_the_script_reproduces_the_bag(script, frames, tmp_path):
    scenes = [script.load_scene(SAMPLES / name) for name in script.SCENES]
    script.write_bag(scenes, tmp_path / 'mars_yard')
    for old, new in zip(frames, _frames(tmp_path / 'mars_yard'), strict=True):
        assert old.stamp_ns == new.stamp_ns
        assert old.camera == new.camera
        assert np.array_equal(old.left, new.left)
        assert np.array_equal(old.right, new.right)
        for topic in TRUTH:
            assert old.extras[topic].data.tobytes() == new.extras[topic].data.tobytes()
