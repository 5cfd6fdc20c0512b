from __future__ import annotations

import json

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.image import decode_float_image, decode_image
from rover_obstacle_detection.simulation import cache
from rover_obstacle_detection.simulation.bag import write_labelled_bag
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.frames import Frame
from rover_obstacle_detection.simulation.poses import standing_pose
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.rigs import RIGS

CAMERA = StereoCamera(8, 6, 9.0, 9.0, 3.5, 2.5, 0.12)
TOPICS = {
    '/stereo/left/image_rect',
    '/stereo/left/camera_info',
    '/stereo/right/image_rect',
    '/stereo/right/camera_info',
    '/truth/labels',
    '/truth/instances',
    '/truth/depth',
    '/truth/pose',
    '/truth/scene',
    '/tf',
}


def frame(number, colour=False, kind=np.uint8):
    rng = np.random.default_rng(number)
    shape = (6, 8, 3) if colour else (6, 8)
    depth = rng.uniform(1, 5, (6, 8)).astype(np.float32)
    depth[0] = np.nan
    return Frame(
        left=rng.integers(0, 255, shape).astype(kind),
        right=rng.integers(0, 255, shape).astype(kind),
        labels=rng.choice(np.array([0, 1, 2, 3, 255], np.uint8), (6, 8)),
        instances=rng.integers(0, 900, (6, 8)).astype(np.uint16),
        depth_m=depth,
        pose=standing_pose(
            lambda x, y: (0.1 * x).astype(np.float32), RIGS['vga'], float(number), 0.0, 0.3
        ),
        camera=CAMERA,
    )


def written(path, frames, **parameters):
    write_labelled_bag(path, scene_of(path.name, 1, ['noon'], 'vga', parameters), frames)
    return path


def read(path):
    with AnyReader([path]) as reader:
        return [
            (connection.topic, time_ns, bytes(data))
            for connection, time_ns, data in reader.messages()
        ]


def test_labelled_bag_round_trip(tmp_path):
    frames = [frame(0), frame(1)]
    path = written(tmp_path / 'two', frames, drive={'frames': 2, 'period_s': 0.25})
    with open_bag(path) as bag:
        assert set(bag.topics) == TOPICS
        camera = bag.calibration(bag.stereo_topics()).camera
        assert (camera.fx, camera.cx, camera.cy) == (CAMERA.fx, CAMERA.cx, CAMERA.cy)
        assert camera.baseline_m == pytest.approx(CAMERA.baseline_m)
        stamps, at = set(), {}
        for topic, time_ns, message in bag.messages(list(TOPICS - {'/tf', '/truth/scene'})):
            assert stamp_ns(message.header) == time_ns
            stamps.add(time_ns)
            at[topic, (time_ns - min(stamps)) // 250_000_000] = message
    assert max(stamps) - min(stamps) == 250_000_000
    for number, each in enumerate(frames):
        for topic, array in (
            ('/stereo/left/image_rect', each.left),
            ('/stereo/right/image_rect', each.right),
            ('/truth/labels', each.labels),
            ('/truth/instances', each.instances),
        ):
            np.testing.assert_array_equal(decode_image(at[topic, number], topic), array)
        depth = decode_float_image(at['/truth/depth', number], 'depth')
        np.testing.assert_array_equal(depth, each.depth_m)
        pose = at['/truth/pose', number].pose
        assert pose.position.x == each.pose.position[0]
        assert pose.orientation.w == each.pose.quaternion[3]


def test_bag_holds_the_scene(tmp_path):
    path = written(tmp_path / 'one', [frame(0)])
    with open_bag(path) as bag:
        ((_, _, message),) = list(bag.messages(['/truth/scene']))
    scene = Scene.from_mapping(json.loads(message.data))
    assert scene.name == 'one'
    assert scene.conditions == ('noon',)


@pytest.mark.parametrize(
    ('colour', 'kind', 'encoding'),
    [(True, np.uint8, 'rgb8'), (False, np.uint8, 'mono8'), (False, np.uint16, 'mono16')],
)
def test_image_encoding_follows_the_array(tmp_path, colour, kind, encoding):
    path = written(tmp_path / 'one', [frame(0, colour, kind)])
    with open_bag(path) as bag:
        ((_, _, message),) = list(bag.messages(['/stereo/left/image_rect']))
    assert message.encoding == encoding


def test_equal_frames_give_equal_messages(tmp_path):
    first = read(written(tmp_path / 'one' / 'x', [frame(0)]))
    second = read(written(tmp_path / 'two' / 'x', [frame(0)]))
    assert first == second
    assert len(first) == len(TOPICS)


def test_failed_bag_leaves_nothing_behind(tmp_path):
    def frames():
        yield frame(0)
        raise RuntimeError('render failed')

    with pytest.raises(RuntimeError):
        written(tmp_path / 'one', frames())
    assert list(tmp_path.iterdir()) == []


def test_existing_bag_is_not_overwritten(tmp_path):
    written(tmp_path / 'one', [frame(0)])
    with pytest.raises(OutputError, match='already exists'):
        written(tmp_path / 'one', [frame(0)])


@pytest.fixture
def rendered(monkeypatch, tmp_path):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    scenes = []

    def render(scene, on_step):
        scenes.append(scene)
        for number in range(scene.drive.frames):
            for _ in range(cache.STEPS_PER_FRAME):
                on_step()
            yield frame(number)

    monkeypatch.setattr(cache, 'render', render)
    return scenes


def test_simulate_writes_one_scene(rendered, tmp_path, capsys):
    call = ['simulate', 'dunes', 'moon', '--rig', 'vga', '--seed', '4', '--frames', '3']
    call += ['--width', '320', '--set', 'light.sun_elevation_deg=20', '-o', str(tmp_path / 'o')]
    assert main(call) == 0
    path = tmp_path / 'o' / 'vga_dunes_moon_4'
    assert capsys.readouterr().out == f'{path}\n'
    (scene,) = rendered
    assert (scene.width, scene.drive.frames) == (320, 3)
    assert scene.light.sun_elevation_deg == 20.0
    with open_bag(path) as bag:
        assert bag.message_count('/truth/labels') == 3
    assert main(call) == 1
    assert 'give --force' in capsys.readouterr().err
    assert main([*call, '--force']) == 0
    assert [entry.name for entry in (tmp_path / 'o').iterdir()] == ['vga_dunes_moon_4']


def test_simulate_renders_a_suite_once(rendered, tmp_path, capsys):
    suite = tmp_path / 'mine.yaml'
    suite.write_text(
        'scenes:\n'
        '  - {name: tune_one, seed: 1, rig: vga}\n'
        '  - {name: tune_two, seed: 2, rig: vga, conditions: [dunes]}\n'
        '  - {name: report_one, seed: 3, rig: vga}\n'
    )
    call = ['simulate', '--suite', str(suite), '--only', 'tune_*']
    assert main(call) == 0
    cached = capsys.readouterr().out.splitlines()
    assert [scene.name for scene in rendered] == ['tune_one', 'tune_two']
    assert [line.rpartition('/')[2] for line in cached] == ['tune_one', 'tune_two']
    assert main([*call, '--output', str(tmp_path / 'o')]) == 0
    assert len(rendered) == 2
    for line in capsys.readouterr().out.splitlines():
        with open_bag(tmp_path / 'o' / line.rpartition('/')[2]) as bag:
            assert bag.message_count('/stereo/left/image_rect') == 1


def test_simulate_finds_the_standard_suite_by_name(rendered, capsys):
    assert main(['simulate', '--suite', 'standard', '--only', 'report_vga_noon']) == 0
    assert [scene.name for scene in rendered] == ['report_vga_noon']
    assert capsys.readouterr().out.endswith('/report_vga_noon\n')


def test_simulate_list_names_rigs_conditions_and_parameters(capsys):
    assert main(['simulate', '--list']) == 0
    out = capsys.readouterr().out
    for name in ('navcam', 'low_sun_across', 'light.sun_elevation_deg', 'empty_flat'):
        assert name in out


@pytest.mark.parametrize(
    ('call', 'status', 'message'),
    [
        (['crator'], 1, "unknown condition 'crator'; did you mean crater?"),
        (['noon', '--rig', 'x'], 1, "rig is 'x'"),
        (['noon', '--set', 'light.sun=1'], 1, 'unknown scene parameter light.sun'),
        (['--suite', 'standard', '--only', 'z*'], 1, "no scene of suite standard matches 'z*'"),
        (['--suite', 'standard', '--seed', '3'], 2, '--suite cannot be combined with --seed'),
        (['--suite', 'standard', '--seed', '0'], 2, 'cannot be combined with --seed'),
        (['--only', 'x', 'noon'], 2, 'needs --suite'),
        (['noon', '--set', 'light=3', '--set', 'soil.x=1'], 1, 'light is 3: expected named'),
        ([], 2, 'nothing to render'),
        (['noon', '--set', 'light'], 2, 'expected name=value'),
    ],
)
def test_simulate_names_the_error(rendered, capsys, call, status, message):
    try:
        result = main(['simulate', *call])
    except SystemExit as exit_:
        result = exit_.code
    assert result == status
    assert message in capsys.readouterr().err
    assert rendered == []


def test_simulate_does_not_replace_other_folders(rendered, tmp_path, capsys):
    target = tmp_path / 'study_noon_1'
    target.mkdir()
    (target / 'thesis.txt').write_text('years of work')
    assert main(['simulate', 'noon', '-o', str(tmp_path), '--force']) == 1
    assert 'is not a bag' in capsys.readouterr().err
    assert (target / 'thesis.txt').exists()
