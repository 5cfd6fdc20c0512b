from __future__ import annotations

import signal
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes says more of the machine than of the code.
settings.register_profile('project', deadline=None)
settings.load_profile('project')

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As in a background job of a shell: the programs under test would ignore Ctrl-C as well.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep each file's tests in one process of pytest-xdist, and all live tests in one."""
    live = Path(__file__).parent / 'node'
    for item in items:
        group = 'live' if live in item.path.parents else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))
