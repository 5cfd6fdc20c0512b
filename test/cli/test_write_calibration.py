import json

import cv2
import numpy as np
import pytest
from hand_made import CAMERA, SCENE, write_stereo_bag
from synthetic import render

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.messages.calibration import (
    load_camera_info,
    load_stereo_calibration,
)
from rover_obstacle_detection.messages.rectification import StereoRectification

PITCHES_DEG = (40.0, 44.0, 48.0)


def moved(image, rows, turn_deg):
    """Move an image down and turn it clockwise about its centre."""
    turn = np.radians(turn_deg)
    centre = np.array([CAMERA.cx, CAMERA.cy])
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shift = centre - matrix @ centre + (0, rows)
    size = CAMERA.width, CAMERA.height
    return cv2.warpAffine(
        image, np.column_stack([matrix, shift]), size, borderMode=cv2.BORDER_REPLICATE
    )


def views(*faults):
    """Pairs whose right images are moved by rows and turned by degrees."""
    rendered = [render(SCENE.with_(pitch_deg=pitch)) for pitch in PITCHES_DEG]
    return [
        (view.left, moved(view.right, *fault))
        for view, fault in zip(rendered, faults, strict=True)
    ]


def write(tmp_path, faults, name='image_raw', **options):
    return write_stereo_bag(tmp_path / 'drive', images=views(*faults), name=name, **options)


def run(bag, folder, *options, status=0):
    assert main(['inspect', str(bag), '--write-calibration', str(folder), *options]) == status


@pytest.mark.parametrize(
    ('name', 'fault'),
    [
        ('image_raw', (1.4, 0.0)),
        ('image_raw', (0.0, -0.6)),
        ('image_raw', (7.0, 0.2)),
        ('image_rect', (-0.8, 0.5)),
        ('image_rect', (7.0, 0.2)),
    ],
)
def test_rows_agree_with_the_corrected_calibration(tmp_path, capsys, name, fault):
    bag = write(tmp_path, [fault] * 3, name)
    folder = tmp_path / 'corrected'
    run(bag, folder, '--json')
    (found,) = json.loads(capsys.readouterr().out)
    written = found['written_calibration']
    rows, turn_deg = fault
    expected_px = abs(rows) + abs(np.radians(turn_deg)) * CAMERA.width / 2
    assert written['rows_off_px'] == pytest.approx(expected_px, abs=0.3)
    assert written['pairs'] == 3
    assert written['spread_px'] < 0.1
    assert (written['lens_bend_px'], written['lens_problem']) == (0, '')
    assert written['files'] == [str(folder / 'left.yaml'), str(folder / 'right.yaml')]

    calibration = load_stereo_calibration(folder / 'left.yaml', folder / 'right.yaml')
    assert calibration.camera == CAMERA
    assert StereoRectification(calibration).is_needed
    for left, right in views(*[fault] * 3):
        pair = StereoRectification(calibration)(left, right)
        detection = Detector(CAMERA).detect(*pair)
        assert detection.alignment.most_px(CAMERA) < 0.1


def raw_image(image, d, r):
    """Image of a distorted, turned camera whose rectified image is given."""
    k = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    raw = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2).astype(np.float64)
    places = cv2.undistortPoints(raw, k, d, R=r, P=k).reshape(*CAMERA.shape, 2)
    places = places.astype(np.float32)
    return cv2.remap(image, places[..., 0], places[..., 1], cv2.INTER_CUBIC)


def test_distortion_and_rotation_of_the_calibration_are_kept(tmp_path, capsys):
    d = np.array([-0.08, 0.01, 0.0, 0.0, 0.0])
    left_r, right_r, wrong_r = (
        cv2.Rodrigues(np.array(vector))[0]
        for vector in ((0.0, 0.02, 0.0), (0.01, -0.02, 0.005), (0.014, -0.02, 0.011))
    )
    rendered = [render(SCENE.with_(pitch_deg=pitch)) for pitch in PITCHES_DEG]
    images = [
        (raw_image(view.left, d, left_r), raw_image(view.right, d, right_r)) for view in rendered
    ]

    def change(side, info):
        info.d = d
        info.r = (left_r if side == 'left' else wrong_r).ravel()

    bag = write_stereo_bag(tmp_path / 'drive', images=images, name='image_raw', change_info=change)
    run(bag, tmp_path, '--json')
    (found,) = json.loads(capsys.readouterr().out)
    assert found['written_calibration']['rows_off_px'] > 1
    assert found['written_calibration']['remaining_px'] < 0.1
    assert all(each['rows_off_px'] < 0.1 for each in found['cameras'][0]['sample']['geometry'])
    left, right = (load_camera_info(tmp_path / f'{side}.yaml') for side in ('left', 'right'))
    assert left.d == right.d == tuple(d)
    assert left.r == pytest.approx(tuple(left_r.ravel()))
    assert right.r == pytest.approx(tuple(right_r.ravel()), abs=0.005)


def test_a_calibration_of_kalibr_is_written_as_one_of_ros(tmp_path):
    def camera(name, pose):
        return (
            f'{name}: {{resolution: [320, 240], distortion_model: radtan, '
            'distortion_coeffs: [0.001, 0, 0, 0], '
            f'intrinsics: [{CAMERA.fx}, {CAMERA.fy}, {CAMERA.cx}, {CAMERA.cy}]{pose}}}\n'
        )

    pose = f'[[1, 0, 0, {-CAMERA.baseline_m}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]'
    chain = tmp_path / 'camchain.yaml'
    chain.write_text(camera('cam0', '') + camera('cam1', f', T_cn_cnm1: {pose}'))
    bag = write(tmp_path, [(1.4, 0.0)] * 3, infos=False)
    run(bag, tmp_path / 'corrected', '--calibration', str(chain))
    for side in ('left', 'right'):
        text = (tmp_path / 'corrected' / f'{side}.yaml').read_text()
        assert 'distortion_model: plumb_bob\n' in text
        assert 'cols: 5\n  data: [0.001, 0.0, 0.0, 0.0, 0.0]' in text


def test_the_command_uses_the_files_for_raw_images(tmp_path, capsys, monkeypatch):
    bag = write(tmp_path, [(2.0, 0.1)] * 3)
    monkeypatch.chdir(tmp_path)
    run(bag, 'corrected')
    text = ' '.join(capsys.readouterr().out.split())
    assert '--left-info corrected/left.yaml' in text
    assert '--right-info corrected/right.yaml' in text
    assert 'written corrected/left.yaml and corrected/right.yaml: rows off 2.' in text
    assert 'No lens distortion to correct was found.' in text
    assert 'recalibrate' not in text


def test_files_do_not_apply_to_images_that_their_calibration_rectified(tmp_path, capsys):
    def change(side, info):
        info.d[0] = -0.1

    bag = write(tmp_path, [(1.0, 0.0)] * 3, 'image_rect', change_info=change)
    run(bag, tmp_path / 'corrected')
    text = ' '.join(capsys.readouterr().out.split())
    assert 'Those of this recording are rectified already, and stay as they are: give the' in text
    assert '--left-info' not in text
    assert load_camera_info(tmp_path / 'corrected' / 'left.yaml').d[0] == -0.1


def test_images_rectified_by_an_unknown_calibration_are_rectified_again(tmp_path, capsys):
    bag = write(tmp_path, [(1.0, 0.0)] * 3, 'image_rect')
    run(bag, tmp_path / 'corrected')
    text = ' '.join(capsys.readouterr().out.split())
    assert 'The files are for the images as recorded, rectified or not' in text
    assert f'--rectify always \\ --left-info {tmp_path}/corrected/left.yaml' in text
    assert 'rectified raw with --rectify always: replay rectifies them; rows off 0.0' in text


LENSES = Lenses(LensDistortion(0.03, -0.01), LensDistortion(-0.02, 0.02))


def bent_views():
    """Pairs with `LENSES`, whose right images are also off by rows."""
    return [
        tuple(
            cv2.remap(
                image,
                *view.straight_places(RectificationParameters()),
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_REPLICATE,
            )
            for image, view in zip(images, LENSES.views(CAMERA), strict=True)
        )
        for images in views(*[(1.2, 0.3)] * 3)
    ]


@pytest.mark.parametrize(
    ('name', 'd', 'turns'),
    [
        ('image_raw', (0.0,) * 5, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
        ('image_raw', (-0.2, 0.04, 0.001, 0.0, 0.0), ((0.0, 0.02, 0.0), (0.01, -0.02, 0.005))),
        ('image_rect', (0.0,) * 5, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
        ('image_rect', (-0.2, 0.04, 0.001, 0.0, 0.0), ((0.0, 0.02, 0.0), (0.01, -0.02, 0.005))),
    ],
)
def test_raw_images_are_straight_with_the_written_files(tmp_path, capsys, name, d, turns):
    rotations = dict(
        zip(('left', 'right'), (cv2.Rodrigues(np.array(turn))[0] for turn in turns), strict=True)
    )
    bent = bent_views()
    raw = [
        tuple(
            raw_image(image, np.array(d), rotation)
            for image, rotation in zip(pair, rotations.values(), strict=True)
        )
        for pair in bent
    ]

    def change(side, info):
        info.d = np.array(d)
        info.r = rotations[side].ravel()

    images = raw if name == 'image_raw' else bent
    bag = write_stereo_bag(tmp_path / 'drive', images=images, name=name, change_info=change)
    run(bag, tmp_path, '--json')
    (found,) = json.loads(capsys.readouterr().out)
    written = found['written_calibration']
    assert written['lens_bend_px'] == pytest.approx(LENSES.mean_bend_px(CAMERA), abs=0.3)
    assert written['rows_off_px'] > 1.5
    assert (written['remaining_lens_bend_px'], written['lens_problem']) == (0, '')
    assert written['remaining_px'] < 0.1
    assert not written['is_common_lens_corrected']
    if not written['for_raw_images']:
        (camera,) = found['cameras']
        assert [each['lens_bend_px'] for each in camera['sample']['geometry']] == [0, 0, 0]

    calibration = load_stereo_calibration(tmp_path / 'left.yaml', tmp_path / 'right.yaml')
    assert calibration.camera.fx == pytest.approx(written['zoom'] * CAMERA.fx)
    assert calibration.camera.baseline_m == pytest.approx(CAMERA.baseline_m)
    # The other rectification has black corners already.
    assert (written['zoom'] > 1) == (d[0] == 0)
    assert written['zoom'] < 1.1
    rectify = StereoRectification(calibration)
    for pair in raw:
        detection = Detector(calibration.camera).detect(*rectify(*pair))
        assert detection.lenses == STRAIGHT_LENSES
        # The rows were measured in the images as recorded.
        assert detection.alignment.most_px(CAMERA) < (0.2 if written['for_raw_images'] else 0.1)


def test_the_text_says_what_of_the_lenses_is_corrected(tmp_path, capsys):
    bag = write_stereo_bag(tmp_path / 'drive', images=bent_views(), name='image_raw')
    run(bag, tmp_path)
    text = ' '.join(capsys.readouterr().out.split())
    assert 'px before, 0.00 px after; of both, only the difference is corrected: pairs' in text
    assert 'lenses bend 0.00 px (0.00 to 0.00) in 3 pairs' in text


def test_distortion_that_pairs_do_not_share_is_left(tmp_path, capsys):
    images = bent_views() + views(*[(1.2, 0.3)] * 3)[:2]
    bag = write_stereo_bag(tmp_path / 'drive', 5, images=images, name='image_raw')
    run(bag, tmp_path)
    text = ' '.join(capsys.readouterr().out.split())
    assert (
        'Lens distortion is not corrected: it differs too much between the pairs: 80% are within'
    ) in text
    assert load_camera_info(tmp_path / 'left.yaml').d == (0,) * 5


def test_a_correct_calibration_is_written_as_it_is(tmp_path, capsys):
    bag = write(tmp_path, [(0.0, 0.0)] * 3)
    folder = tmp_path / 'corrected'
    run(bag, folder)
    right = load_camera_info(folder / 'right.yaml')
    assert right.p == pytest.approx(
        (
            *(CAMERA.fx, 0, CAMERA.cx, -CAMERA.fx * CAMERA.baseline_m),
            *(0, CAMERA.fy, CAMERA.cy, 0),
            *(0, 0, 1, 0),
        )
    )
    assert right.k[5] == pytest.approx(CAMERA.cy, abs=0.1)
    assert (right.width, right.height, right.distortion_model) == (320, 240, 'plumb_bob')


@pytest.mark.parametrize(
    ('faults', 'options', 'words'),
    [
        (
            [(-1.5, 0.0), (0.0, 0.0), (1.5, 0.0)],
            {},
            "the rows of 3 pairs scatter too much to be one camera's: 80% are within 1.",
        ),
        (
            [(0.0, 0.0)] * 3,
            {'pairs': 2},
            'the rows can be measured in 2 pairs: expected at least 3',
        ),
        ([(0.0, 0.0)] * 3, {'infos': False}, 'no calibration to correct: no calibration for'),
        (
            [(0.0, 0.0)] * 3,
            {'change_info': lambda side, info: setattr(info, 'binning_x', 2)},
            'the left camera_info has a region of interest or binning',
        ),
    ],
)
def test_refusals_leave_no_files(tmp_path, capsys, faults, options, words):
    bag = write(tmp_path, faults, **options)
    run(bag, tmp_path / 'corrected', status=1)
    out, err = capsys.readouterr()
    assert words in err
    assert len(err.splitlines()) == 1
    assert 'stereo camera /cam' in out
    assert not (tmp_path / 'corrected').exists()


def test_existing_files_are_kept_without_force(tmp_path, capsys):
    bag = write(tmp_path, [(0.0, 0.0)] * 3)
    (tmp_path / 'left.yaml').write_text('mine')
    run(bag, tmp_path, status=1)
    assert 'left.yaml exists: give --force to replace it' in capsys.readouterr().err
    assert (tmp_path / 'left.yaml').read_text() == 'mine'
    run(bag, tmp_path, '--force')
    assert 'image_width: 320' in (tmp_path / 'left.yaml').read_text()


def test_it_takes_one_bag(capsys):
    with pytest.raises(SystemExit, match='2'):
        main(['inspect', 'one', 'two', '--write-calibration', 'corrected'])
    assert '--write-calibration is given with 2 bags: expected one' in capsys.readouterr().err
