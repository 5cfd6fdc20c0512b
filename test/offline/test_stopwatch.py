import pytest

from rover_obstacle_detection.offline.stopwatch import Stopwatch, stage_times


def _clock(*times_ms):
    ticks = iter(times_ms)
    return lambda: round(next(ticks) * 1e6)


def test_a_lap_starts_at_the_previous_one_and_equal_names_add_up():
    watch = Stopwatch(_clock(0, 5, 7, 10, 100, 104, 200))
    watch.lap('match')
    watch.lap('ground')
    watch.lap('match')
    assert watch.take_ms() == pytest.approx({'match': 8.0, 'ground': 2.0})
    watch.lap('match')
    assert watch.take_ms() == pytest.approx({'match': 4.0})


def test_stage_times_cover_the_frames_with_that_stage():
    times = stage_times([{'a': 1.0, 'b': 10.0}, {'a': 3.0}, {'a': 8.0}])
    assert list(times) == ['a', 'b']
    assert times['a'].mean_ms == 4.0
    assert times['a'].median_ms == 3.0
    assert times['a'].max_ms == 8.0
    assert times['a'].p95_ms == pytest.approx(7.5)
    assert times['b'].p95_ms == 10.0
