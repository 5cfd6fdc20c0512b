from __future__ import annotations

import os
import subprocess
import sys
import threading

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.detection.images.strips import in_strips

# The child ends by a signal if its strips hang.
FORK = """
import os, signal
import cv2
from rover_obstacle_detection.detection.images.strips import in_strips

cv2.setNumThreads(2)
assert len(in_strips(lambda strip: strip, 600)) == 4
child = os.fork()
if not child:
    signal.alarm(20)
    os._exit(len(in_strips(lambda strip: strip, 600)))
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.fixture(params=[1, 2])
def threads(request):
    before = cv2.getNumThreads()
    cv2.setNumThreads(request.param)
    yield request.param
    cv2.setNumThreads(before)


@pytest.mark.parametrize('height', [1, 5, 13, 100, 480, 769])
def test_strips_cover_each_row_once(height, threads):
    rows = np.concatenate(in_strips(lambda strip: np.arange(height)[strip.rows], height, 4))
    np.testing.assert_array_equal(rows, np.arange(height))


@pytest.mark.parametrize('height', [1, 9, 100, 480, 769])
def test_windows_see_beyond_their_strip(height, threads):
    image = np.random.default_rng(0).integers(0, 255, (height, 20), np.uint8)
    whole = cv2.boxFilter(image, cv2.CV_32F, (9, 9))
    parts = in_strips(
        lambda strip: strip.inner(cv2.boxFilter(image[strip.padded], cv2.CV_32F, (9, 9))),
        height,
        4,
    )
    np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize('step', [2, 3])
def test_strips_sample_the_same_rows_as_the_whole_image(step):
    image = np.arange(769)
    sample = in_strips(lambda strip: image[strip.rows][::step], 769)
    np.testing.assert_array_equal(np.concatenate(sample), image[::step])


@pytest.mark.parametrize(('height', 'count'), [(16, 2), (240, 2), (480, 4), (1080, 8)])
def test_strips_are_even_in_number_and_about_as_high_in_every_image(height, count):
    strips = in_strips(lambda strip: strip, height)
    assert len(strips) == count
    assert all(strip.padded == strip.rows for strip in strips)


def test_strips_do_not_depend_on_the_threads():
    before = cv2.getNumThreads()
    strips = []
    for threads in (1, 2):
        cv2.setNumThreads(threads)
        strips.append(in_strips(lambda strip: strip, 600, 6))
    cv2.setNumThreads(before)
    assert strips[0] == strips[1]
    assert len(strips[0]) == 4


def test_work_stays_in_this_thread_where_opencv_is_limited_to_it(threads):
    workers = set(in_strips(lambda strip: threading.current_thread(), 600))
    assert (threading.current_thread() in workers) == (threads == 1)


def test_errors_of_the_work_arrive(threads):
    with pytest.raises(ZeroDivisionError):
        in_strips(lambda strip: 1 // strip.rows.start, 600)


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='no fork on this system')
def test_a_forked_process_has_threads_of_its_own():
    done = subprocess.run([sys.executable, '-c', FORK], check=True, capture_output=True, text=True)
    assert done.stdout == '4\n'
