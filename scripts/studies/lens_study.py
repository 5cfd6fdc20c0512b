"""What lenses that still bend after rectification cost, and what straightening them saves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED
from rover_obstacle_detection.evaluation.methods.ablation import ABLATIONS
from rover_obstacle_detection.evaluation.results import mean_scene_iou, total
from rover_obstacle_detection.evaluation.tables import NONE, Table

Shares = tuple[float, float, float]

BENDS: Mapping[str, tuple[Shares, Shares]] = {
    'none': ((0, 0, 0), (0, 0, 0)),
    'each its own way, 0.5 %': ((0.005, 0, 0), (-0.005, 0, 0)),
    'each its own way, 2 % and 1 %': ((0, -0.02, 0), (0, 0.01, 0)),
    'both alike, 1 %': ((0.01, -0.02, 0), (0.01, -0.02, 0)),
    'both alike, 1 %, wavy': ((0.02, 0.03, -0.06), (0.02, 0.03, -0.06)),
}
"""What each order moves the corners, as a share of their radius: left lens, right lens."""

_ROUNDING_PX = 1e-2


@dataclass(frozen=True)
class SceneLenses:
    """A scene through bent lenses: figures as they come, and with the lenses straightened.

    Parameters
    ----------
    bent, straightened : mapping of str to Figures
        By the name of the bend.
    """

    bent: Mapping[str, Figures]
    straightened: Mapping[str, Figures]


def lenses_of(camera: StereoCamera, bend: tuple[Shares, Shares]) -> Lenses:
    """Turn shares of the corner's radius into the coefficients of a camera's lenses."""
    x, y = camera.rays()
    square = float(np.square(x).max() + np.square(y).max())
    left, right = (
        LensDistortion(*(share / square**order for order, share in enumerate(shares, 1)))
        for shares in bend
    )
    return Lenses(left, right)


def bent_frame(frame: LabelledFrame, lenses: Lenses) -> LabelledFrame:
    """Show a frame as lenses would that rectification took for straight.

    Nothing counts that the frame does not show.
    """
    camera = frame.camera
    left_places, right_places = (
        view.straight_places(RectificationParameters()) for view in lenses.views(camera)
    )
    columns, rows = left_places
    inside = (columns > -_ROUNDING_PX) & (columns < camera.width - 1 + _ROUNDING_PX)
    inside &= (rows > -_ROUNDING_PX) & (rows < camera.height - 1 + _ROUNDING_PX)
    labels = _seen(frame.labels, left_places, cv2.INTER_NEAREST)
    return replace(
        frame,
        left=_seen(frame.left, left_places),
        right=_seen(frame.right, right_places),
        labels=np.where(inside, labels, NOT_COUNTED).astype(np.uint8),
        instances=_seen(frame.instances, left_places, cv2.INTER_NEAREST) * inside,
        depth_m=None,
    )


def compare_lenses(frame: LabelledFrame, config: DetectorConfig) -> SceneLenses:
    """Run the detector on a frame through each pair of lenses, straightened and not."""
    straightened: dict[str, Figures] = {}
    as_they_come: dict[str, Figures] = {}
    for name, bend in BENDS.items():
        bent = bent_frame(frame, lenses_of(frame.camera, bend))
        for stages, found in (
            (HYBRID_STAGES, straightened),
            (ABLATIONS['lenses'], as_they_come),
        ):
            detector = Detector(frame.camera, config, stages=stages)
            mask = detector.detect(bent.left, bent.right).mask
            found[name] = score(mask, bent.labels, bent.instances)
    return SceneLenses(as_they_come, straightened)


def lens_table(scenes: Sequence[SceneLenses]) -> Table:
    """Tabulate the figures of scenes through each pair of lenses."""
    rows = []
    for name in BENDS:
        cells = [name]
        for kind in ('bent', 'straightened'):
            figures = [getattr(scene, kind)[name] for scene in scenes]
            iou, pooled = mean_scene_iou(figures), total(figures)
            alarms = pooled.false_alarms_per_frame
            cells += [
                NONE if iou is None else f'{iou:.3f}',
                f'{pooled.obstacles_found}/{pooled.obstacles}',
                NONE if alarms is None else f'{alarms:.2f}',
            ]
        rows.append(tuple(cells))
    return Table('Lenses that bend', ('lenses', *_HEADER), rows)


_HEADER = (
    'IoU as they come',
    'obstacles',
    'false alarms',
    'IoU straightened',
    'obstacles',
    'false alarms',
)


def _seen(
    image: NDArray[Any],
    places: tuple[NDArray[np.float32], NDArray[np.float32]],
    interpolation: int = cv2.INTER_CUBIC,
) -> NDArray[Any]:
    columns, rows = (np.nan_to_num(each) for each in places)
    return np.asarray(
        cv2.remap(image, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE)
    )
