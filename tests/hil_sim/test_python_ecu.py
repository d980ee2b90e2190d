"""Python controllers in the ECU's place: what they see, and what their decisions become."""

import math

import pytest

from bms.baselines import BASELINES
from bms.decision import NO_MARGINS, Decision
from hil_sim.bus.e2e import Sender
from hil_sim.nodes.python_ecu import PythonEcu
from hil_sim.nodes.views import BusMeasurements, TrueState
from hil_sim.plant.disturbances import DisturbanceKind, disturbance_source
from hil_sim.plant.plant import Plant
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings

MEASURED = {
    "CellElectrical": {"Current": -10.0, "Voltage": 3.3},
    "CellThermal": {"SurfaceTemperature": 305.0, "CoolantTemperature": 301.0},
    "Coolant": {"CoolingPower": 0.5},
}


class Notes:
    """A controller that writes down what it is told."""

    name = "notes"

    def __init__(self, told):
        self.told = told

    def decide(self, observation):
        self.told.append(observation)
        return Decision(-5.0, True, "surface", -5.0, 0.0, NO_MARGINS)


@pytest.fixture
def plant(preset):
    return Plant(preset, disturbance_source(DisturbanceKind.NONE, preset, 0.01, None))


class Bench:
    """A PythonEcu with a Notes controller, fed frame by frame."""

    def __init__(self, preset, database, view):
        self.told, self.made = [], 0
        self.database = database
        self.ecu = PythonEcu(self._make, preset, database, view)
        self._senders = {name: Sender(database[name]) for name in (*MEASURED, "ChargeRequest")}

    def _make(self):
        self.made += 1
        return Notes(self.told)

    def period(self, request=1, without=(), damaged=(), soc=0.25):
        asked = {"Request": request, "ReferenceCurrent": -20.0, "PlugInStateOfCharge": soc}
        for name, values in {**MEASURED, "ChargeRequest": asked}.items():
            frame = self._senders[name].frame(values)
            data = bytes([frame.data[0] ^ 1]) + frame.data[1:] if name in damaged else frame.data
            if name not in without:
                self.ecu.receive(frame.frame_id, data)
        self.ecu.step()
        names = {codec.frame_id: codec for codec in self.database.values()}
        values = {}
        for frame_id, data in self.ecu.transmit():
            values |= names[frame_id].decode(data)
        return values


@pytest.fixture
def bench(preset, database):
    return Bench(preset, database, BusMeasurements(preset, database))


def test_measuring_controllers_are_told_what_is_on_the_bus_and_no_core(bench):
    bench.period()
    (told,) = bench.told
    assert math.isnan(told.core_temperature_K)
    assert told.voltage_V == pytest.approx(3.3)
    assert told.current_A == pytest.approx(-10.0)
    assert told.surface_temperature_K == pytest.approx(305.0)
    assert told.coolant_temperature_K == pytest.approx(301.0)
    assert told.cooling_power_W == pytest.approx(0.5)
    assert told.reference_current_A == pytest.approx(-20.0)


def test_charge_is_counted_from_the_plug_in(bench, preset):
    for _ in range(11):
        bench.period()
    change = 10.0 * preset.timing.sampling_period_s / preset.cell.capacity_As
    gained = bench.told[-1].soc - bench.told[0].soc
    assert gained == pytest.approx(10 * change, rel=1e-9)
    assert bench.told[0].soc == pytest.approx(0.25, abs=2 * change)


@pytest.mark.parametrize("how", ["without", "damaged"])
def test_what_does_not_arrive_intact_is_not_known(bench, how):
    bench.period()
    bench.period(**{how: ("CellThermal",)})
    assert math.isnan(bench.told[-1].surface_temperature_K)
    assert bench.told[-1].voltage_V == pytest.approx(3.3)
    bench.period()
    assert bench.told[-1].surface_temperature_K == pytest.approx(305.0)


def test_controllers_that_assume_the_true_state_get_it(preset, database, plant):
    bench = Bench(preset, database, TrueState(plant))
    bench.period()
    assert bench.told[0][:4] == tuple(plant.state)
    assert bench.told[0].cooling_power_W == plant.cooling_power_W


def test_the_answer_carries_the_decision(bench):
    answer = bench.period()
    assert answer["CommandCurrent"] == pytest.approx(-5.0)
    assert (answer["CommandState"], answer["ActiveConstraint"], answer["Feasible"]) == (3, 4, 1)
    assert answer["CoreTemperature"] is answer["ErrorBound"] is answer["CoreMargin"] is None


def test_without_request_nothing_flows_and_every_charge_has_its_own_controller(bench):
    assert bench.period(request=0)["CommandCurrent"] == pytest.approx(0.0)
    assert bench.made == 0
    for request in (1, 1, 0, 1):
        bench.period(request=request)
    assert bench.made == 2


def test_a_full_cell_is_left_alone(bench, preset):
    answer = bench.period(soc=preset.limits.completion_soc + 0.005)
    assert (answer["CommandCurrent"], answer["CommandState"]) == (pytest.approx(0.0), 4)
    assert bench.told == []


def test_the_command_line_knows_the_firmware_and_every_baseline():
    names = {kind.value for kind in ControllerKind}
    assert names == {"kan-rcbf", *BASELINES}


@pytest.mark.parametrize("kind", [ControllerKind.CC_CV, ControllerKind.MULTI_STAGE])
def test_a_usual_charger_fills_the_cell_within_what_it_measures(any_preset, kind):
    result = run_both(Settings(any_preset, controller=kind, disturbance=DisturbanceKind.UPWARD))
    summary, series = result.summary, result.series
    assert summary.stop_reason == "complete"
    assert summary.max_voltage_V <= any_preset.limits.max_voltage_V
    assert summary.max_surface_temperature_K <= any_preset.limits.max_surface_temperature_K
    assert set(series.estimated_core_temperature_K) == {None}
    assert summary.kan_rmse_K is None
    assert series.estimated_soc[-1] == pytest.approx(series.soc[-1], abs=1e-3)
    assert series.estimated_soc[-1] != series.soc[-1]
