"""The figures of a run, from its time series and from what is true of the cell."""

from __future__ import annotations

import math

from bms.presets.optimum import KnownBound, known_bound
from hil_sim.bus.buses import is_serial_line
from hil_sim.nodes.line_losses import LineLosses
from hil_sim.nodes.punctuality import PlantWatch
from hil_sim.plant.catalog import DEFAULT_PLANT
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.charge import Charge
from hil_sim.run.result import (
    CHARGING_STATES,
    DERATED_STATE,
    STOP_COMPLETE,
    RunResult,
    Summary,
    TimeSeries,
)
from hil_sim.run.settings import ControllerKind, Settings

FOREIGN_ECU = "foreign-ecu"
"""An ECU on the bus that does not say what it is, so that its decisions are none of ours."""


def sum_up(
    settings: Settings,
    charge: Charge,
    reason: str,
    wall_time_s: float,
    watch: PlantWatch | None,
    losses: LineLosses,
) -> RunResult:
    """The result of a charge that ended for a reason of hil_sim.run.result after wall_time_s."""
    series, extremes = charge.series, charge.plant.extremes
    limits = settings.preset.limits
    is_firmware = settings.controller is ControllerKind.KAN_RCBF
    is_foreign = is_firmware and charge.identity is None
    estimates = is_firmware and not is_foreign
    errors_K = estimate_errors_K(series) if estimates else []
    violations = tuple(extremes.violations(limits))
    charge_time_s = series.time_s[-1] if reason == STOP_COMPLETE else None
    bound = bound_of(settings)
    summary = Summary(
        controller=FOREIGN_ECU if is_foreign else settings.controller.value,
        preset=settings.preset.name,
        bus=settings.bus,
        steps=charge.steps,
        max_core_temperature_K=extremes.core_temperature_K,
        max_surface_temperature_K=extremes.surface_temperature_K,
        max_voltage_V=extremes.voltage_V,
        final_soc=charge.plant.state.soc,
        charge_time_s=charge_time_s,
        first_derate_s=first_derate_s(series),
        kan_rmse_K=rmse_K(errors_K),
        kan_max_abs_error_K=max(map(abs, errors_K), default=None),
        wall_time_s=round(wall_time_s, 3),
        max_soc=extremes.soc,
        limits_kept=not violations,
        violations=violations,
        stop_reason=reason,
        first_fault=charge.first_fault,
        infeasible_steps=infeasible_steps(series),
        error_bound_K=charge.error_bound_K if estimates else None,
        seed=settings.seed,
        disturbance=settings.disturbance.value,
        realtime=settings.realtime,
        model_hash=charge.identity.model_hash if charge.identity else None,
        preset_hash=settings.preset.hash,
        command_reception=charge.node.command_counts,
        faults=charge.injection.injected,
        timing=watch.timing([command is not None for command in series.command_A])
        if watch is not None
        else None,
        line_losses=losses if is_serial_line(settings.bus) else None,
        plant=settings.plant,
        min_anode_potential_V=extremes.min_anode_potential_V,
        mean_core_temperature_K=mean_core_temperature_K(series),
        heat_J=extremes.heat_J,
        optimum_time_s=None if bound is None else bound.optimum_time_s,
        time_over_optimum=None if bound is None else _over(charge_time_s, bound.optimum_time_s),
        lower_bound_s=None if bound is None else bound.lower_bound_s,
        time_over_bound=None if bound is None else _over(charge_time_s, bound.lower_bound_s),
        mode=settings.mode_name,
        full_by_s=settings.full_by_s if is_firmware else None,
    )
    return RunResult(summary, series, watch)


def bound_of(settings: Settings) -> KnownBound | None:
    """The bound on the time of this charge; None where its cell is not the nominal one throughout.

    It speaks for the preset's own cell from its own start, without disturbance or fault.
    """
    is_nominal = (
        settings.true_cell is None
        and settings.plant == DEFAULT_PLANT
        and settings.disturbance is DisturbanceKind.NONE
        and not settings.faults
        and settings.initial in (None, settings.preset.initial)
    )
    return known_bound(settings.preset) if is_nominal else None


def _over(time_s: float | None, bound_s: float) -> float | None:
    return None if time_s is None else round(time_s / bound_s, 4)


def first_derate_s(series: TimeSeries) -> float | None:
    """First time in s at which a constraint allowed less than was asked for."""
    derated = (t for t, state in zip(series.time_s, series.state) if state == DERATED_STATE)
    return next(derated, None)


def mean_core_temperature_K(series: TimeSeries) -> float | None:
    """Mean over the control periods of the charge, None without any."""
    cores_K = [
        core_K for time_s, core_K in zip(series.time_s, series.core_temperature_K) if time_s >= 0.0
    ]
    return math.fsum(cores_K) / len(cores_K) if cores_K else None


def infeasible_steps(series: TimeSeries) -> int:
    """Control periods of the charge in which the constraints left no current but 0 A."""
    return sum(
        feasible is False and state in CHARGING_STATES
        for feasible, state in zip(series.feasible, series.state)
    )


def estimate_errors_K(series: TimeSeries) -> list[float]:
    """Estimated less true core temperature (K) in every period of the charge with an estimate."""
    return [
        estimate - truth
        for time_s, estimate, truth in zip(
            series.time_s, series.estimated_core_temperature_K, series.core_temperature_K
        )
        if estimate is not None and time_s >= 0.0
    ]


def rmse_K(errors_K: list[float]) -> float | None:
    """Root of the mean square, None for no errors."""
    if not errors_K:
        return None
    return math.sqrt(math.fsum(error * error for error in errors_K) / len(errors_K))
