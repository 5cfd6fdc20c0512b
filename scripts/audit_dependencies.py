"""Look up the known vulnerabilities of the installed packages with pip-audit.

    .venv/bin/python scripts/audit_dependencies.py path/to/pip-audit

Audits the packages of the environment that runs it, with what pip-audit finds on PyPI. Ends with
status 1 if a package has a known vulnerability. Where the database cannot be reached, or does not
know a package, it says so and passes: pip-audit alone reports that as free of vulnerabilities.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

TIMEOUT_S = 120.0


def main(pip_audit: str) -> int:
    """Audit the environment that runs this script; print the result."""
    freeze = [sys.executable, '-m', 'pip', 'freeze', '--exclude-editable']
    packages = subprocess.run(freeze, check=True, capture_output=True, text=True).stdout
    with tempfile.TemporaryDirectory() as folder:
        requirements = Path(folder) / 'requirements.txt'
        requirements.write_text(packages)
        options = ['--no-deps', '--disable-pip', '--format', 'json', '--progress-spinner', 'off']
        try:
            run = subprocess.run(
                [pip_audit, '--requirement', str(requirements), *options],
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
            )
        except subprocess.TimeoutExpired:
            print(f'not audited: pip-audit took more than {TIMEOUT_S:g} s')
            return 0
    try:
        dependencies = json.loads(run.stdout)['dependencies']
    except ValueError:
        print('not audited:', *run.stderr.strip().splitlines()[-1:])
        return 0
    lines, vulnerable = judge(dependencies)
    print(*lines, sep='\n')
    return int(vulnerable)


def judge(dependencies: list[dict[str, Any]]) -> tuple[list[str], bool]:
    """Summarise pip-audit's JSON.

    Returns
    -------
    lines : list of str
    vulnerable : bool
        Whether a package has a known vulnerability.
    """
    skipped = [each['name'] for each in dependencies if 'skip_reason' in each]
    found = [
        f'VULNERABLE {each["name"]} {each["version"]}: {vulnerability["id"]}, '
        f'fixed in {", ".join(vulnerability["fix_versions"]) or "no version"}'
        for each in dependencies
        for vulnerability in each.get('vulns', ())
    ]
    audited = len(dependencies) - len(skipped)
    lines = [*found, f'{audited} of {len(dependencies)} packages audited, {len(found)} findings']
    if not audited:
        lines.append('NOTHING WAS AUDITED: the database cannot be reached from here')
    elif skipped:
        lines.append(f'not in the database: {", ".join(skipped)}')
    return lines, bool(found)


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
