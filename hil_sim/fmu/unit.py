"""A unit of somebody else's behind FMPy: opened, checked, run; its complaints in one line."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Sequence
from ctypes import byref
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from bms.errors import InputError, PlantError

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ScalarVariable

_INSTALL = "pip install 'kan-rcbf-bms[fmi]'"


class _Log:
    """The last message of a unit, which says why a call has failed."""

    def __init__(self) -> None:
        self.said = ""

    def hear(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        """A message of FMI 3.0."""
        self.said = message.decode(errors="replace")

    def hear_named(
        self, environment: Any, name: bytes, status: int, category: bytes, message: bytes
    ) -> None:
        """A message of FMI 2.0."""
        self.hear(environment, status, category, message)


class Unit:
    """One instance of a unit for co-simulation, of FMI 2.0 or 3.0.

    `where` begins every complaint. Raises InputError when FMPy is not installed, and when the file
    is no unit, not for co-simulation, of another version, or has no library for this machine.
    """

    def __init__(self, path: Path, where: str) -> None:
        try:
            import fmpy  # noqa: PLC0415 (optional, and takes half a second)
        except ImportError:
            raise InputError(f"{where}: FMPy is not installed; run {_INSTALL}") from None
        self._fmpy = fmpy
        self._where = where
        self._log = _Log()
        self.description = self._read(path)
        self._folder = tempfile.mkdtemp(prefix="unit-")
        self._clean = weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        with zipfile.ZipFile(path) as unit:
            unit.extractall(self._folder)
        self.variables: dict[str, ScalarVariable] = {
            variable.name: variable for variable in self.description.modelVariables
        }
        self._now_s = 0.0
        self._slave: Any = None

    @property
    def major_version(self) -> int:
        """2 or 3."""
        return int(self.description.fmiVersion.split(".")[0])

    @property
    def last_message(self) -> str:
        """What the unit has said last; empty for nothing."""
        return self._log.said

    def instantiate(self, *, event_mode: bool = False) -> None:
        """Load the library and make the instance; InputError with what the unit says of it."""
        arguments = {
            "guid": self.description.guid,
            "unzipDirectory": self._folder,
            "modelIdentifier": self.description.coSimulation.modelIdentifier,
            "instanceName": self.description.modelName,
        }
        folder = Path.cwd()
        try:
            if self.major_version == 2:
                self._slave = self._fmpy.fmi2.FMU2Slave(**arguments)
                self._slave.instantiate(callbacks=self._callbacks())
            else:
                self._slave = self._fmpy.fmi3.FMU3Slave(**arguments)
                self._slave.instantiate(eventModeUsed=event_mode, logMessage=self._log.hear)
        except Exception as error:  # FMPy raises nothing narrower
            said = self._log.said or " ".join(str(error).split())
            raise InputError(f"{self._where}: does not start: {said}") from None
        finally:
            os.chdir(folder)  # FMPy stays in the folder of a library that it cannot load
        # Before the folder that the library was loaded from goes.
        weakref.finalize(self, self._slave.freeInstance)

    @property
    def slave(self) -> Any:
        """FMPy's own object, for what only one version has."""
        return self._slave

    def initialize(self) -> None:
        """Leave initialization mode, in which start values were set."""
        self._try(self._slave.exitInitializationMode)

    def enter_initialization(self) -> None:
        """Enter initialization mode at time 0."""
        if self.major_version == 2:
            self._try(self._slave.setupExperiment, startTime=0.0)
            self._try(self._slave.enterInitializationMode)
        else:
            self._try(self._slave.enterInitializationMode, startTime=0.0)

    def get(self, references: Sequence[int]) -> list[float]:
        """Real values by reference; PlantError when the unit refuses."""
        slave = self._slave
        read = slave.getReal if self.major_version == 2 else slave.getFloat64
        values: list[float] = self._try(read, references)
        return values

    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set real values by reference; PlantError when the unit refuses."""
        slave = self._slave
        write = slave.setReal if self.major_version == 2 else slave.setFloat64
        self._try(write, references, values)

    def step(self, step_s: float) -> None:
        """Advance; PlantError when the unit refuses, ends or stops early."""
        if self.major_version == 2:
            self._try(
                self._slave.doStep,
                currentCommunicationPoint=self._now_s,
                communicationStepSize=step_s,
            )
        else:
            _, ends, is_early, _ = self._try(self._slave.doStep, self._now_s, step_s)
            if ends or is_early:
                raise PlantError(f"{self._where}: ends by itself at {self._now_s:g} s")
        self._now_s += step_s

    def _read(self, path: Path) -> ModelDescription:
        if not path.is_file():
            raise InputError(f"{self._where}: no such file; give the path of a unit (.fmu)")
        description: ModelDescription | None = None
        try:
            with zipfile.ZipFile(path) as unit:
                names = unit.namelist()
                head = ElementTree.fromstring(unit.read("modelDescription.xml"))
            version = head.get("fmiVersion") or "of none"
            if version.split(".")[0] in ("2", "3"):
                description = self._fmpy.read_model_description(str(path), validate=False)
        except Exception as error:  # FMPy raises nothing narrower
            said = " ".join(str(error).split())
            raise InputError(f"{self._where}: is no unit that FMPy can read ({said})") from None
        if description is None:
            raise InputError(f"{self._where}: is of FMI {version}; export it for 2.0 or 3.0")
        if description.coSimulation is None:
            raise InputError(
                f"{self._where}: is not for co-simulation; export it for that, not for model "
                "exchange or scheduled execution alone"
            )
        self._require_library(description, names)
        return description

    def _require_library(self, description: ModelDescription, names: Sequence[str]) -> None:
        fmpy = self._fmpy
        platform = fmpy.platform if description.fmiVersion[0] == "2" else fmpy.platform_tuple
        identifier = description.coSimulation.modelIdentifier
        library = f"binaries/{platform}/{identifier}{fmpy.sharedLibraryExtension}"
        if library in names:
            return
        parts = [name.split("/") for name in names]
        others = sorted({part[1] for part in parts if part[0] == "binaries" and len(part) == 3})
        by_sources = any(part[0] == "sources" and part[-1].endswith(".c") for part in parts)
        remedy = ", or build it from its sources by 'fmpy compile FILE'" if by_sources else ""
        raise InputError(
            f"{self._where}: has no {library}, but libraries for {', '.join(others) or 'nothing'}; "
            f"export it for this machine{remedy}"
        )

    def _try(self, call: Any, *arguments: Any, **named: Any) -> Any:
        self._log.said = ""
        try:
            return call(*arguments, **named)
        except Exception as error:  # FMPy raises nothing narrower
            said = self._log.said or " ".join(str(error).split())
            raise PlantError(f"{self._where}: {said}") from None

    def _callbacks(self) -> Any:
        fmi2 = self._fmpy.fmi2
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log.hear_named)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
        try:
            from fmpy.logging import addLoggerProxy  # noqa: PLC0415
        except (ImportError, OSError):
            return callbacks  # messages come without their numbers
        addLoggerProxy(byref(callbacks))
        return callbacks
