"""What `bms export --fmu` writes: by the standard's schemas and headers, and always the same."""

from __future__ import annotations

import ctypes
import re
import subprocess
import zipfile
from io import BytesIO
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from bms.errors import InputError
from bms.native_build import ROOT
from bms.presets import load_preset
from codegen.can_database import database_text
from hil_sim.fmu.archive import archive
from hil_sim.fmu.library import LIBRARY_FLAGS
from hil_sim.fmu.plant import plant_unit
from hil_sim.fmu.unit import Unit
from tests.hil_sim.units import (
    PRESET,
    described,
    exported_ecu,
    exported_plant,
    opened,
    written,
)

FMPY = Path(fmpy.__file__).parent
NATIVE = ROOT / "hil_sim" / "fmu" / "native"
UNITS = {
    "ecu": exported_ecu,
    "plant-2": lambda: exported_plant(2),
    "plant-3": lambda: exported_plant(3),
}


@pytest.fixture(params=UNITS)
def unit(request) -> bytes:
    return UNITS[request.param]()


SCHEMAS = FMPY / "schema" / "fmi3"
MANIFEST_OF_FMI_LS_BUS = f"""
<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema"
    xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest">
  <xs:import namespace="http://fmi-standard.org/fmi-ls-manifest"
      schemaLocation="{SCHEMAS / "fmi3LayeredStandardManifest.xsd"}"/>
  <xs:element name="fmiLayeredStandardManifest">
    <xs:complexType><xs:attributeGroup ref="fmi-ls:ALayeredStandardManifest"/></xs:complexType>
  </xs:element>
</xs:schema>
"""
"""The layered standard has a root element of its own, around the attributes of FMI 3.0."""


def require_valid(content: bytes, rules: etree.XMLSchema) -> None:
    rules.assertValid(etree.fromstring(content))


def schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(file=str(SCHEMAS / name))


def test_the_validator_of_fmpy_has_nothing_to_say(unit, tmp_path):
    assert validate_fmu(str(written(tmp_path, unit))) == []


def test_the_validator_of_fmpy_would_notice_a_unit_that_is_not_defined(tmp_path):
    files = described(exported_plant(3), lambda text: text.replace('unit="V"', 'unit="v"'))
    assert validate_fmu(str(written(tmp_path, files))) != []


def test_what_stands_beside_the_model_description_is_by_the_schemas_of_fmi():
    files = opened(exported_ecu())
    bus = "extra/org.fmi-standard.fmi-ls-bus"
    terminals = files["terminalsAndIcons/terminalsAndIcons.xml"]
    require_valid(terminals, schema("fmi3TerminalsAndIcons.xsd"))
    manifest = etree.XMLSchema(etree.fromstring(MANIFEST_OF_FMI_LS_BUS))
    require_valid(files[f"{bus}/fmi-ls-manifest.xml"], manifest)
    for content in (files, opened(exported_plant(3))):
        require_valid(content["sources/buildDescription.xml"], schema("fmi3BuildDescription.xsd"))
    assert files[f"{bus}/Can.dbc"].decode() == database_text()


def test_the_terminal_names_variables_that_there_are_with_the_roles_of_fmi_ls_bus():
    files = opened(exported_ecu())
    model = etree.fromstring(files["modelDescription.xml"])
    (terminal,) = etree.fromstring(files["terminalsAndIcons/terminalsAndIcons.xml"])[0]
    variables = {v.get("name"): v for v in model.find("ModelVariables")}
    assert terminal.get("terminalKind") == "org.fmi-ls-bus.network-terminal"
    assert terminal.get("matchingRule") == "org.fmi-ls-bus.transceiver"
    members = {
        m.get("memberName"): variables[m.get("variableName")]
        for m in terminal.findall("TerminalMemberVariable")
    }
    roles = {
        name: (v.tag, v.get("causality"), v.get("intervalVariability"))
        for name, v in members.items()
    }
    assert roles == {
        "Rx_Clock": ("Clock", "input", "triggered"),
        "Tx_Clock": ("Clock", "input", "countdown"),
        "Rx_Data": ("Binary", "input", None),
        "Tx_Data": ("Binary", "output", None),
    }
    for data, clock in (("Rx_Data", "Rx_Clock"), ("Tx_Data", "Tx_Clock")):
        assert members[data].get("clocks") == members[clock].get("valueReference")
        assert (
            members[data].get("mimeType")
            == 'application/org.fmi-standard.fmi-ls-bus.can; version="1.0.0"'
        )
    assert model.find("CoSimulation").get("hasEventMode") == "true"


@pytest.mark.parametrize(
    "headers", [(), ("-DUNIT_STANDARD_HEADERS", "-Wmissing-prototypes")], ids=["own", "standard"]
)
@pytest.mark.parametrize("source", sorted(p.name for p in NATIVE.glob("*.c")))
def test_no_compiler_warns_and_the_headers_of_the_standard_declare_what_is_defined(
    source, headers, tmp_path
):
    """They declare every function, so that the compiler sees a wrong argument."""
    for name in ("ecu", "plant"):
        (tmp_path / f"{name}_token.h").write_text(f'#define {name.upper()}_TOKEN "none"\n')
    core = [f"firmware_c/{name}" for name in ("include", "image", "port", "generated")]
    folders = [*(ROOT / name for name in (*core, "hil_sim/native")), FMPY / "c-code", tmp_path]
    warnings = ["-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror"]
    flags = ["-std=c99", *warnings, *headers, "-fsyntax-only", *(f"-I{f}" for f in folders)]
    done = subprocess.run(
        ["cc", *flags, NATIVE / source], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("name", "major", "library"),
    [
        ("ecu", 3, "x86_64-linux/kan_rcbf_ecu.so"),
        ("plant-3", 3, "x86_64-linux/kan_rcbf_plant.so"),
        ("plant-2", 2, "linux64/kan_rcbf_plant.so"),
    ],
)
def test_the_library_has_the_functions_of_the_standard_and_shows_no_others(
    name, major, library, tmp_path
):
    path = tmp_path / "unit.so"
    path.write_bytes(opened(UNITS[name]())[f"binaries/{library}"])
    declared = (FMPY / "c-code" / f"fmi{major}Functions.h").read_text(encoding="utf-8")
    wanted = set(re.findall(rf"^\s*FMI{major}_Export fmi{major}\w+TYPE\s+(\w+);", declared, re.M))
    assert len(wanted) > 30
    model_exchange_of_fmi2 = {
        *("fmi2EnterEventMode", "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode"),
        *("fmi2CompletedIntegratorStep", "fmi2SetTime", "fmi2SetContinuousStates"),
        *("fmi2GetDerivatives", "fmi2GetEventIndicators", "fmi2GetContinuousStates"),
        "fmi2GetNominalsOfContinuousStates",
    }
    loaded = ctypes.CDLL(str(path))
    assert {f for f in wanted if not hasattr(loaded, f)} == (
        model_exchange_of_fmi2 if major == 2 else set()
    )
    assert not hasattr(loaded, "bms_step")
    assert not hasattr(loaded, "cell_step")


def test_a_unit_is_the_same_to_the_byte_when_it_is_made_again(unit):
    assert plant_unit(load_preset(PRESET), 3) == exported_plant(3)
    assert archive(opened(unit)) == unit
    with zipfile.ZipFile(BytesIO(unit)) as files:
        assert {entry.date_time for entry in files.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert str(ROOT).encode() not in b"".join(opened(unit).values())


@pytest.mark.parametrize(("name", "attribute"), [("plant-2", "guid"), ("plant-3", "inst\\w+")])
def test_a_library_beside_the_description_of_another_is_refused(name, attribute, tmp_path):
    other = described(
        UNITS[name](), lambda text: re.sub(rf'( {attribute})="[^"]*"', r'\1="another"', text)
    )
    unit = Unit(written(tmp_path, other), "unit")
    with pytest.raises(InputError, match=r"is not that of this unit; take library and model"):
        unit.instantiate()


@pytest.mark.parametrize("kind", ["ecu", "plant"])
def test_without_a_compiler_the_export_says_so(bms, monkeypatch, tmp_path, kind):
    monkeypatch.setenv("CC", "no-such-compiler")
    code, printed, error = bms("export", "--fmu", kind, "--out", tmp_path / "out")
    assert (code, printed, error.count("\n")) == (2, "", 1)
    assert "no C compiler 'no-such-compiler'" in error
    assert "variable CC" in error
    assert not (tmp_path / "out").exists()


def test_a_compiler_that_fails_is_quoted(bms, monkeypatch, tmp_path):
    compiler = tmp_path / "broken"
    compiler.write_text("#!/bin/sh\necho 'broken: no licence' >&2\nexit 3\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    code, _, error = bms("export", "--fmu", "plant", "--out", tmp_path / "out")
    assert (code, error.count("\n")) == (2, 1)
    assert "fails: broken: no licence" in error


def test_another_platform_is_told_of_the_sources(bms, monkeypatch, tmp_path):
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    code, _, error = bms("export", "--fmu", "plant", "--out", tmp_path / "out")
    assert (code, error.count("\n")) == (2, 1)
    assert "built for x86_64-linux, and this is aarch64" in error
    assert "sources/" in error


def test_a_unit_needs_a_folder(bms):
    code, _, error = bms("export", "--fmu", "ecu", "--sources", "anywhere")
    assert (code, error.count("\n")) == (2, 1)
    assert "--fmu ecu needs a folder" in error


def test_the_flags_of_a_library_keep_every_bit():
    assert {"-ffp-contract=off", "-fvisibility=hidden"} < set(LIBRARY_FLAGS)
    for file in ("ecu", "plant-3"):
        build = opened(UNITS[file]())["sources/buildDescription.xml"].decode()
        assert "-ffp-contract=off" in build
