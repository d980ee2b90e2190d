"""What a BPX file tells of a preset's numbers, each with its source, and what it does not tell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bms.arrays import Array
from bms.errors import InputError
from bms.identification.bpx.file import CONDUCTIVITY, ELECTRODES, ENTROPY, OCP, BpxFile
from bms.identification.bpx.function import values
from bms.identification.geometry import SURFACE_SHARE, Shape, shape
from bms.presets.authoring.firmware_limits import LONGEST_TABLES
from bms.presets.authoring.form import Known

_FINE = np.linspace(0.0, 1.0, 2001)
"""States of charge at which curves are tried."""
_ACCURACY_V = 5e-4
_ENTROPY_POINTS = 21
_FALL_V = 1e-3
"""By which a fitted open-circuit voltage may fall; such points are left out of the table."""
_OTHER_VOLUME = 0.15
_OTHER_CAPACITY = 0.05
_LITHIATION = "OCP (lithiation) [V]"
_LESS, _MORE = "Minimum stoichiometry", "Maximum stoichiometry"
_CAPACITY = "Nominal cell capacity [A.h]"
_UPPER, _LOWER = "Upper voltage cut-off [V]", "Lower voltage cut-off [V]"
_HEAT = ("Density [kg.m-3]", "Specific heat capacity [J.K-1.kg-1]", "Volume [m3]")
_PAIRS = "Number of electrode pairs connected in parallel to make a cell"
_AREA = "External surface area [m2]"
_COEFFICIENT = ("State", "Thermal environment", "Heat transfer coefficient [W.m-2.K-1]")
_TEMPERATURE = ("State", "Initial conditions", "Initial temperature [K]")
_NOT_IN_BPX = {
    "cell.ohmic_resistance_ohm": "only that of porous electrodes; 'bms identify' fits it to pulses",
    "cell.coolant_heat_capacity_J_per_K": "what surrounds the cell",
    "limits.max_core_temperature_K": "temperature limits",
    "limits.max_surface_temperature_K": "temperature limits",
    "limits.reference_current_A": "charging current; that of the data sheet",
}
"""Keys that no BPX file tells, and what of it."""


def known_of(bpx: BpxFile, geometry: str | None) -> dict[str, Known]:
    """What the file tells of a preset's keys, with the shape of --geometry for its core.

    A key with a note and no value is one that this file leaves open. InputError names what cannot
    be: a number that is not above 0, an open-circuit voltage that falls, a shape of other volume.
    """
    known = dict(_direct(bpx))
    known.update(_voltage(bpx))
    known.update(_entropy(bpx))
    known.update(_heat(bpx, None if geometry is None else _shape(bpx, geometry)))
    for key, what in _NOT_IN_BPX.items():
        known[key] = Known(None, f"BPX has none: {what}")
    return known


def _direct(bpx: BpxFile) -> Iterator[tuple[str, Known]]:
    title = " ".join(str(bpx.header.get("Title") or "").split())
    references = " ".join(str(bpx.header.get("References") or "").split())
    source = f"BPX file {bpx.path.name}, version {bpx.version}, model {bpx.header['Model']}"
    told = [f"{source}: {title}" if title else source]
    yield "sources", Known(told + [references] * bool(references), "")
    yield "description", Known(title or f"From BPX file {bpx.path.name}", "")
    capacity_Ah = _positive(bpx, "Cell", _CAPACITY)
    note = bpx.source("Cell", _CAPACITY)
    allowed_Ah = _allowed_Ah(bpx)
    if allowed_Ah is not None and abs(allowed_Ah / capacity_Ah - 1.0) > _OTHER_CAPACITY:
        note += f"; its electrodes hold {allowed_Ah:.4g} A h between SoC 0 and 1: which is right?"
    yield "cell.capacity_Ah", Known(capacity_Ah, note)
    upper_V, lower_V = _positive(bpx, "Cell", _UPPER), _positive(bpx, "Cell", _LOWER)
    if lower_V >= upper_V:
        raise InputError(f"{bpx.path}: Cell: {_LOWER}: not below the upper one; mend the file")
    yield "limits.max_voltage_V", Known(upper_V, bpx.source("Cell", _UPPER))
    if bpx.has(*_TEMPERATURE):
        start_K = _positive(bpx, *_TEMPERATURE)
        yield "initial.temperature_K", Known(start_K, bpx.source(*_TEMPERATURE))


def _allowed_Ah(bpx: BpxFile) -> float | None:
    """Charge of the emptier electrode between its stoichiometries, in A h; None if not told."""
    areas = (
        "Electrode area [m2]",
        "Number of electrode pairs connected in parallel to make a cell",
    )
    parts = ("Thickness [m]", "Maximum concentration [mol.m-3]", "Particle radius [m]")
    found = []
    for electrode in ELECTRODES:
        numbers = [bpx.number("Cell", name) for name in areas]
        numbers += [bpx.number(electrode, name) for name in parts]
        numbers.append(bpx.number(electrode, "Surface area per unit volume [m-1]"))
        least, most = bpx.number(electrode, _LESS), bpx.number(electrode, _MORE)
        if None in numbers or least is None or most is None:
            return None
        # Spheres: their share of the volume is surface area times radius / 3.
        found.append(np.prod([n for n in numbers if n is not None]) / 3.0 * (most - least))
    return float(min(found)) * 96485.33 / 3600.0


def _positive(bpx: BpxFile, *place: str) -> float:
    number = bpx.number(*place)
    if number is None or not number > 0.0:
        raise InputError(f"{bpx.path}: {': '.join(place)}: must be above 0; mend the file")
    return number


def _voltage(bpx: BpxFile) -> Iterator[tuple[str, Known]]:
    if (blank := _blank(bpx, OCP)) is not None:
        yield "cell.ocv.soc", Known(None, f"{blank}; 'bms identify' fits a slow charge")
        return
    voltage_V = _curve(bpx, OCP)
    if np.any(voltage_V < np.maximum.accumulate(voltage_V) - _FALL_V):
        raise InputError(
            f"{bpx.path}: {OCP}: the open-circuit voltage falls with the state of charge; "
            "mend the electrodes' functions or stoichiometries"
        )
    if voltage_V[0] <= 0.0:
        raise InputError(f"{bpx.path}: {OCP}: the empty cell has {voltage_V[0]:.3g} V; mend them")
    soc, points_V, error_V = _thinned(voltage_V)
    reference_K = bpx.number("Cell", "Reference temperature [K]")
    at = "" if reference_K is None else f" at {reference_K:g} K"
    branches = any(_LITHIATION in bpx.parameterisation[name] for name in ELECTRODES)
    hysteresis = "; its hysteresis belongs into cell.interval.ocv_error_V" if branches else ""
    yield "cell.ocv.soc", Known(soc, "")
    yield (
        "cell.ocv.voltage_V",
        Known(
            points_V,
            f"{bpx.source('Positive electrode', OCP)}, less that of Negative electrode, between "
            f"their stoichiometries{at}; straight lines within {1e3 * error_V:.1f} mV{hysteresis}",
        ),
    )


def _thinned(voltage_V: Array) -> tuple[list[float], list[float], float]:
    """Points of a curve on _FINE with which lines follow it, and the largest error in V.

    Rounded to 0.01 mV; no more points than the firmware's table, only such as rise.
    """
    rounded_V = np.round(voltage_V, 5)
    chosen = [0, _FINE.size - 1]
    for _ in range(LONGEST_TABLES["cell.ocv.soc"] - 2):
        error_V = np.abs(np.interp(_FINE, _FINE[chosen], rounded_V[chosen]) - voltage_V)
        after = np.searchsorted(chosen, np.arange(_FINE.size))
        points_V = rounded_V[chosen]
        fits = (rounded_V > points_V[np.maximum(after - 1, 0)]) & (rounded_V < points_V[after])
        worst = int(np.argmax(np.where(fits, error_V, 0.0)))
        if not fits[worst] or error_V[worst] < _ACCURACY_V:
            break
        chosen = sorted([*chosen, worst])
    error_V = np.abs(np.interp(_FINE, _FINE[chosen], rounded_V[chosen]) - voltage_V)
    soc = [round(float(one), 4) for one in _FINE[chosen]]
    return soc, rounded_V[chosen].tolist(), float(np.max(error_V))


def _entropy(bpx: BpxFile) -> Iterator[tuple[str, Known]]:
    if (blank := _blank(bpx, ENTROPY)) is not None:
        yield "cell.entropic_coefficient_V_per_K", Known(None, blank)
        return
    every = (_FINE.size - 1) // (_ENTROPY_POINTS - 1)
    curve = _curve(bpx, ENTROPY)
    source = f"{bpx.source('Positive electrode', ENTROPY)}, less that of Negative electrode"
    mean = float(f"{np.mean(curve):.4g}")
    yield "cell.entropic_coefficient_V_per_K", Known(mean, f"{source}: mean over SoC")
    yield "cell.entropy.soc", Known([round(float(one), 4) for one in _FINE[::every]], "")
    yield (
        "cell.entropy.V_per_K",
        Known([float(f"{one:.4g}") for one in curve[::every]], source),
    )


def _blank(bpx: BpxFile, field: str) -> str | None:
    """Why a function of both electrodes is not told; None where it is."""
    for name in ELECTRODES:
        electrode = bpx.parameterisation.get(name, {})
        if "Particle" in electrode:
            return f"{bpx.path.name}: {name} is a blend, whose {field} is not one function"
        if field not in electrode:
            return f"{bpx.path.name} has none: {name}: {field}"
    return None


def _curve(bpx: BpxFile, field: str) -> Array:
    """Positive less negative electrode over the states of charge _FINE."""
    curves = []
    for name in ELECTRODES:
        electrode = bpx.parameterisation[name]
        least, most = electrode[_LESS], electrode[_MORE]
        if not 0.0 <= least < most <= 1.0:
            raise InputError(f"{bpx.path}: {name}: {_LESS}: must be 0 to {_MORE}, that to 1")
        share = _FINE if name == ELECTRODES[0] else 1.0 - _FINE
        try:
            curves.append(values(electrode[field], least + (most - least) * share))
        except ValueError as error:
            raise InputError(f"{bpx.path}: {name}: {field}: {error}; mend the file") from None
    return curves[1] - curves[0]


def _shape(bpx: BpxFile, geometry: str) -> Shape:
    chosen, volume_m3 = shape(geometry), bpx.number("Cell", _HEAT[2])
    if volume_m3 is not None and abs(volume_m3 / chosen.volume_m3 - 1.0) > _OTHER_VOLUME:
        raise InputError(
            f"--geometry {geometry}: has {1e6 * chosen.volume_m3:.4g} cm3, but {bpx.path.name} "
            f"{1e6 * volume_m3:.4g} cm3 (Cell: {_HEAT[2]}); give the shape of this cell"
        )
    return chosen


def _heat(bpx: BpxFile, chosen: Shape | None) -> Iterator[tuple[str, Known]]:
    core, surface = "cell.core_heat_capacity_J_per_K", "cell.surface_heat_capacity_J_per_K"
    lacking = [name for name in _HEAT if not bpx.has("Cell", name)]
    if lacking:
        for key in (core, surface):
            yield key, Known(None, f"{bpx.path.name} has none: Cell: {', '.join(lacking)}")
    else:
        whole = float(np.prod([_positive(bpx, "Cell", name) for name in _HEAT]))
        share = SURFACE_SHARE[1]
        product = bpx.source("Cell", " times ".join(_HEAT))
        yield core, Known(float(f"{(1 - share) * whole:.4g}"), f"{product}, less the surface's")
        yield (
            surface,
            Known(float(f"{share * whole:.4g}"), f"assumed: {100 * share:g} % of {product}"),
        )
    resistance = "cell.core_resistance_K_per_W"
    if chosen is None:
        yield resistance, Known(None, "BPX has no shape: give --geometry too")
    else:
        yield resistance, _core_resistance(bpx, chosen)
    cooled = "cell.surface_resistance_K_per_W"
    absent = [": ".join(place) for place in (_COEFFICIENT, ("Cell", _AREA)) if not bpx.has(*place)]
    if absent:
        yield cooled, Known(None, f"{bpx.path.name} has none: {', '.join(absent)}")
    else:
        conductance = _positive(bpx, *_COEFFICIENT) * _positive(bpx, "Cell", _AREA)
        source = f"{bpx.source(*_COEFFICIENT)}, times Cell: {_AREA}, inverted; of that cooling"
        yield cooled, Known(float(f"{1.0 / conductance:.4g}"), source)


def _core_resistance(bpx: BpxFile, chosen: Shape) -> Known:
    """By the file's conductivity where it can be that across the layers, else by publications.

    That of a whole cell is mostly that along its layers, with which the core would seem too cold.
    """
    least, middle, most = chosen.conductivity_W_per_mK
    conductivity, source = middle, chosen.source
    for place in (("Cell", CONDUCTIVITY), ("User-defined", CONDUCTIVITY)):
        if bpx.has(*place):
            told = _positive(bpx, *place)
            if least <= told <= most:
                conductivity = told
                source = (
                    f"{bpx.source(*place)}, taken as that across the layers, with geometry "
                    f"{chosen.name} and heat made evenly inside"
                )
            else:
                source += f"; {told:g} of {bpx.source(*place)} is none across layers"
    return Known(float(f"{chosen.unit_resistance_per_m / conductivity:.4g}"), source)
