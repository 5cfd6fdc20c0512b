"""The detector before hazards of each kind: ray-cast scenes, and the cases that users reported."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hazard_check import judge, verdict
from hazard_scenes import HAZARD_SCENES

from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import ObstacleDetectionError, UnjudgeablePairError

SCENES = {scene.name: scene for scene in HAZARD_SCENES}
# Scenes that are passed with a margin: a failure is a change for the worse.
JUDGED = (
    'wall_fills_rover',
    'wall_strip_0.40_wide',
    'wall_oblique+30_0.30_rover',
    'wall_board_study',
    'drop_edge_0.80_at_4.0_mast',
    'drop_edge_0.50_at_1.2_study',
    'drop_cliff_at_2.0_rover',
    'drop_cliff_before_hills_at_1.6_rover',
    'drop_trench_floor_at_1.0_low',
    'drop_trench_nofloor_at_0.9_oblique+20_wide',
    'free_ramp_down_10_at_1.0_wide',
    'free_slope_+12_at_2.5_mast',
    'free_kerb_-0.05_at_1.0_oblique+20_low',
    'free_shadow_on_sand_study',
    'free_black_shadow_study',
    'step_ledge_0.25_at_2.5_oblique+30_rover',
    'step_ledge_0.40_at_3.5_oblique-30_mast',
    'slope_up_28_at_2.5_mast',
    'slope_down_28_at_1.0_study',
    'rock_box_0.15_rover',
    'rock_dome_0.20_wide',
    'rock_boulder_dome_0.70_mast',
    'rock_dark_box_0.20_low',
    'shadow_rock_mast',
    'shadow_trench_rover',
    'slabs_0.30_turned+45_mast',
    'slabs_0.20_turned+0_rover',
    'faint_fog_low',
    'faint_veil_12_percent_study',
    'mirror_puddle_sky_wide',
    'mirror_puddle_hills_rover',
    'mirror_puddle_post_mast',
    'faulty_rows_off_2_low',
    'faulty_jpeg_30_low',
    'faulty_right_darker_rover',
)
REFUSED = {
    'blind_left_covered_study': 'the left image shows hardly any texture.*covered or fogged lens',
    'blind_same_image_twice_low': 'both images are the same',
    'blind_another_moment_aside_study': 'the right image does not belong to the left one',
    'blind_exchanged_low': 'the right image does not belong to the left one',
    'blind_underexposed_0.005_study': 'neither image shows any texture: it is black',
    'blind_upside_down_mast': 'the ground is at the top of the images',
    'faulty_defocused_left_4_mast': 'the left image is out of focus or smeared',
    'faulty_rows_off_8_study': 'the right image is [789] rows higher than the left one',
}
CASES = Path(__file__).parents[3] / 'shared' / 'cases'


def test_each_kind_of_scene_is_judged():
    judged = {SCENES[name].kind for name in (*JUDGED, *REFUSED)}
    assert judged == {scene.kind for scene in HAZARD_SCENES}


@pytest.mark.parametrize('name', JUDGED)
def test_hazards_are_found_and_nothing_else(name):
    passed, text = judge(SCENES[name])
    assert passed, text
    assert not text.startswith('refused')


@pytest.mark.parametrize(('name', 'reason'), REFUSED.items(), ids=REFUSED)
def test_pairs_that_cannot_be_judged_are_refused_with_the_reason(name, reason):
    scene = SCENES[name]
    view = scene.render()
    with pytest.raises(UnjudgeablePairError, match=reason):
        Detector(scene.camera).detect(view.left, view.right)


@pytest.mark.skipif(not CASES.exists(), reason='needs the reported cases')
@pytest.mark.parametrize('case', [path.parent.name for path in CASES.glob('*/expected.png')])
def test_reported_cases_are_judged_right(case):
    folder = CASES / case
    left, right, expected = (
        cv2.imread(str(folder / f'{name}.png'), cv2.IMREAD_GRAYSCALE)
        for name in ('left', 'right', 'expected')
    )
    camera = StereoCamera(**json.loads((folder / 'camera.json').read_text()))
    may_refuse = (folder / 'may_refuse').exists() or not np.isin(expected, (0, 1, 3)).any()
    passed, text = judged_or_refused(camera, left, right, expected, may_refuse=may_refuse)
    assert passed, text


def judged_or_refused(camera, left, right, expected, *, may_refuse):
    try:
        detection = Detector(camera).detect(left, right)
    except ObstacleDetectionError as error:
        return may_refuse, f'refused: {error}'
    return verdict(expected, detection.mask > 0, detection.known)
