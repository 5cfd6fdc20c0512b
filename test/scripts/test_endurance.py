"""The verdicts of the endurance run, its files, and a short run of the live node."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import endurance
import synthetic
from endurance import Injected, LiveRun, Sample, judge
from live_faults import FAULTS, Stage
from live_graph import live_graph
from live_rover import Rover

SECONDS = 3600


def samples(**last: float) -> list[Sample]:
    """Build constant samples whose fields grow evenly to the given values at the end."""
    first = Sample(0.0, 300.0, 170.0, 250.0, 20, 25, 300.0, 400.0)
    return [
        replace(
            first,
            time_s=time_s,
            sent=2 * time_s,
            judged=2 * time_s,
            **{
                name: start + (value - start) * time_s / SECONDS
                for name, value in last.items()
                for start in [getattr(first, name)]
            },
        )
        for time_s in range(0, SECONDS + 1, 5)
    ]


def failed(samples: list[Sample], faults: tuple[Injected, ...] = ()) -> list[str]:
    return [f'{each.target}: {each.found}' for each in judge(samples, faults) if not each.passed]


def test_constant_samples_pass_all_targets() -> None:
    assert failed(samples(), (Injected(20.0, 'burst', recovered=True),)) == []


def test_growing_memory_fails_from_five_percent_after_settling() -> None:
    assert failed(samples(resident_mb=315.0)) == []
    (verdict,) = failed(samples(resident_mb=336.0))
    assert '305.3 MB, at the end 333.7 MB (+9.3%)' in verdict


def test_memory_that_fills_before_settling_is_no_growth() -> None:
    filled = [replace(each, resident_mb=min(100.0 + each.time_s, 400.0)) for each in samples()]
    assert failed(filled) == []


@pytest.mark.parametrize('field', ['threads', 'descriptors'])
def test_counts_must_not_change(field: str) -> None:
    (verdict,) = failed(samples(**{field: 60}))
    assert verdict.startswith(f'{field} constant: ')


def test_rising_latency_fails() -> None:
    (verdict,) = failed(samples(latency_p50_ms=600.0))
    assert 'p50 315 ms, at the end 585 ms (+86%); p95 400 ms, at the end 400 ms' in verdict


def test_unjudged_pairs_fail() -> None:
    lost = samples()
    lost[-1] = replace(lost[-1], judged=6900)
    assert failed(lost) == ['at least 98% of the good pairs judged: 6900 of 7200 (95.8%)']


def test_every_fault_but_an_unfinished_last_one_must_be_followed_by_a_judged_pair() -> None:
    faults = (
        Injected(20.0, 'burst', recovered=True),
        Injected(40.0, 'silence'),
        Injected(60.0, 'blackout'),
    )
    assert failed(samples(), faults) == [
        'a pair judged after every fault: 3 faults of 3 kinds, 1 of 2 followed by a judged pair; '
        'not silence'
    ]


def test_samples_without_latencies_are_judged() -> None:
    replayed = [replace(each, latency_p50_ms=math.nan) for each in samples()]
    assert not any('latency' in each.target for each in judge(replayed, ()))


def test_files(tmp_path: Path) -> None:
    pytest.importorskip('matplotlib', reason='needs the extra report')
    faults = [Injected(20.0, 'burst', recovered=True)]
    endurance.write_csv(tmp_path / 'faults.csv', Injected, faults)
    endurance.draw(tmp_path / 'plot.png', samples(), faults)

    with (tmp_path / 'faults.csv').open(newline='') as file:
        assert list(csv.DictReader(file)) == [
            {'time_s': '20.0', 'name': 'burst', 'recovered': 'True'}
        ]
    assert (tmp_path / 'plot.png').read_bytes().startswith(b'\x89PNG')


def test_live_run_recovers_from_faults(tmp_path: Path) -> None:
    names = ('burst', 'another camera', 'all subscribers go and come', 'deactivate and activate')
    kinds = {name: FAULTS[name] for name in names}
    views = endurance.exposures(160, 120, each=2)
    with live_graph(tmp_path) as graph:
        stage = Stage(Rover(graph, watchdog=True), views, synthetic.render(synthetic.mast(80, 60)))
        run = LiveRun(stage, rate_hz=10.0, fault_period_s=0.0, sample_period_s=1.0, kinds=kinds)
        run.run(faults=len(kinds))

    assert tuple(each.name for each in run.faults) == names
    assert all(each.recovered for each in run.faults)
    assert 0 < run.samples[-1].judged <= run.samples[-1].sent
