"""``replay`` with the calibration of files and of numbers, and what it rectifies."""

import numpy as np
import pytest
from hand_made import (
    CAMERA,
    stereo_images,
    write_calibration,
    write_side_by_side_bag,
    write_stereo_bag,
)
from replay_outputs import TYPES, detections_of, summary_of

from rover_obstacle_detection.cli.main import main


def test_topics_and_calibration_files_can_be_given(tmp_path):
    bag = write_stereo_bag(tmp_path / 'bare', pairs=1, infos=False)
    left, right = write_calibration(tmp_path)
    arguments = ['--left-topic', '/cam/left/image_rect', '--right-topic', '/cam/right/image_rect']
    arguments += ['--left-info', str(left), '--right-info', str(right)]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *arguments]) == 0
    assert summary_of(tmp_path / 'out')['counts']['detected'] == 1


def test_numbers_calibrate_a_recording_without_camera_info(tmp_path, bag, replayed, capsys):
    bare = write_stereo_bag(tmp_path / 'bare', pairs=1, infos=False)
    arguments = ['replay', str(bare), '-o', str(tmp_path / 'out')]
    assert main([*arguments, '--fx', str(CAMERA.fx)]) == 1
    error = capsys.readouterr().err
    assert f'{bare}: the calibration lacks baseline: expected' in error
    assert 'no camera_info topic' in error
    numbers = [f'--{each}={getattr(CAMERA, each)}' for each in ('fx', 'fy', 'cx', 'cy')]
    assert main([*arguments, *numbers, f'--baseline={CAMERA.baseline_m}']) == 0
    same, as_before = summary_of(tmp_path / 'out'), summary_of(replayed[1])
    assert same['cameras'] == [pytest.approx(as_before['cameras'][0])]
    assert same['frames'][0]['obstacle_share'] == as_before['frames'][0]['obstacle_share']


def test_both_views_may_be_side_by_side(tmp_path, replayed, capsys):
    path = write_side_by_side_bag(tmp_path / 'wide', [stereo_images()] * 2)
    arguments = ['replay', str(path), '-o', str(tmp_path / 'out'), '--side-by-side']
    assert main([*arguments, '--left-topic', '/zed/none']) == 1
    assert 'no topic /zed/none' in capsys.readouterr().err
    arguments += ['--left-topic', '/zed/image_rect', '--approximate-sync', '0.01']
    assert main(arguments) == 1
    assert 'no calibration for /zed/image_rect' in capsys.readouterr().err
    numbers = [f'--{each}={getattr(CAMERA, each)}' for each in ('fx', 'fy', 'cx', 'cy')]
    assert main([*arguments, *numbers, f'--baseline={CAMERA.baseline_m}']) == 0
    same, as_before = summary_of(tmp_path / 'out'), summary_of(replayed[1])
    assert same['cameras'] == [pytest.approx(as_before['cameras'][0])]
    shares = [frame['obstacle_share'] for frame in same['frames']]
    assert shares == [as_before['frames'][0]['obstacle_share']] * 2
    topics = {topic for topic, *_ in detections_of(tmp_path / 'out')}
    assert topics == {topic.replace('/cam/', '/zed/') for topic in TYPES}


def test_a_number_replaces_that_of_the_recording(tmp_path, bag):
    arguments = ['--duration', '0.05', '--baseline', '0.13']
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *arguments]) == 0
    summary = summary_of(tmp_path / 'out')
    (camera,) = summary['cameras']
    topics = '/cam/left/camera_info and /cam/right/camera_info'
    assert summary['calibration'] == f'--baseline 0.13, {topics}'
    assert (camera['fx'], camera['baseline_m']) == pytest.approx((CAMERA.fx, 0.13))


def test_a_wrong_focal_length_of_raw_images_is_corrected(tmp_path):
    def change(side, info):
        info.k[0] = info.k[4] = info.p[0] = info.p[5] = 0.75 * CAMERA.fx
        info.p[3] *= 0.75

    raw = write_stereo_bag(tmp_path / 'raw', pairs=1, name='image_raw', change_info=change)
    numbers = [f'--fx={CAMERA.fx}', f'--baseline={CAMERA.baseline_m}']
    heights = []
    for options in (numbers[:1], numbers):
        assert main(['replay', str(raw), '-o', str(tmp_path / 'out'), '--force', *options]) == 0
        heights.append(summary_of(tmp_path / 'out')['frames'][0]['camera_height_m'])
    assert heights[0] == pytest.approx(heights[1])


@pytest.mark.parametrize(
    ('name', 'rectify', 'rectifies'),
    [
        ('image_raw', 'by_name', True),
        ('image_raw', 'never', False),
        ('image_rect', 'by_name', False),
        ('image_rect', 'always', True),
    ],
)
def test_which_images_are_rectified_can_be_said(tmp_path, capsys, name, rectify, rectifies):
    def change(side, info):
        info.distortion_model = 'plumb_bob'
        info.d = np.array([-0.2, 0.05, 0, 0, 0], np.float64)

    bag = write_stereo_bag(tmp_path / 'bag', pairs=1, name=name, change_info=change)
    out = str(tmp_path / 'out')
    assert main(['replay', str(bag), '-o', out, '--rectify', rectify]) == 0
    assert ('are raw images: rectifying them' in capsys.readouterr().err) == rectifies


@pytest.mark.parametrize(
    ('name', 'changed', 'options', 'warns'),
    [
        ('image_raw', {'d': -0.2}, ['fx', 'baseline'], True),
        ('image_raw', {'d': -0.2}, ['baseline'], False),
        ('image_raw', {}, ['fx', 'baseline'], False),
        ('image_raw', {'d': 0, 'k': 0, 'r': 0, 'p': 0}, ['fx', 'baseline'], False),
        ('image_rect', {'d': -0.2}, ['fx', 'baseline'], False),
    ],
)
def test_numbers_that_replace_a_distortion_are_a_warning(
    tmp_path, capsys, name, changed, options, warns
):
    def change(side, info):
        for matrix, value in changed.items():
            if matrix == 'd':
                info.d = np.array([value, 0, 0, 0, 0], np.float64)
            else:
                getattr(info, matrix)[:] = value

    bag = write_stereo_bag(tmp_path / 'bag', pairs=1, name=name, change_info=change)
    numbers = {'fx': CAMERA.fx, 'baseline': CAMERA.baseline_m}
    arguments = [f'--{each}={numbers[each]}' for each in options]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *arguments]) == 0
    warning = (
        'a lens distortion or rotation is in /cam/left/camera_info and /cam/right/camera_info, '
        f'which --fx {CAMERA.fx:g} --baseline {CAMERA.baseline_m:g} replaces: the images are taken'
    )
    assert (warning in capsys.readouterr().err) == warns
