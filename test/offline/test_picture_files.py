import cv2
import numpy as np
from hand_made import small_detection

from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.offline.picture_files import (
    PICTURE_NAMES,
    ColourBar,
    overlay_key,
    with_key,
    write_pictures,
)
from rover_obstacle_detection.pictures import KIND_COLOURS, RED, disparity_picture


def test_every_picture_is_written_with_its_key_below(tmp_path):
    detection = small_detection()
    write_pictures(detection, None, tmp_path / 'images', '000001_')
    names = {f'000001_{name}.png' for name in PICTURE_NAMES}
    assert {path.name for path in (tmp_path / 'images').iterdir()} == names
    read = cv2.imread(str(tmp_path / 'images' / '000001_disparity.png'))
    assert np.array_equal(read[:48], disparity_picture(detection))
    assert read.shape[0] > 48
    assert read.shape[1] == 64


def test_the_key_of_the_overlay_names_the_kinds_in_the_picture():
    mask = small_detection().mask > 0
    cues = np.where(mask, np.uint8(Cue.DROP), np.uint8(0))
    key = overlay_key(small_detection(cues=cues))
    assert key[:2] == (KIND_COLOURS['drop'], 'drop')
    assert 'rock' not in key
    assert overlay_key(small_detection(mask=np.zeros_like(cues)))[0] == 'no obstacle'


def test_the_key_has_texts_swatches_and_bars():
    picture = np.zeros((100, 1600, 3), np.uint8)
    bar = ColourBar(cv2.COLORMAP_TURBO)
    strip = with_key(picture, (RED, 'an obstacle', bar, 'from blue to red'))[100:].astype(int)
    assert (strip == RED).all(axis=2).any()
    assert (strip.min(axis=2) > 200).any()
    saturated = strip.max(axis=2) - strip.min(axis=2) > 100
    bar_columns = np.flatnonzero(saturated.any(axis=0))[40:]
    left, right = strip[:, bar_columns[10]], strip[:, bar_columns[-10]]
    assert left[:, 0].max() > left[:, 2].max()
    assert right[:, 2].max() > right[:, 0].max()


def test_a_key_wider_than_the_picture_is_cut():
    picture = np.zeros((10, 8, 3), np.uint8)
    drawn = with_key(picture, ('far too long', RED, ColourBar(0)))
    assert drawn.shape[1] == 8
    assert np.array_equal(drawn[:10], picture)
