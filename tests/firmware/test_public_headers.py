"""The public headers stand alone in C and in C++, and what they declare links from C++."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from bms.decision import ACTIVE_CONSTRAINTS
from bms.firmware import Firmware
from bms.native_build import CORE_FOLDERS, FIRMWARE, FLAGS, ROOT, declarations
from tests.firmware.ports import IS_CI

INCLUDES = [f"-I{ROOT / folder}" for folder in FIRMWARE.folders]
PUBLIC = [ROOT / header for header in FIRMWARE.headers]
USED_BY_CALLERS = [*PUBLIC, *sorted((ROOT / "firmware_c/generated").glob("*.h"))]
WARNINGS = ("-pedantic", "-Wall", "-Wextra", "-Werror")
NEEDS_CXX = pytest.mark.skipif(
    shutil.which("g++") is None and not IS_CI, reason="not run: g++ is not installed"
)
LANGUAGES = {
    "C99": ("gcc", "-std=c99", "-xc"),
    "C++11": ("g++", "-std=c++11", "-xc++"),
    "C++20": ("g++", "-std=c++20", "-xc++"),
}

CONTROL = """
#include <cstdio>
#include "bms.h"
int main()
{
    const float inputs[KAN_MEASURED_INPUTS] = { -20.0f, 0.25f, 310.0f, 300.0f };
    const kan_estimate_t estimate = kan_evaluate(&BMS_DEFAULT_CALIBRATION.kan, inputs);
    rcbf_input_t input = {};
    input.core_temperature_K.high_K = estimate.core_temperature_K;
    input.surface_temperature_K.high_K = 310.0f;
    input.coolant_temperature_K.high_K = 300.0f;
    input.cooling_power_W = 0.25f;
    input.soc = 0.5f;
    input.reference_current_A = -23.0f;
    const rcbf_decision_t decision = rcbf_solve(&BMS_DEFAULT_CALIBRATION.rcbf, &input);
    std::printf("%a %d %a %d\\n", estimate.core_temperature_K, estimate.in_domain,
                decision.current_A, decision.active);
}
"""


def test_every_header_of_the_core_is_a_public_one() -> None:
    assert {*(ROOT / "firmware_c/include").glob("*.h")} <= {*PUBLIC}


@NEEDS_CXX
@pytest.mark.parametrize("language", LANGUAGES)
def test_each_header_compiles_alone(language: str) -> None:
    for header in USED_BY_CALLERS:
        command = [*LANGUAGES[language], *WARNINGS, *INCLUDES, "-fsyntax-only", "-"]
        done = subprocess.run(
            command,
            input=f'#include "{header.name}"\n',
            text=True,
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, f"{header.name}: {done.stderr}"


def linked(
    folder: Path, program: str, library: Path, first: tuple[Path, ...] = ()
) -> subprocess.CompletedProcess[str]:
    """Compiles and links a C++ program; headers in the folders `first` come before the others."""
    source = folder / "main.cpp"
    source.write_text(program)
    command = ["g++", "-std=c++11", *WARNINGS, *(f"-I{f}" for f in first), *INCLUDES, str(source)]
    command += [str(library), "-lm", "-o", str(folder / "main")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def all_functions() -> str:
    """A program that needs the address of every function that a public header declares."""
    names = [name for header in PUBLIC for name in re.findall(r"(\w+)\(", declarations(header))]
    assert {"kan_evaluate", "rcbf_solve", "bms_step", "soc_count", "image_crc32"} < {*names}
    includes = "".join(f'#include "{header.name}"\n' for header in PUBLIC)
    uses = ",\n    ".join(f"reinterpret_cast<function>({name})" for name in names)
    return f"""{includes}
typedef void (*function)();
extern const function functions[] = {{
    {uses}
}};
int main() {{ return functions[0] == nullptr; }}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The core, image checks and what the host needs, compiled as C."""
    folder = tmp_path_factory.mktemp("core")
    sources = [path for path in FIRMWARE.files() if path.suffix == ".c"]
    subprocess.run(["gcc", *FLAGS, "-O0", *INCLUDES, "-c", *sources], cwd=folder, check=True)
    subprocess.run(["ar", "rc", "libcore.a", *folder.glob("*.o")], cwd=folder, check=True)
    return folder / "libcore.a"


@NEEDS_CXX
def test_a_program_in_c_plus_plus_gets_the_estimates_and_decisions_of_the_firmware(
    tmp_path: Path, library: Path
) -> None:
    done = linked(tmp_path, CONTROL, library)
    assert done.returncode == 0, done.stderr
    printed = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout
    core_K, in_domain, current_A, active = printed.split()

    firmware = Firmware(preset="paper_calibrated")
    conditions = {
        "surface_temperature_K": 310.0,
        "coolant_temperature_K": 300.0,
        "cooling_power_W": 0.25,
    }
    estimate = firmware.estimate(current_A=-20.0, **conditions)
    decision = firmware.solve(
        soc=0.5,
        core_temperature_K=estimate.core_temperature_K,
        reference_current_A=-23.0,
        **conditions,
    )
    assert (float.fromhex(core_K), bool(int(in_domain))) == estimate
    assert float.fromhex(current_A) == decision.current_A < 0.0
    assert ACTIVE_CONSTRAINTS[int(active)] == decision.active_constraint


@NEEDS_CXX
def test_every_declared_function_links_from_c_plus_plus(tmp_path: Path, library: Path) -> None:
    done = linked(tmp_path, all_functions(), library)
    assert done.returncode == 0, done.stderr


@NEEDS_CXX
def test_a_header_without_its_guard_would_not_link(tmp_path: Path, library: Path) -> None:
    text = (ROOT / CORE_FOLDERS[0] / "kan.h").read_text(encoding="utf-8")
    (tmp_path / "kan.h").write_text(
        re.sub(r"#ifdef __cplusplus\n.*?#endif\n", "", text, flags=re.S)
    )
    done = linked(tmp_path, all_functions(), library, (tmp_path,))
    assert done.returncode != 0
    assert "undefined reference to `kan_evaluate(" in done.stderr
