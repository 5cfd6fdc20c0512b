"""``replay`` writes detections, summary and pictures, of what its options choose."""

import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from hand_made import CAMERA, FIRST_STAMP_NS, stereo_images, write_stereo_bag
from mcap.reader import make_reader
from replay_outputs import PERIOD_NS, TYPES, detections_of, summary_of

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.messages.cloud import decode_cloud
from rover_obstacle_detection.messages.image import decode_compressed_image, decode_image
from rover_obstacle_detection.offline.picture_files import PICTURE_NAMES
from rover_obstacle_detection.pictures import overlay_picture


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
    summary = summary_of(replayed[1])
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
    assert {*own, 'clouds and obstacles'} < set(stages)
    assert frames[0]['detection_ms'] == pytest.approx(
        sum(ms for stage, ms in stages.items() if stage not in own), abs=0.1
    )
    assert list(summary['stage_ms']) == list(stages)


def test_every_key_of_the_summary_is_documented(replayed):
    documentation = (Path(__file__).parents[2] / 'docs' / 'replay.md').read_text()
    summary = summary_of(replayed[1])
    frame = summary['frames'][0]
    for key in [*summary, *summary['counts'], *frame]:
        assert f'`{key}`' in documentation, key


def test_every_message_has_the_stamp_and_frame_of_the_left_image(replayed):
    seen = {}
    for topic, time_ns, message in detections_of(replayed[1]):
        header = message.markers[0].header if topic.endswith('markers') else message.header
        stamp_ns = header.stamp.sec * 10**9 + header.stamp.nanosec
        assert time_ns == stamp_ns
        assert header.frame_id == 'left_optical'
        seen.setdefault(topic, []).append(stamp_ns)
    expected = [FIRST_STAMP_NS + index * PERIOD_NS for index in range(3)]
    assert seen == dict.fromkeys(TYPES, expected)


def test_the_bag_holds_what_viewers_show(replayed):
    frame = summary_of(replayed[1])['frames'][0]
    messages = {}
    for topic, _, message in detections_of(replayed[1]):
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
    (warning, *_) = summary_of(tmp_path / 'out')['frames'][0]['warnings']
    messages = {topic: message for topic, _, message in detections_of(tmp_path / 'out')}
    (status,) = messages['/diagnostics'].status
    assert int(status.level) == 1
    assert warning in status.message


def test_every_masked_pixel_but_those_of_rims_has_a_point(replayed):
    messages = {topic: message for topic, _, message in detections_of(replayed[1])}
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


def test_the_mcap_package_reads_thedetections_of(replayed):
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
        for topic, _, message in detections_of(replayed[1])
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
    frames = summary_of(tmp_path / 'part')['frames']
    assert [each['stamp_ns'] for each in frames] == [FIRST_STAMP_NS + PERIOD_NS]
    assert main(['replay', str(bag), '-o', str(tmp_path / 'every'), '--every', '2']) == 0
    summary = summary_of(tmp_path / 'every')
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
    parameters = summary_of(tmp_path / 'out')['parameters']
    assert parameters['max_step'] == 0.2
    assert parameters['max_slope'] == 25.0
    assert parameters['equalize_histogram'] is True
    assert parameters['method'] == 'study'


def test_the_rover_itself_is_not_an_obstacle(bag, tmp_path):
    polygon = '[[0,0],[319,0],[319,239],[0,239]]'
    arguments = ['-o', str(tmp_path / 'out'), '--rover-polygon', polygon, '--duration', '0.05']
    assert main(['replay', str(bag), *arguments]) == 0
    frame = summary_of(tmp_path / 'out')['frames'][0]
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
    assert summary_of(tmp_path / 'out')['counts']['smallest_gap_s'] == pytest.approx(0.0034)


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
    summary = summary_of(tmp_path / 'out')
    assert summary['counts']['bad'] == 1
    assert summary['counts']['detected'] == 2
    (bad,) = summary['bad_frames']
    assert bad['stamp_ns'] == FIRST_STAMP_NS + PERIOD_NS
    assert '/cam/right/image_rect: data has' in bad['reason']
    shown = ' '.join(capsys.readouterr().out.split())
    assert '/cam/right/image_rect: data has' in shown


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
    assert summary_of(output)['parameters']['max_step'] == 0.3
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
    one, two = (summary_of(output / name) for name in ('drive', 'drive_2'))
    assert one['bag'] == str(bag)
    assert two['bag'] == str(other)
    assert one['counts'] == two['counts']
    masks = [
        [m.data.tobytes() for t, _, m in detections_of(output / name) if t.endswith('mask')]
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
