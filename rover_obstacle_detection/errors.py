"""Errors a user can act on; each message names what is wrong and what was expected."""

from __future__ import annotations

import re

_LINE_BREAK = re.compile('[ \t\r]*\n[ \t\r\n]*')
_CONTROL = re.compile('[\x00-\x1f\x7f-\x9f\u2028\u2029]')


class ObstacleDetectionError(Exception):
    """Base class of the errors that this package raises deliberately."""

    def __str__(self) -> str:
        """Return the message on one line: names in recordings may hold line breaks."""
        line = _LINE_BREAK.sub(' ', super().__str__())
        return _CONTROL.sub(lambda found: repr(found[0])[1:-1], line)


class CameraError(ObstacleDetectionError):
    """A stereo calibration that gives no depth."""


class ConfigurationError(ObstacleDetectionError):
    """A parameter with an invalid value."""


class ImageError(ObstacleDetectionError):
    """An image that cannot be decoded or does not match its partner or its calibration."""


class UnjudgeablePairError(ObstacleDetectionError):
    """A stereo pair that shows too little, or contradicts itself, to say anything about ground."""


class BagError(ObstacleDetectionError):
    """A recording that cannot be read or lacks required topics."""


class OutputError(ObstacleDetectionError):
    """An output that cannot be written."""


class MissingExtraError(ObstacleDetectionError):
    """An optional dependency that is not installed."""


class ClusterError(ObstacleDetectionError):
    """A Dask cluster that cannot be reached or fails at its work."""


class ModelError(ObstacleDetectionError):
    """A trained model that does not fit this version of the package."""


class NothingDoneError(ObstacleDetectionError):
    """Work that was interrupted before there was anything to keep."""


def failure_text(error: BaseException) -> str:
    """Return an error on one line: the text of one of ours, the kind and text of any other."""
    text = ' '.join(str(error).split())
    if isinstance(error, ObstacleDetectionError):
        return text
    kind = type(error)
    name = kind.__name__ if kind.__module__ == 'builtins' else f'{kind.__module__}.{kind.__name__}'
    return f'{name}: {text}' if text else name
