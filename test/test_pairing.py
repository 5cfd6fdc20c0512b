from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_obstacle_detection.pairing import Pair, StereoPairing, shows_one_moment

SECOND = 1_000_000_000
MS = 1_000_000


def run(pairing, arrivals):
    """Add images as ('left' | 'right', stamp); return the pairs as (left stamp, right stamp)."""
    pairs = []
    for side, stamp in arrivals:
        add = pairing.add_left if side == 'left' else pairing.add_right
        pair = add(stamp, (side, stamp))
        if pair is not None:
            pairs.append(pair)
    pairs += pairing.flush()
    for pair in pairs:
        assert pair.left == ('left', pair.stamp_ns)
        assert pair.gap_ns == abs(pair.left[1] - pair.right[1])
    return [(pair.left[1], pair.right[1]) for pair in pairs]


def interleave(left, right, draws, lead):
    """Merge two streams so that neither is more than `lead` images ahead of the other."""
    arrivals, i, j = [], 0, 0
    for take_left in draws:
        if i < len(left) and (j == len(right) or (take_left and i - j < lead) or j - i >= lead):
            arrivals.append(('left', left[i]))
            i += 1
        elif j < len(right):
            arrivals.append(('right', right[j]))
            j += 1
    arrivals += [('left', stamp) for stamp in left[i:]]
    return arrivals + [('right', stamp) for stamp in right[j:]]


def nearest_in_order(left, right, tolerance):
    """Pair two complete sequences; the reference for the streaming implementation."""
    pairs, i, j = [], 0, 0
    while i < len(left) and j < len(right):
        gap = abs(left[i] - right[j])
        first, k, other = (left, i, right[j]) if left[i] <= right[j] else (right, j, left[i])
        better = k + 1 < len(first) and abs(first[k + 1] - other) < gap
        if gap > tolerance or better:
            i, j = (i + 1, j) if first is left else (i, j + 1)
        else:
            pairs.append((left[i], right[j]))
            i, j = i + 1, j + 1
    return pairs


any_arrivals = st.lists(
    st.tuples(st.sampled_from(['left', 'right']), st.integers(0, 3 * SECOND)), max_size=60
)
few_stamps = st.lists(
    st.tuples(st.sampled_from(['left', 'right']), st.integers(0, 6).map(lambda n: n * 400 * MS)),
    max_size=60,
)
tolerances = st.one_of(st.none(), st.integers(0, SECOND))


@given(st.one_of(any_arrivals, few_stamps), tolerances, st.integers(1, 6))
def test_every_image_is_paired_pending_or_unmatched(arrivals, tolerance, queue_size):
    pairing = StereoPairing(tolerance, queue_size)
    emitted = []
    for number, (side, stamp) in enumerate(arrivals):
        add = pairing.add_left if side == 'left' else pairing.add_right
        pair = add(stamp, number)
        emitted += [pair] if pair else []
        now = pairing.statistics
        assert now.left == now.pairs + now.unmatched_left + now.pending_left
        assert now.right == now.pairs + now.unmatched_right + now.pending_right
        assert max(now.pending_left, now.pending_right) <= queue_size
    emitted += pairing.flush()
    end = pairing.statistics
    assert (end.pending_left, end.pending_right) == (0, 0)
    assert end.pairs == len(emitted)
    assert end.left == sum(side == 'left' for side, _ in arrivals)
    assert end.right == len(arrivals) - end.left
    assert len({pair.left for pair in emitted}) == len({pair.right for pair in emitted})
    assert len({pair.left for pair in emitted}) == len(emitted)
    for pair in emitted:
        assert arrivals[pair.left] == ('left', pair.stamp_ns)
        assert arrivals[pair.right][0] == 'right'
        assert pair.gap_ns == abs(arrivals[pair.right][1] - pair.stamp_ns) <= (tolerance or 0)


@given(
    st.lists(st.integers(0, 30), unique=True),
    st.lists(st.integers(0, 30), unique=True),
    st.lists(st.booleans(), max_size=80),
    st.integers(1, 6),
)
def test_exact_pairs_are_the_common_stamps_for_any_interleaving(left, right, draws, queue_size):
    # Missing images let one side run ahead in stamps, so the lead is counted in stamps here.
    left, right = sorted(left), sorted(right)
    arrivals = sorted(
        [('left', stamp) for stamp in left] + [('right', stamp) for stamp in right],
        key=lambda arrival: arrival[1],
    )
    shuffled = list(arrivals)
    for index, swap in enumerate(draws[: max(len(shuffled) - 1, 0)]):
        if swap and shuffled[index][0] != shuffled[index + 1][0]:
            shuffled[index : index + 2] = shuffled[index + 1], shuffled[index]
    common = [(stamp, stamp) for stamp in left if stamp in right]
    assert run(StereoPairing(queue_size=queue_size), arrivals) == common
    assert run(StereoPairing(queue_size=max(queue_size, 62)), shuffled) == common


@settings(max_examples=300)
@given(st.data())
def test_nearest_pairs_do_not_depend_on_the_interleaving(data):
    # The class requires that spacings vary by less than a factor of two.
    def stream():
        steps = data.draw(st.lists(st.integers(50, 99), max_size=20))
        stamps = [data.draw(st.integers(0, 100))]
        for number, step in enumerate(steps):
            # The first spacing must be a true one.
            lost = number > 0 and data.draw(st.sampled_from([False, False, False, True]))
            stamps.append(stamps[-1] + step * (2 if lost else 1))
        return stamps

    left, right = stream(), stream()
    tolerance = data.draw(st.integers(0, 250))
    draws = data.draw(st.lists(st.booleans(), min_size=50, max_size=50))
    queue_size = data.draw(st.integers(45, 50))
    pairs = run(StereoPairing(tolerance, queue_size), interleave(left, right, draws, queue_size))
    assert pairs == nearest_in_order(left, right, tolerance)
    assert pairs == sorted(pairs)


def test_exact_pairing_returns_the_pair_with_its_second_image():
    pairing = StereoPairing()
    assert pairing.add_left(5, 'l') is None
    assert pairing.add_right(5, 'r') == Pair(stamp_ns=5, left='l', right='r', gap_ns=0)


def test_exact_pairing_counts_a_missing_partner():
    pairing = StereoPairing()
    arrivals = [('left', 1), ('left', 2), ('right', 2), ('right', 3), ('left', 3)]
    assert run(pairing, arrivals) == [(2, 2), (3, 3)]
    end = pairing.statistics
    assert (end.left, end.right, end.pairs) == (3, 2, 2)
    assert (end.unmatched_left, end.unmatched_right) == (1, 0)


def test_the_queues_are_bounded():
    pairing = StereoPairing(queue_size=2)
    for stamp in range(10):
        pairing.add_left(stamp, None)
    assert pairing.statistics.pending_left == 2
    assert pairing.statistics.unmatched_left == 8
    assert pairing.add_right(7, None) is None
    assert pairing.add_right(8, None).stamp_ns == 8


def test_the_smallest_gap_is_known_without_any_pair():
    pairing = StereoPairing()
    assert pairing.statistics.smallest_gap_ns is None
    for frame in range(4):
        pairing.add_left(frame * 100 * MS, None)
        pairing.add_right(frame * 100 * MS + 7 * MS, None)
    assert pairing.statistics.pairs == 0
    assert pairing.statistics.smallest_gap_ns == 7 * MS


def test_a_lost_image_does_not_shift_the_streams_by_one_frame():
    lost = {3}
    arrivals = []
    for frame in range(10):
        arrivals += [('left', frame * 100)] if frame not in lost else []
        arrivals += [('right', frame * 100 + 5)]
    pairs = run(StereoPairing(tolerance_ns=100), arrivals)
    assert pairs == [(n * 100, n * 100 + 5) for n in range(10) if n not in lost]


def test_a_small_gap_is_paired_immediately():
    pairing = StereoPairing(tolerance_ns=50)
    pairing.add_left(0, 0)
    pairing.add_right(5, 5)
    pairing.add_left(100, 100)
    assert pairing.add_right(105, 105) == Pair(100, 100, 105, 5)
    assert pairing.add_left(200, 200) is None
    assert pairing.add_right(205, 205) == Pair(200, 200, 205, 5)


def test_a_gap_of_a_quarter_of_the_spacing_needs_no_wait():
    pairing = StereoPairing(tolerance_ns=50)
    pairing.add_left(0, 0)
    pairing.add_left(100, 100)
    assert pairing.add_right(125, 125) == Pair(100, 100, 125, 25)
    pairing.add_left(200, 200)
    assert pairing.add_right(226, 226) is None


def test_a_held_pair_waits_until_the_queue_is_full():
    pairing = StereoPairing(tolerance_ns=50, queue_size=2)
    pairing.add_left(0, 0)
    assert pairing.add_right(40, 40) is None
    assert pairing.add_right(140, 140) is None
    assert pairing.add_right(240, 240) == Pair(0, 0, 40, 40)


@pytest.mark.parametrize(
    ('tolerance', 'back_ns', 'dropped'),
    [(None, SECOND, 0), (None, SECOND + 1, 1), (MS, 0, 0), (MS, 1, 1)],
)
def test_only_exact_stamps_may_be_out_of_order_by_up_to_a_second(tolerance, back_ns, dropped):
    pairing = StereoPairing(tolerance)
    pairing.add_left(5 * SECOND, None)
    pairing.add_left(5 * SECOND - back_ns, None)
    assert pairing.statistics.unmatched_left == dropped


def test_a_repeated_stamp_is_no_spacing():
    pairing = StereoPairing()
    for stamp in (0, 0, 100):
        pairing.add_left(stamp, None)
    assert pairing.statistics.spacing_ns == 100


def test_flush_returns_a_held_pair():
    pairing = StereoPairing(tolerance_ns=50)
    assert pairing.add_left(0, 'l') is None
    assert pairing.add_right(5, 'r') is None
    assert pairing.flush() == [Pair(0, 'l', 'r', 5)]
    assert pairing.flush() == []


@pytest.mark.parametrize('tolerance', [None, 10 * MS])
@pytest.mark.parametrize('length', [3, 40])
def test_a_looped_recording_is_paired_in_every_loop(tolerance, length):
    frames = [(side, n * 100 * MS) for n in range(length) for side in ('left', 'right')]
    pairing = StereoPairing(tolerance)
    assert run(pairing, frames * 3) == [(n * 100 * MS, n * 100 * MS) for n in range(length)] * 3
    assert pairing.statistics.unmatched_left == 0


@pytest.mark.parametrize('tolerance', [None, 10 * MS])
def test_images_from_before_a_jump_back_are_dropped_and_counted(tolerance):
    pairing = StereoPairing(tolerance)
    pairing.add_left(100 * SECOND, 'stale')
    pairing.add_right(99 * SECOND, 'stale')
    pairing.add_left(5 * SECOND, 'l')
    assert pairing.statistics.unmatched_left == 1
    assert pairing.statistics.unmatched_right == 1
    assert pairing.add_right(5 * SECOND, 'r') == Pair(5 * SECOND, 'l', 'r', 0)
    assert pairing.add_left(99 * SECOND, 'l') is None
    assert pairing.statistics.pairs == 1


@pytest.mark.parametrize(('tolerance', 'queue_size'), [(-1, 5), (None, 0)])
def test_invalid_settings_are_refused(tolerance, queue_size):
    with pytest.raises(ValueError, match='too small'):
        StereoPairing(tolerance, queue_size)


def test_recent_gaps_forget_what_is_past():
    pairing = StereoPairing(tolerance_ns=SECOND)
    offsets = [0] * 5 + [300 * MS] * 20 + [7 * MS] * 5 + [8 * MS] * 20
    largest = []
    for frame, offset in enumerate(offsets):
        pairing.add_left(frame * SECOND, None)
        pairing.add_right(frame * SECOND + offset, None)
        largest.append(pairing.statistics.pair_gap_ns)

    now = pairing.statistics
    assert now.spacing_ns == SECOND
    assert (now.smallest_gap_ns, now.recent_gap_ns) == (0, 8 * MS)
    assert (largest[4], largest[24], largest[-1]) == (0, 300 * MS, 8 * MS)


@pytest.mark.parametrize(
    ('gap_ms', 'spacing_ms', 'one_moment'),
    [(20, 100, True), (25, 100, True), (26, 100, False), (51, 1000, False), (50, None, True)],
)
def test_images_of_one_moment_are_near_in_time_and_against_the_frame_period(
    gap_ms, spacing_ms, one_moment
):
    spacing_ns = None if spacing_ms is None else spacing_ms * MS
    assert shows_one_moment(gap_ms * MS, spacing_ns) == one_moment
