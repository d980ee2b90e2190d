"""Options of `bms identify` for recordings of a cycler, without a measured core."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, cast

import typer

from bms.data.cycler import ColumnMap, CyclerFormat, TemperatureUnit
from bms.errors import InputError

ColumnsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--columns",
        help="Columns by place from 0 or by name, such as "
        "time=0,current=1,voltage=2,surface=4,ambient=6; also row, the number of a sample. May be "
        "repeated: a file takes the first that fits it, else the names of its header.",
    ),
]
TemperatureUnitOption = Annotated[
    str, typer.Option("--temperature-unit", help="Of the recordings: degC or K.")
]
ChargeSignOption = Annotated[
    bool,
    typer.Option(
        "--charge-positive/--charge-negative", help="Sign of a charging current in the recordings."
    ),
]
SamplePeriodOption = Annotated[
    float | None,
    typer.Option(
        "--sample-period", min=1e-4, max=3600.0, help="Time in s from row to row without a time."
    ),
]
GeometryOption = Annotated[
    str | None,
    typer.Option(
        "--geometry",
        help="Shape, for the core that was not measured: 18650, 21700, 26650, "
        "cylinder:DIAMETERxLENGTH, prismatic:AxBxC or pouch:AxBxC in mm.",
    ),
]
RatedOption = Annotated[
    list[str] | None,
    typer.Option(
        "--rated",
        help="A limit of the data sheet, may be repeated: max_charge_A=4, max_voltage_V=4.2, "
        "charge_temperature_degC=0..50, max_core_temperature_degC, life_resistance, "
        "life_capacity. What is missing is what the recordings have shown, never more.",
    ),
]
EntropyOption = Annotated[
    Path | None,
    typer.Option(
        "--entropy", help="dU/dT of a publication in place of a fitted one: CSV soc,V_per_K."
    ),
]
CheckOption = Annotated[
    Path | None,
    typer.Option("--check", help="Recording that is not fitted, to hold the result against."),
]
SaveAsOption = Annotated[
    Path | None,
    typer.Option(
        "--save-as", help="Write the recordings with the project's columns (CSV; numbered if many)."
    ),
]
ReportOption = Annotated[
    Path | None,
    typer.Option("--report", help="Folder for a page with the fits. Default: nothing is written."),
]


@dataclass(frozen=True)
class SurfaceOptions:
    """The options together, each as it is when it is not given."""

    columns: tuple[str, ...] = ()
    temperature_unit: str = "K"
    charge_is_positive: bool = False
    sample_period_s: float | None = None
    geometry: str | None = None
    rated: tuple[str, ...] = ()
    entropy: Path | None = None
    check: Path | None = None
    save_as: Path | None = None
    report: Path | None = None

    @property
    def is_given(self) -> bool:
        """Whether any of them asks for the way without a measured core."""
        return self != SurfaceOptions()

    @property
    def form(self) -> CyclerFormat:
        """How the cycler writes; InputError names a wrong option."""
        if self.temperature_unit not in ("degC", "K"):
            raise InputError(f"--temperature-unit {self.temperature_unit}: give degC or K")
        return CyclerFormat(
            tuple(ColumnMap.parse(text) for text in self.columns),
            cast(TemperatureUnit, self.temperature_unit),
            self.charge_is_positive,
            self.sample_period_s,
        )
