"""Generated C: regenerating gives the same bytes, and what goes wrong leaves nothing behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.errors import InputError, ModelMismatchError
from bms.model.model_file import load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from codegen.calibration_source import calibration_source
from codegen.can_document import can_document
from codegen.can_names import can_names
from codegen.can_sources import can_sources
from codegen.pack_database import pack_database
from codegen.pack_document import pack_document
from codegen.pack_sources import pack_sources
from codegen.rendering import float_literal, write_files

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "firmware_c"
GENERATED = FIRMWARE / "generated"


def regenerated() -> dict[str, str]:
    preset, model = load_preset(DEFAULT_PRESET), load_shipped_model(DEFAULT_PRESET)
    return {**can_sources(), **calibration_source(preset, model)}


def everything_regenerated() -> dict[str, str]:
    return {
        **regenerated(),
        **can_names(),
        "can.md": can_document(FIRMWARE),
        **pack_database(),
        **pack_sources(),
        "can-pack.md": pack_document(),
    }


def test_checked_in_sources_are_what_the_generator_writes() -> None:
    fresh = regenerated()
    assert {path.name for path in GENERATED.iterdir()} == set(fresh)
    for name, text in fresh.items():
        assert (GENERATED / name).read_text() == text, f"{name}: run 'make generate'"


def test_checked_in_document_of_the_bus_is_what_the_generator_writes() -> None:
    written = (ROOT / "docs" / "can.md").read_text(encoding="utf-8")
    assert written == can_document(FIRMWARE), "run 'make generate'"


def test_checked_in_names_of_the_bus_are_what_the_generator_writes() -> None:
    ((name, text),) = can_names().items()
    written = ROOT / "hil_sim" / "bus" / name
    assert written.read_text(encoding="utf-8") == text, "run 'make generate'"


def test_checked_in_database_tables_and_document_of_packs_are_what_the_generator_writes() -> None:
    places = {
        ROOT / "codegen" / "can": pack_database(),
        FIRMWARE / "pack" / "generated": pack_sources(),
        ROOT / "docs": {"can-pack.md": pack_document()},
    }
    for folder, fresh in places.items():
        for name, text in fresh.items():
            assert (folder / name).read_text(encoding="utf-8") == text, f"{name}: 'make generate'"


def test_generation_is_deterministic() -> None:
    assert everything_regenerated() == everything_regenerated()


def test_generated_files_say_where_they_come_from_and_carry_no_date() -> None:
    for name, text in {**regenerated(), **can_names(), **pack_sources()}.items():
        head = text[:600].lower()
        assert "generated" in head, name
        assert "202" not in head.split("sha-256")[0], name


def test_a_model_of_another_cell_is_refused() -> None:
    preset = load_preset("lin2014")
    with pytest.raises(ModelMismatchError, match="train it again"):
        calibration_source(preset, load_shipped_model("paper_calibrated"))


def test_a_change_of_the_cell_makes_its_model_stale() -> None:
    preset = load_preset("lin2014")
    warmer = replace(preset, cell=replace(preset.cell, ohmic_resistance_ohm=0.02))
    with pytest.raises(ModelMismatchError):
        calibration_source(warmer, load_shipped_model("lin2014"))


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_float_literals_read_back_as_the_same_number(value: float) -> None:
    literal = float_literal(value)
    assert literal.endswith("f") and ("." in literal or "e" in literal)
    assert np.float32(float(literal[:-1])) == np.float32(value)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e39])
def test_numbers_beyond_float32_are_refused(value: float) -> None:
    with pytest.raises(InputError, match="float32"):
        float_literal(value)


def test_an_unwritable_folder_gets_nothing(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        write_files(blocked / "out", {"a.c": "x"})
    assert blocked.read_text() == "in the way"


def test_all_files_or_none(tmp_path: Path) -> None:
    (tmp_path / "b.c").mkdir()
    (tmp_path / "b.c" / "x").touch()
    (tmp_path / "a.c").write_text("old")
    with pytest.raises(InputError):
        write_files(tmp_path, {"a.c": "new", "b.c": "new"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.c", "b.c"]
    assert (tmp_path / "a.c").read_text() == "old"
