"""The fuzz targets: nothing in or near the corpora breaks a rule, and oracles see what does."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from tests.firmware.fuzz.build import TARGETS, Builder, Change, corpus_of, has_libfuzzer
from tests.firmware.fuzz.seeds import corpora
from tests.firmware.ports import needs_compiler

RUNS = {"session": 2000, "clock": 1000, "slcan": 20_000, "image": 20_000, "calibration": 2000}
LARGEST_CORPUS = 32_768

BROKEN = {
    "a fault that stands is no reason": (
        "session",
        "current while faulted",
        Change("src/bms.c", "is_charging(bms) && !bms->monitor.stop &&", "is_charging(bms) &&"),
    ),
    "what has latched does not stay": (
        "session",
        "current while faulted",
        Change("src/bms.c", "bms->monitor.latched != 0u) {\n", "bms->periods == UINT32_MAX) {\n"),
    ),
    "a reading that is no number passes for one within": (
        "session",
        "current with electrical readings",
        Change(
            "src/bms_symptoms.c",
            "((value >= range->low) && (value <= range->high))",
            "!((value < range->low) || (value > range->high))",
        ),
    ),
    "a message that is not there is not missed": (
        "session",
        "current with",
        Change("src/bms_symptoms.c", "!is_usable(bms, i), MISSING[i])", "false, MISSING[i])"),
    ),
    "a restart goes on charging": (
        "session",
        "a charge begins whose request was never off",
        Change(
            "src/bms.c",
            "(bms->state == BMS_STANDBY) && bms->may_start &&",
            "(bms->state == BMS_STANDBY) &&",
        ),
    ),
    "an end of a request is not seen": (
        "session",
        "current without a request",
        Change(
            "src/bms.c",
            "bms->state != BMS_FAULT) {\n            bms->state = BMS_STANDBY;",
            "bms->state == BMS_INIT) {",
        ),
    ),
    "what is asked for is no bound": (
        "session",
        "current",
        Change(
            "src/bms_growth.c", "numeric_larger(planned_A, asked_A)", "(0.0f * planned_A - 3e3f)"
        ),
    ),
    "growth has no bound": (
        "session",
        "current grows faster",
        Change(
            "src/bms_growth.c",
            "bms->command_A - bms->growth_A);\n    /*",
            "bms->command_A - 9.0f * bms->growth_A);\n    /*",
        ),
    ),
    "a long frame is read to its end": (
        "session",
        "AddressSanitizer",
        Change("src/e2e.c", "(length != expected_length)", "(length < expected_length)"),
    ),
    "a command repeats its counter": (
        "session",
        "counter does not follow",
        Change(
            "src/bms.c", "bms->counters[i]++;", "bms->counters[i] += (uint8_t)(bms->periods & 1u);"
        ),
    ),
    "any SYNC steps": (
        "clock",
        "a charge on its own clock steps by a foreign SYNC",
        Change("port/ecu_loop.c", "(loop->is_in_lock_step || !is_charging(&loop->bms))", "true"),
    ),
    "a period is due at once": (
        "clock",
        "more steps than the time has room for",
        Change("port/ecu_loop.c", "/ loop->period_ms + 1u)", "/ loop->period_ms)"),
    ),
    "a silence without end": (
        "clock",
        "sleeps for longer",
        Change(
            "port/ecu_loop.c",
            "port_time_ms() + ECU_LOOP_SYNC_SILENCE_MS",
            "port_time_ms() + 9u * ECU_LOOP_SYNC_SILENCE_MS",
        ),
    ),
    "identifiers of twelve bits": (
        "slcan",
        "an identifier above eleven bits",
        Change("port/slcan.c", "(frame->id > HIGHEST_IDENTIFIER)", "(frame->id > 0xFFFu)"),
    ),
    "nine bytes": (
        "slcan",
        "more than eight bytes",
        Change("port/slcan.c", "(length > MAX_DATA_LENGTH)", "(length > 10u)"),
    ),
    "lines of another length": (
        "slcan",
        "a frame that the host did not send",
        Change(
            "port/slcan.c",
            "(slcan->length != FRAME_HEAD + 2u * length)",
            "(slcan->length < FRAME_HEAD + 2u * length)",
        ),
    ),
    "frames while closed": (
        "slcan",
        "a frame that the host did not send",
        Change(
            "port/slcan.c",
            "(slcan->is_open && parse_frame(slcan, frame))",
            "parse_frame(slcan, frame)",
        ),
    ),
    "a full buffer takes more": (
        "slcan",
        "more bytes taken than were put",
        Change("port/ring.c", "if (ring_room(ring) == 0u)", "if (ring_room(ring) == UINT32_MAX)"),
    ),
    "losses are not counted": (
        "slcan",
        "a line lost in silence",
        Change("port/slcan_link.c", "link->lines_lost++;", ""),
    ),
    "half a frame is queued": (
        "slcan",
        "half a line for the host",
        Change(
            "port/slcan_link.c",
            "ring_room(&link->to_host) < length",
            "ring_room(&link->to_host) < 1u",
        ),
    ),
    "frames are lost uncounted": (
        "slcan",
        "a frame lost in silence",
        Change("port/slcan_link.c", "link->frames_lost++;", ""),
    ),
    "a model's sizes behind the part": (
        "image",
        "AddressSanitizer",
        Change("image/image.c", "(header->length < UP_TO_TABLES)", "false"),
    ),
    "a boot stage of three bytes": (
        "image",
        "AddressSanitizer",
        Change(
            "image/image.c",
            "if (place->length < sizeof(uint32_t))",
            "if (place->length > 1000000u)",
        ),
    ),
    "any checksum": (
        "image",
        "a damaged boot stage is taken",
        Change(
            "image/image.c",
            "== *crc32) ? IMAGE_OK : IMAGE_WRONG_CRC",
            "== *crc32) ? IMAGE_OK : IMAGE_OK",
        ),
    ),
    "any length": (
        "image",
        "AddressSanitizer",
        Change("image/image.c", "|| (header->length > place->length)", ""),
    ),
    "any hash": (
        "image",
        "an edited part is taken",
        Change(
            "image/image.c",
            "return (hash[0] == header->content_hash) &&",
            "return (hash[0] != hash[1]) ||",
        ),
    ),
    "any board": (
        "image",
        "an application for another board is taken",
        Change(
            "image/image.c", "if (header->target != target)", "if (header->target == 0u * target)"
        ),
    ),
    "any start": (
        "image",
        "a start outside of the part is taken",
        Change("image/image.c", "(is_stack_right && is_start_right)", "is_stack_right"),
    ),
    "any stack": (
        "image",
        "a stack outside of RAM is taken",
        Change("image/image.c", "(is_stack_right && is_start_right)", "is_start_right"),
    ),
    "any version": (
        "image",
        "an application older than the floor is taken",
        Change("image/image.c", "(application->firmware_version >= floor->version)", "true"),
    ),
    "any length of tables": (
        "image",
        "a calibration whose tables do not end with it is taken",
        Change(
            "image/image.c",
            "(header->length == sizeof *header + content_calibration_length(calibration)) &&",
            "",
        ),
    ),
    "any origin": (
        "image",
        "a calibration of another origin",
        Change("image/image.c", "(calibration->model_hash == header->model_hash) &&", ""),
    ),
    "any voltage": (
        "calibration",
        "a voltage beyond the envelope is taken",
        Change("src/calibration.c", "WITHIN(rcbf.max_voltage_V, 1.5f, 4.5f),", ""),
    ),
    "any current": (
        "calibration",
        "a current beyond the envelope is taken",
        Change("src/calibration.c", "WITHIN(reference_current_A, -3000.0f, -0.001f),", ""),
    ),
    "any temperature": (
        "calibration",
        "a temperature beyond the envelope is taken",
        Change(
            "src/calibration.c",
            "WITHIN(rcbf.max_surface_temperature_K.high_K, 253.0f, 353.0f),",
            "",
        ),
    ),
    "any overshoot": (
        "calibration",
        "an overshoot beyond the envelope is taken",
        Change("src/calibration.c", "WITHIN(plausibility.voltage_overshoot_V, 1e-6f, 0.3f),", ""),
    ),
    "any model": (
        "calibration",
        "runtime error",
        Change("src/calibration.c", "&&\n           kan_model_is_valid(&calibration->kan)", ""),
    ),
    "any cell": (
        "calibration",
        "AddressSanitizer",
        Change("src/calibration.c", "rcbf_constants_are_valid(&calibration->rcbf) &&", ""),
    ),
}

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Builder:
    return Builder(tmp_path_factory.mktemp("fuzz"), libfuzzer=False)


@pytest.fixture(scope="module")
def fuzzers(tmp_path_factory: pytest.TempPathFactory) -> Builder:
    return Builder(tmp_path_factory.mktemp("libfuzzer"), libfuzzer=True)


def run(command: list[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    """What a target says of its inputs, and its exit code."""
    return subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env={**os.environ, "ASAN_OPTIONS": "detect_leaks=0", "UBSAN_OPTIONS": ""},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_corpora_are_those_that_the_script_makes_and_small() -> None:
    made = corpora()
    assert set(made) == set(TARGETS)
    kept = {name: {p.name: p.read_bytes() for p in corpus_of(name)} for name in TARGETS}
    assert kept == made, "make them anew: python -m tests.firmware.fuzz.seeds"
    for target, files in made.items():
        assert sum(map(len, files.values())) < LARGEST_CORPUS, target
        assert len(set(files.values())) == len(files), "no seed twice"


@pytest.mark.parametrize("target", TARGETS)
def test_nothing_in_a_corpus_breaks_a_rule(target: str, programs: Builder, tmp_path: Path) -> None:
    done = run([programs.program(target), *corpus_of(target)], tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(
    not has_libfuzzer() and "CI" not in os.environ,
    reason="needs clang-19 of 'tools/debian_packages.sh gates'",
)
@pytest.mark.parametrize("target", TARGETS)
def test_nothing_that_grows_from_a_corpus_breaks_a_rule(
    target: str, fuzzers: Builder, tmp_path: Path
) -> None:
    program = fuzzers.program(target)
    seeds = corpus_of(target)[0].parent
    (tmp_path / "found").mkdir()
    options = [f"-runs={RUNS[target]}", "-seed=1", "-max_len=512", "-timeout=20"]
    done = run([program, *options, "found", seeds], tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]
    assert f"Done {RUNS[target]} runs" in done.stderr


@pytest.mark.parametrize("name", BROKEN)
def test_an_oracle_sees_a_broken_core(name: str, programs: Builder, tmp_path: Path) -> None:
    target, finding, change = BROKEN[name]
    done = run([programs.program(target, change), *corpus_of(target)], tmp_path)
    assert done.returncode != 0, "nobody noticed"
    assert finding in done.stderr
