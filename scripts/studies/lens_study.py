"""Effect of residual lens distortion on detection, with and without its correction."""

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
from rover_obstacle_detection.evaluation.tables import Table, found_of, number

Shares = tuple[float, float, float]

DISTORTIONS: Mapping[str, tuple[Shares, Shares]] = {
    'none': ((0, 0, 0), (0, 0, 0)),
    'opposite, 0.5 %': ((0.005, 0, 0), (-0.005, 0, 0)),
    'opposite, 2 % and 1 %': ((0, -0.02, 0), (0, 0.01, 0)),
    'equal, 1 %': ((0.01, -0.02, 0), (0.01, -0.02, 0)),
    'equal, 1 %, alternating': ((0.02, 0.03, -0.06), (0.02, 0.03, -0.06)),
}
"""Corner displacement by each radial order, as a share of the corner radius: left, right lens."""

# Slack for rounding at the image border, pixels.
_ROUNDING_PX = 1e-2


@dataclass(frozen=True)
class SceneLenses:
    """Figures of a frame with added lens distortion, by the name of the distortion.

    Parameters
    ----------
    uncorrected, corrected : mapping of str to Figures
        Without and with the detector's correction.
    """

    uncorrected: Mapping[str, Figures]
    corrected: Mapping[str, Figures]


def lenses_of(camera: StereoCamera, distortion: tuple[Shares, Shares]) -> Lenses:
    """Convert shares of the corner radius to distortion coefficients."""
    x, y = camera.rays()
    square = float(np.square(x).max() + np.square(y).max())
    left, right = (
        LensDistortion(*(share / square**order for order, share in enumerate(shares, 1)))
        for shares in distortion
    )
    return Lenses(left, right)


def distorted_frame(frame: LabelledFrame, lenses: Lenses) -> LabelledFrame:
    """Resample a frame as if rectification had left this lens distortion.

    Pixels from outside the original frame are not counted.
    """
    camera = frame.camera
    left_places, right_places = (
        view.straight_places(RectificationParameters()) for view in lenses.views(camera)
    )
    columns, rows = left_places
    inside = (columns > -_ROUNDING_PX) & (columns < camera.width - 1 + _ROUNDING_PX)
    inside &= (rows > -_ROUNDING_PX) & (rows < camera.height - 1 + _ROUNDING_PX)
    labels = _resampled(frame.labels, left_places, cv2.INTER_NEAREST)
    return replace(
        frame,
        left=_resampled(frame.left, left_places),
        right=_resampled(frame.right, right_places),
        labels=np.where(inside, labels, NOT_COUNTED).astype(np.uint8),
        instances=_resampled(frame.instances, left_places, cv2.INTER_NEAREST) * inside,
        depth_m=None,
    )


def compare_lenses(frame: LabelledFrame, config: DetectorConfig) -> SceneLenses:
    """Run the detector on a frame with each distortion, with and without correction."""
    corrected: dict[str, Figures] = {}
    uncorrected: dict[str, Figures] = {}
    for name, distortion in DISTORTIONS.items():
        distorted = distorted_frame(frame, lenses_of(frame.camera, distortion))
        for stages, found in ((HYBRID_STAGES, corrected), (ABLATIONS['lenses'], uncorrected)):
            detector = Detector(frame.camera, config, stages=stages)
            mask = detector.detect(distorted.left, distorted.right).mask
            found[name] = score(mask, distorted.labels, distorted.instances)
    return SceneLenses(uncorrected, corrected)


def lens_table(scenes: Sequence[SceneLenses]) -> Table:
    """Tabulate the figures of scenes, one row per distortion."""
    rows = []
    for name in DISTORTIONS:
        cells = [name]
        for by_name in ('uncorrected', 'corrected'):
            figures = [getattr(scene, by_name)[name] for scene in scenes]
            pooled = total(figures)
            cells += [
                number(mean_scene_iou(figures)),
                found_of(pooled),
                number(pooled.false_alarms_per_frame, 2),
            ]
        rows.append(tuple(cells))
    counts = ('obstacles', 'false alarms')
    header = ('distortion', 'IoU uncorrected', *counts, 'IoU corrected', *counts)
    return Table('Residual lens distortion', header, rows)


def _resampled(
    image: NDArray[Any],
    places: tuple[NDArray[np.float32], NDArray[np.float32]],
    interpolation: int = cv2.INTER_CUBIC,
) -> NDArray[Any]:
    columns, rows = (np.nan_to_num(each) for each in places)
    return np.asarray(
        cv2.remap(image, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE)
    )
