"""Each bus that a page, an example or a message names comes with `pip install` of this package."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, packages_distributions, requires

import can.interfaces
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.docs.pages import PAGES, ROOT

EXAMPLES = [path for path in (ROOT / "examples").rglob("*") if path.suffix in {".py", ".md"}]
SOURCES = [path for wing in ("bms", "hil_sim") for path in (ROOT / wing).rglob("*.py")]
BUS = re.compile(rf"\b({'|'.join(can.interfaces.BACKENDS)}):(?=[\w/])([\w./:-]*\w)")

# Opens a bus where nothing can be imported but what this package requires.
OPEN = """
import sys

class Absent:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ABSENT:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)

ABSENT = set(sys.argv[2].split(","))
sys.meta_path.insert(0, Absent())
from bms.errors import BusError
from hil_sim.bus.buses import open_bus
try:
    open_bus(sys.argv[1]).close()
except BusError as error:
    sys.exit(str(error))
"""
NO_DEVICE = ("No such device", "No such file or directory", "refused", "Address family not")
"""What may be wrong with a bus of the pages here: no adapter, or a kernel without CAN."""


def named_buses() -> dict[str, str]:
    """A bus for each interface that is named somewhere."""
    found: dict[str, str] = {}
    for path in (*PAGES, *EXAMPLES, *SOURCES):
        for interface, channel in BUS.findall(path.read_text(encoding="utf-8")):
            found.setdefault(interface, f"{interface}:{channel}")
    return found


def required(name: str, extras: frozenset[str] = frozenset()) -> set[str]:
    """Names of a distribution and of all that comes with it."""
    names = {canonicalize_name(name)}
    try:
        rows = requires(name) or []
    except PackageNotFoundError:  # for another platform or Python
        return names
    for requirement in map(Requirement, rows):
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in extras or {""}):
            names |= required(requirement.name, frozenset(requirement.extras))
    return names


def absent_modules() -> set[str]:
    """Modules that are installed here for tests, and that a user has not."""
    here = required("kan-rcbf-bms") | {"setuptools"}
    return {
        module
        for module, owners in packages_distributions().items()
        if module.isidentifier() and here.isdisjoint(map(canonicalize_name, owners))
    }


def opened(bus: str, absent: set[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", OPEN, bus, ",".join(absent)], capture_output=True, text=True,
        timeout=60, check=False,
    )  # fmt: skip


def test_the_pages_name_these_interfaces() -> None:
    assert {"virtual", "socketcan", "udp_multicast", "slcan"} <= set(named_buses())


def test_what_is_there_for_tests_alone_is_told_from_what_is_required() -> None:
    assert {"pytest", "hypothesis", "yaml"} <= absent_modules()
    assert absent_modules().isdisjoint({"can", "cantools", "msgpack", "serial", "numpy", "bms"})


@pytest.mark.parametrize("bus", named_buses().values(), ids=named_buses())
def test_interface_is_installed(bus: str) -> None:
    done = opened(bus, absent_modules())
    assert done.returncode == 0 or any(reason in done.stderr for reason in NO_DEVICE), done.stderr
    assert "Traceback" not in done.stderr


def test_this_would_tell_of_a_package_that_is_lacking() -> None:
    done = opened("udp_multicast:239.74.163.88", absent_modules() | {"msgpack"})
    assert done.returncode == 1
    assert "msgpack" in done.stderr
