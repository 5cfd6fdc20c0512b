from __future__ import annotations

from dataclasses import fields, is_dataclass

import pytest
from synthetic import mast, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.parameters import DetectorParameters

# The stages whose parameters depend on each field.
CONFIGURED = {
    'method': ('stereo', 'result'),
    'max_step': ('plane_fit', 'resolution', 'terrain', 'rocks', 'result'),
    'max_slope': ('ground_check', 'terrain'),
    'max_roughness': ('terrain',),
    'camera_height': ('plane_fit',),
    'max_camera_pitch': ('plane_fit',),
    'max_camera_roll': ('plane_fit',),
    'speed': ('resolution',),
    'working_scale': ('resolution',),
    'ground_cell': ('result',),
    'grid_cell': ('result',),
    'grid_extent': ('result',),
    'min_range': ('stereo',),
    'max_range': ('plane_fit', 'resolution', 'terrain', 'rocks', 'study'),
    'min_disparity': ('stereo',),
    'disparity_range': ('stereo', 'study'),
    'correlation_window_size': ('stereo', 'result'),
    'P1': ('stereo',),
    'P2': ('stereo',),
    'uniqueness_ratio': ('stereo',),
    'speckle_size': ('stereo',),
    'speckle_range': ('stereo',),
    'disp12_max_diff': ('stereo',),
    'prefilter_cap': ('stereo',),
    'sgbm_mode': ('stereo',),
    'smoothness': ('stereo',),
    'core_share': ('rocks',),
    'core_noises': ('rocks',),
    'outline_probability': ('rocks',),
    'min_confidence': ('result',),
    'mean_shift_spatial_radius': ('regions',),
    'mean_shift_color_radius': ('regions',),
    'min_region_size': ('regions',),
    'min_seed_points': ('regions',),
    'window_size': ('study',),
    'study_max_roughness': ('study',),
    'study_max_step': ('study',),
    'dark_grey_level': ('study',),
    'morphology_size': ('study',),
    'morphology_iterations': ('study',),
}
# Read by the detector itself: each with a configuration in which it matters.
DIRECT = {
    'gravity_source': {'gravity_source': 'parameters', 'camera_pitch': 30.0},
    'camera_pitch': {'gravity_source': 'parameters', 'camera_pitch': 40.0},
    'camera_roll': {'gravity_source': 'parameters', 'camera_pitch': 46.0, 'camera_roll': 5.0},
    'equalize_histogram': {'equalize_histogram': True},
    'upside_down': {'upside_down': True, 'gravity_source': 'parameters', 'camera_pitch': 46.0},
}
DESCRIPTIONS = {each.name: each for each in DetectorConfig.parameters()}
STAGES = [each.name for each in fields(DetectorParameters) if each.name != 'config']


def another_value(each):
    """A valid value that is not the default."""
    if each.choices:
        return next(choice for choice in each.choices if choice != each.default)
    step = each.step or (1 if isinstance(each.default, int) else (each.maximum - each.default) / 7)
    value = each.default + step
    return value if value <= each.maximum else each.default - step


def parameters(**config):
    return DetectorParameters.from_config(DetectorConfig(**config))


def test_every_field_of_the_configuration_is_checked_here():
    assert set(CONFIGURED) | set(DIRECT) == set(DESCRIPTIONS)
    assert not set(CONFIGURED) & set(DIRECT)


@pytest.mark.parametrize(('name', 'stages'), CONFIGURED.items(), ids=CONFIGURED)
def test_field_reaches_its_stages_and_no_others(name, stages):
    default, changed = parameters(), parameters(**{name: another_value(DESCRIPTIONS[name])})
    different = [stage for stage in STAGES if getattr(default, stage) != getattr(changed, stage)]
    assert different == list(stages)
    assert changed.config != default.config


@pytest.mark.parametrize(('name', 'config'), DIRECT.items(), ids=DIRECT)
def test_detector_reads_the_other_fields_itself(name, config):
    scene = mast()
    view = render(scene)
    default = {key: value for key, value in config.items() if key != name}
    changed, same = (
        Detector(scene.camera, DetectorConfig(**each)).detect(view.left, view.right)
        for each in (config, default)
    )
    assert changed.ground != same.ground or (changed.grey != same.grey).any()


def test_defaults_of_all_stages_are_those_of_the_configuration():
    found = parameters()
    for stage in STAGES:
        each = getattr(found, stage)
        assert is_dataclass(each)
        # The tolerance of the plane fit has no default.
        if stage != 'plane_fit':
            assert each == type(each)(), stage


def test_half_a_step_is_what_the_ground_may_be_off_its_plane():
    assert parameters(max_step=0.3).plane_fit.tolerance_m == pytest.approx(0.15)


def test_zero_disparity_range_of_the_study_is_its_own():
    assert parameters(disparity_range=0).study.disparities == 48
    assert parameters(disparity_range=64).study.disparities == 64
