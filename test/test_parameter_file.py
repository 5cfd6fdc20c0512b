from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.parameter_file import (
    NODE_PARAMETER_NAMES,
    check_node_file,
    dump_config,
    load_config,
)


@pytest.fixture
def load(tmp_path):
    def load_text(text):
        path = tmp_path / 'parameters.yaml'
        path.write_text(text)
        return load_config(path)

    return load_text


@pytest.mark.parametrize(
    'key',
    [
        '/**',
        'obstacle_detector',
        '/obstacle_detector',
        '/rover/front/obstacle_detector',
        '/**/obstacle_detector',
        '/*/obstacle_detector',
    ],
)
def test_parameters_are_found_under_the_node_and_under_wildcards(load, key):
    config = load(f'{key}:\n  ros__parameters:\n    max_step: 0.2\n    method: study\n')
    assert config == DetectorConfig(max_step=0.2, method='study')


def test_namespaces_may_be_nested(load):
    config = load('rover:\n  obstacle_detector:\n    ros__parameters: {max_step: 0.2}\n')
    assert config == DetectorConfig(max_step=0.2)


def test_the_node_overrides_the_wildcard_in_any_order(load):
    text = """
obstacle_detector: {ros__parameters: {max_step: 0.3}}
/**: {ros__parameters: {max_step: 0.2, max_slope: 15}}
"""
    assert load(text) == DetectorConfig(max_step=0.3, max_slope=15.0)


def test_whole_numbers_become_floats(load):
    config = load('/**: {ros__parameters: {max_step: 1}}')
    assert config.max_step == 1.0
    assert isinstance(config.max_step, float)


def test_parameters_of_the_live_node_are_ignored(load):
    text = """
/**:
  ros__parameters:
    use_sim_time: true
    approximate_sync: true
    qos_overrides:
      /left/image_rect: {subscription: {reliability: reliable}}
    max_step: 0.2
"""
    assert load(text) == DetectorConfig(max_step=0.2)


def test_the_known_node_parameters_are_those_it_declares():
    settings = pytest.importorskip('rover_obstacle_detection.node.settings')
    declared = {each.name for each in settings.NODE_PARAMETERS}
    assert declared | {'use_sim_time', 'start_type_description_service'} == NODE_PARAMETER_NAMES


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('/**: {ros__parameters: {max_stepp: 1}}', 'max_stepp is not a parameter: did you mean'),
        ('/**: {ros__parameters: {zzz: 1}}', 'zzz is not a parameter: expected'),
        ('/**: {ros__parameters: {max_step: 99.0}}', 'max_step is 99.0: expected 0.01 to 2'),
        ('/**: {ros__parameters: {max_step: high}}', "max_step is 'high': expected a number"),
        ('/**: {ros__parameters: {sgbm_mode: 1.5}}', 'sgbm_mode is 1.5: expected a whole number'),
        ('/**: {ros__parameters: {method: magic}}', "method is 'magic': expected one of"),
        ('/**: {ros__parameters: {P1: 9, P2: 8}}', 'P2 is 8.0: expected more than P1'),
        ('/**: {ros__parameters: [1]}', 'ros__parameters of ** is [1]: expected name: value'),
        ('other: {ros__parameters: {x: 1}}', 'only has parameters of other'),
        ('max_step: 0.2', 'is not a ROS parameter file'),
        ('ros__parameters: {max_step: 0.2}', 'is not a ROS parameter file'),
        ('', 'is not a ROS parameter file'),
        ('a: [1', 'is not valid YAML'),
        ('a: 1\na: 2', 'is not valid YAML: found duplicate key "a"'),
    ],
)
def test_errors_name_the_file_and_the_cause_in_one_line(load, tmp_path, text, words):
    with pytest.raises(ConfigurationError) as caught:
        load(text)
    assert str(caught.value).startswith(f'{tmp_path / "parameters.yaml"}: {words}')
    assert '\n' not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r'none\.yaml: no such parameter file'):
        load_config(tmp_path / 'none.yaml')
    with pytest.raises(ConfigurationError, match='cannot be read: Is a directory'):
        load_config(tmp_path)


@settings(max_examples=20)
@given(st.floats(0.01, 2.0), st.sampled_from(['hybrid', 'study']), st.booleans())
def test_a_dumped_configuration_loads_unchanged(tmp_path_factory, step, method, equalize):
    config = DetectorConfig(max_step=step, method=method, equalize_histogram=equalize)
    path = tmp_path_factory.mktemp('dump') / 'parameters.yaml'
    path.write_text(dump_config(config))
    assert load_config(path) == config
    text = path.read_text()
    for description in DetectorConfig.parameters():
        assert f'    {description.name}: ' in text
        assert description.description.split()[0] in text


@pytest.mark.parametrize(
    ('key', 'name', 'matches'),
    [
        ('/**', '/stereo/obstacle_detector', True),
        ('obstacle_detector', '/obstacle_detector', True),
        ('obstacle_detector', '/stereo/obstacle_detector', False),
        ('/obstacle_detector', '/stereo/obstacle_detector', False),
        ('stereo/obstacle_detector', '/stereo/obstacle_detector', True),
        ('/stereo:\n obstacle_detector', '/stereo/obstacle_detector', True),
        ('/stereo/obstacle_detector', '/rover/stereo/obstacle_detector', False),
        ('/*/obstacle_detector', '/stereo/obstacle_detector', True),
        ('/*/obstacle_detector', '/obstacle_detector', False),
        ('/**/obstacle_detector', '/obstacle_detector', True),
        ('/**/obstacle_detector', '/rover/stereo/obstacle_detector', True),
        ('/stereo/*', '/stereo/obstacle_detector', True),
        ('/stereo/**', '/stereo/obstacle_detector', True),
        ('/stereo/**', '/obstacle_detector', False),
        ('controller', '/stereo/obstacle_detector', False),
    ],
)
def test_a_file_for_other_nodes_only_is_refused(tmp_path, key, name, matches):
    path = tmp_path / 'parameters.yaml'
    path.write_text(f'{key}:\n  ros__parameters: {{max_step: 0.2}}\n')
    if matches:
        check_node_file(path, name)
        return
    full_key = '/' + key.strip('/')
    with pytest.raises(ConfigurationError) as caught:
        check_node_file(path, name)
    assert str(caught.value) == (
        f'{path}: only has parameters of {full_key}: expected /** or {name}'
    )


def test_a_file_without_parameters_is_refused(tmp_path):
    path = tmp_path / 'parameters.yaml'
    path.write_text('max_step: 0.2')
    with pytest.raises(ConfigurationError, match='is not a ROS parameter file'):
        check_node_file(path, '/obstacle_detector')
    with pytest.raises(ConfigurationError, match='no such parameter file'):
        check_node_file(tmp_path / 'none.yaml', '/obstacle_detector')
