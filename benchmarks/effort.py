"""How much each part of the benchmark measures."""

from __future__ import annotations

from dataclasses import dataclass

from rover_obstacle_detection import DetectorConfig

Size = tuple[int, int]
DEFAULT = DetectorConfig()


@dataclass(frozen=True)
class Effort:
    """Repeats, scenes and sizes.

    Parameters
    ----------
    turns : int
        Turns per pair, after one to warm up.
    frames_per_bag : int, optional
        Frames that are read of each bag; all if omitted.
    configs : tuple of DetectorConfig
        Resolutions to compare; the default comes first.
    sizes : tuple of tuple of int
        Widths and heights, ascending, to which a pair is resized.
    listing_pairs : int
        Pairs on which the study's listing runs, which takes seconds for each.
    live_pairs : int
        Pairs of the long live run, for memory.
    rate_pairs : int
        Pairs of the other live runs.
    settled_pairs : int
        Pairs after which these two are measured.
    search_s : float
        Length of a run at a lower rate, where the goal is not reached.
    idle_s, overload_s : float
        Length of the idle and the overloaded run of the node.
    replay_pairs : int
        Pairs of each of two recordings.
    """

    turns: int = 7
    frames_per_bag: int | None = None
    configs: tuple[DetectorConfig, ...] = (
        DEFAULT,
        DetectorConfig(speed='fast'),
        DetectorConfig(working_scale=1.0),
    )
    sizes: tuple[Size, ...] = (
        (320, 240),
        (512, 384),
        (640, 480),
        (800, 600),
        (1024, 768),
        (1280, 960),
        (1600, 1200),
        (2048, 1536),
    )
    listing_pairs: int = 3
    live_pairs: int = 1000
    rate_pairs: int = 150
    settled_pairs: int = 50
    search_s: float = 15.0
    idle_s: float = 20.0
    overload_s: float = 10.0
    replay_pairs: int = 60


FULL = Effort()
QUICK = Effort(
    turns=1,
    frames_per_bag=1,
    configs=(DEFAULT, DetectorConfig(speed='fast')),
    sizes=((320, 240), (640, 480)),
    listing_pairs=1,
    live_pairs=20,
    rate_pairs=20,
    settled_pairs=10,
    search_s=2.0,
    idle_s=2.0,
    overload_s=2.0,
    replay_pairs=8,
)
