"""The clock of a control loop, on a clock of the tests' own: nothing here sleeps."""

from __future__ import annotations

import re
import time
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control import loop as loop_module
from rbimpedance.control.loop import RESOLUTION, Loop
from rbimpedance.trajectories import hold

DT = 1e-3


class Clock:
    """A time that passes only when somebody works or sleeps."""

    def __init__(self) -> None:
        self.now = 100.0
        self.late = 0.0

    def __call__(self) -> float:
        return self.now

    def pass_by(self, duration: float) -> None:
        self.now += duration

    def sleep(self, duration: float) -> None:
        self.pass_by(duration + self.late)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """A sleep on it ends `late` after its time."""
    made = Clock()
    monkeypatch.setattr(loop_module, "sleep", made.sleep)
    return made


def run(clock: Clock, work: list[float]) -> tuple[Loop, list[float]]:
    """Tick once more than there is work, which takes so long each time."""
    loop, periods = Loop(DT, clock=clock), []
    for duration in [*work, 0.0]:
        periods.append(loop.wait())
        clock.pass_by(duration)
    return loop, periods


def test_first_period_is_the_nominal_one(clock: Clock) -> None:
    assert Loop(DT, clock=clock).wait() == DT


def test_period_is_kept_while_the_work_is_shorter(clock: Clock) -> None:
    loop, periods = run(clock, [0.2 * DT, 0.9 * DT, 0.5 * DT])
    np.testing.assert_allclose(periods, DT, rtol=1e-9)
    assert loop.report().overruns == loop.report().missed == 0


def test_late_wake_ups_do_not_add_up(clock: Clock) -> None:
    """Every sleep ends 0.1 periods late; a clock that counts from the wake-up would lose 50 of 500 ticks."""
    clock.late = 0.1 * DT
    loop, periods = run(clock, [0.3 * DT] * 500)
    assert loop.time == pytest.approx(500.1 * DT, rel=1e-9)
    np.testing.assert_allclose(periods[2:], DT, rtol=1e-9)
    assert loop.report().overruns == 0


def test_wake_up_that_is_very_late_is_counted_and_no_tick_follows_at_once(clock: Clock) -> None:
    loop = Loop(DT, clock=clock)
    loop.wait()
    clock.late = 6.2 * DT
    assert loop.wait() == pytest.approx(7.2 * DT, rel=1e-9)
    clock.late = 0.0
    assert loop.wait() == pytest.approx(DT, rel=1e-9)
    assert (loop.report().overruns, loop.report().missed) == (1, 6)


def test_stall_is_measured_counted_and_not_made_up_for(clock: Clock) -> None:
    loop, periods = run(clock, [0.5 * DT, 4.3 * DT, 0.5 * DT, 1.2 * DT, 0.5 * DT])
    np.testing.assert_allclose(periods, [DT, DT, 4.3 * DT, DT, 1.2 * DT, DT], rtol=1e-9)
    report = loop.report()
    assert (report.ticks, report.overruns, report.missed) == (5, 2, 3)
    assert report.longest == pytest.approx(4.3 * DT, rel=1e-9)


def test_report_reads_as_one_line(clock: Clock) -> None:
    loop, _ = run(clock, [0.5 * DT, 4.3 * DT])
    assert repr(loop.report()) == (
        "LoopReport: 2 periods, median 1 ms, 99 % up to 4.3 ms, longest 4.3 ms; "
        "1 ticks late (overruns), 3 left out (missed)"
    )


def test_time_is_the_sum_of_the_periods(clock: Clock) -> None:
    loop, periods = run(clock, [0.5 * DT, 2.3 * DT, 0.1 * DT])
    assert loop.time == pytest.approx(sum(periods[1:]), rel=1e-9)


def test_percentiles_are_those_of_numpy_to_the_resolution(
    clock: Clock, rng: np.random.Generator
) -> None:
    work = DT * (1.0 + rng.exponential(2.0, size=2000))  # all of them late: the period is the work
    loop, periods = run(clock, work.tolist())
    report = loop.report()
    for share, found in ((50.0, report.p50), (99.0, report.p99)):
        exact = np.percentile(periods[1:], share, method="inverted_cdf")
        assert found == pytest.approx(exact, rel=RESOLUTION)
    assert report.longest == max(periods[1:])


def test_report_before_the_first_period_has_no_figures(clock: Clock) -> None:
    report = Loop(DT, clock=clock).report()
    assert report[:3] == (0, 0, 0)
    assert np.isnan(report.p50)


def test_iteration_gives_the_periods(clock: Clock) -> None:
    periods = list(islice(Loop(DT, clock=clock), 4))
    np.testing.assert_allclose(periods, DT, rtol=1e-9)


def test_other_limiters_can_keep_the_rate(clock: Clock) -> None:
    class Coarse:
        slack = -2.5 * DT

        def sleep(self) -> None:
            clock.pass_by(10.0 * DT)

    loop = Loop(DT, clock=clock, limiter=Coarse())
    list(islice(loop, 3))
    report = loop.report()
    assert (report.ticks, report.overruns, report.missed) == (2, 2, 4)
    np.testing.assert_allclose(report[3:], 10.0 * DT, rtol=RESOLUTION)


def test_long_runs_take_no_more_memory_than_short_ones(clock: Clock) -> None:
    def size(ticks: int) -> int:
        loop = Loop(DT, clock=clock)
        list(islice(loop, ticks))
        return sum(getattr(x, "nbytes", 0) for x in vars(loop).values())

    assert size(10) == size(5000)


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, "fast"])
def test_period_that_cannot_be_is_refused(dt: Any) -> None:
    with pytest.raises(rbi.ParameterError, match="dt must be"):
        Loop(dt)


def test_stalls_do_not_bring_the_arm_off_where_their_length_is_told(clock: Clock) -> None:
    """Half of the ticks come 3 periods late. The impedance filter, whose exact answer to a constant torque is known,
    is where it should be at that time; a loop that does not tell the period lags behind by half of the time."""
    arm = rbi.load_robot("two_link")
    target = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
    controller = rbi.ImpedanceController(
        arm, target, rbi.FastTerminalSurface(2.0, 3.0, 0.6), rbi.SuperTwisting(15.0, 40.0), DT
    )
    loop, push = Loop(DT, clock=clock), np.array([4.0, -2.0])
    state, reference = controller.init(), hold(arm)
    for k in range(200):
        period = loop.wait()
        output, state = controller.step(
            state, arm.neutral, np.zeros(2), reference(loop.time), push, period
        )
        clock.pass_by(3.0 * DT if k % 2 else 0.1 * DT)
    exact, _ = target.filter(2, loop.time).advance(np.zeros(2), np.zeros(2), push)
    np.testing.assert_allclose(output.q_e, exact, rtol=1e-9)
    assert loop.time == pytest.approx(397.0 * DT, rel=1e-9)


def test_examples_of_the_page_run(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of docs/reliability.md, the thread that stalls among them."""
    page = (Path(__file__).parents[2] / "docs" / "reliability.md").read_text(encoding="utf-8")
    monkeypatch.setattr(time, "sleep", clock.pass_by)
    monkeypatch.setattr(Loop.__init__, "__kwdefaults__", {"limiter": None, "clock": clock})
    names: dict[str, Any] = {}
    for block in re.findall(r"^```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE):
        exec(block, names)
    assert (names["report"].ticks, names["report"].overruns) == (19, 1)
    assert names["report"].longest == pytest.approx(5e-3, rel=1e-9)
