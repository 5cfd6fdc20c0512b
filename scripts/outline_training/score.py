"""How well a model outlines rocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from outline_training.examples import Example
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel
from rover_obstacle_detection.detection.rocks.parameters import RockParameters


def mean_iou(model: OutlineModel, examples: Sequence[Example]) -> float:
    """Mean, over the frames that show rocks, of the IoU of their pixels; NaN without rocks."""
    inside = RockParameters().outline_probability
    values = []
    for example in examples:
        rock = example.rock.numpy()
        if rock.any():
            found = model.probability(example.features.numpy().astype(np.float32)) > inside
            found &= example.counted.numpy()
            values.append(np.count_nonzero(found & rock) / np.count_nonzero(found | rock))
    return float(np.mean(values)) if values else float('nan')
