"""The hybrid with single stages left out, as methods with names of their own."""

from __future__ import annotations

from rover_obstacle_detection.detection import hybrid

WHOLE = 'hybrid'
WITHOUT = f'{WHOLE} without '


def optional_stages() -> tuple[str, ...]:
    """Names of the stages that the hybrid can do without."""
    return tuple(getattr(hybrid, 'OPTIONAL_STAGES', ()))


def ablated_methods() -> tuple[str, ...]:
    """Name the hybrid, and the hybrid without each of its optional stages."""
    return (WHOLE, *(f'{WITHOUT}{stage}' for stage in optional_stages()))


def left_out_stage(method: str) -> str | None:
    """Stage that a method's name says is left out; None where it is no such name."""
    stage = method.removeprefix(WITHOUT)
    return stage if stage != method and stage in optional_stages() else None
