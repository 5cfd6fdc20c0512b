"""What the audit of the dependencies says about pip-audit's results."""

from __future__ import annotations

import stat
from pathlib import Path

import audit_dependencies
import pytest
from audit_dependencies import judge

FINE = {'name': 'numpy', 'version': '2.4.6', 'vulns': []}
BAD = {
    'name': 'jinja2',
    'version': '2.10',
    'vulns': [
        {'id': 'PYSEC-2019-217', 'fix_versions': ['2.10.1']},
        {'id': 'CVE-2024-1', 'fix_versions': []},
    ],
}
UNKNOWN = {'name': 'ros-rcl', 'skip_reason': 'Dependency not found on PyPI'}


def test_vulnerabilities_are_named_with_the_fix() -> None:
    assert judge([FINE, BAD]) == (
        [
            'VULNERABLE jinja2 2.10: PYSEC-2019-217, fixed in 2.10.1',
            'VULNERABLE jinja2 2.10: CVE-2024-1, fixed in no version',
            '2 of 2 packages audited, 2 findings',
        ],
        True,
    )


def test_packages_that_the_database_does_not_know_are_named() -> None:
    assert judge([FINE, UNKNOWN]) == (
        ['1 of 2 packages audited, 0 findings', 'not in the database: ros-rcl'],
        False,
    )


def test_an_audit_of_nothing_does_not_look_like_a_success() -> None:
    assert judge([UNKNOWN]) == (
        [
            '0 of 1 packages audited, 0 findings',
            'NOTHING WAS AUDITED: the database cannot be reached from here',
        ],
        False,
    )


@pytest.mark.parametrize(
    ('script', 'status', 'said'),
    [
        (
            """grep -q '^numpy==' "$2" || exit 3
            echo '{"dependencies": [{"name": "numpy", "version": "1", "vulns":
                [{"id": "X-1", "fix_versions": []}]}]}'; exit 1""",
            1,
            'VULNERABLE numpy 1: X-1',
        ),
        ('echo "cannot connect" >&2; exit 1', 0, 'not audited: cannot connect'),
    ],
)
def test_the_installed_packages_are_audited(
    script: str, status: int, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake = tmp_path / 'pip-audit'
    fake.write_text(f'#!/bin/sh\n{script}\n')
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)

    assert audit_dependencies.main(str(fake)) == status
    assert said in capsys.readouterr().out
