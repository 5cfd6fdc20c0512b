import pytest
from recordings import IMAGE

from rover_obstacle_detection.offline.inspection.streams import Stream, synchronise

PERIOD_NS = 100_000_000
STAMPS_NS = [PERIOD_NS * number for number in range(1, 11)]


def stream(stamps_ns):
    return Stream('/t', IMAGE, stamps_ns=list(stamps_ns), log_times_ns=list(stamps_ns))


def delayed(*delays_ms):
    """Stamps, some of them delayed."""
    delays_ms = [*delays_ms, *[0] * (len(STAMPS_NS) - len(delays_ms))]
    return [stamp + delay * 1_000_000 for stamp, delay in zip(STAMPS_NS, delays_ms, strict=True)]


@pytest.mark.parametrize(
    ('right_ns', 'tolerance_s', 'pairs'),
    [
        (STAMPS_NS, None, 10),
        (STAMPS_NS[::3], None, 4),
        (delayed(50, 50), None, 8),
        (delayed(3, 3, 3), 0.004, 10),
        (delayed(*[1] * 9), 0.002, 10),
        (delayed(*[50] * 10), None, 0),
        ([], None, 0),
        (STAMPS_NS[:1], None, 1),
    ],
)
def test_the_tolerance_pairs_what_shows_one_moment(right_ns, tolerance_s, pairs):
    for sides in ((STAMPS_NS, right_ns), (right_ns, STAMPS_NS)):
        found, paired = synchronise(*map(stream, sides))
        assert found.approximate_sync_s == (tolerance_s and pytest.approx(tolerance_s))
        assert found.pairs == len(paired) == pairs


def test_gaps_are_those_of_the_side_with_fewer_images():
    found, _ = synchronise(stream(STAMPS_NS), stream(delayed(*[2] * 10)[::3]))
    assert found.smallest_gap_ms == found.median_gap_ms == pytest.approx(2)
    assert found.equal_stamps == 0


def test_without_images_there_is_nothing_to_compare():
    found, _ = synchronise(stream(STAMPS_NS), stream([]))
    assert found.smallest_gap_ms is None
