"""Figures of a detector's answer to a view, and their means over views."""

from __future__ import annotations

import re
import statistics
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.evaluation.blind.view import View
from rover_obstacle_detection.evaluation.labels import is_obstacle

WRONG_RANGE_SHARE = 0.2
"""A range that is off by more than this share of the true one is wrong."""

MAX_WORDS_LENGTH = 60
"""Longest excerpt of a message in a table, characters."""


class Answer(Protocol):
    """The fields of a `Detection` that are measured."""

    @property
    def mask(self) -> NDArray[np.uint8]:
        """0 free or unknown, 255 obstacle."""

    @property
    def known(self) -> NDArray[np.bool_]:
        """Pixels that were judged."""

    @property
    def disparity(self) -> NDArray[np.float32]:
        """Pixels; 0 where there is no match."""

    @property
    def height(self) -> NDArray[np.float32]:
        """Metres above the local ground; NaN where there is no 3D."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the pair less trustworthy than usual."""


Judge = Callable[[View], Answer]
"""A detector; raises `ObstacleDetectionError` if it refuses the view."""


@dataclass(frozen=True)
class BlindFigures:
    """A detector's answer to one view. Shares are 0 to 1; None where they are not defined.

    Parameters
    ----------
    refusal : str, optional
        Why the view was refused; None if it was judged. The shares of a refused view are None.
    crashed : bool
        Whether the refusal was not one of the package's own errors.
    warnings : tuple of str
    free, obstacle, unknown : float, optional
        Shares of the image; their sum is 1.
    blind_called_free : float, optional
        Share of the pixels of which the pair says nothing.
    wrong_range : float, optional
        Share of the free points of known range; see `WRONG_RANGE_SHARE`.
    falsely_free : float, optional
        Share of the image that is called free at a wrong range, on an obstacle, or where the pair
        says nothing.
    obstacle_called_free : float, optional
        Share of the obstacle pixels.
    """

    refusal: str | None = None
    crashed: bool = False
    warnings: tuple[str, ...] = ()
    free: float | None = None
    obstacle: float | None = None
    unknown: float | None = None
    blind_called_free: float | None = None
    wrong_range: float | None = None
    falsely_free: float | None = None
    obstacle_called_free: float | None = None


SHARES = (
    'free',
    'obstacle',
    'unknown',
    'blind_called_free',
    'wrong_range',
    'falsely_free',
    'obstacle_called_free',
)
"""Names of the shares of `BlindFigures`."""


def judged(view: View, judge: Judge) -> BlindFigures:
    """Let a detector judge a view and measure its answer.

    An exception other than the package's own is recorded as a crash, so that the other views are
    still judged.
    """
    try:
        answer = judge(view)
    except ObstacleDetectionError as error:
        return BlindFigures(refusal=f'{type(error).__name__}: {error}')
    except Exception as error:
        return BlindFigures(refusal=f'crash, {type(error).__name__}: {error}', crashed=True)
    return measured(answer, view)


def measured(answer: Answer, view: View) -> BlindFigures:
    """Measure an answer against the truth of a view."""
    obstacle = answer.mask != 0
    free = answer.known & ~obstacle
    points = free & (answer.disparity > 0) & np.isfinite(answer.height)
    compared = points & np.isfinite(view.depth_m)
    # As in Detection.points: the range that a planner is given, with the calibration it is told.
    range_m = view.camera.fx * view.camera.baseline_m / answer.disparity[compared]
    true_m = view.depth_m[compared]
    wrong = np.abs(range_m - true_m) > WRONG_RANGE_SHARE * true_m
    false = is_obstacle(view.labels)
    false[compared] |= wrong
    if view.blind is not None:
        false |= view.blind
    return BlindFigures(
        warnings=answer.warnings,
        free=_share(free),
        obstacle=_share(obstacle),
        unknown=_share(~free & ~obstacle),
        blind_called_free=None if view.blind is None else _share(free[view.blind]),
        wrong_range=_share(wrong),
        falsely_free=_share(free & false),
        obstacle_called_free=_share(free[is_obstacle(view.labels)]),
    )


@dataclass(frozen=True)
class Strength:
    """The figures of all views under one condition of one strength.

    Parameters
    ----------
    group, condition, strength : str
        As in `Condition`.
    views : tuple of BlindFigures
    """

    group: str
    condition: str
    strength: str
    views: tuple[BlindFigures, ...]

    @property
    def refused(self) -> int:
        """Number of refused views, without crashes."""
        return sum(view.refusal is not None and not view.crashed for view in self.views)

    @property
    def warned(self) -> int:
        """Number of views that were judged with a warning."""
        return sum(bool(view.warnings) for view in self.views)

    @property
    def silent(self) -> Strength:
        """The views that were judged without a warning."""
        views = [view for view in self.views if view.refusal is None and not view.warnings]
        return replace(self, views=tuple(views))

    @property
    def crashed(self) -> int:
        """Number of views that ended in another exception."""
        return sum(view.crashed for view in self.views)

    def mean(self, share: str) -> float | None:
        """Mean of one of the `SHARES` over the views that have it; None if none has."""
        values = [getattr(view, share) for view in self.views]
        defined = [value for value in values if value is not None]
        return statistics.fmean(defined) if defined else None

    def words(self) -> tuple[str, int]:
        """Return the commonest refusal or warning, abridged, and the number of its views."""
        said = Counter(
            words for view in self.views for words in {abridged(each) for each in _messages(view)}
        )
        return said.most_common(1)[0] if said else ('', 0)


def abridged(message: str) -> str:
    """Shorten a message to its first clause; numbers become ``#``, so that equal ones count."""
    message = re.sub(r'^\w+Error: ', '', message)
    clause = re.split(r': expected|; |\. | \(', message, maxsplit=1)[0].strip()
    clause = re.sub(r'\d+(\.\d+)?', '#', clause)
    if len(clause) > MAX_WORDS_LENGTH:
        clause = clause[: MAX_WORDS_LENGTH - 3].rstrip() + '...'
    return clause


def _messages(view: BlindFigures) -> Sequence[str]:
    return view.warnings if view.refusal is None else (view.refusal,)


def _share(where: NDArray[np.bool_]) -> float | None:
    return float(where.mean()) if where.size else None
