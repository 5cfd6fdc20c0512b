from __future__ import annotations

import os
import platform
import subprocess
import sys

import numpy as np
import pytest
from synthetic import Box, mast, render

SCENE = mast(640, 480, solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22),))
PAGES_OF_A_FRAME = """
import resource
import numpy as np
from synthetic import mast
from rover_obstacle_detection.detection.detector import Detector

left, right = np.load('pair.npy')
detector = Detector(mast(640, 480).camera)

def pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    detector.detect(left, right)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

print(min(pages() for _ in range(6)))
"""


@pytest.mark.skipif(
    platform.libc_ver()[0] != 'glibc' or sys.maxsize < 2**32, reason='only 64-bit glibc adapts'
)
def test_frames_reuse_the_memory_of_earlier_ones(tmp_path):
    view = render(SCENE)
    np.save(tmp_path / 'pair.npy', (view.left, view.right))
    program = [sys.executable, '-c', PAGES_OF_A_FRAME]
    # A setting of the user switches off what is tested.
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith('MALLOC_') and name not in ('GLIBC_TUNABLES', 'LD_PRELOAD')
    }
    environment = kept | {'PYTHONPATH': os.pathsep.join(sys.path)}
    done = subprocess.run(
        program, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    # More than a thousand otherwise.
    assert int(done.stdout) < 200
