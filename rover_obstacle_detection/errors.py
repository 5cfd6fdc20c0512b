"""Errors a user can act on: each message names what was wrong and what was expected."""

from __future__ import annotations


class ObstacleDetectionError(Exception):
    """Base of every error that this package raises on purpose."""


class CameraError(ObstacleDetectionError):
    """A stereo calibration that no depth can be computed from."""


class ConfigurationError(ObstacleDetectionError):
    """A parameter with an impossible value."""


class ImageError(ObstacleDetectionError):
    """An image that cannot be decoded, or that does not fit its partner or its calibration."""


class BagError(ObstacleDetectionError):
    """A recording that cannot be read, or lacks what a stereo replay needs."""


class OutputError(ObstacleDetectionError):
    """A result that cannot be written where it was asked for."""


class MissingExtraError(ObstacleDetectionError):
    """An optional library that is not installed."""


class ModelError(ObstacleDetectionError):
    """A trained model that does not fit this version of the package."""
