"""Builds bms.firmware._firmware: the C core of firmware_c/ behind cffi (API mode).

The declarations are read from the headers themselves, so that binding and firmware cannot differ.
Run by setuptools on installation; `python -m bms.firmware.build --help` builds variants.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from cffi import FFI

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = Path("firmware_c")
MODULE = "bms.firmware._firmware"
HEADERS = (
    *("kan", "rcbf", "thermal", "calibration", "can_frame", "e2e", "codec", "monitor", "soc"),
    *("history", "network", "bms"),
)
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")

# What a host needs beyond the firmware: constants by address, and its functions by the thousand.
_HOST_DECLARATIONS = """
const bms_calibration_t *host_default_calibration(void);
const fault_policy_t *host_fault_policies(void);
const codec_message_t *host_transmitted_messages(void);
uint32_t host_transmitted_count(void);
void host_estimate_rows(const kan_model_t *model, const float *inputs, uint32_t rows,
                        float *core_temperature_K, uint8_t *in_domain);
void host_edge_values(const kan_model_t *model, uint32_t edge, const float *arguments,
                      uint32_t count, float *values, uint8_t *in_domain);
void host_decide_rows(const rcbf_constants_t *constants, const rcbf_input_t *inputs, uint32_t rows,
                      float *current_A);
uint32_t host_run_periods(bms_t *bms, const can_frame_t *received, uint32_t frames_a_period,
                          uint32_t periods, float *command_A);
"""
_HOST_SOURCE = """
#include "bms.h"
#include "can_catalog.h"
#include "image.h"

static const bms_calibration_t *host_default_calibration(void)
{
    return &BMS_DEFAULT_CALIBRATION;
}

static const fault_policy_t *host_fault_policies(void)
{
    return MONITOR_POLICY;
}

static const codec_message_t *host_transmitted_messages(void)
{
    return CAN_TRANSMITTED;
}

static uint32_t host_transmitted_count(void)
{
    return CAN_TRANSMITTED_COUNT;
}

static void host_estimate_rows(const kan_model_t *model, const float *inputs, uint32_t rows,
                               float *core_temperature_K, uint8_t *in_domain)
{
    for (uint32_t i = 0u; i < rows; i++) {
        const kan_estimate_t estimate = kan_evaluate(model, &inputs[i * model->width[0]]);
        core_temperature_K[i] = estimate.core_temperature_K;
        in_domain[i] = estimate.in_domain ? 1u : 0u;
    }
}

static void host_edge_values(const kan_model_t *model, uint32_t edge, const float *arguments,
                             uint32_t count, float *values, uint8_t *in_domain)
{
    for (uint32_t i = 0u; i < count; i++) {
        bool inside = true;
        values[i] = kan_edge_value(model, edge, arguments[i], &inside);
        in_domain[i] = inside ? 1u : 0u;
    }
}

static void host_decide_rows(const rcbf_constants_t *constants, const rcbf_input_t *inputs,
                             uint32_t rows, float *current_A)
{
    for (uint32_t i = 0u; i < rows; i++) {
        current_A[i] = rcbf_solve(constants, &inputs[i]).current_A;
    }
}

static uint32_t host_run_periods(bms_t *bms, const can_frame_t *received, uint32_t frames_a_period,
                                 uint32_t periods, float *command_A)
{
    can_frame_t sent;
    uint32_t frames_sent = 0u;
    for (uint32_t period = 0u; period < periods; period++) {
        for (uint32_t i = 0u; i < frames_a_period; i++) {
            bms_receive(bms, received++);
        }
        bms_step(bms);
        while (bms_transmit(bms, &sent)) {
            frames_sent++;
        }
        command_A[period] = bms->command_A;
    }
    return frames_sent;
}
"""


def declarations(header: Path) -> str:
    """What cffi needs of a header: no comments, preprocessor lines or constant objects."""
    text = re.sub(r"/\*.*?\*/", "", header.read_text(encoding="utf-8"), flags=re.DOTALL)
    lines = (line for line in text.splitlines() if not re.match(r"extern|#(?!define \w+ \d)", line))
    return "\n".join(lines)


def make_builder(flags: tuple[str, ...] = FLAGS, tree: Path | None = None) -> FFI:
    """Builder of the extension from tree/firmware_c.

    Without a tree it is the repository, with paths relative to it as setuptools wants them.
    """
    builder = FFI()
    home, base = (ROOT, Path()) if tree is None else (tree.resolve(), tree.resolve())
    headers = [home / FIRMWARE / "include" / f"{name}.h" for name in HEADERS]
    headers.append(home / FIRMWARE / "image" / "image.h")
    builder.cdef("\n".join(declarations(header) for header in headers))
    builder.cdef(_HOST_DECLARATIONS)
    folders = [FIRMWARE / name for name in ("include", "src", "generated", "image")]
    sources = [path for folder in folders for path in sorted((home / folder).glob("*.c"))]
    builder.set_source(
        MODULE,
        _HOST_SOURCE,
        sources=[str(base / path.relative_to(home)) for path in sources],
        include_dirs=[str(base / folder) for folder in folders],
        extra_compile_args=list(flags),
        extra_link_args=[flag for flag in flags if flag.startswith("-fsanitize")],
    )
    return builder


def main() -> None:
    """Build a variant of the extension into a folder, beside the installed one."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the extension")
    parser.add_argument("--tree", type=Path, default=ROOT, help="folder that holds firmware_c")
    parser.add_argument("--sanitize", action="store_true", help="address and undefined behaviour")
    arguments = parser.parse_args()
    flags = (*FLAGS, *SANITIZERS) if arguments.sanitize else FLAGS
    print(make_builder(flags, arguments.tree).compile(tmpdir=str(arguments.out)))


if __name__ == "__main__":
    main()
else:
    ffibuilder = make_builder()
