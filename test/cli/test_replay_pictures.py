"""``replay --images`` writes the chosen pictures, and ``--video`` the overlays as a video."""

from contextlib import ExitStack

import cv2
import numpy as np
import pytest
from hand_made import CAMERA, stereo_images

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.cli.replay_command import PICTURES
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.offline.overlay_video import OverlayVideo
from rover_obstacle_detection.offline.picture_files import PICTURE_NAMES
from rover_obstacle_detection.pictures import overlay_picture


def test_pictures_can_be_chosen(bag, tmp_path):
    arguments = ['-o', str(tmp_path / 'out'), '--images', 'overlay,disparity']
    assert main(['replay', str(bag), *arguments, '--duration', '0.05']) == 0
    names = {path.name for path in (tmp_path / 'out' / 'images').iterdir()}
    assert names == {'000001_overlay.png', '000001_disparity.png'}


def test_pictures_are_those_that_can_be_written():
    assert PICTURES == PICTURE_NAMES


def test_an_unknown_picture_is_a_usage_error(bag, tmp_path, capsys):
    with pytest.raises(SystemExit) as raised:
        main(['replay', '-o', str(tmp_path / 'out'), '--images', str(bag)])
    assert raised.value.code == 2
    error = capsys.readouterr().err
    assert f"'{bag}' is not a picture: expected some of overlay,disparity" in error
    assert 'a bag has to stand before --images' in error


def test_the_overlays_become_a_video(bag, tmp_path, capsys):
    output = tmp_path / 'out'
    assert main(['replay', str(bag), '-o', str(output), '--video']) == 0
    assert f'video: {output / "overlays.mp4"}' in capsys.readouterr().out
    video = cv2.VideoCapture(str(output / 'overlays.mp4'))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 3
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(10)
    read, shown = video.read()
    video.release()
    assert read
    drawn = overlay_picture(Detector(CAMERA).detect(*stereo_images()))
    assert np.abs(shown.astype(int) - drawn).mean() < 10


class NoEncoder:
    def __init__(self, *arguments):
        pass

    fourcc = staticmethod(cv2.VideoWriter.fourcc)

    def isOpened(self):  # noqa: N802
        return False


def test_a_missing_video_encoder_is_named_before_any_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cv2, 'VideoWriter', NoEncoder)
    arguments = ['replay', str(tmp_path / 'missing'), '-o', str(tmp_path / 'out'), '--video']
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert 'cannot write overlays.mp4: OpenCV' in error
    assert 'cannot encode mp4v' in error
    assert error.count('\n') == 1
    assert list(tmp_path.iterdir()) == []


def test_a_video_that_lacks_pictures_is_an_error(tmp_path):
    picture = np.zeros((48, 64, 3), np.uint8)
    stack = ExitStack()
    video = stack.enter_context(OverlayVideo(tmp_path / 'overlays.mp4', 10.0))
    video.add(picture)
    video.add(picture[::2, ::2])
    (tmp_path / 'overlays.mp4').unlink()
    with pytest.raises(OutputError, match=r'overlays.mp4 has 0 pictures: expected 2'):
        stack.close()
