from __future__ import annotations

import xml.etree.ElementTree
from pathlib import Path

import pytest

from rover_obstacle_detection.node import transport
from rover_obstacle_detection.node.transport import (
    PROFILE,
    PROFILE_VARIABLES,
    segment_size,
    use_large_message_profile,
)

LARGEST_CLOUD = 1024 * 768 * 16


@pytest.fixture
def plenty_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, '_free_bytes', lambda folder: 1 << 40)


@pytest.mark.usefixtures('plenty_of_memory')
def test_shipped_profile_is_set_by_default(tmp_path: Path) -> None:
    environment: dict[str, str] = {}

    assert use_large_message_profile(environment, folder=tmp_path) is None

    assert environment == dict.fromkeys(PROFILE_VARIABLES, str(PROFILE))
    assert PROFILE.is_file()


@pytest.mark.usefixtures('plenty_of_memory')
@pytest.mark.parametrize(
    'environment',
    [
        {'FASTRTPS_DEFAULT_PROFILES_FILE': 'mine.xml'},
        {'FASTDDS_DEFAULT_PROFILES_FILE': 'mine.xml'},
        {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'},
        {'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'},
    ],
)
def test_transport_chosen_by_the_user_is_kept(environment: dict[str, str], tmp_path: Path) -> None:
    before = dict(environment)

    assert use_large_message_profile(environment, folder=tmp_path) is None

    assert environment == before


@pytest.mark.usefixtures('plenty_of_memory')
def test_profile_in_the_working_directory_is_kept(tmp_path: Path) -> None:
    (tmp_path / 'DEFAULT_FASTRTPS_PROFILES.xml').touch()
    environment: dict[str, str] = {}

    assert use_large_message_profile(environment, folder=tmp_path) is None

    assert environment == {}


def test_too_little_shared_memory_is_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, '_free_bytes', lambda folder: 32_000_000)
    environment: dict[str, str] = {}

    warning = use_large_message_profile(environment, folder=tmp_path)

    assert warning is not None
    assert 'has 32 MB free' in warning
    assert 'may be lost' in warning
    assert environment == {}


def test_missing_shared_memory_is_a_warning(tmp_path: Path) -> None:
    environment: dict[str, str] = {}

    warning = use_large_message_profile(
        environment, folder=tmp_path, shared_memory=tmp_path / 'none'
    )

    assert warning is not None
    assert environment == {}


def test_segment_holds_several_of_the_largest_clouds() -> None:
    root = xml.etree.ElementTree.parse(PROFILE).getroot()
    values = {each.tag.rpartition('}')[2]: each.text for each in root.iter()}

    assert segment_size() >= 4 * LARGEST_CLOUD
    assert int(values['maxMessageSize'] or 0) > LARGEST_CLOUD
    assert values['useBuiltinTransports'] == 'false'


def test_a_running_process_is_found_within_half_a_second() -> None:
    root = xml.etree.ElementTree.parse(PROFILE).getroot()
    period = next(each for each in root.iter() if each.tag.endswith('leaseAnnouncement'))
    seconds, nanoseconds = (int(each.text or '') for each in period)

    assert seconds + nanoseconds / 1e9 == 0.5
