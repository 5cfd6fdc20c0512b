"""The hybrid without single stages."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
import pytest
import waves
from hazard_scenes import HAZARD_SCENES
from synthetic import Box, Dome, Pit, Plane, Scene, mast, pinhole, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES, HybridStages
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.methods.ablation import (
    ABLATIONS,
    ablated_methods,
    left_out_stage,
)
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method

BLOCK = mast(solids=(Box(0.0, 1.2, 0.3, 0.3, 0.3),))
ROCKS = mast(solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22), Dome(-0.3, 1.0, 0.2)), solid_brightness=0.3)
STEEP = mast(planes=(Plane.uphill(26),))
HOLE = mast(camera=pinhole(320, 240, 60.0, 0.15), pits=(Pit(0, 1.1, 0.8, 0.8, 0.4),))
NOISY = mast(camera=pinhole(320, 240, 60.0, 0.15), pits=(Pit(0, 1.8, 0.5, 0.5, 0.18),), noise=11.0)
# Reaches beyond the first layer of the survey.
AHEAD = Scene(pinhole(160, 120, 60.0, 0.12), 25.0, 0.6)
BANK = Scene(
    pinhole(320, 240, 60.0, 0.15), 40.0, 1.0, planes=(Plane(), Plane.uphill(35, start_y=1.5))
)


class Case(NamedTuple):
    """A pair on which a stage matters, and a product that changes without it."""

    scene: Scene
    product: str
    left: np.ndarray
    right: np.ndarray
    config: DetectorConfig = DetectorConfig()
    gravity: bool = True

    @classmethod
    def of(cls, scene, product, gravity=True, **config):
        view = render(scene)
        return cls(scene, product, view.left, view.right, DetectorConfig(**config), gravity)

    def detect(self, stages=HYBRID_STAGES):
        return Detector(self.scene.camera, self.config, stages=stages).detect(
            self.left, self.right, gravity=self.scene.gravity if self.gravity else None
        )


def row_off():
    view = render(BLOCK)
    return Case(BLOCK, 'disparity', view.left, np.roll(view.right, 1, axis=0))


def distorted():
    scene = mast(640, 480)
    view, lens = render(scene), LensDistortion(0.0, -0.06)
    places = waves.straight_right(scene.camera, *np.meshgrid(np.arange(640), np.arange(480)), lens)
    columns, rows = (each.astype(np.float32) for each in places)
    right = cv2.remap(view.right, columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return Case(scene, 'disparity', view.left, right)


def puddle():
    scene = next(each for each in HAZARD_SCENES if each.name == 'mirror_puddle_wall_wide')
    scene = scene.resized(320)
    view = scene.render()
    return Case(scene, 'disparity', view.left, view.right)


CASES = {
    'noise': lambda: Case.of(BLOCK.with_(noise=12.0), 'disparity'),
    'rows': row_off,
    'lenses': distorted,
    'subpixel': lambda: Case.of(BLOCK, 'disparity'),
    'reflections': puddle,
    'brims': lambda: Case.of(HOLE, 'cues'),
    'layers': lambda: Case.of(AHEAD, 'height'),
    'vertical': lambda: Case.of(BANK, 'cues', gravity=False),
    'slope': lambda: Case.of(STEEP, 'cues'),
    'drop': lambda: Case.of(HOLE, 'cues'),
    'hazards': lambda: Case.of(HOLE, 'cues'),
    'outlines': lambda: Case.of(BLOCK, 'rock_probability'),
    'parallax': lambda: Case.of(BLOCK, 'rock_probability'),
    'sight': lambda: Case.of(BLOCK, 'rock_probability'),
    'doubt': lambda: Case.of(NOISY, 'cues'),
}


@cache
def detected(stage):
    """The detection with all stages, and without the one that the case is made for."""
    case = CASES[stage]()
    return case.detect(), case.detect(ABLATIONS[stage])


def test_every_ablation_has_a_case():
    assert list(CASES) == list(ABLATIONS)


def test_every_stage_of_the_hybrid_is_ablated_by_itself():
    changed = [
        {
            each.name
            for each in fields(HybridStages)
            if getattr(stages, each.name) is not getattr(HYBRID_STAGES, each.name)
        }
        for stages in ABLATIONS.values()
    ]
    # Slopes and drops are found in two ways.
    judges = [names - {'hazards'} if len(names) > 1 else names for names in changed]
    assert all(len(names) == 1 for names in judges)
    assert set.union(*changed) == {each.name for each in fields(HybridStages)}


@pytest.mark.parametrize('stage', CASES)
def test_result_changes_without_the_stage(stage):
    whole, part = detected(stage)
    product = CASES[stage]().product
    assert not np.array_equal(getattr(whole, product), getattr(part, product), equal_nan=True)


def test_without_slope_only_that_cue_is_missing():
    whole, part = detected('slope')
    assert (whole.cues & Cue.SLOPE).any()
    np.testing.assert_array_equal(part.cues, whole.cues & ~np.uint8(Cue.SLOPE))


@pytest.mark.parametrize('stage', ['drop', 'brims'])
def test_lower_ground_and_brims_are_drops_by_themselves(stage):
    whole, part = detected(stage)
    dropped, left = ((each.cues & Cue.DROP) > 0 for each in (whole, part))
    assert left.any()
    assert (left <= dropped).all()
    assert np.count_nonzero(left) < np.count_nonzero(dropped)
    # The network tells slopes from drops, and sees where brims are.
    others = ~np.uint8(Cue.DROP)
    assert np.mean((part.cues & others) != (whole.cues & others)) < 0.02


def test_without_brims_what_lies_behind_them_may_be_free():
    whole, part = detected('brims')
    free, free_without = (each.known & (each.mask == 0) for each in (whole, part))
    assert np.count_nonzero(free_without & ~free) > 10
    assert not (free & ~free_without).any()


def test_without_reflections_points_below_the_ground_are_believed():
    whole, part = detected('reflections')
    removed = (whole.disparity == 0) & (part.disparity > 0)
    assert np.count_nonzero(removed) > 1000
    assert (part.height[removed & np.isfinite(part.height)] < 0).all()
    kept = whole.disparity > 0
    np.testing.assert_array_equal(whole.disparity[kept], part.disparity[kept])


def test_without_rows_nothing_of_the_rectification_is_corrected():
    whole, part = detected('rows')
    assert whole.alignment.offset_px == pytest.approx(1, abs=0.1)
    assert part.alignment.offset_px == 0


def test_without_lenses_rows_are_still_corrected():
    whole, part = detected('lenses')
    assert whole.lenses
    assert not part.lenses
    assert part.alignment.offset_px != 0


def test_without_subpixel_the_noise_is_that_of_matching():
    _, part = detected('subpixel')
    ground = (part.disparity > 0) & (np.abs(part.height) < 0.01)
    expected = part.ground.height_m * 0.125 / part.disparity[ground]
    # The ground seems to tilt a little, which changes the noise a little.
    off = np.abs(part.height_noise[ground] / expected - 1)
    assert np.median(off) < 0.02
    assert np.quantile(off, 0.99) < 0.1


def test_without_vertical_the_normal_of_the_plane_is_up():
    whole, part = detected('vertical')
    assert part.ground.up == part.ground.normal
    assert whole.ground.up != whole.ground.normal
    assert whole.ground.normal == part.ground.normal


def test_without_outlines_height_outlines_the_rock():
    whole, part = detected('outlines')
    outlined = part.rock_probability > 0
    np.testing.assert_allclose(part.rock_probability[outlined], 0.6)
    assert ((part.mask > 0) <= outlined).all()
    assert np.count_nonzero(part.mask & whole.mask) > 0.8 * np.count_nonzero(whole.mask)


def test_without_sight_no_rock_is_accepted_by_its_looks():
    whole, part = detected('sight')
    limit = RockParameters().accepted_probability
    assert np.nanmax(whole.rock_probability) > limit
    # Where height overrules the network, looks do not count.
    assert np.nanmax(part.rock_probability[part.rock_probability < 1]) < limit
    seen = np.isfinite(whole.rock_probability) & (whole.rock_probability < limit - 0.01)
    np.testing.assert_array_equal(part.rock_probability[seen], whole.rock_probability[seen])


def test_without_doubt_noise_makes_specks_around_a_hollow():
    whole, part = detected('doubt')
    assert not whole.mask[part.mask == 0].any()
    more = (part.mask > 0) & (whole.mask == 0)
    assert more.sum() > 20
    assert part.confidence[more].max() < 0.9


def test_hybrid_itself_is_the_default():
    assert HybridStages() == HYBRID_STAGES
    view = render(BANK)
    hybrid = make_method('hybrid', DetectorConfig(method='study'))
    mask = hybrid(BANK.camera, view.left, view.right)
    found = Detector(BANK.camera).detect(view.left, view.right)
    np.testing.assert_array_equal(mask, found.mask)


def test_ablated_methods_are_made_by_name():
    assert ablated_methods()[:3] == ('hybrid', 'hybrid without noise', 'hybrid without rows')
    assert len(ablated_methods()) == 1 + len(ABLATIONS)
    assert left_out_stage('hybrid without slope') == 'slope'
    view = render(BANK)
    method = make_method('hybrid without slope', DetectorConfig(method='study'))
    expected = Detector(BANK.camera, stages=ABLATIONS['slope']).detect(view.left, view.right)
    mask = method(BANK.camera, view.left, view.right)
    np.testing.assert_array_equal(mask, expected.mask)
    assert (Detector(BANK.camera).detect(view.left, view.right).mask != mask).any()


@pytest.mark.parametrize('name', ['hybrid without taste', 'regions', 'hybrid without hybrid'])
def test_other_stages_cannot_be_left_out(name):
    assert left_out_stage(name) is None
    with pytest.raises(ConfigurationError, match=f"method is '{name}'"):
        make_method(name)
    assert not set(ablated_methods()[1:]) & set(METHOD_DESCRIPTIONS)
