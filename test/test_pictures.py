from dataclasses import replace
from typing import get_args

import cv2
import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection import pictures
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.result.cue import KINDS, Cue, Kind
from rover_obstacle_detection.detection.result.obstacles import Obstacle

INSIDE = (38, 37)
OUTSIDE = (5, 50)
UNKNOWN = (10, 0)


@pytest.mark.parametrize('name', [*pictures.PICTURES, 'overlay'])
def test_pictures_of_a_detection_without_any_data(name):
    nothing = small_detection(
        disparity=np.zeros((48, 64), np.float32),
        height=np.full((48, 64), np.nan, np.float32),
        roughness=np.full((48, 64), np.nan, np.float32),
        step=np.full((48, 64), np.nan, np.float32),
        seeds=np.zeros((48, 64), bool),
        known=np.zeros((48, 64), bool),
        mask=np.zeros((48, 64), np.uint8),
    )
    draw = pictures.PICTURES.get(name, pictures.overlay_picture)
    picture = draw(nothing)
    assert picture.shape == draw(small_detection()).shape == (48, 64, 3)
    assert picture.dtype == np.uint8


def test_disparity_is_blue_far_away_red_nearby_and_black_without_a_match():
    disparity = np.tile(np.linspace(2, 20, 64, dtype=np.float32), (48, 1))
    disparity[:, 40] = 0
    picture = pictures.disparity_picture(small_detection(disparity=disparity)).astype(int)
    blue, _, red = picture[10, 8]
    assert blue > red
    blue, _, red = picture[10, 60]
    assert red > blue
    assert not picture[:, 40].any()


def test_regions_differ_in_hue_and_have_a_dark_outline():
    detection = small_detection()
    picture = pictures.regions_picture(detection)
    hue = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)[..., 0].astype(int)
    assert abs(hue[INSIDE] - hue[OUTSIDE]) > 20
    assert np.all(picture[OUTSIDE] == picture[10, 60])
    assert picture[32, 37].max() < 30
    assert picture[OUTSIDE].max() > 60


def test_a_brighter_region_is_drawn_brighter():
    grey = np.full((48, 64), 40, np.uint8)
    grey[32:44, 30:44] = 220
    picture = pictures.regions_picture(small_detection(grey=grey))
    assert picture[INSIDE].max() > picture[OUTSIDE].max() + 50


def test_seed_regions_are_teal_and_others_orange():
    seeds = np.ones((48, 64), bool)
    seeds[:, :10] = False
    picture = pictures.seeds_picture(small_detection(seeds=seeds)).astype(int)
    blue, green, red = picture[5, 30]
    assert min(blue, green) > red + 20
    blue, green, red = picture[5, 4]
    assert red > green > blue


def test_a_larger_step_is_drawn_brighter():
    step = np.full((48, 64), 0.002, np.float32)
    step[:, 20:40] = 0.2
    step[:, 40:] = np.nan
    picture = pictures.roughness_step_picture(small_detection(step=step)).astype(int)
    assert picture[5, 30].sum() > picture[5, 10].sum() + 100
    assert not picture[:, 40:].any()


def test_the_mask_shows_obstacle_free_and_unknown():
    picture = pictures.mask_picture(small_detection())
    assert tuple(picture[INSIDE]) == (255, 255, 255)
    assert tuple(picture[OUTSIDE]) == (0, 0, 0)
    assert tuple(picture[UNKNOWN]) == pictures.DARK_GREY


def test_the_overlay_tints_obstacles_and_keeps_free_ground():
    image = np.zeros((48, 64, 3), np.uint8)
    image[:] = (60, 90, 120)
    before = image.copy()
    picture = pictures.overlay_picture(small_detection(), image).astype(int)
    assert np.array_equal(image, before)
    assert tuple(picture[5, 50]) == (60, 90, 120)
    assert picture[INSIDE][2] > 160
    assert picture[INSIDE][1] < 90


def test_the_overlay_hatches_unknown_pixels_in_grey():
    image = np.full((48, 64, 3), (60, 90, 120), np.uint8)
    known = np.ones((48, 64), bool)
    known[:, 44:] = False
    nothing = small_detection(known=known, mask=np.zeros((48, 64), np.uint8))
    unknown = pictures.overlay_picture(nothing, image)[:, 44:]
    assert np.all(unknown.max(axis=2) == unknown.min(axis=2))
    assert len(np.unique(unknown)) == 2


def test_the_overlay_of_a_16_bit_image_uses_the_grey_image():
    deep = np.full((48, 64), 60000, np.uint16)
    picture = pictures.overlay_picture(small_detection(), deep)
    assert tuple(picture[5, 50]) == (100, 100, 100)


def _obstacle(kind, max_height_m, range_m):
    nowhere = (0.0, 0.0, 0.0)
    return Obstacle(0, 0, 5, 5, 25, nowhere, nowhere, max_height_m, range_m, 0.9, kind)


@pytest.mark.parametrize(
    ('kind', 'max_height_m', 'range_m', 'label'),
    [
        ('rock', 0.214, 1.38, 'rock 21 cm @ 1.4 m'),
        ('rock', 0.05, 2.0, 'rock @ 2.0 m'),
        ('rock', -0.3, 2.0, 'rock @ 2.0 m'),
        ('rock', np.nan, 2.0, 'rock @ 2.0 m'),
        ('rock', np.nan, np.nan, 'rock, no 3D'),
        ('slope', 0.21, 2.0, 'slope @ 2.0 m'),
        ('drop', -0.3, 2.0, 'drop @ 2.0 m'),
        ('rough', 0.05, 2.0, 'rough @ 2.0 m'),
        ('unmeasured', 0.3, 2.0, 'unmeasured @ 2.0 m'),
        ('unmeasured', np.nan, np.nan, 'no 3D'),
    ],
)
def test_a_label_has_kind_and_distance_and_height_where_it_counts(
    kind, max_height_m, range_m, label
):
    assert pictures.obstacle_label(_obstacle(kind, max_height_m, range_m), 0.10) == label


def test_each_kind_has_a_colour_of_its_own():
    assert set(pictures.KIND_COLOURS) == set(get_args(Kind))
    colours = np.array(list(pictures.KIND_COLOURS.values()), int)
    apart = np.abs(colours[:, np.newaxis] - colours).sum(axis=2)
    assert (apart[~np.eye(len(colours), dtype=bool)] > 90).all()


def test_labels_go_to_the_nearest_and_the_tallest():
    far, tall = _obstacle('rock', 0.2, 5.0), _obstacle('rock', 0.9, 4.0)
    near, second = _obstacle('rock', 0.12, 1.0), _obstacle('slope', 3.0, 2.0)
    nowhere = _obstacle('rock', np.nan, np.nan)
    ranked = pictures.by_importance([nowhere, far, second, tall, near], 0.10)
    assert ranked == [near, tall, second, far, nowhere]


def test_few_of_many_obstacles_are_labelled_and_all_are_outlined(monkeypatch):
    mask = np.zeros((960, 1280), np.uint8)
    places = [(row, column) for row in range(100, 960, 100) for column in range(60, 1200, 200)]
    for row, column in places:
        mask[row : row + 30, column : column + 60] = 255
    texts = []
    monkeypatch.setattr(pictures.cv2, 'putText', lambda *given: texts.append((given[1], given[2])))
    seen = _large_detection(mask)
    picture = pictures.overlay_picture(seen)
    assert len(seen.obstacles) == len(places) == 54
    assert len(set(texts)) == len(texts) == pictures.MAX_LABELS == 8
    assert {text[:12] for text, _ in texts} == {'rock 30 cm @'}
    for row, column in places:
        assert tuple(picture[row, column + 30]) == pictures.RED


def test_of_labels_that_would_overlap_only_the_nearer_obstacles_is_drawn():
    mask = np.zeros((480, 640), np.uint8)
    mask[205:240, 200:240] = mask[205:240, 260:300] = 255
    alone = np.zeros((480, 640), np.uint8)
    alone[205:240, 260:300] = 255
    both = pictures.overlay_picture(_large_detection(mask))[170:198]
    nearer = pictures.overlay_picture(_large_detection(alone))[170:198]
    assert (nearer == 50).any()
    np.testing.assert_array_equal(both, nearer)


@pytest.mark.parametrize('cue', Cue)
def test_the_overlay_has_the_colour_of_the_kind(cue):
    mask = small_detection().mask
    seen = small_detection(cues=np.where(mask > 0, np.uint8(cue), np.uint8(0)))
    assert list(pictures.pixels_by_kind(seen)) == [KINDS[cue]]
    tinted = pictures.overlay_picture(seen)[INSIDE]
    expected = 0.6 * 100 + 0.4 * np.array(pictures.KIND_COLOURS[KINDS[cue]])
    np.testing.assert_allclose(tinted, expected, atol=1)


def test_each_pixel_of_an_obstacle_has_its_own_kind():
    mask = small_detection().mask
    cues = np.where(mask > 0, np.uint8(Cue.SLOPE), np.uint8(0))
    cues[32:36, 30:44] |= np.uint8(Cue.HEIGHT)
    cues[40:44, 30:44] = 0
    seen = small_detection(cues=cues)
    parts = pictures.pixels_by_kind(seen)
    assert set(parts) == {'rock', 'slope'}
    np.testing.assert_array_equal(parts['rock'], (cues & np.uint8(Cue.HEIGHT)) > 0)
    np.testing.assert_array_equal(parts['slope'], (mask > 0) & ~parts['rock'])
    assert [each.kind for each in seen.obstacles] == ['slope']


def test_without_a_ground_plane_obstacles_have_no_height():
    seen = small_detection()
    assert pictures.shown_obstacles(seen) == seen.obstacles
    assumed = replace(seen, ground=replace(seen.ground, measured=False))
    (shown,) = pictures.shown_obstacles(assumed)
    assert np.isnan(shown.max_height_m)
    assert shown.range_m == seen.obstacles[0].range_m


def _large_detection(mask):
    shape = mask.shape
    return small_detection(
        mask=mask,
        grey=np.full(shape, 200, np.uint8),
        disparity=np.full(shape, 5.0, np.float32),
        height=np.full(shape, 0.3, np.float32),
        height_noise=np.full(shape, 0.01, np.float32),
        cues=(mask > 0).astype(np.uint8),
        known=np.ones(shape, bool),
        camera=StereoCamera(shape[1], shape[0], 600.0, 600.0, 319.5, 239.5, 0.1),
    )


def test_an_obstacle_has_a_label_on_dark_background_above_it():
    mask = np.zeros((480, 640), np.uint8)
    mask[200:300, 250:400] = 255
    above = pictures.overlay_picture(_large_detection(mask))[180:198, 280:370]
    assert (above == 50).any()
    assert above.max() > 240


def test_a_speck_has_no_label():
    mask = np.zeros((480, 640), np.uint8)
    mask[200:204, 300:304] = 255
    picture = pictures.overlay_picture(_large_detection(mask))
    assert np.all(picture[:195] == 200)
    assert picture[202, 302, 2] > picture[202, 302, 0] + 50
