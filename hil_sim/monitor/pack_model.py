"""The state of a running pack as its frames tell it, without a clock or a screen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from cantools.database.can import Database

from bms.presets import Preset
from codegen import can_database
from codegen.pack_database import CELLS_A_PAGE, GROUPS, MOST_CELLS
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import NETWORK_VERSION
from hil_sim.bus.database import MessageCodec, Values
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.bus.identity import Identity
from hil_sim.monitor.model import Reading
from hil_sim.monitor.traffic import ForeignMeter, ForeignTraffic, MessageMeter

_SYNC = "SYNC"
_VOLTAGE, _THERMISTOR, _CORE, _SOC = (
    next(group for group in GROUPS if group.name == name)
    for name in ("CellVoltages", "CellTemperatures", "CellCores", "CellCharges")
)


@dataclass(frozen=True)
class CellState:
    """What is known of a cell, numbered from 1; None for what has not come."""

    number: int
    voltage_V: float | None
    core_K: float | None
    soc: float | None
    is_stale: bool


@dataclass(frozen=True)
class Margin:
    """What a cell leaves of the limit that it is nearest to, also as a share of the way to it."""

    cell: CellState
    limit: str
    share: float


@dataclass(frozen=True)
class PackSnapshot:
    """Everything that is known of a pack at a time."""

    silence_s: float | None
    """Time without a good frame of the database in s; None before the first one."""
    is_silent: bool
    is_lock_step: bool
    readings: Mapping[str, Reading]
    cells: tuple[CellState, ...]
    thermistors_K: tuple[float, ...]
    foreign: ForeignTraffic
    refused: int
    """Frames of wrong length or CRC."""
    identity: Identity | None
    remark: str
    choices: Mapping[str, Mapping[int, str]]

    def name(self, signal: str) -> str | None:
        """Name of a signal's value, or None when it is not available."""
        value = self.readings[signal].value
        return None if value is None else self.choices[signal].get(int(value), f"{value:g}")

    def faults(self, signal: str) -> list[str] | None:
        """Names of the faults whose bits are set in ActiveFaults or LatchedFaults."""
        value = self.readings[signal].value
        if value is None:
            return None
        bits, names = int(value), self.choices["FirstFault"]
        return [names.get(n, str(n)) for n in range(bits.bit_length()) if bits >> n & 1]

    def cell(self, signal: str) -> int | None:
        """Number of the cell that a signal names; None for none."""
        return int(self.readings[signal].value or 0) or None

    def nearest(self, preset: Preset) -> list[Margin]:
        """Every cell of which something is known, that with the least margin first."""
        limits = preset.limits
        ways = {
            "voltage": (preset.cell.ocv.voltage_V[0], limits.max_voltage_V),
            "core": (preset.operating_box.surface_temperature_K[0], limits.max_core_temperature_K),
            "soc": (0.0, limits.max_soc),
        }
        found = []
        for cell in self.cells:
            values = {"voltage": cell.voltage_V, "core": cell.core_K, "soc": cell.soc}
            shares = [
                ((limit - value) / (limit - idle), name)
                for name, (idle, limit) in ways.items()
                if (value := values[name]) is not None
            ]
            if shares:
                share, name = min(shares)
                found.append(Margin(cell, name, share))
        return sorted(found, key=lambda one: (one.share, one.cell.number))


class PageCodec(MessageCodec):
    """A message in pages: the values of the page that a payload has."""

    def decode(self, data: bytes) -> Values | None:
        """Values of the page's cells, None for each that is not available; as MessageCodec."""
        if not self.is_intact(data):
            return None
        raw = self._message.decode(data, decode_choices=False, scaling=False)
        return {s.name: s.physical(raw[s.name]) for s in self.signals if s.name in raw}


@cache
def pack_database() -> Database:
    """The pack's database, whose many signals take long to parse."""
    return can_database.load_database(can_database.PACK)


@cache
def pack_codecs() -> Mapping[str, MessageCodec]:
    """Every message of the pack's database by name."""
    return {
        message.name: (PageCodec if message.is_multiplexed() else MessageCodec)(message)
        for message in pack_database().messages
    }


class PackModel:
    """Takes frames with the time at which they came; times in s must not run backwards."""

    def __init__(self, cells: int | None = None) -> None:
        """`cells` is how many the pack is said to have; None: what its ECU or charger says."""
        parsed = pack_database()
        codecs = pack_codecs()
        self._given = cells
        self._version = can_database.network_version(parsed)
        self._meters = {
            message.frame_id: MessageMeter(
                codecs[message.name],
                1e-3 * can_database.number_attribute(parsed, message, can_database.CYCLE_ATTRIBUTE),
            )
            for message in parsed.messages
        }
        self._plain = [
            meter for meter in self._meters.values() if not isinstance(meter.codec, PageCodec)
        ]
        self._choices = {
            signal: names for codec in codecs.values() for signal, names in codec.choices.items()
        }
        self._sync_id = codecs[_SYNC].frame_id
        self._paged: dict[str, tuple[float, float | None]] = {}
        self._foreign = ForeignMeter()
        self.is_heard = False
        """Whether an intact frame of a pack's own has come."""

    def take(self, time_s: float, frame: Frame | ForeignFrame) -> None:
        """Count a frame and keep what it says."""
        meter = self._meters.get(frame.frame_id) if isinstance(frame, Frame) else None
        if meter is None or isinstance(frame, ForeignFrame):
            self._foreign.take(time_s, frame)
            return
        values = meter.take(time_s, frame.data)
        if values is None:
            return
        self.is_heard = self.is_heard or frame.frame_id != self._sync_id
        if isinstance(meter.codec, PageCodec):
            self._paged.update({signal: (time_s, value) for signal, value in values.items()})

    def snapshot(self, now_s: float) -> PackSnapshot:
        """What is known at a time in s, not before that of the last frame."""
        traffic = {id_: meter.traffic(now_s) for id_, meter in self._meters.items()}
        readings = {
            signal: Reading(meter.values.get(signal), traffic[meter.codec.frame_id].is_stale)
            for meter in self._plain
            for signal in meter.codec.signal_names
        }
        ages_s = [one.age_s for one in traffic.values() if one.age_s is not None]
        silence_s = min(ages_s, default=None)
        shortest_s = min(meter.stale_s for meter in self._plain)
        sync = traffic[self._sync_id]
        told = int(readings["Cells"].value or readings["CellsInSeries"].value or 0)
        identity, remark = self._identity(readings)
        if self._given is not None and told not in (0, self._given):
            remark = f"--cells {self._given} is not what the bus says: {told} cells"
        return PackSnapshot(
            silence_s=silence_s,
            is_silent=silence_s is not None and silence_s > shortest_s,
            is_lock_step=sync.age_s is not None and not sync.is_stale,
            readings=readings,
            cells=tuple(self._cell(n + 1, now_s) for n in range(told or self._given or 0)),
            thermistors_K=tuple(
                value
                for n in range(MOST_CELLS)
                if (value := self._value(_THERMISTOR.signal.format(n + 1))) is not None
            ),
            foreign=self._foreign.traffic(now_s),
            refused=sum(one.refused for one in traffic.values()),
            identity=identity,
            remark=remark,
            choices=self._choices,
        )

    def _identity(self, readings: Mapping[str, Reading]) -> tuple[Identity | None, str]:
        """What the ECU says that it has, in the words of one cell's; and what is amiss there."""
        names = ("ModelHash", "PresetHash", "NetworkVersion")
        model, preset, version = (readings[name].value for name in names)
        if model is None or preset is None or version is None:
            return None, ""
        if int(version) != self._version:
            return None, (
                f"the ECU speaks version {int(version)} of the pack's database, of which this bms "
                f"has version {self._version}"
            )
        return Identity(NETWORK_VERSION, 0, f"{int(model):08x}", f"{int(preset):04x}"), ""

    def _value(self, signal: str) -> float | None:
        return self._paged.get(signal, (0.0, None))[1]

    def _cell(self, number: int, now_s: float) -> CellState:
        parts = {group.name: group.signal.format(number) for group in (_VOLTAGE, _CORE, _SOC)}
        is_stale = False
        for group in (_VOLTAGE, _CORE, _SOC):
            meter = self._meters[group.first_id]
            turns = MOST_CELLS / CELLS_A_PAGE / (group.pages_a_period or MOST_CELLS)
            came = self._paged.get(parts[group.name])
            is_stale |= came is not None and now_s - came[0] > meter.stale_s * max(1.0, turns)
        return CellState(
            number,
            voltage_V=self._value(parts[_VOLTAGE.name]),
            core_K=self._value(parts[_CORE.name]),
            soc=self._value(parts[_SOC.name]),
            is_stale=is_stale,
        )
