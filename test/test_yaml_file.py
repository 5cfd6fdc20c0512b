"""YAML files that are damaged, hostile or no YAML at all: one line that names the file."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from rover_obstacle_detection.errors import CameraError, ConfigurationError
from rover_obstacle_detection.messages.calibration import load_camera_info
from rover_obstacle_detection.parameter_file import load_config
from rover_obstacle_detection.yaml_file import MAX_BYTES, MAX_DEPTH, read_yaml

ALIASES = 'anchors and aliases are not supported on line 1'
BOMB = 'a: &a [x, x]\n' + ''.join(
    f'{name}: &{name} [{", ".join([f"*{before}"] * 9)}]\n'
    for before, name in itertools.pairwise('abcdefghij')
)
CASES = {
    'a date that does not exist': ('a: 2024-13-45', 'month must be in 1..12'),
    'an integer of 5,000 digits': ('a: ' + '9' * 5000, '5000 digits'),
    'an integer of 5,000 hexadecimal digits': ('a: 0x' + 'f' * 5000, 'more than 64 bits'),
    'a key that is a large integer': ('? 0x' + 'f' * 5000 + '\n: 1', 'more than 64 bits'),
    'a list that contains itself': ('&a [*a]', ALIASES),
    'a mapping merged into itself': ('a: &a\n  <<: *a', ALIASES),
    'aliases of aliases': (BOMB, ALIASES),
    'a key that is a mapping': ('? {a: [1]}\n: 2', 'unhashable'),
    'a key that is a list': ('? [a, [b]]\n: 2', 'unhashable'),
    'brackets': ('[' * 5000, 'nested more than 32 deep on line 1'),
    'braces': ('{a: ' * 3000, 'nested more than 32 deep on line 1'),
    'more values than any file of these has': ('[' + '1, ' * 20_000, 'more than 10000 values'),
    'indentation': (''.join(f'{" " * depth}a:\n' for depth in range(99)), 'nested more than 32'),
    'a duplicate key': ('a: 1\na: 2', 'found duplicate key "a"'),
    'a number that is none': ('a: !!int x', "invalid literal for int() with base 10: 'x'"),
    'a tag of Python': ('a: !!python/object:os.system x', 'could not determine a constructor'),
    'two documents': ('a: 1\n---\nb: 2', 'found another document on line 2'),
    'a control character': ('a: \0', 'unacceptable character'),
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / 'file.yaml'


@pytest.mark.parametrize(('text', 'words'), CASES.values(), ids=CASES)
def test_text_that_is_refused(file: Path, text: str, words: str) -> None:
    file.write_text(text)
    for load, error_type in ((load_config, ConfigurationError), (load_camera_info, CameraError)):
        with pytest.raises(error_type) as caught:
            load(file)
        message = str(caught.value)
        assert message.startswith(f'{file}: is not valid YAML: ')
        assert words in message
        assert '\n' not in message
        assert len(message) < len(str(file)) + 300


def test_bytes_that_are_not_text_are_refused(file: Path) -> None:
    file.write_bytes(bytes(range(256)))
    with pytest.raises(ConfigurationError, match=r'file\.yaml: is not valid YAML: expected UTF-8'):
        load_config(file)


def test_a_large_file_is_not_read(file: Path) -> None:
    file.symlink_to('/dev/zero')
    with pytest.raises(CameraError) as caught:
        load_camera_info(file)
    assert str(caught.value) == (
        f'{file}: has more than {MAX_BYTES} bytes: expected a calibration file'
    )


def test_nesting_up_to_the_limit_is_read(file: Path) -> None:
    file.write_text('[' * MAX_DEPTH + ']' * MAX_DEPTH)
    content = read_yaml(file, 'file', ConfigurationError)
    for _ in range(MAX_DEPTH - 1):
        assert isinstance(content, list)
        (content,) = content
    assert content == []
    file.write_text('[' * (MAX_DEPTH + 1) + ']' * (MAX_DEPTH + 1))
    with pytest.raises(ConfigurationError, match='nested more than 32 deep on line 1'):
        read_yaml(file, 'file', ConfigurationError)


def test_values_of_all_kinds_are_read(file: Path) -> None:
    file.write_text('{a: [1, 2.5, true, text, null, 9223372036854775807], b: {c: -1}}')
    assert read_yaml(file, 'file', ConfigurationError) == {
        'a': [1, 2.5, True, 'text', None, 2**63 - 1],
        'b': {'c': -1},
    }
