"""Recordings that decompress to more than they should."""

from __future__ import annotations

import bz2
import errno
import os

import lz4.frame
import pytest
from mcap.writer import CompressionType
from recordings import ROS1, ROS2, WRITERS, stereo_messages, write_mcap, write_ros1, write_ros2
from rosbags.rosbag1 import Writer as Writer1

from rover_obstacle_detection.bags import decompression, sources
from rover_obstacle_detection.bags.decompression import (
    TooLargeError,
    decompress_bz2,
    decompress_lz4,
    decompress_zstd,
)
from rover_obstacle_detection.bags.reader import bag_name, open_bag
from rover_obstacle_detection.errors import BagError

COMPRESSED = {
    **{name: write for name, write in WRITERS.items() if 'zstd' in name or name == 'mcap file'},
    'mcap file, lz4': lambda path, messages: write_mcap(
        path.with_suffix('.mcap'), messages, compression=CompressionType.LZ4
    ),
    'mcap file cut short': lambda path, messages: cut_short(
        write_mcap(path.with_suffix('.mcap'), messages)
    ),
    'lone mcap.zstd': lambda path, messages: whole(
        write_mcap(path.with_suffix('.mcap'), messages)
    ),
    'lone mcap.zstd cut short before': lambda path, messages: whole(
        cut_short(write_mcap(path.with_suffix('.mcap'), messages))
    ),
    'lone db3.zstd': lambda path, messages: next(
        write_ros2(path, messages, 'sqlite3', 'file').glob('*.db3.zstd')
    ),
    'rosbag1, bz2': lambda path, messages: write_ros1(
        path.with_suffix('.bag'), messages, Writer1.CompressionFormat.BZ2
    ),
    'rosbag1, lz4': lambda path, messages: write_ros1(
        path.with_suffix('.bag'), messages, Writer1.CompressionFormat.LZ4
    ),
}


def whole(path):
    """Compress a file as `ros2 bag record --compression-mode file` does, and leave only that."""
    compressed = path.with_name(f'{path.name}.zstd')
    compressed.write_bytes(decompression._zstd.compress(path.read_bytes()))
    path.unlink()
    return compressed


def cut_short(path):
    path.write_bytes(path.read_bytes()[:-30])
    return path


def read(path):
    with open_bag(path) as bag:
        return list(bag.messages(list(bag.topics)))


@pytest.fixture(params=COMPRESSED)
def recording(request, tmp_path):
    factory = ROS1 if 'rosbag1' in request.param else ROS2
    return COMPRESSED[request.param](tmp_path / 'bag', stereo_messages(3, factory=factory))


def test_compressed_recordings_are_read(recording):
    assert len(read(recording)) == 12


def test_a_recording_beyond_the_limit_is_refused(recording, monkeypatch):
    monkeypatch.setattr(decompression, 'MAX_BYTES', 500)
    monkeypatch.setattr(decompression, 'MAX_FILE_RATIO', 0)
    with pytest.raises(BagError) as caught:
        read(recording)
    message = str(caught.value)
    assert message.startswith(f'{recording}: ')
    assert 'after decompression: expected at most ' in message
    assert '\n' not in message


def test_a_file_may_have_many_times_its_compressed_size(tmp_path, monkeypatch):
    monkeypatch.setattr(decompression, 'MAX_BYTES', 8_000)
    recording = WRITERS['mcap zstd file'](tmp_path / 'bag', stereo_messages(9))
    assert len(read(recording)) == 36


zstd = decompression._zstd
DATA = bytes(3_000_000) + b'end'
FORMATS = {
    'zstd': (decompress_zstd, zstd.compress),
    'zstd without a size': (
        decompress_zstd,
        lambda data: (compressor := zstd.ZstdCompressor()).compress(data) + compressor.flush(),
    ),
    'lz4': (decompress_lz4, lz4.frame.compress),
    'lz4 without a size': (
        decompress_lz4,
        lambda data: lz4.frame.compress(data, store_size=False),
    ),
    'bz2': (decompress_bz2, bz2.compress),
}


@pytest.mark.parametrize(('decompress', 'compress'), FORMATS.values(), ids=FORMATS)
def test_data_is_decompressed_up_to_the_limit(decompress, compress, monkeypatch):
    monkeypatch.setattr(decompression, 'MAX_BYTES', len(DATA))
    assert decompress(compress(DATA)) == DATA
    assert decompress(compress(DATA[:500_000]) + compress(DATA[500_000:])) == DATA
    with pytest.raises(TooLargeError, match=f'expected at most {len(DATA)}'):
        decompress(compress(DATA + b'.'))
    with pytest.raises(TooLargeError):
        decompress(compress(DATA) + compress(b'.'))
    with pytest.raises(Exception, match=r'.'):
        decompress(compress(DATA)[:-10])


def test_a_lone_compressed_file_is_read_and_leaves_nothing_behind(tmp_path, monkeypatch):
    recording = whole(write_mcap(tmp_path / 'drive.mcap', stereo_messages(2)))
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(temporary))

    with open_bag(recording) as bag:
        assert bag.notes == ()
        assert len(list(bag.messages(list(bag.topics)))) == 8
        assert list(temporary.rglob('*.mcap'))

    assert list(temporary.iterdir()) == []
    assert list(tmp_path.glob('*.mcap')) == []
    assert bag_name(recording) == 'drive'


def test_damage_is_reported_of_the_compressed_file(tmp_path, monkeypatch):
    inner = whole(cut_short(write_mcap(tmp_path / 'inner.mcap', stereo_messages(2))))
    with open_bag(inner) as bag:
        (note,) = bag.notes
    assert note.startswith(f'{inner}: cut short or damaged')

    outer = whole(write_mcap(tmp_path / 'outer.mcap', stereo_messages(2)))
    outer.write_bytes(outer.read_bytes()[:-20])
    empty = tmp_path / 'empty.mcap.zstd'
    empty.write_bytes(b'')
    other = tmp_path / 'other.mcap.zstd'
    other.write_bytes(decompression._zstd.compress(b'not a recording'))
    for path in (outer, empty, other):
        with pytest.raises(BagError) as caught:
            read(path)
        assert str(caught.value).startswith(f'{path}: ')
        assert 'tmp' not in str(caught.value).replace(str(path), '')
        assert '\n' not in str(caught.value)


def test_what_precedes_the_end_of_a_compressed_file_cut_short_is_read(tmp_path):
    recording = write_mcap(tmp_path / 'drive.mcap', stereo_messages(200), chunk_size=4096)
    complete = len(read(recording))
    compressed = whole(recording)
    compressed.write_bytes(compressed.read_bytes()[: compressed.stat().st_size // 2])
    with open_bag(compressed) as bag:
        (note,) = bag.notes
        found = len(list(bag.messages(list(bag.topics))))
    assert 0 < found < complete
    assert note.startswith(f'{compressed}: cut short or damaged (')
    assert note.endswith(f'; {found} messages can be read')


def test_only_the_end_of_a_compressed_file_is_lost(tmp_path):
    compressed = whole(write_mcap(tmp_path / 'drive.mcap', stereo_messages(2)))
    plain = decompression._zstd.decompress(compressed.read_bytes())
    compressor = decompression._zstd.ZstdCompressor()
    # All blocks, but not the last one, which is empty and says that it is the last.
    compressed.write_bytes(compressor.compress(plain, compressor.FLUSH_BLOCK))
    with open_bag(compressed) as bag:
        assert len(list(bag.messages(list(bag.topics)))) == 8
        (note,) = bag.notes
    assert note.startswith(f'{compressed}: cut short (')
    assert note.endswith('; what precedes can be read')


@pytest.mark.parametrize('number', [errno.ENOSPC, errno.EACCES])
def test_a_full_disk_is_not_taken_for_damage(tmp_path, monkeypatch, number):
    compressed = whole(write_mcap(tmp_path / 'drive.mcap', stereo_messages(2)))

    def fail(path, plain):
        raise OSError(number, os.strerror(number), str(plain))

    monkeypatch.setattr(sources, 'decompress_file', fail)
    with pytest.raises(BagError) as caught:
        read(compressed)
    reason = os.strerror(number)
    assert str(caught.value) == f'{compressed}: cannot be decompressed: {reason}'


def test_other_compressed_files_are_no_recordings(tmp_path):
    path = tmp_path / 'notes.txt.zstd'
    path.write_bytes(decompression._zstd.compress(b'text'))
    with pytest.raises(BagError, match='is not a recording'):
        read(path)


def test_a_folder_without_metadata_has_each_file_once(tmp_path):
    first = write_mcap(tmp_path / 'a.mcap', stereo_messages(2))
    kept = first.read_bytes()
    whole(first)
    assert len(read(tmp_path)) == 8
    # A recorder that was killed while it compressed leaves both.
    first.write_bytes(kept)
    assert len(read(tmp_path)) == 8
