"""Folders of stereo images as a recording."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.decompression import MAX_BYTES
from rover_obstacle_detection.bags.image_layouts import Camera, find_cameras
from rover_obstacle_detection.bags.source import Entry
from rover_obstacle_detection.bags.topics import COMPRESSED_TYPE, INFO_TYPE
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.errors import BagError, ImageError
from rover_obstacle_detection.messages.calibration import CameraInfo
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import image_size
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory, ros2_typestore

_SIDES = ('left', 'right')


class ImageFolders:
    """The images of a folder as compressed image messages; see `Source`.

    A calibration found beside is one camera_info message per side.

    Parameters
    ----------
    path : Path
    cameras : list of Camera
        The stereo cameras of the folder.

    Raises
    ------
    BagError
        If there is no image.
    """

    def __init__(self, path: Path, cameras: list[Camera]) -> None:
        self._factory = RosbagsFactory()
        self._images: dict[str, list[tuple[int, Path]]] = {}
        self._files: dict[tuple[str, int], Path] = {}
        self._infos: dict[str, tuple[Camera, int]] = {}
        self.note = ''
        for camera in cameras:
            for index, folder in enumerate(camera.folders):
                self._add_side(camera, index, folder)
        self.topics: Mapping[str, str] = {
            **dict.fromkeys(self._images, COMPRESSED_TYPE),
            **dict.fromkeys(self._infos, INFO_TYPE),
        }
        stamps = [stamp for images in self._images.values() for stamp, _ in images]
        if not stamps:
            listed = ', '.join(str(folder) for each in cameras for folder in each.folders)
            raise BagError(f'{path}: no images in {listed}')
        self.span_ns: tuple[int, int] | None = (min(stamps), max(stamps) + 1)

    @classmethod
    def find(cls, path: Path) -> ImageFolders | None:
        """Open a folder of stereo images; None if it has no known layout."""
        cameras = find_cameras(path)
        return cls(path, cameras) if cameras else None

    def _add_side(self, camera: Camera, index: int, folder: Path) -> None:
        side = _SIDES[index] + (f'_{camera.name}' if camera.name else '')
        kind = 'image_rect' if camera.rectified else 'image'
        topic = f'/stereo/{side}/{kind}/compressed'
        stamps = camera.stamps_ns[index]
        self._images[topic] = sorted((stamp, folder / name) for name, stamp in stamps.items())
        self._files |= {(topic, stamp): file for stamp, file in self._images[topic]}
        if camera.calibration:
            info = f'/stereo/{side}/camera_info'
            self._infos[info] = camera, index

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        return int(topic in self._infos) or len(self._images.get(topic, ()))

    def file_of(self, topic: str, stamp_ns: int) -> Path | None:
        """File of the image with a stamp; None if there is none."""
        return self._files.get((topic, stamp_ns))

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Yield messages in time order; an image is read when it is decoded."""
        assert self.span_ns is not None
        first_ns = self.span_ns[0]
        entries = [
            Entry(topic, first_ns, INFO_TYPE, b'', self)
            for topic in self._infos
            if topic in topics
        ]
        entries += [
            Entry(topic, stamp, COMPRESSED_TYPE, os.fsencode(path), self)
            for topic, images in self._images.items()
            if topic in topics
            for stamp, path in images
        ]
        for entry in sorted(entries, key=lambda each: each.log_time_ns):
            if (start_ns is None or entry.log_time_ns >= start_ns) and (
                end_ns is None or entry.log_time_ns < end_ns
            ):
                yield entry

    def deserialize(self, entry: Entry) -> Any:
        """Read the image or the calibration of an entry."""
        side = entry.topic.split('/')[2]
        header = make_header(entry.log_time_ns, f'{side}_optical', self._factory)
        if entry.type_name == INFO_TYPE:
            return self._info_message(self._info(entry.topic), header)
        path = Path(os.fsdecode(entry.data))
        return self._factory.make(
            COMPRESSED_TYPE,
            header=header,
            format=path.suffix[1:].lower(),
            data=_content(path),
        )

    def serialized(self, entry: Entry) -> bytes | memoryview:
        """Return an entry in ROS 2 wire format (CDR)."""
        return ros2_typestore().serialize_cdr(self.deserialize(entry), entry.type_name)

    def _info(self, topic: str) -> CameraInfo:
        camera, index = self._infos[topic]
        request = CalibrationRequest(camera.calibration)
        calibration = request.calibration(lambda: self._size(camera), str(camera.folders[0]))
        return calibration.right if index else calibration.left

    def _size(self, camera: Camera) -> tuple[int, int]:
        for name in camera.stamps_ns[0]:
            path = camera.folders[0] / name
            try:
                data = _content(path)
            except (OSError, ImageError):
                continue
            if size := image_size(self._factory.make(COMPRESSED_TYPE, data=data)):
                return size
        raise BagError(f'{camera.folders[0]}: no image can be decoded')

    def _info_message(self, info: CameraInfo, header: Any) -> Any:
        return self._factory.make(
            INFO_TYPE,
            header=header,
            width=info.width,
            height=info.height,
            distortion_model=info.distortion_model,
            **{name: np.array(getattr(info, name), np.float64) for name in 'dkrp'},
        )


def _content(path: Path) -> NDArray[np.uint8]:
    with path.open('rb') as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        msg = f'has more than {MAX_BYTES} bytes: expected an image'
        raise ImageError(msg)
    return np.frombuffer(data, np.uint8)
