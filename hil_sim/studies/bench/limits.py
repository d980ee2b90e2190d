"""For each figure with an aim: what it is made of, and what the aim would have to do without."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hil_sim.studies.bench.aims import Aim, aims
from hil_sim.studies.bench.board import BoardCost
from hil_sim.studies.bench.breakdown import Breakdown, grouped, parts_with_rest
from hil_sim.studies.bench.campaign_parts import FIRMWARE_PART, CampaignParts
from hil_sim.studies.bench.layers import BUS
from hil_sim.studies.bench.run import Result
from hil_sim.studies.bench.simulation import BusSpeed

_MS_PER_S, _US_PER_S = 1e3, 1e6

PLANNER, FAMILY, CALIBRATION = "planner", "family of cells", "calibration: model and tables"
FUNCTIONS: Mapping[str, tuple[str, ...]] = {
    PLANNER: ("planner_", "bms_plan", "bms_has_planned", "end_prediction", "begin_inner"),
    "frames: checksums": ("e2e_",),
    "frames: raw values and packing": (
        *("codec_", "can_db_", "write_", "encode_", "queue_", "bms_transmit"),
    ),
    "frames: reception": ("network_", "bms_receive", "request_", "pace_"),
    "open-circuit voltage, the planner's too": ("rcbf_open_circuit", "look_up_voltage", "numeric_"),
    "decision": ("rcbf_", "narrow", "decide", "steady"),
    "estimate": ("kan_", "history_", "clamp_to_reach"),
    "states, symptoms, filters": (
        *("bms_", "monitor_", "thermal_", "soc_", "run_period", "update_", "symptoms_", "outside_"),
    ),
}
"""Functions of the firmware by the beginnings of their names."""
MODULES: Mapping[str, tuple[str, ...]] = {
    PLANNER: ("src/planner", "src/bms_plan"),
    FAMILY: ("src/family_",),
    CALIBRATION: ("generated/calibration_default",),
    "check of the calibration": ("src/calibration",),
    "frames": ("src/codec", "src/e2e", "src/network", "src/request", "src/pace", "generated/can"),
    "estimate and decision": ("src/kan", "src/rcbf", "src/history", "src/thermal", "src/soc"),
    "monitor and symptoms": ("src/monitor", "src/bms_symptoms"),
    "states": ("src/bms", "src/choices"),
    "of the compiler and of several": ("src/shared", "src/numeric", "library"),
}
"""Modules of the firmware by the beginnings of their names."""
CORE_BEGINS = ("src/", "generated/", "library")


def breakdowns(result: Result) -> Iterator[Breakdown]:
    """Of every figure whose parts were measured; aims and figures have the same names."""
    of_name = {aim.name: aim for aim in aims(result)}
    if result.period_instructions:
        yield _period(of_name["control period with frames in C"], result.period_instructions)
    for speed in result.simulation:
        name = f"simulation on {speed.bus}, {speed.parties}"
        if speed.layer_shares_percent and name in of_name:
            yield _simulation(of_name[name], speed)
    if result.campaign_parts is not None:
        yield _campaign(of_name["campaign, runs a second and core"], result.campaign_parts)
    for cost in result.board:
        name = f"flash of the application on {cost.board}"
        if cost.modules_flash_B and name in of_name:
            yield flash_breakdown(of_name[name], cost)


def _period(aim: Aim, counts: Mapping[str, float]) -> Breakdown:
    whole = sum(counts.values())
    pace = whole / aim.measured
    wanted = pace * aim.wanted
    parts = parts_with_rest(whole, grouped(counts, FUNCTIONS))
    return Breakdown(
        aim.name,
        "instructions",
        whole,
        wanted,
        parts,
        f"{whole:,.0f} instructions in {aim.measured:.0f} ns are {pace:.1f} a ns; "
        f"{aim.wanted:.0f} ns hold {wanted:,.0f} at that pace, and without the planner "
        f"{whole - parts.get(PLANNER, 0.0):,.0f} are left",
    )


def _simulation(aim: Aim, speed: BusSpeed) -> Breakdown:
    period_us = speed.period_s * _US_PER_S
    whole_us, wanted_us = period_us / aim.measured, period_us / aim.wanted
    shares = speed.layer_shares_percent
    parts = parts_with_rest(whole_us, {k: whole_us * v / 100.0 for k, v in shares.items()})
    bus_us = parts.get(BUS, 0.0)
    return Breakdown(
        aim.name,
        "us a period",
        whole_us,
        wanted_us,
        parts,
        f"asked are {wanted_us:.0f} us; all but the bus takes {whole_us - bus_us:.0f} us, the bus "
        f"with python-can {bus_us:.0f} us; the plant's process had a core for "
        f"{whole_us * speed.processor_share_percent / 100.0:.0f} us of all that",
    )


def _campaign(aim: Aim, parts: CampaignParts) -> Breakdown:
    wanted_ms = _MS_PER_S / aim.wanted
    firmware_ms = parts.parts_ms[FIRMWARE_PART]
    return Breakdown(
        aim.name,
        "ms a run",
        parts.whole_ms,
        wanted_ms,
        parts_with_rest(parts.whole_ms, parts.parts_ms),
        f"asked are {wanted_ms:.1f} ms for {parts.periods:,.0f} periods of three charges; the "
        f"firmware with its frames takes {firmware_ms:.1f} ms of them, all else "
        f"{parts.whole_ms - firmware_ms:.1f} ms",
    )


def period_breakdown(board: str, counts: Mapping[str, float], wanted: float) -> Breakdown:
    """Mean instructions of a control period in mid-charge by what they are for."""
    whole = sum(counts.values())
    parts = parts_with_rest(whole, grouped(counts, FUNCTIONS))
    frames = sum(value for name, value in parts.items() if name.startswith("frames"))
    return Breakdown(
        f"control period in mid-charge on {board}",
        "instructions",
        whole,
        wanted,
        parts,
        f"mean of some periods without a search for a plan; frames with their protection take "
        f"{frames:,.0f} of the {wanted:,.0f} asked for",
    )


def flash_breakdown(aim: Aim, cost: BoardCost) -> Breakdown:
    """Bytes of the application by what they are for."""
    core = {m: float(b) for m, b in cost.modules_flash_B.items() if m.startswith(CORE_BEGINS)}
    parts = parts_with_rest(aim.measured, grouped(core, MODULES))
    without_family_B = aim.measured - parts.get(FAMILY, 0.0)
    without_planner_B = without_family_B - parts.get(PLANNER, 0.0)
    without_tables_B = without_planner_B - parts.get(CALIBRATION, 0.0)
    return Breakdown(
        aim.name,
        "B",
        aim.measured,
        aim.wanted,
        parts,
        f"asked are {aim.wanted:,.0f} B; without what speaks for a family of cells there are "
        f"{without_family_B:,.0f} B, without the planner too {without_planner_B:,.0f} B, and "
        f"{without_tables_B:,.0f} B without the calibration in it",
    )
