"""Run the node, or a replay, for a long time and check that nothing grows.

    python scripts/endurance.py --seconds 3600 --output endurance
    python scripts/endurance.py --replay 2000 --output endurance_replay

Live: the node runs as a process of its own over DDS, with subscribers to mask and both clouds. A
stereo camera of 640 x 480 feeds it; every 20 s a fault takes the place of some pairs. Replay: a
long recording of a small camera. Writes ``samples.csv``, ``faults.csv`` and ``endurance.png``,
prints the verdicts, and ends with status 1 if a target is missed. Needs the extra ``report``.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import itertools
import json
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / 'test' / 'support'))

import synthetic
from live_faults import FAULTS, Fault, Stage
from live_graph import Process, live_graph, write_stereo_bag
from live_rover import Rover

from rover_obstacle_detection.report.extra import report_library

SAMPLE_PERIOD_S = 5.0
# Caches and thread pools fill up first; memory is compared from then on.
SETTLED_AFTER_S = 300.0
# Memory, threads and descriptors are medians over this long: every kind of fault once, because
# memory depends on what is sent and subscribed.
WINDOW_S = 20.0 * len(FAULTS)
# The next fault waits for the recovery from the one before at most this long.
RECOVERY_S = 20.0
MAX_GROWTH = 0.05
MAX_SLOWDOWN = 0.25
MIN_JUDGED = 0.98
SECOND = 1_000_000_000


@dataclass(frozen=True)
class Sample:
    """The process at one moment; latencies are of the masks since the last sample."""

    time_s: float
    resident_mb: float
    own_mb: float
    proportional_mb: float
    threads: int
    descriptors: int
    latency_p50_ms: float = math.nan
    latency_p95_ms: float = math.nan
    sent: int = 0
    judged: int = 0


@dataclass
class Injected:
    """A fault, and whether the node judged a pair that was sent after it."""

    time_s: float
    name: str
    recovered: bool = False


@dataclass(frozen=True)
class Verdict:
    """One line of the result."""

    target: str
    found: str
    passed: bool


def main() -> int:
    """Run, write the files and print the verdicts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--seconds', type=float, default=3600.0, help='length of the live run')
    parser.add_argument('--rate', type=float, default=2.0, help='pairs per second')
    parser.add_argument(
        '--fault-period', type=float, default=20.0, metavar='S', help='seconds between faults'
    )
    parser.add_argument('--replay', type=int, metavar='N', help='replay N pairs instead')
    parser.add_argument('--output', type=Path, default=Path('endurance'), help='folder to write')
    arguments = parser.parse_args()
    report_library('matplotlib')
    arguments.output.mkdir(parents=True, exist_ok=True)
    faults: list[Injected] = []
    if arguments.replay:
        samples = replay(arguments.replay)
    else:
        camera = exposures(640, 480), synthetic.render(synthetic.mast())
        with tempfile.TemporaryDirectory() as folder, live_graph(Path(folder)) as graph:
            stage = Stage(Rover(graph, watchdog=True), *camera)
            run = LiveRun(stage, rate_hz=arguments.rate, fault_period_s=arguments.fault_period)
            run.run(arguments.seconds)
        samples, faults = run.samples, run.faults
    verdicts = judge(samples, faults)
    write_csv(arguments.output / 'samples.csv', Sample, samples)
    write_csv(arguments.output / 'faults.csv', Injected, faults)
    draw(arguments.output / 'endurance.png', samples, faults)
    for verdict in verdicts:
        print(f'{"ok  " if verdict.passed else "FAIL"}  {verdict.target}: {verdict.found}')
    return int(not all(verdict.passed for verdict in verdicts))


def exposures(width: int, height: int, each: int = 4) -> list[Any]:
    """Render several scenes of one camera, each in several exposures."""
    scenes = (
        (),
        (synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),),
        (synthetic.Dome(-0.2, 1.1, 0.2), synthetic.Box(0.4, 1.3, 0.2, 0.2, 0.15)),
    )
    return [
        synthetic.exposed_again(
            synthetic.render(synthetic.mast(width, height, solids=solids)), seed
        )
        for solids in scenes
        for seed in range(each)
    ]


class LiveRun:
    """Feeds the node, injects faults and takes samples, all in one thread."""

    def __init__(
        self,
        stage: Stage,
        *,
        rate_hz: float,
        fault_period_s: float,
        sample_period_s: float = SAMPLE_PERIOD_S,
        kinds: Mapping[str, Fault] = FAULTS,
    ) -> None:
        self.samples: list[Sample] = []
        self.faults: list[Injected] = []
        self._stage = stage
        self._process = stage.rover.process
        self._pair_period_s = 1.0 / rate_hz
        self._fault_period_s = fault_period_s
        self._sample_period_s = sample_period_s
        self._kinds = itertools.cycle(kinds.items())
        self._fault: Iterator[None] | None = None
        self._fault_ended_ns = 0
        self._latencies_ms: list[float] = []
        self._judged = 0

    def run(self, seconds: float = math.inf, faults: int | None = None) -> None:
        """Run for a time, or until the node has recovered from a number of faults."""
        self._connect()
        start_s = time.monotonic()
        pair_due_s, fault_due_s = start_s, start_s + self._fault_period_s
        sample_due_s = start_s + self._sample_period_s
        while (now_s := time.monotonic()) < start_s + seconds and self._recovered != faults:
            if now_s >= fault_due_s and self._may_start_fault(now_s - fault_due_s):
                name, fault = next(self._kinds)
                self.faults.append(Injected(now_s - start_s, name))
                self._fault = fault(self._stage)
                fault_due_s = max(fault_due_s + self._fault_period_s, now_s)
            if now_s >= pair_due_s:
                self._step()
                pair_due_s = max(pair_due_s + self._pair_period_s, now_s)
            if now_s >= sample_due_s:
                self._sample(now_s - start_s)
                sample_due_s += self._sample_period_s
            due_s = min(pair_due_s, sample_due_s)
            self._spin_until(lambda due_s=due_s: time.monotonic() >= due_s)
        self._finish(time.monotonic() - start_s)

    @property
    def _recovered(self) -> int:
        return sum(each.recovered for each in self.faults)

    def _may_start_fault(self, overdue_s: float) -> bool:
        if not self.faults:
            return True
        return self._fault is None and (self.faults[-1].recovered or overdue_s > RECOVERY_S)

    def _connect(self) -> None:
        self._stage.rover.camera.wait_for_subscribers()
        for _ in self._stage.until_connected():
            self._spin_until(lambda: self._stage.rover.mask.messages)

    def _finish(self, time_s: float) -> None:
        for _ in self._fault or ():
            due_s = time.monotonic() + self._pair_period_s
            self._spin_until(lambda due_s=due_s: time.monotonic() >= due_s)
        count = self._stage.rover.diagnostics.count
        self._spin_until(lambda: self._stage.rover.diagnostics.count > count + 2)
        self._sample(time_s)

    def _spin_until(self, condition: Callable[[], Any]) -> None:
        self._stage.rover.wait_for(condition)
        self._take_masks()

    def _step(self) -> None:
        """Let the fault go on, or send a good pair."""
        if self._fault is not None:
            try:
                next(self._fault)
            except StopIteration:
                self._fault, self._fault_ended_ns = None, time.time_ns()
        if self._fault is None:
            self._stage.send_good()

    def _take_masks(self) -> None:
        latencies_s = self._stage.take_latencies()
        self._judged += len(latencies_s)
        self._latencies_ms += [1000 * each for each in latencies_s]
        if (
            self.faults
            and self._fault is None
            and (latencies_s and self._stage.latest_mask_ns > self._fault_ended_ns)
        ):
            self.faults[-1].recovered = True

    def _sample(self, time_s: float) -> None:
        p50_ms, p95_ms = (
            np.percentile(self._latencies_ms, (50, 95)).tolist()
            if self._latencies_ms
            else (math.nan, math.nan)
        )
        self._latencies_ms.clear()
        self.samples.append(
            sample(
                self._process,
                time_s,
                latency_p50_ms=p50_ms,
                latency_p95_ms=p95_ms,
                sent=len(self._stage.sent_ns),
                judged=self._judged,
            )
        )


def sample(process: Process, time_s: float, **figures: Any) -> Sample:
    """Measure a process now."""
    return Sample(
        time_s=round(time_s, 1),
        resident_mb=process.resident_mb(),
        own_mb=process.own_mb(),
        proportional_mb=process.proportional_mb(),
        threads=process.threads(),
        descriptors=process.descriptors(),
        **figures,
    )


def replay(frames: int, sample_period_s: float = 1.0) -> list[Sample]:
    """Replay a recording of a small camera, with new stamps in every frame."""
    view = synthetic.render(synthetic.mast(160, 120))
    samples = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bag, output = folder / 'bag', folder / 'output'
        write_stereo_bag(bag, view, [SECOND * (1000 + number) for number in range(frames)])
        command = [sys.executable, '-m', 'rover_obstacle_detection', 'replay', str(bag)]
        process = Process(
            [*command, '--output', str(output)], folder / 'replay.log', dict(os.environ)
        )
        started_s = time.monotonic()
        while process.running:
            # A process that has just ended has no memory to measure.
            with contextlib.suppress(FileNotFoundError, ProcessLookupError, AssertionError):
                samples.append(sample(process, time.monotonic() - started_s))
            time.sleep(sample_period_s)
        if process.wait():
            raise SystemExit(process.output)
        judged = len(json.loads((output / 'summary.json').read_text())['frames'])
    return [*samples[:-1], replace(samples[-1], sent=frames, judged=judged)]


def judge(samples: Sequence[Sample], faults: Sequence[Injected]) -> list[Verdict]:
    """Compare the samples with the targets."""
    verdicts = [
        _memory(samples),
        _constant(samples, 'threads'),
        _constant(samples, 'descriptors'),
        _judged(samples[-1]),
    ]
    if any(math.isfinite(each.latency_p50_ms) for each in samples):
        verdicts.append(_latency(samples))
    if faults:
        verdicts.append(_recoveries(faults))
    return verdicts


def settled_windows(samples: Sequence[Sample]) -> tuple[list[Sample], list[Sample]]:
    """Return the samples of one round of faults after settling, and of the last round.

    A run too short for this settles in a third of its time.
    """
    end_s = samples[-1].time_s
    settled_s = min(SETTLED_AFTER_S, end_s / 3)
    window_s = min(WINDOW_S, end_s / 3)
    first = [each for each in samples if settled_s <= each.time_s <= settled_s + window_s]
    return first, [each for each in samples if each.time_s >= end_s - window_s]


def _medians(samples: Sequence[Sample], field: str) -> tuple[float, float]:
    first, last = (
        float(np.median([getattr(each, field) for each in window]))
        for window in settled_windows(samples)
    )
    return first, last


def _memory(samples: Sequence[Sample]) -> Verdict:
    first_mb, last_mb = _medians(samples, 'resident_mb')
    own_mb = _medians(samples, 'own_mb')
    growth = last_mb / first_mb - 1.0
    return Verdict(
        f'resident memory grows by less than {MAX_GROWTH:.0%}',
        f'{first_mb:.1f} MB, at the end {last_mb:.1f} MB ({growth:+.1%}); not shared '
        f'{own_mb[0]:.1f} MB, at the end {own_mb[1]:.1f} MB',
        growth < MAX_GROWTH,
    )


def _constant(samples: Sequence[Sample], field: str) -> Verdict:
    first, last = _medians(samples, field)
    return Verdict(f'{field} constant', f'{first:g}, at the end {last:g}', first == last)


def _latency(samples: Sequence[Sample]) -> Verdict:
    tenth = max(len(samples) // 10, 1)
    first_ms, last_ms = (
        float(np.nanmedian([each.latency_p50_ms for each in part]))
        for part in (samples[:tenth], samples[-tenth:])
    )
    p95_ms = [
        float(np.nanmedian([each.latency_p95_ms for each in part]))
        for part in (samples[:tenth], samples[-tenth:])
    ]
    growth = last_ms / first_ms - 1.0
    return Verdict(
        f'latency of the last tenth at most {MAX_SLOWDOWN:.0%} above the first',
        f'p50 {first_ms:.0f} ms, at the end {last_ms:.0f} ms ({growth:+.0%}); '
        f'p95 {p95_ms[0]:.0f} ms, at the end {p95_ms[1]:.0f} ms',
        growth <= MAX_SLOWDOWN,
    )


def _judged(last: Sample) -> Verdict:
    share = last.judged / max(last.sent, 1)
    return Verdict(
        f'at least {MIN_JUDGED:.0%} of the good pairs judged',
        f'{last.judged} of {last.sent} ({share:.1%})',
        share >= MIN_JUDGED,
    )


def _recoveries(faults: Sequence[Injected]) -> Verdict:
    # The last one may have lasted until the end of the run.
    over = [each for each in faults if each.recovered or each is not faults[-1]]
    failed = sorted({each.name for each in over if not each.recovered})
    kinds = len({each.name for each in faults})
    return Verdict(
        'a pair judged after every fault',
        f'{len(faults)} faults of {kinds} kinds, {sum(each.recovered for each in over)} of '
        f'{len(over)} followed by a judged pair' + ''.join(f'; not {name}' for name in failed),
        not failed,
    )


def write_csv(path: Path, type_: type, rows: Sequence[Any]) -> None:
    """Write dataclass objects as a table."""
    with path.open('w', newline='') as file:
        writer = csv.DictWriter(file, [field.name for field in fields(type_)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def draw(path: Path, samples: Sequence[Sample], faults: Sequence[Injected]) -> None:
    """Draw memory, threads and descriptors, and latency over time."""
    panels = {
        'memory (MB)': {
            'resident_mb': 'resident',
            'proportional_mb': 'proportional',
            'own_mb': 'not shared',
        },
        'count': {'threads': 'threads', 'descriptors': 'descriptors'},
        'latency (ms)': {'latency_p95_ms': 'p95', 'latency_p50_ms': 'p50'},
    }
    figure = report_library('matplotlib.figure').Figure(figsize=(9.0, 8.0), layout='constrained')
    times_min = [each.time_s / 60 for each in samples]
    for axes, (label, lines) in zip(figure.subplots(3, sharex=True), panels.items(), strict=True):
        for field, name in lines.items():
            axes.plot(times_min, [getattr(each, field) for each in samples], label=name)
        for fault in faults:
            axes.axvline(fault.time_s / 60, color='0.9', linewidth=0.5, zorder=0)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.legend(frameon=False)
    axes.set_xlabel('time (min); grey lines: faults')
    figure.savefig(path, dpi=100)


if __name__ == '__main__':
    sys.exit(main())
