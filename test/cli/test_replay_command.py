import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from hand_made import (
    CAMERA,
    FIRST_STAMP_NS,
    stereo_images,
    write_calibration,
    write_stereo_bag,
)
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.messages.cloud import decode_cloud
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import (
    decode_compressed_image,
    decode_image,
    encode_image,
)
from rover_obstacle_detection.offline import replay
from rover_obstacle_detection.offline.picture_files import PICTURE_NAMES
from rover_obstacle_detection.pictures import overlay_picture

PERIOD_NS = 100_000_000
COMMAND = (sys.executable, '-m', 'rover_obstacle_detection', 'replay')


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'drive', pairs=3)


@pytest.fixture(scope='module')
def long_bag(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'long', pairs=60)


@pytest.fixture(scope='module')
def replayed(bag, tmp_path_factory):
    output = tmp_path_factory.mktemp('replayed') / 'out'
    arguments = [str(bag), '--output', str(output), '--images']
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done, output


def _summary(output):
    return json.loads((output / 'summary.json').read_text())


def _detections(output):
    with AnyReader([output / 'detections']) as reader:
        for connection, time_ns, data in reader.messages():
            yield connection.topic, time_ns, reader.deserialize(data, connection.msgtype)


def test_the_table_shows_counts_obstacles_and_times(replayed):
    done, output = replayed
    rows = {}
    for line in done.stdout.splitlines():
        cells = [cell.strip() for cell in line.strip('│').split('│')]
        if len(cells) == 3:
            rows[cells[0]] = cells[1:]
    assert rows['left images'] == ['3', '/cam/left/image_rect']
    assert rows['right images'] == ['3', '/cam/right/image_rect']
    assert rows['pairs'] == ['3', '3 processed']
    assert rows['unmatched'][0] == '0'
    assert rows['bad frames'][0] == '0'
    assert float(rows['obstacles per frame'][0]) >= 1
    assert re.search(r'in all \d+ rock', rows['obstacles per frame'][1])
    assert float(rows['disparity, ms per frame'][0]) > 0
    assert float(rows['detector total, ms per frame'][0]) > 0
    assert f'images: {output / "images"}' in done.stdout
    assert done.stderr == ''


def test_the_summary_records_inputs_and_results(replayed, bag):
    summary = _summary(replayed[1])
    assert summary['bag'] == str(bag)
    assert summary['interrupted'] is False
    assert summary['counts'] == {
        'left_images': 3,
        'right_images': 3,
        'pairs': 3,
        'done': 3,
        'expected': 3,
        'detected': 3,
        'bad': 0,
        'unjudgeable': 0,
        'unmatched_left': 0,
        'unmatched_right': 0,
        'smallest_gap_s': 0.0,
    }
    assert summary['parameters']['method'] == 'hybrid'
    assert summary['parameters']['max_step'] == 0.10
    assert summary['versions']['opencv'] == cv2.__version__
    assert summary['topics']['left_image'] == '/cam/left/image_rect'
    assert summary['cameras'][0]['baseline_m'] == pytest.approx(CAMERA.baseline_m)
    frames = summary['frames']
    assert [each['number'] for each in frames] == [1, 2, 3]
    assert [each['stamp_ns'] for each in frames] == [
        FIRST_STAMP_NS + index * PERIOD_NS for index in range(3)
    ]
    assert frames[0]['obstacles'] >= 1
    assert frames[0]['camera_pitch_deg'] == pytest.approx(46, abs=5)
    assert frames[0]['camera_height_m'] == pytest.approx(1.0, abs=0.1)
    assert frames[0]['rows_off_px'] == pytest.approx(0, abs=0.2)
    assert frames[0]['lens_bend_px'] == 0
    stages = frames[0]['stage_ms']
    own = ('read', 'write bag', 'write images')
    assert set(own) < set(stages)
    assert frames[0]['detection_ms'] == pytest.approx(
        sum(ms for stage, ms in stages.items() if stage not in own), abs=0.1
    )
    assert list(summary['stage_ms']) == list(stages)


def test_every_key_of_the_summary_is_documented(replayed):
    documentation = (Path(__file__).parents[2] / 'docs' / 'replay.md').read_text()
    summary = _summary(replayed[1])
    frame = summary['frames'][0]
    for key in [*summary, *summary['counts'], *frame]:
        assert f'`{key}`' in documentation, key


TYPES = {
    '/cam/obstacle_mask': 'sensor_msgs/msg/Image',
    '/cam/obstacle_points': 'sensor_msgs/msg/PointCloud2',
    '/cam/ground_points': 'sensor_msgs/msg/PointCloud2',
    '/cam/obstacle_grid': 'nav_msgs/msg/OccupancyGrid',
    '/cam/obstacle_markers': 'visualization_msgs/msg/MarkerArray',
    '/cam/detection_image/compressed': 'sensor_msgs/msg/CompressedImage',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
}


def test_every_message_has_the_stamp_and_frame_of_the_left_image(replayed):
    seen = {}
    for topic, time_ns, message in _detections(replayed[1]):
        header = message.markers[0].header if topic.endswith('markers') else message.header
        stamp_ns = header.stamp.sec * 10**9 + header.stamp.nanosec
        assert time_ns == stamp_ns
        assert header.frame_id == 'left_optical'
        seen.setdefault(topic, []).append(stamp_ns)
    expected = [FIRST_STAMP_NS + index * PERIOD_NS for index in range(3)]
    assert seen == dict.fromkeys(TYPES, expected)


def test_the_bag_holds_what_viewers_show(replayed):
    frame = _summary(replayed[1])['frames'][0]
    messages = {}
    for topic, _, message in _detections(replayed[1]):
        messages.setdefault(topic, message)
    compressed = messages['/cam/detection_image/compressed']
    assert compressed.format == 'bgr8; jpeg compressed bgr8'
    shown = decode_compressed_image(compressed, 'overlay')
    drawn = overlay_picture(Detector(CAMERA).detect(*stereo_images()))
    assert shown.shape == drawn.shape
    assert np.abs(shown.astype(int) - drawn).mean() < 5
    kinds = [marker.ns for marker in messages['/cam/obstacle_markers'].markers]
    assert kinds.count('rock') == frame['obstacle_kinds']['rock']
    (status,) = messages['/diagnostics'].status
    assert status.name == '/cam/obstacle_detector: detection'
    assert int(status.level) == 0
    values = {each.key: each.value for each in status.values}
    assert values['obstacles'] == str(frame['obstacles'])
    assert values['nearest obstacle (m)'] == f'{frame["nearest_obstacle_m"]:.2f}'
    assert values['camera height (m)'] == f'{frame["camera_height_m"]:.2f}'


def test_a_warning_is_in_the_diagnostics(bag, tmp_path):
    arguments = ['-o', str(tmp_path / 'out'), '--duration', '0.05', '--set', 'camera_pitch=20']
    arguments += ['--set', 'gravity_source=parameters']
    assert main(['replay', str(bag), *arguments]) == 0
    (warning, *_) = _summary(tmp_path / 'out')['frames'][0]['warnings']
    messages = {topic: message for topic, _, message in _detections(tmp_path / 'out')}
    (status,) = messages['/diagnostics'].status
    assert int(status.level) == 1
    assert warning in status.message


def test_every_masked_pixel_but_those_of_rims_has_a_point(replayed):
    messages = {topic: message for topic, _, message in _detections(replayed[1])}
    mask = decode_image(messages['/cam/obstacle_mask'], 'mask')
    assert mask.shape == CAMERA.shape
    assert set(np.unique(mask)) == {0, 255}
    detection = Detector(CAMERA).detect(*stereo_images())
    assert np.array_equal(mask, detection.mask)
    has_point = (detection.disparity > 0) & np.isfinite(detection.height)
    for name, wanted in (
        ('obstacle_points', (mask == 255) & ~detection.rims.behind),
        ('ground_points', (mask == 0) & detection.known & has_point & ~detection.rims.before),
    ):
        cloud = decode_cloud(messages[f'/cam/{name}'])
        expected = getattr(detection, name)
        np.testing.assert_array_equal(cloud[:, : expected.shape[1]], expected)
        assert len(cloud) > 100
        x, y, z = cloud[:, :3].astype(float).T
        columns = np.rint(x / z * CAMERA.fx + CAMERA.cx).astype(int)
        rows = np.rint(y / z * CAMERA.fy + CAMERA.cy).astype(int)
        drawn = np.zeros(mask.shape, int)
        np.add.at(drawn, (rows, columns), 1)
        assert drawn.max() == 1
        assert not drawn[~wanted].any()
        if name == 'obstacle_points':
            assert drawn[wanted].all()


def test_the_mcap_package_reads_the_detections(replayed):
    path = replayed[1] / 'detections' / 'detections.mcap'
    with path.open('rb') as file:
        reader = make_reader(file)
        topics = [channel.topic for _, channel, _ in reader.iter_messages()]
        schemas = {schema.name for schema in reader.get_summary().schemas.values()}
    assert topics.count('/cam/obstacle_mask') == 3
    assert schemas == set(TYPES.values())


def test_each_frame_has_its_pictures(replayed):
    names = {path.name for path in (replayed[1] / 'images').iterdir()}
    assert names == {f'{number:06d}_{name}.png' for number in (1, 2, 3) for name in PICTURE_NAMES}
    overlay = cv2.imread(str(replayed[1] / 'images' / '000001_overlay.png'))[: CAMERA.height]
    mask = next(
        decode_image(message, topic)
        for topic, _, message in _detections(replayed[1])
        if topic == '/cam/obstacle_mask'
    )
    redness = overlay[..., 2].astype(float) - overlay[..., 0]
    inside = cv2.erode(mask, np.ones((9, 9), np.uint8)) > 0
    outside = cv2.dilate(mask, np.ones((9, 9), np.uint8)) == 0
    assert np.median(redness[inside]) > 40
    assert np.median(redness[outside]) == 0


def test_a_part_of_the_recording_can_be_replayed(bag, tmp_path, capsys):
    arguments = ['--start', '0.05', '--duration', '0.1']
    assert main(['replay', str(bag), '-o', str(tmp_path / 'part'), *arguments]) == 0
    frames = _summary(tmp_path / 'part')['frames']
    assert [each['stamp_ns'] for each in frames] == [FIRST_STAMP_NS + PERIOD_NS]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'every'), '--every', '2']) == 0
    summary = _summary(tmp_path / 'every')
    assert [each['stamp_ns'] for each in summary['frames']] == [
        FIRST_STAMP_NS,
        FIRST_STAMP_NS + 2 * PERIOD_NS,
    ]
    assert summary['counts']['pairs'] == 3
    assert '2 processed' in capsys.readouterr().out


def test_set_and_method_override_the_parameter_file(bag, tmp_path):
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    max_step: 0.2\n    max_slope: 15.0\n')
    arguments = ['--params', str(file), '--set', 'max_slope=25', '--method', 'study']
    arguments += ['--set', 'equalize_histogram=true', '--duration', '0.05']
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *arguments]) == 0
    parameters = _summary(tmp_path / 'out')['parameters']
    assert parameters['max_step'] == 0.2
    assert parameters['max_slope'] == 25.0
    assert parameters['equalize_histogram'] is True
    assert parameters['method'] == 'study'


def test_the_rover_itself_is_not_an_obstacle(bag, tmp_path):
    polygon = '[[0,0],[319,0],[319,239],[0,239]]'
    arguments = ['-o', str(tmp_path / 'out'), '--rover-polygon', polygon, '--duration', '0.05']
    assert main(['replay', str(bag), *arguments]) == 0
    frame = _summary(tmp_path / 'out')['frames'][0]
    assert frame['obstacles'] == 0
    assert frame['nearest_obstacle_m'] is None
    assert frame['unknown_share'] == 1.0


def test_approximate_sync_pairs_different_stamps(tmp_path, capsys):
    bag = write_stereo_bag(tmp_path / 'late', pairs=2, right_delay_ns=3_400_000)
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 1
    error = capsys.readouterr().err
    assert '2 left images' in error
    assert '2 right' in error
    assert 'smallest stamp gap 3.400 ms; try --approximate-sync 0.004' in error
    assert error.count('\n') == 1
    assert not (tmp_path / 'out').exists()
    arguments = ['-o', str(tmp_path / 'out'), '--approximate-sync', '0.004']
    assert main(['replay', str(bag), *arguments]) == 0
    assert _summary(tmp_path / 'out')['counts']['smallest_gap_s'] == pytest.approx(0.0034)


def test_images_of_different_moments_are_not_to_be_paired(tmp_path, capsys):
    bag = write_stereo_bag(tmp_path / 'unsynchronised', pairs=2, right_delay_ns=40_000_000)
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 1
    error = capsys.readouterr().err
    assert error.endswith(
        'smallest stamp gap 40.000 ms: the images show different moments: expected synchronised '
        'cameras\n'
    )
    assert '--approximate-sync' not in error


def test_a_bad_frame_is_reported_and_skipped(tmp_path, capsys):
    def spoil(index, side, message):
        if (index, side) == (1, 'right'):
            message.data = message.data[:-100]

    bag = write_stereo_bag(tmp_path / 'spoilt', pairs=3, change_image=spoil)
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 0
    summary = _summary(tmp_path / 'out')
    assert summary['counts']['bad'] == 1
    assert summary['counts']['detected'] == 2
    (bad,) = summary['bad_frames']
    assert bad['stamp_ns'] == FIRST_STAMP_NS + PERIOD_NS
    assert '/cam/right/image_rect: data has' in bad['reason']
    shown = ' '.join(capsys.readouterr().out.split())
    assert '/cam/right/image_rect: data has' in shown


def test_topics_and_calibration_files_can_be_given(tmp_path):
    bag = write_stereo_bag(tmp_path / 'bare', pairs=1, infos=False)
    left, right = write_calibration(tmp_path)
    arguments = ['--left-topic', '/cam/left/image_rect', '--right-topic', '/cam/right/image_rect']
    arguments += ['--left-info', str(left), '--right-info', str(right)]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *arguments]) == 0
    assert _summary(tmp_path / 'out')['counts']['detected'] == 1


def test_numbers_calibrate_a_recording_without_camera_info(tmp_path, bag, replayed, capsys):
    bare = write_stereo_bag(tmp_path / 'bare', pairs=1, infos=False)
    arguments = ['replay', str(bare), '-o', str(tmp_path / 'out')]
    assert main([*arguments, '--fx', str(CAMERA.fx)]) == 1
    error = capsys.readouterr().err
    assert f'{bare}: the calibration lacks baseline: expected' in error
    assert 'no camera_info topic' in error
    numbers = [f'--{each}={getattr(CAMERA, each)}' for each in ('fx', 'fy', 'cx', 'cy')]
    assert main([*arguments, *numbers, f'--baseline={CAMERA.baseline_m}']) == 0
    same, as_before = _summary(tmp_path / 'out'), _summary(replayed[1])
    assert same['cameras'] == [pytest.approx(as_before['cameras'][0])]
    assert same['frames'][0]['obstacle_share'] == as_before['frames'][0]['obstacle_share']


def test_both_views_may_be_side_by_side(tmp_path, replayed, capsys):
    path = tmp_path / 'wide'
    with BagWriter(path) as bag:
        for stamp_ns in (FIRST_STAMP_NS, FIRST_STAMP_NS + PERIOD_NS):
            header = make_header(stamp_ns, 'camera', bag.factory)
            message = encode_image(np.hstack(stereo_images()), 'mono8', header, bag.factory)
            bag.add('/zed/image_rect', 'sensor_msgs/msg/Image', message, stamp_ns)
    arguments = ['replay', str(path), '-o', str(tmp_path / 'out'), '--side-by-side']
    assert main([*arguments, '--left-topic', '/zed/none']) == 1
    assert 'no topic /zed/none' in capsys.readouterr().err
    arguments += ['--left-topic', '/zed/image_rect', '--approximate-sync', '0.01']
    assert main(arguments) == 1
    assert 'no calibration for /zed/image_rect' in capsys.readouterr().err
    numbers = [f'--{each}={getattr(CAMERA, each)}' for each in ('fx', 'fy', 'cx', 'cy')]
    assert main([*arguments, *numbers, f'--baseline={CAMERA.baseline_m}']) == 0
    same, as_before = _summary(tmp_path / 'out'), _summary(replayed[1])
    assert same['cameras'] == [pytest.approx(as_before['cameras'][0])]
    shares = [frame['obstacle_share'] for frame in same['frames']]
    assert shares == [as_before['frames'][0]['obstacle_share']] * 2
    topics = {topic for topic, *_ in _detections(tmp_path / 'out')}
    assert topics == {topic.replace('/cam/', '/zed/') for topic in TYPES}


def test_a_number_replaces_that_of_the_recording(tmp_path, bag):
    arguments = ['--duration', '0.05', '--baseline', '0.13']
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), *arguments]) == 0
    summary = _summary(tmp_path / 'out')
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
        heights.append(_summary(tmp_path / 'out')['frames'][0]['camera_height_m'])
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


def test_existing_output_needs_force(bag, tmp_path, capsys):
    output = tmp_path / 'out'
    arguments = ['replay', str(bag), '-o', str(output), '--duration', '0.05']
    assert main([*arguments, '--images']) == 0
    (output / 'notes.txt').write_text('mine')
    (output / 'images' / 'sketch.png').write_text('mine')
    before = (output / 'summary.json').read_bytes()
    assert main(arguments) == 1
    assert '--force' in capsys.readouterr().err
    assert (output / 'summary.json').read_bytes() == before
    assert main([*arguments, '--force', '--set', 'max_step=0.3']) == 0
    assert _summary(output)['parameters']['max_step'] == 0.3
    assert (output / 'notes.txt').read_text() == 'mine'
    assert [path.name for path in (output / 'images').iterdir()] == ['sketch.png']
    assert sorted(path.name for path in tmp_path.iterdir()) == ['out']


def test_workers_replay_several_bags_although_one_fails(bag, tmp_path, capsys):
    other = tmp_path / 'other' / bag.name
    shutil.copytree(bag, other)
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(b'no bag at all')
    output = tmp_path / 'out'
    bags = [str(bag), str(broken), str(other)]
    assert main(['replay', *bags, '-o', str(output), '--workers', '2']) == 1
    assert sorted(path.name for path in output.iterdir()) == ['drive', 'drive_2']
    one, two = (_summary(output / name) for name in ('drive', 'drive_2'))
    assert one['bag'] == str(bag)
    assert two['bag'] == str(other)
    assert one['counts'] == two['counts']
    masks = [
        [m.data.tobytes() for t, _, m in _detections(output / name) if t.endswith('mask')]
        for name in ('drive', 'drive_2')
    ]
    assert masks[0] == masks[1]
    captured = capsys.readouterr()
    error, count = captured.err.splitlines()
    assert error.startswith(f'rover-obstacles: error: {broken}')
    assert count == 'rover-obstacles: error: 1 of 3 bags failed'
    assert captured.out.count('drive') >= 4


def test_one_worker_replays_several_bags(bag, tmp_path):
    output = tmp_path / 'out'
    arguments = [str(bag), str(bag), '-o', str(output), '--duration', '0.05']
    assert main(['replay', *arguments]) == 0
    assert sorted(path.name for path in output.iterdir()) == ['drive', 'drive_2']


SIGNALS = pytest.mark.parametrize(
    ('number', 'status', 'workers'),
    [
        (signal.SIGINT, 130, '1'),
        (signal.SIGTERM, 143, '1'),
        (signal.SIGINT, 130, '2'),
        (signal.SIGTERM, 143, '2'),
    ],
)


def _begin(bags, output, *arguments):
    """Start a replay in its own process group; return it when the first pictures are there."""
    command = [*COMMAND, *map(str, bags), '-o', str(output), '--images', *arguments]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not list(output.parent.rglob('000002_overlay.png')):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


@SIGNALS
def test_an_interrupt_keeps_what_is_done(long_bag, tmp_path, number, status, workers):
    output = tmp_path / 'out'
    bags = [long_bag] if workers == '1' else [long_bag] * 3
    process = _begin(bags, output, '--workers', workers)
    # As Ctrl-C in a terminal does it: every process of the group gets it.
    os.killpg(process.pid, number)
    shown, error = process.communicate(timeout=60)
    assert process.returncode == status
    assert [path.name for path in tmp_path.iterdir()] == ['out']
    parts = [output] if workers == '1' else sorted(output.iterdir())
    lines = error.splitlines()
    if workers == '2':
        assert f'rover-obstacles: interrupted: {long_bag} is not begun' in lines
    kept = [line for line in lines if 'are kept in' in line]
    assert len(lines) == len(bags), error
    assert len(kept) == len(parts) >= 1
    for part in parts:
        summary = _summary(part)
        frames = summary['frames']
        assert 1 <= len(frames) < 60
        assert summary['interrupted'] is True
        counts = summary['counts']
        assert (counts['detected'], counts['done'], counts['expected']) == (
            len(frames),
            len(frames),
            60,
        )
        assert (
            f'rover-obstacles: interrupted: {len(frames)} of about 60 pairs of {long_bag} '
            f'are kept in {part}'
        ) in kept
        stamps = {time_ns for _, time_ns, _ in _detections(part)}
        assert stamps == {frame['stamp_ns'] for frame in frames}
        assert len(list((part / 'images').glob('*_overlay.png'))) == len(frames)
        assert f'summary: {part / "summary.json"}' in shown
    if workers == '1':
        assert f'{len(frames)} of about 60, interrupted' in ' '.join(shown.split())


@SIGNALS
def test_a_second_interrupt_leaves_nothing(long_bag, tmp_path, number, status, workers):
    process = _begin([long_bag] * int(workers), tmp_path / 'out', '--workers', workers)
    process.send_signal(number)
    # Two signals of one kind would merge before the process has taken the first.
    process.send_signal(signal.SIGINT if number == signal.SIGTERM else signal.SIGTERM)
    _, error = process.communicate(timeout=60)
    assert process.returncode in (130, 143)
    assert 'Traceback' not in error
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_before_the_first_pair_keeps_nothing(bag, tmp_path, monkeypatch, capsys):
    read = replay.read_pairs

    def interrupt(*arguments, **options):
        os.kill(os.getpid(), signal.SIGINT)
        return read(*arguments, **options)

    monkeypatch.setattr(replay, 'read_pairs', interrupt)
    assert main(['replay', str(bag), str(bag), '-o', str(tmp_path / 'out')]) == 130
    assert capsys.readouterr().err == (
        f'rover-obstacles: interrupted: no usable pair of {bag} so far: nothing is kept\n'
        f'rover-obstacles: interrupted: {bag} is not begun\n'
    )
    assert list(tmp_path.iterdir()) == []


def test_signals_are_handled_as_before_after_a_replay(bag, tmp_path):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out'), '--duration', '0.05']) == 0
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
