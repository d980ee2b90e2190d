"""What determines a charge of one pack over a bus."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from bms.bus_signals import BUS
from bms.errors import InputError
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Sensor
from hil_sim.pack.cell_plants import CellPlants
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.studies.pack._pack import lib
from hil_sim.studies.pack.engine import Core, View, all_cells
from hil_sim.studies.pack.function import horizons
from hil_sim.studies.pack.reserves import reserves
from hil_sim.studies.pack.spread import Spread, Surroundings

_EQUAL = (1.0, 1.0)
NO_SPREAD = Spread(_EQUAL, _EQUAL, _EQUAL, _EQUAL, _EQUAL, start_soc=0.0)


def spread_of(kind: SpreadKind) -> Spread:
    """Intervals of the factors on a cell's parameters."""
    return Spread() if kind is SpreadKind.PUBLISHED else NO_SPREAD


@dataclass(frozen=True)
class PackChargeSettings:
    """One pack on one bus. Raises InputError for numbers of cells that cannot be."""

    preset: Preset
    model: KanModel
    cells: int
    bus: str = "virtual:bms"
    spread: SpreadKind = SpreadKind.PUBLISHED
    seed: int = 0
    per_thermistor: int = 1
    max_time_s: float = 3600.0
    disturbed: bool = True
    answer_timeout_s: float = 1.0
    bleed_ohm: float = 0.0
    """Of the resistor across each cell; 0 for none."""
    balance_s: float = 0.0
    """For which a full pack stays plugged in."""
    thermistor_at: tuple[int, ...] | None = None
    """Cell of each thermistor, from 0 on; None for one in the middle of each `per_thermistor`."""
    around: Surroundings = field(default_factory=Surroundings)
    cell_plants: CellPlants = ()
    """Cells that are another plant than the pack's own."""

    def __post_init__(self) -> None:
        is_family = self.preset.cell.interval is not None
        most = lib.BMS_MAX_FAMILY_CELLS if is_family else lib.BMS_MAX_CELLS
        if not 1 <= self.cells <= most:
            raise InputError(f"--cells {self.cells}: from 1 to {most} cells fit into a pack")
        if is_family and not self.has_all_thermistors:
            option = (
                f"--per-thermistor {self.per_thermistor}"
                if self.thermistor_at is None
                else f"--thermistors: {len(self.thermistor_at)} of {self.cells} cells"
            )
            raise InputError(
                f"{option}: preset '{self.preset.name}' states a family, each cell of which needs "
                "a thermistor; leave it out"
            )

    @property
    def view(self) -> View:
        """Which cells have a thermistor; all are seen."""
        if self.thermistor_at is not None:
            return View(tuple(range(self.cells)), self.thermistor_at)
        return all_cells(self.cells, self.per_thermistor)

    @property
    def has_all_thermistors(self) -> bool:
        """Whether each cell has a thermistor."""
        return len(self.view.thermistors) == self.cells

    def core(self) -> Core:
        """Constants of the control core, with what the spread needs in reserve.

        Raises InputError as `reserves` and ModelMismatchError as calibration_fields does.
        """
        kept = _reserves(self.preset, spread_of(self.spread), self.around)
        return Core(self.preset, self.model, kept)

    def horizons(self) -> list[dict[str, float]]:
        """Members of pack_horizon_t until the next command acts, and for 10 s."""
        return horizons(
            self.preset,
            spread_of(self.spread),
            self.around,
            self.model.error_bound_K,
            all_seen=self.has_all_thermistors,
        )

    def balance(self) -> dict[str, float]:
        """Members of pack_balance_t."""
        return {
            "resistor_ohm": self.bleed_ohm,
            "least_soc": BALANCE_LEAST_SOC,
            "least_gap": BALANCE_LEAST_GAP,
        }

    @property
    def pack_voltage_sensor(self) -> Sensor:
        """The sensor across the whole string, as the cells' are over as many."""
        own = self.preset.sensors.voltage_V
        share = self.cells**0.5
        return Sensor(resolution=10.0 * own.resolution, noise_std=share * own.noise_std, bias=0.0)

    @property
    def pack_voltage_error_V(self) -> float:
        """By which the sum of the cells' readings may miss that of the string, with its frame."""
        cell_V = self.preset.sensors.voltage_V.error_bound + BUS.voltage_V
        return self.cells * cell_V + self.pack_voltage_sensor.error_bound + PACK_VOLTAGE_STEP_V


_reserves = lru_cache(maxsize=8)(reserves)
"""A second to compute, for plant, ECU and every further run."""

BALANCE_LEAST_SOC, BALANCE_LEAST_GAP = 0.8, 0.002
"""Near the top; and a gap that is more than what counting misses in an hour."""

PACK_VOLTAGE_STEP_V = 0.01
"""Half a step of PackVoltage; a test holds it to the database."""
