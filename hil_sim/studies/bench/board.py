"""What the firmware costs on a microcontroller: instructions in QEMU, and flash of its image."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from bms.errors import InputError
from bms.image import TARGETS
from bms.native_build import ROOT
from bms.presets import load_preset
from codegen.budgets.budgets import load_figures
from codegen.budgets.measure import BOOT, CONTROL, CORE, IMAGE
from hil_sim.studies.cost import CostReport, measure_cost
from hil_sim.targets.catalog import built_folder

_FIRMWARE = ROOT / "firmware_c"
_FEW_CHARGES, _FEW_STATES = 1, 50
"""Here the charge counts; `make cost` also searches for the worst."""


@dataclass(frozen=True)
class BoardCost:
    """Instructions over a charge of the default preset, and bytes of the last accepted build."""

    board: str
    estimate_and_decision_worst: int | None
    period_median: int | None
    application_flash_B: int | None
    image_flash_B: int | None
    not_run: str = ""
    modules_flash_B: dict[str, int] = field(default_factory=dict)
    """Of the application and what is around it in the image, by module."""


def board_costs(preset: str) -> list[BoardCost]:
    """Of each board; what cannot run here, or was not built, is named with the reason."""
    return [_board_cost(board, preset) for board in TARGETS]


def board_flash(board: str, not_run: str = "") -> BoardCost:
    """Flash of the last accepted build alone."""
    figures = load_figures(_FIRMWARE / "figures.json", board.replace("-", "_"))
    application_B, image_B = (
        figures[part].flash if part in figures else None for part in (CORE, IMAGE)
    )
    modules_B = {
        row: now.flash
        for row, now in figures.items()
        if row not in (CONTROL, CORE, BOOT, IMAGE) and now.flash is not None
    }
    return BoardCost(board, None, None, application_B, image_B, not_run, modules_B)


def _board_cost(board: str, preset: str) -> BoardCost:
    try:
        report = measure_cost(
            built_folder(board) / "cost.elf",
            board,
            load_preset(preset),
            0,
            _FEW_CHARGES,
            _FEW_STATES,
        )
    except InputError as error:
        return board_flash(board, str(error))
    return counted_board(report)


def counted_board(report: CostReport) -> BoardCost:
    """Instructions of a report on a board, with the flash of the last accepted build."""
    costs = report.costs
    return replace(
        board_flash(report.board),
        estimate_and_decision_worst=costs["estimate_and_decision"].charge_worst,
        period_median=costs["control_period"].charge_median,
    )
