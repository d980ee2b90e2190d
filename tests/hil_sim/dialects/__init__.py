"""Logs as other tools write them: the same frames, and foreign entries, in each dialect.

The texts are put together here from what the tools' sources and files show, so that the readers
are held against something that they did not write.
"""

from __future__ import annotations

from tests.hil_sim.dialects.asc import (
    ASC_FOREIGN,
    ASC_HEADER,
    BUSMASTER_HEADER,
    SAVVYCAN_HEADER,
    asc,
    asc_canfd,
    asc_canxl,
    asc_decimal,
    asc_relative,
)
from tests.hil_sim.dialects.blf import blf, blf_in_containers
from tests.hil_sim.dialects.candump import (
    LOG_FOREIGN,
    SHOWN_FOREIGN,
    candump_log,
    candump_shown,
)
from tests.hil_sim.dialects.csv_rows import (
    PYTHON_CAN_FOREIGN,
    SAVVYCAN_COLUMNS,
    SAVVYCAN_FOREIGN,
    csv_python_can,
    csv_savvycan,
)
from tests.hil_sim.dialects.dialect import Dialect
from tests.hil_sim.dialects.trc import TRC_FOREIGN, TRC_LINES, trc

DIALECTS = {
    "candump -L -x": Dialect(".log", candump_log, LOG_FOREIGN),
    "candump -L": Dialect(
        ".log", lambda f: candump_log(f, has_direction=False), LOG_FOREIGN, keeps_direction=False
    ),
    "candump -t a": Dialect(".log", candump_shown, SHOWN_FOREIGN, keeps_direction=False),
    "candump -t a -x -c": Dialect(
        ".log", lambda f: candump_shown(f, has_direction=True, colour="\x1b[32m"), SHOWN_FOREIGN
    ),
    "CANoe": Dialect(".asc", asc, ASC_FOREIGN),
    "CANoe, relative times": Dialect(".asc", asc_relative),
    "CANoe, decimal": Dialect(".asc", asc_decimal),
    "ASC without a header": Dialect(".asc", lambda f: asc(f, header=()), ASC_FOREIGN),
    "ASC without events": Dialect(".asc", lambda f: asc(f, header=ASC_HEADER[:2]), ASC_FOREIGN),
    "BUSMASTER": Dialect(".asc", lambda f: asc(f, BUSMASTER_HEADER, tail=" "), ASC_FOREIGN),
    "SavvyCAN as ASC": Dialect(".asc", lambda f: asc(f, SAVVYCAN_HEADER, tail="  "), ASC_FOREIGN),
    "log2asc -f": Dialect(".asc", asc_canfd, ASC_FOREIGN),
    "log2asc -x": Dialect(".asc", asc_canxl, ASC_FOREIGN),
    "python-can as CSV": Dialect(".csv", csv_python_can, PYTHON_CAN_FOREIGN, keeps_direction=False),
    "CSV without a header": Dialect(
        ".csv", lambda f: csv_python_can(f, ()), PYTHON_CAN_FOREIGN, keeps_direction=False
    ),
    "CSV of a spreadsheet": Dialect(
        ".csv", lambda f: csv_python_can(f, separator=";"), keeps_direction=False
    ),
    "SavvyCAN": Dialect(".csv", csv_savvycan, SAVVYCAN_FOREIGN),
    "SavvyCAN without a header": Dialect(".csv", lambda f: csv_savvycan(f, ()), SAVVYCAN_FOREIGN),
    "SavvyCAN without Dir": Dialect(
        ".csv",
        lambda f: csv_savvycan(f, (SAVVYCAN_COLUMNS.replace("Dir,", ""),), has_direction=False),
        keeps_direction=False,
    ),
    **{
        f"PEAK {version}": Dialect(
            ".trc",
            lambda f, version=version: trc(f, version),  # type: ignore[misc]
            TRC_FOREIGN.get(version, {}),
            keeps_direction=version != "1.0",
        )
        for version in TRC_LINES
    },
    "BLF": Dialect(".blf", blf),
    "BLF in small containers": Dialect(".blf", lambda f: blf_in_containers(f, 2, 100)),
    "BLF without compression": Dialect(".blf", lambda f: blf_in_containers(f, 0)),
    "BLF without containers": Dialect(".blf", lambda f: blf_in_containers(f, -1)),
}
