"""An electrochemical cell by PyBaMM: current and temperature in, voltage and heat out."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

from bms.errors import InputError, PlantError

MODELS = {"spme": "SPMe", "dfn": "DFN"}
PARAMETER_SET = "Prada2013"
DIFFUSIVITY_FACTOR = 3.0
"""On the particles' diffusivity of this set, which is too slow for the measured 2C charge."""
REFERENCE_TEMPERATURE_K = 298.0
"""At which the set's open-circuit potentials hold."""
ELECTRODE_POINTS, PARTICLE_POINTS = 10, 20
PARTICLE_STRETCH = 3.0
"""Crowds the points of a particle near its surface, where its concentration changes most.

Evenly spread, 20 points miss the voltage at 10C by 70 mV; so, they are within 2 mV of 200.
"""
LARGEST_VOLTAGE_V = 10.0
"""Beyond it an electrode is full or empty, and the equations describe no cell any more."""

_VOLTAGE, _HEAT = "Voltage [V]", "Total heating [W]"
_ANODE = "Negative electrode surface potential difference at separator interface [V]"
_STOICHIOMETRY = "Negative electrode stoichiometry"
_POINTS = {name: ELECTRODE_POINTS for name in ("x_n", "x_s", "x_p")} | {
    name: PARTICLE_POINTS for name in ("r_n", "r_p")
}
_CURRENT, _TEMPERATURE = "Current function [A]", "Ambient temperature [K]"


@dataclass(frozen=True)
class Outputs:
    """What the electrochemical model says at one moment."""

    voltage_V: float
    heat_W: float
    """Irreversible heat: reactions, ohmic losses, mixing in the particles."""
    anode_potential_V: float
    """Negative electrode against the electrolyte at the separator; lithium plates below 0."""
    soc: float


class Electrochemistry:
    """SPMe or DFN of a parameter set's cell at one uniform temperature, in steps of `step_s`.

    The state of charge counts from the set's own limits: of Prada's, 0 where the open-circuit
    voltage is 2.0 V, 1 where it is 3.6 V. Raises InputError when PyBaMM is missing, or has no such
    set for a lithium-ion cell with one kind of particle in each electrode.
    """

    def __init__(
        self,
        model: str,
        soc: float,
        temperature_K: float,
        step_s: float,
        parameter_set: str = PARAMETER_SET,
    ) -> None:
        pybamm = import_pybamm()
        factor = DIFFUSIVITY_FACTOR if parameter_set == PARAMETER_SET else 1.0
        parameters = _parameters(pybamm, factor, parameter_set)
        empty, full, _, _ = pybamm.lithium_ion.get_min_max_stoichiometries(
            parameters, inputs=_inputs(0.0, REFERENCE_TEMPERATURE_K)
        )
        self._empty, self._span = float(empty), float(full - empty)
        self.capacity_As: float = 3600.0 * parameters["Nominal cell capacity [A.h]"]
        parameters.set_initial_state(soc, inputs=_inputs(0.0, REFERENCE_TEMPERATURE_K))
        options = {
            "thermal": "isothermal",
            "calculate heat source for isothermal models": "true",
            "heat of mixing": "true",
        }
        equations = getattr(pybamm.lithium_ion, MODELS[model])(options)
        # PyBaMM stops at its voltage limits; here the controller has to keep them.
        equations.events = []
        self._solver = pybamm.IDAKLUSolver(
            rtol=1e-6,
            atol=1e-8,
            output_variables=[_VOLTAGE, _HEAT, _ANODE, _STOICHIOMETRY],
        )
        simulation = pybamm.Simulation(
            equations,
            parameter_values=parameters,
            solver=self._solver,
            submesh_types=_meshes(pybamm, equations),
            var_pts=_POINTS,
        )
        simulation.build()
        self._model, self._step_s = simulation.built_model, step_s
        self._failure = pybamm.SolverError
        self._state: Any = None
        self._next: Any = None

    def step(
        self, current_A: float, temperature_K: float, step_s: float | None = None
    ) -> tuple[Outputs, Outputs]:
        """Begin and end of a step from the present state, which `keep` makes the next state.

        The step takes `step_s` where it is given, else the usual time. Raises PlantError when the
        equations cannot be solved.
        """
        try:
            self._next = self._solver.step(
                self._state,
                self._model,
                self._step_s if step_s is None else step_s,
                inputs=_inputs(current_A, temperature_K),
                save=False,
            )
        except self._failure as error:
            raise PlantError(
                f"PyBaMM: no solution with {current_A:g} A at {temperature_K:.1f} K "
                f"({str(error).splitlines()[0]}); start at another state of charge, or take a "
                "preset with a smaller current"
            ) from None
        begin, end = self._outputs(0), self._outputs(-1)
        if not abs(end.voltage_V) < LARGEST_VOLTAGE_V:
            raise PlantError(
                f"PyBaMM: {current_A:g} A at state of charge {end.soc:.3f} empties or "
                "fills an electrode; the controller charges beyond what the cell can hold"
            )
        return begin, end

    def keep(self) -> None:
        """Take the end of the last step as the present state."""
        self._state = self._next

    def restart(self) -> None:
        """Take the rest at the beginning as the present state."""
        self._state = self._next = None

    def _outputs(self, place: int) -> Outputs:
        value = {name: float(self._next[name].data[place]) for name in self._names}
        return Outputs(
            value[_VOLTAGE],
            value[_HEAT],
            value[_ANODE],
            (value[_STOICHIOMETRY] - self._empty) / self._span,
        )

    _names = (_VOLTAGE, _HEAT, _ANODE, _STOICHIOMETRY)


@cache
def import_pybamm() -> ModuleType:
    """PyBaMM, without its question whether it may report its use; InputError when missing."""
    os.environ.setdefault("PYBAMM_DISABLE_TELEMETRY", "true")
    try:
        import pybamm  # noqa: PLC0415 (an optional extra)
    except ImportError:
        raise InputError(
            "PyBaMM is not installed; run pip install 'kan-rcbf-bms[pybamm]'"
        ) from None
    module: ModuleType = pybamm
    return module


def _inputs(current_A: float, temperature_K: float) -> dict[str, float]:
    return {_CURRENT: current_A, _TEMPERATURE: temperature_K}


def _meshes(pybamm: ModuleType, equations: Any) -> dict[str, Any]:
    particle = pybamm.MeshGenerator(
        pybamm.Exponential1DSubMesh, {"side": "right", "stretch": PARTICLE_STRETCH}
    )
    return {
        **equations.default_submesh_types,
        "negative particle": particle,
        "positive particle": particle,
    }


def _parameters(
    pybamm: ModuleType, diffusivity_factor: float, parameter_set: str = PARAMETER_SET
) -> Any:
    """A set, with current and temperature as inputs of each step."""
    if parameter_set not in pybamm.parameter_sets:
        raise InputError(
            f"PyBaMM has no parameter set '{parameter_set}'; take one such as {PARAMETER_SET}"
        )
    parameters = pybamm.ParameterValues(parameter_set)
    for electrode in ("Negative", "Positive"):
        if diffusivity_factor != 1.0:
            parameters[f"{electrode} particle diffusivity [m2.s-1]"] *= diffusivity_factor
        # Prada's set has no current collectors; the heat's formula asks for them.
        absent = {
            f"{electrode} current collector thickness [m]": 0.0,
            f"{electrode} current collector conductivity [S.m-1]": 1.0,
        }
        parameters.update(
            {name: value for name, value in absent.items() if name not in parameters},
            check_already_exists=False,
        )
    parameters.update({_CURRENT: "[input]", _TEMPERATURE: "[input]"})
    return parameters
