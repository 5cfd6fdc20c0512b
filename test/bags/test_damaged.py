"""Damaged, truncated and missing recordings: read what is left, or fail with one clear line."""

from __future__ import annotations

import os
import shutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recordings import (
    FRAME_NS,
    ROS1,
    START_NS,
    stereo_messages,
    text_messages,
    write_mcap,
    write_ros1,
    write_ros2,
)

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.errors import BagError, CameraError

LEFT = '/stereo/left/image_rect'
KINDS = ['mcap chunks', 'mcap one chunk', 'mcap rosbags', 'sqlite3', 'rosbag1', 'folder']


def read_all(path):
    """Open a recording as a replay does, read every message and return their number."""
    with open_bag(path) as bag:
        bag.calibration(bag.stereo_topics())
        return sum(1 for _ in bag.messages(list(bag.topics)))


def error_of(path):
    with pytest.raises((BagError, CameraError)) as caught:
        read_all(path)
    line = str(caught.value)
    assert line.startswith(str(path))
    assert '\n' not in line
    return line


def read_or_fail_clearly(path):
    """Return the number of messages, or 0 after a known error of one line."""
    try:
        return read_all(path)
    except (BagError, CameraError) as error:
        assert str(path) in str(error)  # noqa: PT017
        assert '\n' not in str(error)  # noqa: PT017
        return 0


@pytest.fixture(scope='module')
def intact(tmp_path_factory):
    """One intact recording of each kind, as (path to open, file to damage)."""
    folder = tmp_path_factory.mktemp('intact')
    messages = stereo_messages(4)
    chunks = write_mcap(folder / 'chunks.mcap', messages, chunk_size=500)
    one = write_mcap(folder / 'one.mcap', messages)
    rosbags = next(write_ros2(folder / 'rosbags', messages, compression='storage').glob('*.mcap'))
    sqlite = next(write_ros2(folder / 'sqlite', messages, 'sqlite3').glob('*.db3'))
    ros1 = write_ros1(folder / 'ros1.bag', stereo_messages(4, factory=ROS1))
    split = write_ros2(folder / 'split', messages)
    return {
        'mcap chunks': (chunks, chunks),
        'mcap one chunk': (one, one),
        'mcap rosbags': (rosbags, rosbags),
        'sqlite3': (sqlite, sqlite),
        'rosbag1': (ros1, ros1),
        'folder': (split, next(split.glob('*.mcap'))),
    }


def positions(size):
    """Draw byte positions, often in the headers at the start and the indices at the end."""
    return st.one_of(
        st.integers(0, size - 1), st.integers(0, 200), st.integers(size - 600, size - 1)
    )


def damaged_copy(intact, kind, target, change):
    path, file = intact[kind]
    copy = target / path.name
    (shutil.copytree if path.is_dir() else shutil.copy)(path, copy)
    damaged = copy / file.name if path.is_dir() else copy
    data = bytearray(damaged.read_bytes())
    damaged.write_bytes(change(data))
    return copy


@pytest.mark.parametrize('kind', KINDS)
def test_intact_recordings_are_read(intact, kind):
    assert read_all(intact[kind][0]) == 16


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
@pytest.mark.parametrize('kind', KINDS)
def test_a_recording_cut_anywhere_raises_only_known_errors(intact, tmp_path_factory, kind, data):
    kept = data.draw(positions(intact[kind][1].stat().st_size))
    copy = damaged_copy(intact, kind, tmp_path_factory.mktemp('cut'), lambda data: data[:kept])
    assert read_or_fail_clearly(copy) <= 16
    shutil.rmtree(copy.parent)


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
@pytest.mark.parametrize('kind', KINDS)
def test_any_damaged_byte_raises_only_known_errors(intact, tmp_path_factory, kind, data):
    position = data.draw(positions(intact[kind][1].stat().st_size))
    value = data.draw(st.integers(0, 255))

    def change(content):
        content[position] = value
        return content

    copy = damaged_copy(intact, kind, tmp_path_factory.mktemp('damaged'), change)
    read_or_fail_clearly(copy)
    shutil.rmtree(copy.parent)


@pytest.mark.parametrize('kind', ['mcap chunks', 'mcap rosbags'])
def test_an_mcap_without_its_end_is_read_up_to_the_cut(intact, tmp_path, kind):
    size = intact[kind][1].stat().st_size
    copy = damaged_copy(intact, kind, tmp_path, lambda data: data[: size - 40])
    with open_bag(copy) as bag:
        assert len(bag.notes) == 1
        assert str(copy) in bag.notes[0]
        assert 'cut short or damaged' in bag.notes[0]
        assert '16 messages' in bag.notes[0]
        assert bag.message_count(LEFT) == 4
        assert (bag.start_ns, bag.end_ns) == (START_NS, START_NS + 3 * FRAME_NS + 1)
        assert bag.calibration(bag.stereo_topics()).camera.fx == 40
        times = [time_ns for _, time_ns, _ in bag.messages([LEFT], START_NS + 1)]
    assert times == [START_NS + n * FRAME_NS for n in (1, 2, 3)]


def test_half_an_mcap_yields_the_messages_before_the_cut(intact, tmp_path):
    size = intact['mcap chunks'][1].stat().st_size
    copy = damaged_copy(intact, 'mcap chunks', tmp_path, lambda data: data[: size // 2])
    count = read_all(copy)
    assert 4 <= count < 16


def test_a_folder_left_by_a_power_loss_is_read_up_to_the_cut(intact, tmp_path):
    size = intact['folder'][1].stat().st_size
    copy = damaged_copy(intact, 'folder', tmp_path, lambda data: data[: size - 40])
    (copy / 'metadata.yaml').unlink()
    assert read_all(copy) == 16
    (copy / 'metadata.yaml').write_bytes(b'')
    assert read_all(copy) == 16


@pytest.mark.parametrize('name', ['bag', 'bag.mcap', 'bag.db3', 'bag.bag'])
def test_missing_recording(tmp_path, name):
    assert error_of(tmp_path / name).endswith('no such recording')


NAMES = ['bag.mcap', 'bag.db3', 'bag.bag', 'bag.mcap.zstd', 'bag.db3.zstd']


@pytest.mark.parametrize('name', NAMES)
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    assert error_of(tmp_path / name).endswith('is no file, but a pipe or a device')
    assert 'is not a recording: the folder has no' in error_of(tmp_path)


@pytest.mark.parametrize('name', NAMES)
def test_empty_file(tmp_path, name):
    (tmp_path / name).touch()
    assert 'is empty (0 bytes)' in error_of(tmp_path / name)


@pytest.mark.parametrize('name', ['bag.mcap', 'bag.db3', 'bag.bag'])
def test_text_in_a_file_named_like_a_recording(tmp_path, name):
    (tmp_path / name).write_text('no recording at all\n' * 20)
    assert 'cannot be read; is it cut short or damaged?' in error_of(tmp_path / name)


def test_file_with_another_suffix(tmp_path):
    (tmp_path / 'notes.txt').write_text('no recording')
    line = error_of(tmp_path / 'notes.txt')
    assert 'is not a recording: expected a rosbag2 folder, a .mcap, .db3, .bag file or a' in line


def test_an_image_leads_to_the_folder_and_to_detect(tmp_path):
    (tmp_path / 'left.PNG').write_bytes(b'')
    line = error_of(tmp_path / 'left.PNG')
    assert 'left.PNG: is an image: expected a rosbag2 folder, a .mcap' in line
    assert 'a folder of images; for two image files, there is rover-obstacles detect' in line


def test_folder_without_a_recording(tmp_path):
    (tmp_path / 'notes.txt').write_text('no recording')
    assert 'is not a recording: the folder has no metadata.yaml' in error_of(tmp_path)


def test_metadata_without_its_files(tmp_path):
    folder = write_ros2(tmp_path / 'bag', text_messages())
    next(folder.glob('*.mcap')).unlink()
    assert 'files are missing' in error_of(folder)


def test_recording_without_messages(tmp_path):
    folder = write_ros2(tmp_path / 'bag', [])
    assert 'no stereo topics: the recording has no topics' in error_of(folder)


def test_rosbag1_that_was_not_closed(intact, tmp_path):
    def forget_index(data):
        at = data.index(b'index_pos=') + len(b'index_pos=')
        data[at : at + 8] = bytes(8)
        return data

    copy = damaged_copy(intact, 'rosbag1', tmp_path, forget_index)
    assert 'reindex' in error_of(copy)


def test_invalid_message_definitions_do_not_stop_a_salvage(tmp_path):
    messages = stereo_messages(3) + text_messages()
    path = write_mcap(tmp_path / 'bag.mcap', messages, chunk_size=300)
    data = path.read_bytes().replace(b'string data', b'?!ring data')
    path.write_bytes(data[:-40])
    with open_bag(path) as bag:
        assert bag.calibration(bag.stereo_topics()).camera.fx == 40
        assert len(list(bag.messages([LEFT]))) == 3
