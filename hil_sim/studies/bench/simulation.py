"""Speed of a charge in lock step on each bus, in multiples of real time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from bms.errors import BusError
from bms.presets import load_preset
from hil_sim.bus.buses import GUEST
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both, run_plant
from hil_sim.run.settings import Settings
from hil_sim.studies.bench.layers import sampled
from hil_sim.studies.bench.race import Clocks, Quartiles

BUSES = ("virtual:bench", "udp_multicast:239.74.163.71", "socketcan:vcan0")
_GUEST_TIMEOUT_S = 900
_ANSWER_TIMEOUT_S = 6.0
"""Ten times in a row: long enough for an ECU that starts in a guest on a busy machine."""
_BMS = (sys.executable, "-c", "from bms.cli import main; main()")
_NS_PER_S = 1e9
_PARTIES = {1: "one process", 2: "two processes"}


@dataclass(frozen=True)
class BusSpeed:
    """Multiples of real time of the charges on one bus, or why there is none."""

    bus: str
    processes: int
    """Of plant and ECU together."""
    parties: str
    periods: int
    times_real_time: Quartiles | None
    processor_share_percent: float
    """Of one core, that the plant's process had; all of it is a run that nobody else disturbed."""
    layer_shares_percent: dict[str, float]
    not_run: str = ""
    period_s: float = 0.1


class _Pace:
    """Time from the first answered period to the last."""

    def __init__(
        self,
        clocks: Clocks,
        begin: Callable[[], None] = lambda: None,
        end: Callable[[], None] = lambda: None,
    ) -> None:
        """`begin` is called by the first answered period, `end` by each."""
        self._clocks, self._begin, self._end = clocks, begin, end
        self._first_ns = self._last_ns = self._first_cpu_ns = 0
        self.periods = 0

    def tick(self, soc: float) -> None:
        self._last_ns = self._clocks.wall_ns()
        if self.periods == 0:
            self._first_ns, self._first_cpu_ns = self._last_ns, self._clocks.cpu_ns()
            self._begin()
        self._end()
        self.periods += 1

    def times_real_time(self, period_s: float) -> float:
        return (self.periods - 1) * period_s * _NS_PER_S / (self._last_ns - self._first_ns)

    def processor_share_percent(self) -> float:
        had_ns = self._clocks.cpu_ns() - self._first_cpu_ns
        return 100.0 * had_ns / (self._last_ns - self._first_ns)


def processes_on(bus: str) -> tuple[int, ...]:
    """In how many processes plant and ECU are timed on a bus."""
    interface = bus.partition(":")[0]
    return {"virtual": (1,), "socketcan": (1, 2)}.get(interface, (2,))


def bus_speed(
    bus: str, preset: str, max_time_s: float, repetitions: int, clocks: Clocks, processes: int
) -> BusSpeed:
    """Charges for max_time_s, recorded to can.log; one more, not timed, shows the layers.

    Plant and ECU are in one process or in two; the layers are those of the plant's process. A bus
    that does not exist here or on which a charge fails is named with the reason, but a SocketCAN
    one is looked for in the guest first. What passes before the first answer of the ECU does not
    count.
    """
    interface, _, channel = bus.partition(":")
    if interface == "socketcan" and not Path("/sys/class/net", channel).exists():
        return _in_guest(bus, preset, max_time_s, repetitions, processes)
    parties = _PARTIES[processes]
    is_alone = processes == 1
    settings = Settings(
        load_preset(preset), bus=bus, max_time_s=max_time_s, answer_timeout_s=_ANSWER_TIMEOUT_S
    )
    speeds, shares, periods = [], [], 0
    try:
        for _ in range(repetitions):
            pace = _Pace(clocks)
            _charge(settings, preset, is_alone, pace)
            shares.append(pace.processor_share_percent())
            speeds.append(pace.times_real_time(settings.preset.timing.sampling_period_s))
            periods = pace.periods
        with sampled() as layers:
            _charge(settings, preset, is_alone, _Pace(clocks, layers.forget, layers.settle))
    except BusError as error:
        return BusSpeed(bus, processes, parties, 0, None, 0.0, {}, str(error))
    return BusSpeed(
        bus,
        processes,
        parties,
        periods,
        Quartiles.of(speeds),
        median(shares),
        layers.shares_percent,
        period_s=settings.preset.timing.sampling_period_s,
    )


def _charge(settings: Settings, preset: str, is_alone: bool, pace: _Pace) -> None:
    """Charge; BusError when that fails, as a speed of something else would mean nothing."""
    with TemporaryDirectory() as folder, Recorder(Path(folder) / "can.log") as recorder:
        if is_alone:
            summary = run_both(settings, recorder, pace.tick).summary
        else:
            with _ecu_process(settings.bus, preset):
                summary = run_plant(settings, recorder, pace.tick).summary
    if summary.failures:
        raise BusError(f"charge failed: {'; '.join(summary.failures)}")


@contextmanager
def _ecu_process(bus: str, preset: str) -> Iterator[None]:
    command = [*_BMS, "ecu", "--bus", bus, "--preset", preset]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as ecu:
        try:
            yield
        finally:
            ecu.terminate()


def _in_guest(
    bus: str, preset: str, max_time_s: float, repetitions: int, processes: int
) -> BusSpeed:
    """The same, run by this module's command line where the guest provides vcan0."""
    parties = f"{_PARTIES[processes]} in a guest"
    if not GUEST.is_file():
        reason = f"no such bus on this machine, and no {GUEST.name} beside this package"
        return BusSpeed(bus, processes, parties, 0, None, 0.0, {}, reason)
    command = [
        "bash",
        GUEST,
        sys.executable,
        "-m",
        "hil_sim.studies.bench",
        bus,
        preset,
        max_time_s,
        repetitions,
        processes,
    ]
    done = subprocess.run(
        list(map(str, command)),
        env={**os.environ, "VCAN_TIMEOUT_S": str(_GUEST_TIMEOUT_S)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or [f"{GUEST.name} failed"])[-1]
        return BusSpeed(bus, processes, parties, 0, None, 0.0, {}, reason)
    content = json.loads(done.stdout)
    speed = content["times_real_time"]
    content["times_real_time"] = None if speed is None else Quartiles(**speed)
    return BusSpeed(**{**content, "parties": parties})
