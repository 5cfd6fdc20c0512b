from __future__ import annotations

import platform

import machine
import pytest


@pytest.mark.parametrize('release', ['6.8.0-45-generic', '6.8.0'])
def test_kernel_is_named_without_what_a_distributor_adds(
    release: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, 'release', lambda: release)
    assert '; Linux 6.8.0; ' in machine.described_machine().replace(platform.system(), 'Linux')
