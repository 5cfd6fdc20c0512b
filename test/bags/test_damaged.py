"""Recordings that are none, or no longer whole: one clear line, or what is left of them."""

from __future__ import annotations

import shutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recordings import (
    FRAME_NS,
    ROS1,
    ROS2,
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
    """Open a recording as a replay does and read every message; return how many."""
    with open_bag(path) as bag:
        topics = bag.stereo_topics()
        bag.camera(topics)
        return sum(1 for _ in bag.messages(list(bag.topics)))


def one_line_error(path):
    with pytest.raises((BagError, CameraError)) as caught:
        read_all(path)
    assert str(caught.value).startswith(str(path))
    assert '\n' not in str(caught.value)
    return str(caught.value)


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """One intact recording of each kind, as (the path to open, the file to damage)."""
    folder = tmp_path_factory.mktemp('whole')
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


def damaged_copy(whole, kind, target, change):
    path, file = whole[kind]
    copy = target / path.name
    (shutil.copytree if path.is_dir() else shutil.copy)(path, copy)
    damaged = copy / file.name if path.is_dir() else copy
    data = bytearray(damaged.read_bytes())
    damaged.write_bytes(change(data))
    return copy


@pytest.mark.parametrize('kind', KINDS)
def test_the_intact_recordings_are_read(whole, kind):
    assert read_all(whole[kind][0]) == 16


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
@pytest.mark.parametrize('kind', KINDS)
def test_wherever_it_is_cut_only_a_known_error_comes_out(whole, tmp_path_factory, kind, data):
    size = whole[kind][1].stat().st_size
    # The beginning and the end hold the headers and indices.
    kept = data.draw(
        st.one_of(st.integers(0, size - 1), st.integers(0, 200), st.integers(size - 600, size - 1))
    )
    copy = damaged_copy(whole, kind, tmp_path_factory.mktemp('cut'), lambda whole: whole[:kept])
    try:
        assert read_all(copy) <= 16
    except (BagError, CameraError) as error:
        assert str(copy) in str(error)  # noqa: PT017
        assert '\n' not in str(error)  # noqa: PT017
    shutil.rmtree(copy.parent)


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
@pytest.mark.parametrize('kind', KINDS)
def test_whatever_byte_is_damaged_only_a_known_error_comes_out(
    whole, tmp_path_factory, kind, data
):
    size = whole[kind][1].stat().st_size
    position = data.draw(
        st.one_of(st.integers(0, size - 1), st.integers(0, 200), st.integers(size - 600, size - 1))
    )
    value = data.draw(st.integers(0, 255))

    def change(whole):
        whole[position] = value
        return whole

    copy = damaged_copy(whole, kind, tmp_path_factory.mktemp('damaged'), change)
    try:
        read_all(copy)
    except (BagError, CameraError) as error:
        assert str(copy) in str(error)  # noqa: PT017
        assert '\n' not in str(error)  # noqa: PT017
    shutil.rmtree(copy.parent)


@pytest.mark.parametrize('kind', ['mcap chunks', 'mcap rosbags'])
def test_an_mcap_without_its_end_is_read_up_to_the_cut(whole, tmp_path, kind):
    size = whole[kind][1].stat().st_size
    copy = damaged_copy(whole, kind, tmp_path, lambda data: data[: size - 40])
    with open_bag(copy) as bag:
        assert len(bag.notes) == 1
        assert str(copy) in bag.notes[0]
        assert 'cut short or damaged' in bag.notes[0]
        assert '16 messages' in bag.notes[0]
        assert bag.message_count(LEFT) == 4
        assert (bag.start_ns, bag.end_ns) == (START_NS, START_NS + 3 * FRAME_NS + 1)
        assert bag.camera(bag.stereo_topics()).fx == 40
        times = [time_ns for _, time_ns, _ in bag.messages([LEFT], START_NS + 1)]
    assert times == [START_NS + n * FRAME_NS for n in (1, 2, 3)]


def test_half_an_mcap_gives_its_first_half(whole, tmp_path):
    size = whole['mcap chunks'][1].stat().st_size
    copy = damaged_copy(whole, 'mcap chunks', tmp_path, lambda data: data[: size // 2])
    count = read_all(copy)
    assert 4 <= count < 16


def test_a_folder_after_a_loss_of_power_is_read_up_to_the_cut(whole, tmp_path):
    size = whole['folder'][1].stat().st_size
    copy = damaged_copy(whole, 'folder', tmp_path, lambda data: data[: size - 40])
    (copy / 'metadata.yaml').unlink()
    assert read_all(copy) == 16
    (copy / 'metadata.yaml').write_bytes(b'')
    assert read_all(copy) == 16


@pytest.mark.parametrize('name', ['bag', 'bag.mcap', 'bag.db3', 'bag.bag'])
def test_no_such_recording(tmp_path, name):
    assert one_line_error(tmp_path / name).endswith('no such recording')


@pytest.mark.parametrize('name', ['bag.mcap', 'bag.db3', 'bag.bag'])
def test_an_empty_file(tmp_path, name):
    (tmp_path / name).touch()
    assert 'is empty (0 bytes)' in one_line_error(tmp_path / name)


@pytest.mark.parametrize('name', ['bag.mcap', 'bag.db3', 'bag.bag'])
def test_a_file_that_only_has_the_name_of_a_recording(tmp_path, name):
    (tmp_path / name).write_text('no recording at all\n' * 20)
    assert 'cannot be read, is it cut short or damaged?' in one_line_error(tmp_path / name)


def test_a_file_of_another_kind(tmp_path):
    (tmp_path / 'notes.txt').write_text('no recording')
    line = one_line_error(tmp_path / 'notes.txt')
    assert 'is not a recording: expected a rosbag2 folder, or a file .mcap, .db3, .bag' in line


def test_a_folder_of_other_things(tmp_path):
    (tmp_path / 'notes.txt').write_text('no recording')
    assert 'is not a recording: the folder has no metadata.yaml' in one_line_error(tmp_path)


def test_metadata_whose_files_are_gone(tmp_path):
    folder = write_ros2(tmp_path / 'bag', text_messages())
    next(folder.glob('*.mcap')).unlink()
    assert 'files are missing' in one_line_error(folder)


def test_a_recording_without_messages(tmp_path):
    folder = write_ros2(tmp_path / 'bag', [])
    assert 'no stereo topics: it holds no topics' in one_line_error(folder)


def test_a_rosbag1_that_was_not_closed(whole, tmp_path):
    def forget_index(data):
        at = data.index(b'index_pos=') + len(b'index_pos=')
        data[at : at + 8] = bytes(8)
        return data

    copy = damaged_copy(whole, 'rosbag1', tmp_path, forget_index)
    assert 'reindex' in one_line_error(copy)


def test_custom_types_that_cannot_be_parsed_do_not_stop_the_salvage(tmp_path):
    messages = stereo_messages(3) + text_messages()
    path = write_mcap(tmp_path / 'bag.mcap', messages, chunk_size=300)
    data = path.read_bytes().replace(b'string data', b'?!ring data')
    path.write_bytes(data[:-40])
    with open_bag(path) as bag:
        assert bag.camera(bag.stereo_topics()).fx == 40
        assert len(list(bag.messages([LEFT]))) == 3
    assert ROS2.typestore.types
