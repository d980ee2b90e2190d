"""Faults of a pack's readings and frames, each with the time in which it has to end in 0 A."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from hil_sim.bus.catalog import FirstFault
from hil_sim.bus.frame import Frame
from hil_sim.fault_matrix.needs import unknown_cell
from hil_sim.pack.charge import PackResult, charge_pack
from hil_sim.pack.plant import PackPlant
from hil_sim.pack.settings import PackChargeSettings

BEGIN_PERIOD = 150
"""Since the start, when the charge has its full current."""
CELL = 4
"""The cell that faults are of, from 0 on; its page is that of 3 to 5."""
LEAST_CELLS = 6
"""That a pack with this page has."""
VOLTAGE_ID, TEMPERATURE_ID, PLUG_IN_ID = 0x210, 0x220, 0x230
COOLANT_ID, REQUEST_ID = 0x201, 0x202
CELL_OFFSET_V = 0.3
_PAGE = 1

Reading = Callable[[PackPlant, int, dict[str, float]], None]
"""Changes readings; is told the periods since the fault began, and may keep numbers."""
Delivery = Callable[[Frame, int], Iterable[Frame]]
"""What arrives in place of a frame."""

Excuse = Callable[[PackChargeSettings], str | None]


@dataclass(frozen=True)
class PackFault:
    """A fault from BEGIN_PERIOD on.

    `stop_periods` is the deadline: after so many periods more every command is 0 A; 0 means the
    very period. `names` are faults of which one has to stand in the end. `excuse` says why a fault
    cannot be told from what is right in a pack like this; None where it can.
    """

    name: str
    stop_periods: int
    names: tuple[FirstFault, ...]
    reading: Reading | None = None
    delivery: Delivery | None = None
    excuse: Excuse = lambda settings: None


def run_fault(settings: PackChargeSettings, fault: PackFault, periods: int) -> PackResult:
    """The charge with the fault, for so many periods after it began."""
    step = {"now": -1}
    kept: dict[str, float] = {}

    def tamper(plant: Any) -> None:
        step["now"] += 1
        since = step["now"] - BEGIN_PERIOD
        if since >= 0 and fault.reading is not None:
            fault.reading(plant, since, kept)

    def sent(frames: list[Frame]) -> list[Frame]:
        since = step["now"] - BEGIN_PERIOD
        if since < 0 or fault.delivery is None:
            return frames
        return [arrived for frame in frames for arrived in fault.delivery(frame, since)]

    limit_s = (BEGIN_PERIOD + periods) * settings.preset.timing.sampling_period_s
    longer = replace(settings, max_time_s=limit_s)
    return charge_pack(longer, tamper=tamper, sent=sent, ends_early=False)


def is_charging(result: PackResult) -> bool:
    """Whether a current was asked for when the fault began."""
    before_A = result.commands_A[BEGIN_PERIOD - 1]
    return before_A is not None and before_A < 0.0


def complaint(result: PackResult, fault: PackFault) -> str | None:
    """What is wrong with how the ECU met a fault; None where it kept its deadline."""
    commands = result.commands_A
    if not is_charging(result):
        return f"there was no charging current before the fault: {commands[BEGIN_PERIOD - 1]}"
    for period in range(BEGIN_PERIOD + fault.stop_periods, len(commands)):
        if commands[period] != 0.0:
            return f"{commands[period]} A, {period - BEGIN_PERIOD} periods after it began"
    latched = {name for name in FirstFault if name < 32 and result.latched_faults >> name & 1}
    if not latched & set(fault.names):
        return f"latched {[name.label for name in latched]}, not {[n.label for n in fault.names]}"
    return None


def _is_page(frame: Frame, first_id: int) -> bool:
    return frame.frame_id == first_id and len(frame.data) > 1 and frame.data[1] >> 4 == _PAGE


def _missing(first_id: int) -> Delivery:
    return lambda frame, since: [] if _is_page(frame, first_id) else [frame]


def _corrupted(first_id: int) -> Delivery:
    def deliver(frame: Frame, since: int) -> list[Frame]:
        if not _is_page(frame, first_id):
            return [frame]
        return [Frame(frame.frame_id, frame.data[:-1] + bytes([frame.data[-1] ^ 0x10]))]

    return deliver


def _as_another_page(frame: Frame, since: int) -> list[Frame]:
    """The page's number is another: what a receiver must not take for that one's content."""
    if not _is_page(frame, VOLTAGE_ID):
        return [frame]
    return [Frame(frame.frame_id, bytes([frame.data[0], frame.data[1] & 0x0F, *frame.data[2:]]))]


def _late(first_id: int, is_paged: bool = True) -> Delivery:
    """A queue that has grown by a period: from then on each frame comes in the next one."""
    waiting: list[Frame] = []

    def deliver(frame: Frame, since: int) -> list[Frame]:
        is_it = _is_page(frame, first_id) if is_paged else frame.frame_id == first_id
        if not is_it:
            return [frame]
        if since == 0:
            waiting.clear()
        waiting.append(frame)
        return [] if since == 0 else [waiting.pop(0)]

    return deliver


def _frozen(first_id: int) -> Delivery:
    """A gateway that repeats an old frame."""
    old: list[Frame] = []

    def deliver(frame: Frame, since: int) -> list[Frame]:
        if not _is_page(frame, first_id):
            return [frame]
        if not old or since == 0:
            old[:] = [frame]
            return [frame]
        return list(old)

    return deliver


def _twice(frame: Frame, since: int) -> list[Frame]:
    """A second sender of a page."""
    return [frame, frame] if _is_page(frame, VOLTAGE_ID) else [frame]


def _unknown_page(frame: Frame, since: int) -> list[Frame]:
    """A sender that has more cells than the pack."""
    if not _is_page(frame, VOLTAGE_ID):
        return [frame]
    return [frame, Frame(frame.frame_id, bytes([frame.data[0], 0xF0, *frame.data[2:]]))]


def _short(frame: Frame, since: int) -> list[Frame]:
    return [Frame(frame.frame_id, frame.data[:-1])] if _is_page(frame, VOLTAGE_ID) else [frame]


def _unknown_cell(settings: PackChargeSettings) -> str | None:
    return unknown_cell(settings.preset)


def _sum_is_loose(settings: PackChargeSettings) -> str | None:
    known_V = settings.pack_voltage_error_V
    if known_V < CELL_OFFSET_V:
        return None
    return (
        f"the voltages of {settings.cells} cells, by the errors of this preset's sensors, may miss "
        f"the string's by {known_V:.2f} V together; one that is off by {CELL_OFFSET_V:g} V may be "
        "right"
    )


def _set_voltage(value_V: float) -> Reading:
    def change(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
        plant.measured.voltage_V[CELL] = value_V

    return change


def _set_surface(value_K: float) -> Reading:
    def change(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
        plant.measured.surface_temperature_K[CELL] = value_K

    return change


def _off_voltage(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
    plant.measured.voltage_V[CELL] += CELL_OFFSET_V


def _off_string(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
    plant.pack_voltage_V += 1.0


def _stuck_voltage(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
    plant.measured.voltage_V[CELL] = kept.setdefault("V", plant.measured.voltage_V[CELL])


def _stuck_surface(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
    measured = plant.measured.surface_temperature_K
    measured[CELL] = kept.setdefault("K", measured[CELL])


def _no_current(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
    plant.measured.current_A = math.nan


def _no_coolant(plant: PackPlant, since: int, kept: dict[str, float]) -> None:
    plant.measured.coolant_out_K = math.nan


MISSING_V, MISSING_T = FirstFault.ELECTRICAL_MISSING, FirstFault.THERMAL_MISSING
CORRUPTED, DEVIATION = FirstFault.CORRUPTED_FRAMES, FirstFault.VOLTAGE_DEVIATION
VOLTAGE, SURFACE = FirstFault.VOLTAGE_RANGE, FirstFault.SURFACE_RANGE
FAULTS = (
    PackFault("voltage page missing", 0, (MISSING_V,), delivery=_missing(VOLTAGE_ID)),
    PackFault("temperature page missing", 0, (MISSING_T,), delivery=_missing(TEMPERATURE_ID)),
    PackFault(
        "plug-in page missing", 35, (FirstFault.REQUEST_INVALID,), delivery=_missing(PLUG_IN_ID)
    ),
    PackFault("voltage page corrupted", 0, (MISSING_V,), delivery=_corrupted(VOLTAGE_ID)),
    PackFault("temperature page corrupted", 0, (MISSING_T,), delivery=_corrupted(TEMPERATURE_ID)),
    PackFault("voltage page under another's number", 0, (MISSING_V,), delivery=_as_another_page),
    PackFault("voltage page frozen", 1, (MISSING_V,), delivery=_frozen(VOLTAGE_ID)),
    PackFault("temperature page frozen", 1, (MISSING_T,), delivery=_frozen(TEMPERATURE_ID)),
    PackFault("voltage page a period late", 0, (MISSING_V,), delivery=_late(VOLTAGE_ID)),
    PackFault("temperature page a period late", 0, (MISSING_T,), delivery=_late(TEMPERATURE_ID)),
    PackFault(
        "coolant a period late", 0, (FirstFault.COOLANT_MISSING,), delivery=_late(COOLANT_ID, False)
    ),
    PackFault(
        "request a period late", 0, (FirstFault.REQUEST_MISSING,), delivery=_late(REQUEST_ID, False)
    ),
    PackFault("voltage page too short", 0, (MISSING_V,), delivery=_short),
    PackFault("voltage page from two senders", 2, (CORRUPTED,), delivery=_twice),
    PackFault("page of cells that are not there", 2, (CORRUPTED,), delivery=_unknown_page),
    PackFault("a cell's voltage not a number", 0, (VOLTAGE,), reading=_set_voltage(math.nan)),
    PackFault("a cell's voltage out of range", 0, (VOLTAGE,), reading=_set_voltage(6.0)),
    PackFault(
        "a cell's voltage off by 0.3 V",
        0,
        (VOLTAGE,),
        reading=_off_voltage,
        excuse=_sum_is_loose,
    ),
    PackFault("the string's voltage off by 1 V", 0, (VOLTAGE,), reading=_off_string),
    PackFault(
        "a cell's voltage stuck",
        600,
        (VOLTAGE, DEVIATION),
        reading=_stuck_voltage,
        excuse=_unknown_cell,
    ),
    PackFault("thermistor wire open", 0, (SURFACE,), reading=_set_surface(math.nan)),
    PackFault("thermistor reads its lowest", 0, (SURFACE,), reading=_set_surface(200.0)),
    PackFault(
        "thermistor stuck",
        600,
        (FirstFault.SURFACE_DEFICIT,),
        reading=_stuck_surface,
        excuse=_unknown_cell,
    ),
    PackFault("no current reading", 0, (FirstFault.CURRENT_RANGE,), reading=_no_current),
    PackFault("no coolant reading", 0, (FirstFault.COOLANT_RANGE,), reading=_no_coolant),
)
