"""Reading of a file of faults: TOML with one [[fault]] table for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Union, cast

from pydantic import Field

from bms.errors import InputError
from bms.validation import parse, read_toml, strict
from hil_sim.bus.database import MessageCodec, load_codecs
from hil_sim.faults.base import Fault
from hil_sim.faults.clocks import CLOCK_FAULTS
from hil_sim.faults.ecu import ECU_FAULTS
from hil_sim.faults.frames import FRAME_FAULTS, FrameFault
from hil_sim.faults.plant import PLANT_FAULTS
from hil_sim.faults.sensors import SENSOR_FAULTS

KINDS: tuple[type[Fault], ...] = (
    *FRAME_FAULTS,
    *SENSOR_FAULTS,
    *PLANT_FAULTS,
    *ECU_FAULTS,
    *CLOCK_FAULTS,
)
# A union of a tuple is beyond the type checker, but not beyond pydantic.
AnyFault = Annotated[Union[KINDS], Field(discriminator="kind")]  # type: ignore[valid-type]  # noqa: UP007


@strict
@dataclass(frozen=True)
class _File:
    fault: tuple[AnyFault, ...]


def load_faults(path: Path) -> tuple[Fault, ...]:
    """Faults of a file in their order.

    Raises InputError in one line with file, key and remedy.
    """
    content = read_toml(path)
    if not content.get("fault"):
        raise InputError(f"{path}: fault: there is none; add a table [[fault]]")
    for number, table in enumerate(content["fault"] if isinstance(content["fault"], list) else []):
        if isinstance(table, dict) and "kind" not in table:
            raise InputError(f"{path}: fault.{number}: no kind; give one, such as 'message-lost'")
    faults = cast("tuple[Fault, ...]", parse(_File, content, str(path)).fault)
    database = load_codecs()
    for number, fault in enumerate(faults):
        check(fault, database, f"{path}: fault.{number}")
    return faults


def parse_fault(content: Mapping[str, Any], where: str) -> Fault:
    """One fault from decoded TOML; InputError as load_faults."""
    return cast("Fault", parse(cast("type[Any]", AnyFault), dict(content), where))


def check(fault: Fault, database: Mapping[str, MessageCodec], where: str) -> None:
    """Raise InputError when a fault names what the CAN database does not have."""
    if isinstance(fault, FrameFault):
        try:
            fault.check(database)
        except InputError as error:
            raise InputError(f"{where}: {fault.kind}: {error}") from None
