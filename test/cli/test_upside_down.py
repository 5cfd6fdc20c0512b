"""Recordings and image files of a camera that is mounted upside down."""

from __future__ import annotations

import json
import shlex

import cv2
import degrade
import numpy as np
import pytest
from hand_made import CAMERA, stereo_images, write_stereo_bag

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.evaluation.methods.registry import make_method
from rover_obstacle_detection.messages.image import decode_image

LEFT, RIGHT = stereo_images()
# What the camera's own left lens sees is what the right one sees of an upright camera.
TURNED = degrade.upside_down(LEFT, RIGHT)
SET = ('--set', 'upside_down=true')


def mask_of_the_right_image():
    """The original pair judged in its right image, for which it is seen in a mirror."""
    mirrored = (np.ascontiguousarray(image[:, ::-1]) for image in (RIGHT, LEFT))
    return Detector(CAMERA).detect(*mirrored).mask[:, ::-1]


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('turned') / 'bag'
    return write_stereo_bag(path, pairs=2, images=[TURNED])


def test_inspect_prints_the_command_that_replays_it(bag, tmp_path, capsys, monkeypatch):
    assert main(['inspect', '--json', str(bag)]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    (camera,) = found['cameras']
    assert not camera['missing']
    warnings = ' '.join(camera['warnings'])
    assert 'the camera is taken for one that is mounted upside down' in warnings
    command = shlex.split(camera['command'])
    assert tuple(command[-2:]) == SET
    monkeypatch.chdir(tmp_path)
    assert main(command[1:]) == 0
    summary = json.loads((tmp_path / 'bag_detections' / 'summary.json').read_text())
    assert summary['parameters']['upside_down'] is True
    assert summary['counts']['detected'] == 2


def test_a_single_turned_pair_does_not_turn_the_camera(tmp_path, capsys):
    images = [TURNED, (LEFT, RIGHT), (LEFT, RIGHT)]
    bag = write_stereo_bag(tmp_path / 'bag', pairs=3, images=images)
    assert main(['inspect', '--json', str(bag)]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    (camera,) = found['cameras']
    assert [each['upside_down'] for each in camera['sample']['geometry']] == [True, False, False]
    assert 'upside_down' not in camera['command']


def test_turned_recording_has_the_turned_mask(bag, tmp_path):
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *SET]) == 0

    with open_bag(tmp_path / 'out' / 'detections') as detections:
        messages = [message for _, _, message in detections.messages(['/cam/obstacle_mask'])]
    assert len(messages) == 2
    for message in messages:
        assert message.header.frame_id == 'left_optical'
        mask = decode_image(message, 'mask')
        np.testing.assert_array_equal(mask, mask_of_the_right_image()[::-1, ::-1])
    frame = json.loads((tmp_path / 'out' / 'summary.json').read_text())['frames'][0]
    assert frame['camera_pitch_deg'] == pytest.approx(46.0, abs=2.0)
    assert frame['obstacles'] == 1


def test_turned_image_files_have_the_same_mask(tmp_path):
    paths = [str(tmp_path / f'{side}.png') for side in ('left', 'right')]
    for path, image in zip(paths, TURNED, strict=True):
        cv2.imwrite(path, image)
    numbers = ['--fx', str(CAMERA.fx), '--baseline', str(CAMERA.baseline_m)]
    assert main(['detect', *paths, *numbers, '-o', str(tmp_path / 'out'), *SET]) == 0

    mask = cv2.imread(str(tmp_path / 'out' / 'mask.png'), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(mask, mask_of_the_right_image()[::-1, ::-1])


def test_without_the_parameter_the_refusal_names_it(bag, tmp_path, capsys):
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 1
    assert 'Then set upside_down to true' in capsys.readouterr().err


@pytest.mark.parametrize('name', ['hybrid', 'study', 'depth_only', 'image_only'])
def test_every_evaluated_method_judges_the_upright_view(name):
    rows = [np.ascontiguousarray(image[::-1]) for image in (LEFT, RIGHT)]
    expected = make_method(name)(CAMERA, LEFT, RIGHT)
    method = make_method(name, DetectorConfig(upside_down=True))

    assert expected.any()
    np.testing.assert_array_equal(method(CAMERA.mirrored(), *rows), expected[::-1])
