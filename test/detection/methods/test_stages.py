"""Stages of the hybrid that are replaced from outside."""

from __future__ import annotations

from dataclasses import fields, replace

import cv2
import numpy as np
import pytest
from synthetic import Box, Dome, mast, render

from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES, HybridStages
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.terrain.brims import Brims
from rover_obstacle_detection.detection.terrain.hazard_model import HazardProbability
from rover_obstacle_detection.detection.terrain.slope import Hazard
from rover_obstacle_detection.detection.terrain.surface import Surface

SCENE = mast(solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22), Dome(-0.3, 1.0, 0.2)), solid_brightness=0.3)
NAMES = [each.name for each in fields(HybridStages)]


def detect(stages, **options):
    view = render(SCENE)
    return Detector(SCENE.camera, stages=stages).detect(view.left, view.right, **options)


@pytest.mark.parametrize('name', NAMES)
def test_given_stage_is_the_one_that_runs(name):
    calls = []

    def recorded(*arguments):
        calls.append(name)
        return getattr(HYBRID_STAGES, name)(*arguments)

    found = detect(replace(HYBRID_STAGES, **{name: recorded}))
    assert calls
    whole = detect(HYBRID_STAGES)
    for product in ('disparity', 'height', 'cues', 'mask', 'known'):
        np.testing.assert_array_equal(getattr(found, product), getattr(whole, product))


def test_known_gravity_is_not_estimated():
    def estimate(*arguments):
        raise AssertionError

    stages = replace(HYBRID_STAGES, verticals=estimate)
    assert detect(stages, gravity=SCENE.gravity).ground.up == SCENE.gravity.up
    with pytest.raises(AssertionError):
        detect(stages)


def everywhere(terrain, *others):
    all_ = np.ones(terrain.height_m.shape, np.bool_)
    return Hazard(all_, all_)


def undecided(terrain, *others):
    either = np.full(terrain.height_m.shape, 0.2, np.float32)
    return HazardProbability(either, either)


def possible_everywhere(terrain, *others):
    none, all_ = (
        np.zeros(terrain.height_m.shape, np.bool_),
        np.ones(terrain.height_m.shape, np.bool_),
    )
    return Hazard(none, all_)


@pytest.mark.parametrize(('name', 'cue'), [('slope', Cue.SLOPE), ('drop', Cue.DROP)])
def test_pixels_that_a_stage_finds_have_its_cue(name, cue):
    found = detect(replace(HYBRID_STAGES, hazards=undecided, **{name: everywhere}))
    assert ((found.cues & cue) > 0).all()
    assert (found.mask > 0).all()


@pytest.mark.parametrize('name', ['slope', 'drop'])
def test_where_a_hazard_is_possible_nothing_is_free(name):
    plain = detect(HYBRID_STAGES)
    assert (plain.known & (plain.mask == 0)).any()
    found = detect(replace(HYBRID_STAGES, **{name: possible_everywhere}))
    np.testing.assert_array_equal(found.known, found.mask > 0)


@pytest.mark.parametrize(('probability', 'free'), [(0.09, True), (0.11, False)])
def test_what_the_network_does_not_rule_out_is_not_free(probability, free):
    def drawn(stereo, terrain, standing, window, parameters):
        return np.full(standing.parts[window].shape, probability, np.float32)

    found = detect(replace(HYBRID_STAGES, outlines=drawn))
    asked = np.isfinite(found.rock_probability) & (found.rock_probability < 1)
    assert asked.any()
    assert (found.known & (found.mask == 0))[asked].any() == free


def test_nothing_free_touches_an_obstacle():
    found = detect(HYBRID_STAGES)
    beside = cv2.dilate(found.mask, np.ones((3, 3), np.uint8)) > 0
    assert found.mask.any()
    assert not (found.known & (found.mask == 0) & beside).any()


def test_outlines_are_those_that_are_drawn():
    def nothing(stereo, terrain, standing, window, parameters):
        return np.zeros(standing.parts[window].shape, np.float32)

    found = detect(HYBRID_STAGES), detect(replace(HYBRID_STAGES, outlines=nothing))
    # The brim of the block's top stays: below it, the ground is lower than a step.
    assert [bool((each.cues & Cue.HEIGHT).any()) for each in found] == [True, False]


def test_ground_near_a_possible_brim_is_not_free():
    rows, columns = np.full(100, 150), np.arange(100, 200)
    no = np.zeros(100, bool)

    def brims(stereo, parameters):
        surface = Surface(stereo, parameters)
        level_m = np.zeros(100, np.float32)
        return Brims(rows, columns, rows, no, no, level_m, level_m, np.full(100, 5), surface)

    whole, found = detect(HYBRID_STAGES), detect(replace(HYBRID_STAGES, brims=brims))
    np.testing.assert_array_equal(found.mask, whole.mask)
    before = np.s_[150:160, 100:200]
    free = whole.known[before] & (whole.mask[before] == 0)
    assert free.mean() > 0.3
    assert not (found.known[before] & free).any()


def test_uneven_ground_is_not_free():
    def rippled(*arguments):
        terrain = HYBRID_STAGES.survey(*arguments)
        height_m = terrain.height_m.copy()
        height_m[:, ::4] += 0.05
        height_m[:, 1::4] += 0.05
        return replace(terrain, height_m=height_m)

    whole, found = detect(HYBRID_STAGES), detect(replace(HYBRID_STAGES, survey=rippled))
    quiet = (whole.mask == 0) & (found.mask == 0) & (found.height_noise < 0.015)
    assert whole.known[quiet].mean() > 0.5
    assert not found.known[quiet].any()
