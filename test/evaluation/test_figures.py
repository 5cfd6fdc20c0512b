"""Figures of hand-made masks against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.overlay import judgement_picture

SHAPE = (60, 80)
SKY = np.s_[:10]
ROCK = np.s_[20:40, 10:30]
OTHER_ROCK = np.s_[20:40, 50:60]


def frame() -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """Ten rows of sky, a rock of 400 pixels and one of 200."""
    labels = np.zeros(SHAPE, np.uint8)
    instances = np.zeros(SHAPE, np.uint16)
    labels[SKY] = 255
    labels[ROCK] = labels[OTHER_ROCK] = 1
    instances[ROCK], instances[OTHER_ROCK] = 7, 3
    return labels, instances


def mask_of(*areas: tuple[slice, ...] | slice) -> NDArray[np.uint8]:
    mask = np.zeros(SHAPE, np.uint8)
    for area in areas:
        mask[area] = 255
    return mask


def test_perfect_mask() -> None:
    figures = score(mask_of(ROCK, OTHER_ROCK), *frame())
    assert figures == Figures(
        frames=1, true_positives=600, true_negatives=3400, rocks=2, rocks_found=2
    )
    assert figures.precision == figures.recall == figures.f1 == figures.iou == 1.0
    assert figures.obstacle_recall == 1.0
    assert figures.false_alarms_per_frame == 0.0


def test_inverted_mask() -> None:
    figures = score(255 - mask_of(ROCK, OTHER_ROCK), *frame())
    assert figures == Figures(frames=1, false_positives=3400, false_negatives=600, rocks=2)
    assert figures.precision == figures.recall == figures.f1 == figures.iou == 0.0


def test_empty_mask_has_no_precision() -> None:
    figures = score(mask_of(), *frame())
    assert figures.precision is None
    assert figures.recall == 0.0


def test_frame_without_obstacles_has_no_recall() -> None:
    nothing = np.zeros(SHAPE, np.uint8), np.zeros(SHAPE, np.uint16)
    figures = score(mask_of(), *nothing)
    assert figures.recall is None
    assert figures.iou is None
    assert figures.obstacle_recall is None
    assert Figures().false_alarms_per_frame is None


def test_rock_is_found_if_half_of_it_is_flagged() -> None:
    half = mask_of(np.s_[20:30, 10:30])
    figures = score(half, *frame())
    assert (figures.rocks, figures.rocks_found) == (2, 1)
    assert figures.recall == pytest.approx(200 / 600)
    assert figures.precision == 1.0
    assert figures.f1 == pytest.approx(400 / 800)
    assert figures.iou == pytest.approx(200 / 600)
    half[20, 10] = 0
    assert score(half, *frame()).rocks_found == 0


def test_rock_of_less_than_200_pixels_does_not_count_as_obstacle() -> None:
    labels, instances = frame()
    labels[20, 50] = 255
    figures = score(mask_of(ROCK), labels, instances)
    assert (figures.rocks, figures.rocks_found) == (1, 1)
    assert figures.false_negatives == 199


def test_blob_in_the_sky_does_not_count() -> None:
    figures = score(mask_of(np.s_[:10, :40]), *frame())
    assert figures.false_positives == 0
    assert figures.false_alarms == 0
    assert figures.precision is None


def test_uncounted_rock_may_be_flagged_or_not() -> None:
    labels, instances = frame()
    labels[OTHER_ROCK] = 255
    for mask in (mask_of(ROCK), mask_of(ROCK, OTHER_ROCK)):
        figures = score(mask, labels, instances)
        assert figures == Figures(
            frames=1, true_positives=400, true_negatives=3400, rocks=1, rocks_found=1
        )


def test_blob_of_100_counted_pixels_is_a_false_alarm() -> None:
    assert score(mask_of(np.s_[45:55, 30:40]), *frame()).false_alarms == 1
    assert score(mask_of(np.s_[45:54, 30:41]), *frame()).false_alarms == 0


def test_blobs_touching_at_a_corner_are_one() -> None:
    mask = mask_of(np.s_[45:50, 30:40], np.s_[50:55, 40:50])
    assert score(mask, *frame()).false_alarms == 1


def test_blob_with_a_tenth_on_an_obstacle_is_no_false_alarm() -> None:
    # One row of 20 pixels on the rock, nine rows below it.
    tenth = mask_of(np.s_[39:49, 10:30])
    assert score(tenth, *frame()).false_alarms == 0
    less = mask_of(np.s_[39:49, 10:30], np.s_[49, 10])
    figures = score(less, *frame())
    assert figures.false_alarms == 1
    assert figures.false_positives == 181


def test_blob_with_a_tenth_on_uncounted_pixels_is_no_false_alarm() -> None:
    assert score(mask_of(np.s_[9:19, 40:60]), *frame()).false_alarms == 0
    assert score(mask_of(np.s_[9:20, 40:60]), *frame()).false_alarms == 1


def test_slopes_and_drops_count_from_2000_pixels() -> None:
    labels, instances = np.zeros((100, 100), np.uint8), np.zeros((100, 100), np.uint16)
    labels[:40, :50] = 2
    labels[60:, :49] = 3
    flagged = np.zeros((100, 100), bool)
    flagged[:20] = True
    figures = score(flagged, labels, instances)
    assert (figures.areas, figures.areas_found) == (1, 1)
    assert figures.obstacles == 1
    labels[40, 0] = 3
    figures = score(flagged, labels, instances)
    assert (figures.areas, figures.areas_found) == (1, 0), 'touching slope and drop are one area'


def test_adding_figures_pools_the_counts() -> None:
    found, missed = score(mask_of(ROCK), *frame()), score(mask_of(), *frame())
    total = found + missed
    assert total.frames == 2
    assert total.recall == pytest.approx(400 / 1200)
    assert total.obstacle_recall == pytest.approx(1 / 4)
    assert sum([found, missed], Figures()) == total


def test_missed_pixels_are_called_free_only_where_known() -> None:
    known = np.zeros(SHAPE, bool)
    known[:, 50:55] = True
    known[20:30, 10:30] = True
    figures = score(mask_of(ROCK), *frame(), known)
    assert (figures.called_free, figures.checked_obstacle_pixels) == (100, 600)
    assert figures.called_free_share == pytest.approx(1 / 6)
    unreported = score(mask_of(ROCK), *frame())
    assert unreported.called_free_share is None
    assert (figures + unreported).called_free_share == figures.called_free_share
    assert score(mask_of(), *frame(), ~known).called_free == 600 - 100 - 200


def test_free_pixels_are_confirmed_only_where_known() -> None:
    known = np.zeros(SHAPE, bool)
    known[SKY] = True
    known[40:50] = True
    # A false alarm on ground, which is known but not free.
    figures = score(mask_of(ROCK, np.s_[40:42]), *frame(), known)
    assert (figures.confirmed_free, figures.checked_free_pixels) == (8 * 80, 3400)
    assert figures.confirmed_free_share == pytest.approx(640 / 3400)
    assert score(mask_of(ROCK), *frame()).confirmed_free_share is None


def test_different_shapes_are_refused() -> None:
    labels, instances = frame()
    with pytest.raises(ValueError, match=r'\(10, 80\)'):
        score(labels[:10], labels, instances)


@given(
    arrays(np.bool_, (12, 15)),
    arrays(np.uint8, (12, 15), elements=st.sampled_from([0, 1, 2, 3, 255])),
)
def test_every_counted_pixel_counts_once(
    mask: NDArray[np.bool_], labels: NDArray[np.uint8]
) -> None:
    figures = score(mask, labels, labels.astype(np.uint16))
    counted = int((labels != 255).sum())
    assert figures.obstacle_pixels == int(np.isin(labels, (1, 2, 3)).sum())
    assert figures.true_positives + figures.false_positives == int((mask & (labels != 255)).sum())
    assert (figures.obstacle_pixels + figures.false_positives + figures.true_negatives) == counted


def test_overlay_has_a_colour_for_each_outcome() -> None:
    labels, _ = frame()
    left = np.full(SHAPE, 100, np.uint8)
    picture = judgement_picture(left, mask_of(ROCK, np.s_[50:55, 70:80]), labels)
    hit, miss, false, sky, free = (
        picture[at].tolist() for at in ((30, 20), (30, 55), (52, 75), (5, 5), (58, 5))
    )
    assert hit[1] == max(hit)
    assert miss[0] == max(miss)
    assert false[2] == max(false)
    assert sky == [122, 122, 122]
    assert free == [100, 100, 100]
