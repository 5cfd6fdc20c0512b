"""The hybrid without single stages, as named methods."""

from __future__ import annotations

from rover_obstacle_detection.detection import hybrid

WHOLE = 'hybrid'
WITHOUT = f'{WHOLE} without '


def optional_stages() -> tuple[str, ...]:
    """Names of the stages that the hybrid can run without."""
    return tuple(getattr(hybrid, 'OPTIONAL_STAGES', ()))


def ablated_methods() -> tuple[str, ...]:
    """Names of the hybrid and of the hybrid without each optional stage."""
    return (WHOLE, *(f'{WITHOUT}{stage}' for stage in optional_stages()))


def left_out_stage(method: str) -> str | None:
    """Stage that a method of this name leaves out; None for other methods."""
    stage = method.removeprefix(WITHOUT)
    return stage if stage != method and stage in optional_stages() else None
