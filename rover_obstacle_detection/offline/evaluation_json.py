"""Convert an evaluation to JSON content."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.evaluation.distributions import EDGES_M, Distribution
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.ranges import span_names
from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    SceneResult,
    mean_iou,
    total,
)
from rover_obstacle_detection.offline.summary import preamble

RATIOS = (
    'precision',
    'recall',
    'f1',
    'iou',
    'obstacle_recall',
    'false_alarms_per_frame',
    'called_free_share',
    'confirmed_free_share',
)


def evaluation_json(evaluation: Evaluation, config: DetectorConfig) -> dict[str, Any]:
    """Return all figures of an evaluation; undefined ratios are None."""
    return {
        **preamble('evaluate', config),
        'problems': list(evaluation.problems),
        'methods': {
            method: {
                'all': _group(evaluation.of(method)),
                'conditions': {
                    condition: _group(evaluation.of(method, condition))
                    for condition in evaluation.conditions
                    if evaluation.of(method, condition)
                },
                'scenes': [_scene(result) for result in evaluation.of(method)],
                'by_range': [
                    {'range': name, **figures_json(figures)}
                    for name, figures in zip(
                        span_names(), evaluation.by_range(method), strict=False
                    )
                ],
                'curve': [
                    {'max_step': max_step_m, **figures_json(figures)}
                    for max_step_m, figures in sorted(evaluation.curves.get(method, {}).items())
                ],
            }
            for method in evaluation.methods
        },
        'distribution_edges_m': EDGES_M[1:-1].tolist(),
        'distributions': {
            method: {'roughness': _counts(both.roughness), 'step': _counts(both.step)}
            for method, both in evaluation.distributions.items()
        },
    }


def figures_json(figures: Figures) -> dict[str, Any]:
    """Return the counts and ratios of some figures."""
    ratios = {name: getattr(figures, name) for name in RATIOS}
    return {
        **dataclasses.asdict(figures),
        'obstacles': figures.obstacles,
        'obstacles_found': figures.obstacles_found,
        **ratios,
    }


def _group(results: Sequence[SceneResult]) -> dict[str, Any]:
    pooled = total(result.figures for result in results)
    return {
        'scenes': len(results),
        'mean_iou': mean_iou(results),
        **figures_json(pooled),
        'median_ms': [round(1000 * result.median_seconds, 3) for result in results],
        'times_plain_sgbm': [round(result.times_plain, 3) for result in results],
    }


def _scene(result: SceneResult) -> dict[str, Any]:
    return {
        'scene': result.scene,
        'conditions': list(result.conditions),
        **figures_json(result.figures),
        'median_ms': round(1000 * result.median_seconds, 3),
        'times_plain_sgbm': round(result.times_plain, 3),
        'frames': [
            {
                'stamp_ns': frame.stamp_ns,
                **figures_json(frame.figures),
                'ms': round(1000 * frame.seconds, 3),
                'plain_sgbm_ms': round(1000 * frame.plain_seconds, 3),
            }
            for frame in result.frames
        ],
    }


def _counts(distribution: Distribution) -> dict[str, Any]:
    return {
        'free': distribution.free.tolist(),
        'obstacle': distribution.obstacle.tolist(),
        'separation': distribution.separation,
    }
