"""Write the overlays of all frames as a video."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.pictures import Picture
from rover_obstacle_detection.wording import counted

CODEC = 'mp4v'
SLOWEST_HZ, FASTEST_HZ = 1.0, 60.0


class OverlayVideo:
    """An MPEG-4 video. Use it as a context manager.

    Its size is that of the first picture; others are scaled.

    Parameters
    ----------
    path : Path
    rate_hz : float
        Pictures per second, limited to what players can show.

    Raises
    ------
    OutputError
        If the video cannot be written; also from `add` and at the end.
    """

    def __init__(self, path: Path, rate_hz: float) -> None:
        self._path = path
        self._rate_hz = min(max(rate_hz, SLOWEST_HZ), FASTEST_HZ)
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)
        self._pictures = 0

    def __enter__(self) -> OverlayVideo:
        return self

    def add(self, picture: Picture) -> None:
        """Append a BGR picture."""
        if self._writer is None:
            self._size = (picture.shape[1], picture.shape[0])
            self._writer = open_writer(self._path, self._rate_hz, self._size)
        if (picture.shape[1], picture.shape[0]) != self._size:
            picture = np.asarray(cv2.resize(picture, self._size), np.uint8)
        self._writer.write(picture)
        self._pictures += 1

    def __exit__(self, exc_type: object, *others: object) -> None:
        if self._writer is None:
            return
        self._writer.release()
        if exc_type is not None:
            return
        # OpenCV says nothing when the disk is full.
        written = cv2.VideoCapture(str(self._path))
        count = max(0, int(written.get(cv2.CAP_PROP_FRAME_COUNT)))
        written.release()
        if count != self._pictures:
            raise OutputError(
                f'{self._path.name} has {counted(count, "picture")}: expected {self._pictures}; '
                'is the disk full?'
            )


def open_writer(path: Path, rate_hz: float, size: tuple[int, int]) -> cv2.VideoWriter:
    """Open a video for writing.

    Raises
    ------
    OutputError
        If OpenCV cannot do that.
    """
    codec = cv2.VideoWriter.fourcc(*CODEC)
    writer = cv2.VideoWriter(str(path), codec, rate_hz, size)
    if not writer.isOpened():
        raise OutputError(
            f'cannot write {path.name}: OpenCV {cv2.__version__} cannot encode {CODEC} videos '
            'here: expected an OpenCV with FFmpeg, as the one from pip; or leave out --video'
        )
    return writer


def require_encoder(name: str) -> None:
    """Check that videos can be written, before the work that fills them.

    Raises
    ------
    OutputError
        If not; it names the file.
    """
    with tempfile.TemporaryDirectory() as folder:
        open_writer(Path(folder) / name, 10.0, (64, 64)).release()
