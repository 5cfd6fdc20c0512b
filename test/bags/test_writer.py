from __future__ import annotations

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from recordings import FRAME_NS, START_NS, image, pixels
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.messages.cloud import encode_cloud
from rover_obstacle_detection.messages.header import make_header, stamp_ns
from rover_obstacle_detection.messages.image import decode_image

MASK, POINTS = '/stereo/obstacle_mask', '/stereo/obstacle_points'
IMAGE, CLOUD = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/PointCloud2'


def cloud(number):
    return np.arange(4 * number, dtype=np.float32).reshape(number, 4)


@pytest.fixture(params=[True, False], ids=['compressed', 'plain'])
def written(request, tmp_path):
    with BagWriter(tmp_path / 'out' / 'detections', compress=request.param) as writer:
        for number in range(3):
            stamp = START_NS + number * FRAME_NS
            header = make_header(stamp, 'left_optical', writer.factory)
            writer.add(MASK, IMAGE, image(pixels(number), stamp), stamp)
            writer.add(POINTS, CLOUD, encode_cloud(cloud(number), header, writer.factory), stamp)
    return tmp_path / 'out' / 'detections'


def test_a_written_recording_can_be_read(written):
    with open_bag(written) as bag:
        assert bag.topics == {MASK: IMAGE, POINTS: CLOUD}
        assert bag.notes == ()
        masks = list(bag.messages([MASK]))
    assert [time_ns for _, time_ns, _ in masks] == [START_NS + n * FRAME_NS for n in range(3)]
    for number, (_, time_ns, message) in enumerate(masks):
        assert stamp_ns(message.header) == time_ns
        np.testing.assert_array_equal(decode_image(message, MASK), pixels(number))


def test_rosbags_reads_it_without_standard_definitions(written):
    with AnyReader([written]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            assert message.header.frame_id == 'left_optical'
        assert reader.message_count == 6


def test_the_mcap_package_decodes_it(written):
    with (written / 'detections.mcap').open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        read = [(channel.topic, each) for _, channel, _, each in reader.iter_decoded_messages()]
    masks = [message for topic, message in read if topic == MASK]
    clouds = [message for topic, message in read if topic == POINTS]
    assert len(masks) == len(clouds) == 3
    for number, (mask, points) in enumerate(zip(masks, clouds, strict=True)):
        assert mask.encoding == 'mono8'
        assert bytes(mask.data) == pixels(number).tobytes()
        assert bytes(points.data) == cloud(number).tobytes()
        assert [field.name for field in points.fields] == ['x', 'y', 'z', 'height']
        assert mask.header.stamp.nanosec == number * FRAME_NS
        assert mask.header.frame_id == 'left_optical'


def test_an_exception_leaves_nothing_behind(tmp_path):
    target = tmp_path / 'detections'

    def write_and_fail():
        with BagWriter(target) as writer:
            writer.add(MASK, IMAGE, image(pixels(0), START_NS), START_NS)
            assert not target.exists()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_and_fail()
    assert list(tmp_path.iterdir()) == []


def test_an_empty_recording_can_be_read(tmp_path):
    with BagWriter(tmp_path / 'detections'):
        pass
    with open_bag(tmp_path / 'detections') as bag:
        assert bag.topics == {}
        assert (bag.start_ns, bag.end_ns) == (0, 0)


def test_an_existing_folder_is_not_overwritten(tmp_path):
    (tmp_path / 'detections').mkdir()
    with pytest.raises(OutputError, match='already exists'), BagWriter(tmp_path / 'detections'):
        pass
    assert list(tmp_path.iterdir()) == [tmp_path / 'detections']


def test_an_unwritable_path_is_named(tmp_path):
    (tmp_path / 'file').touch()
    target = tmp_path / 'file' / 'detections'
    with pytest.raises(OutputError, match=f'{target}: cannot be written: '), BagWriter(target):
        pass


def test_a_full_disk_is_reported_and_leaves_nothing_behind(tmp_path, monkeypatch):
    target = tmp_path / 'detections'

    def fill_up():
        with BagWriter(target) as writer:

            def no_space(*_):
                raise OSError(28, 'No space left on device')

            monkeypatch.setattr(writer._writer, 'write', no_space)
            writer.add(MASK, IMAGE, image(pixels(0), START_NS), START_NS)

    with pytest.raises(OutputError, match='cannot be written: No space left on device'):
        fill_up()
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_is_removed(tmp_path, caplog):
    left = tmp_path / '.detections.partial' / 'detections'
    left.mkdir(parents=True)
    (left / 'detections.mcap').write_bytes(b'cut short')
    with BagWriter(tmp_path / 'detections'):
        pass
    assert '.detections.partial is left over from a run that was killed' in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ['detections']


def test_two_processes_do_not_write_the_same_recording(tmp_path):
    target = tmp_path / 'detections'
    with (
        BagWriter(target),
        pytest.raises(OutputError, match=f'another run is writing to {target}'),
        BagWriter(target),
    ):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ['detections']
