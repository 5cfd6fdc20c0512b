"""``inspect --side-by-side``: one topic whose images show both views."""

import json
import shlex

import pytest
from hand_made import CAMERA, SCENE, write_side_by_side_bag
from synthetic import render

from rover_obstacle_detection.cli.main import main

TOPIC = '/zed/image_rect'
SIDE_BY_SIDE = ['--side-by-side', '--left-topic', TOPIC]
NUMBERS = [f'--fx={CAMERA.fx}', f'--baseline={CAMERA.baseline_m}']


@pytest.fixture(scope='module')
def views():
    rendered = [render(SCENE.with_(pitch_deg=46.0 + turn)) for turn in range(2)]
    return [(view.left, view.right) for view in rendered]


@pytest.fixture(scope='module')
def bag(views, tmp_path_factory):
    return write_side_by_side_bag(tmp_path_factory.mktemp('inspected') / 'wide', views)


def as_json(capsys, *arguments, status=0):
    assert main(['inspect', '--json', *map(str, arguments)]) == status
    (found,) = json.loads(capsys.readouterr().out)
    (camera,) = found['cameras']
    return camera


def test_both_views_are_measured(bag, capsys):
    camera = as_json(capsys, bag, *SIDE_BY_SIDE, *NUMBERS)
    assert camera['topics']['left_image'] == camera['topics']['right_image'] == TOPIC
    assert camera['left']['sizes'] == [f'{2 * CAMERA.width} x {CAMERA.height}']
    assert camera['synchronisation']['pairs'] == camera['sample']['pairs'] == 2
    assert len(camera['sample']['geometry']) == 2
    assert not any(each['swapped'] for each in camera['sample']['geometry'])
    assert not camera['missing']


def test_the_printed_command_replays_it(bag, tmp_path, capsys, monkeypatch):
    camera = as_json(capsys, bag, *SIDE_BY_SIDE, *NUMBERS)
    command = shlex.split(camera['command'])
    assert command[-7:-4] == SIDE_BY_SIDE
    monkeypatch.chdir(tmp_path)
    assert main(command[1:]) == 0
    summary = json.loads((tmp_path / 'wide_detections' / 'summary.json').read_text())
    assert summary['counts']['detected'] == 2


def test_the_topic_is_described_once(bag, capsys):
    assert main(['inspect', str(bag), *SIDE_BY_SIDE, *NUMBERS]) == 0
    text = ' '.join(capsys.readouterr().out.split())
    assert f'stereo camera /zed both {TOPIC} Image mono8 640 x 240, 2 images' in text
    assert 'synchronised both views in one image, 2 pairs' in text


def test_a_calibration_is_asked_for(bag, capsys):
    camera = as_json(capsys, bag, *SIDE_BY_SIDE, status=1)
    (missing,) = camera['missing']
    assert missing.startswith(f'no calibration for {TOPIC} (no camera_info topic): expected')
    assert '--side-by-side --left-topic /zed/image_rect --left-info LEFT.yaml' in camera['command']


def test_an_image_that_cannot_be_halved_is_named_once(views, tmp_path, capsys):
    def spoil(index, message):
        if index == 1:
            message.width -= 1
            message.step = message.width
            message.data = message.data[: message.step * message.height]

    bag = write_side_by_side_bag(tmp_path / 'wide', views, change_image=spoil)
    camera = as_json(capsys, bag, *SIDE_BY_SIDE, *NUMBERS)
    odd = f'{TOPIC}: width is 639: expected an even number for two views side by side'
    assert f'1 sampled pair cannot be used: {odd}' in camera['warnings']
    assert sum('changes size' in each for each in camera['warnings']) == 1


@pytest.mark.parametrize('topics', [[], ['--left-topic', TOPIC, '--right-topic', '/other']])
def test_the_one_topic_has_to_be_given(bag, capsys, topics):
    with pytest.raises(SystemExit) as raised:
        main(['inspect', str(bag), '--side-by-side', *topics])
    assert raised.value.code == 2
    assert 'expected --left-topic with both views, and no --right-topic' in capsys.readouterr().err
