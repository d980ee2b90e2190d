"""Every command where users have it hard, all of it at once.

A terminal of 60 columns; an ordinary user who may write neither the installation nor his home;
LANG=C without UTF-8; a folder whose name has blanks. What a command does is tested elsewhere; here
it must do it without a traceback, without a note of a library, and without a figure cut off.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from bms.model.model_file import shipped_model_path
from bms.presets.authoring.form import form
from tests.bms.kan_samples import write_recording
from tests.firmware.ports import built, needs_emulator
from tests.hil_sim.dashboard_page import needs_page

pytestmark = pytest.mark.slow

COLUMNS = 60
ROOT = Path(__file__).parents[1]
GOLDEN = ROOT / "tests" / "hil_sim" / "golden"
MODEL = shipped_model_path("lin2014")
NOBODY = "65534"
MAIN = "from bms.cli import main; main()"
PATIENCE_S = 120.0
BUS = "udp_multicast:239.74.163.89"

EXTRAS = {
    "plating": "pybamm", "optimum": "cvxpy", "compare-charges": "cvxpy", "tune": "cvxpy",
}  # fmt: skip
MARKS = {"flash": needs_emulator, "dashboard": needs_page}
Started = subprocess.Popen[bytes]

COMMANDS: dict[str, tuple[int, str]] = {
    "sil": (1, "--max-time-s 5 --baseline s-cbf --out DIR/out --log DIR/run.asc"),
    "ecu": (0, f"--bus {BUS} --silence-s 1"),
    "plant": (1, f"--bus {BUS} --max-time-s 1 --answer-timeout-s 20 --out DIR/out"),
    "monitor": (0, f"--bus {BUS} --for-s 0.2"),
    "dashboard": (0, f"--bus {BUS} --port 0 --for-s 0.2"),
    "replay": (0, "GOLDEN/message_loss.log.gz"),
    "fault-matrix": (0, "--rows once --jobs 2 --out DIR/out"),
    "campaign": (0, "--runs 2 --jobs 2 --max-time-s 5 --out DIR/out"),
    "pack": (1, "--cells 3 --packs 2 --jobs 2 --max-time-s 5 --out DIR/out"),
    "pack-budget": (0, "--cells 16"),
    "reproduce": (0, "--max-time-s 1 --jobs 2 --out DIR/out"),
    "bench": (0, "--quick --section period"),
    "plating": (0, "--temperatures 288.15,298.15 --soc 0,0.6,1 --out DIR/map.toml"),
    "verify": (1, "--boxes 50"),
    "verify-tables": (0, "--stride 10000000 --processes 1"),
    "export": (0, "--preset lin2014 --out DIR/out"),
    "train": (0, "--data DIR/run.csv --lagged --out DIR/model.json"),
    "optimum": (0, "--preset lin2014 --samples 20 --no-ramp --out DIR/out"),
    "compare-charges": (1, "--what family --runs 1 --jobs 1 --out DIR/out"),
    "tune": (0, "--preset lin2014 --gap"),
    "evaluate": (0, "--model MODEL --data DIR/run.csv"),
    "explain": (0, "--model MODEL --data DIR/run.csv --out DIR/out"),
    "bound": (1, "--model MODEL --data DIR/run.csv --out DIR/out"),
    "compare-estimators": (0, "--preset lin2014 --quick --profiles 1 --out DIR/out"),
    "identify": (1, "--data DIR/run.csv"),
    "import-pykan": (0, "DIR/net --out DIR/model.json"),
    "cell": (2, "--preset DIR/form.toml --out DIR/out"),
    "preset new": (0, "my_cell --out DIR/cell.toml"),
    "preset check": (1, "DIR/form.toml"),
    "preset show": (0, "a123_26650"),
    "preset diff": (0, "lin2014 paper_calibrated"),
    "flash": (0, "--image IMAGE/firmware.bin --flash DIR/flash.bin --no-start"),
    "evidence": (2, "--out DIR/run.csv"),
    "cost": (2, "--target qemu:mps2-an386 --out DIR/cost.png"),
    "compare-targets": (2, "--target qemu:mps2-an386 --rows lost --build DIR"),
}
"""Exit code and arguments by command; MODEL, IMAGE and the like are places."""


def ordinary_users() -> list[list[str]]:
    """Ways to start a command as one, the strictest first.

    The interpreter may lie where only the superuser looks, as under /root. Then another user gets
    the right to look everywhere, which changes nothing for what he may write; and where no such
    right can be given, the superuser at least loses all of his.
    """
    if os.geteuid() != 0:
        return [[]]
    nobody = ["setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups"]
    look = "-all,+dac_read_search"
    return [
        [*nobody, "--bounding-set=-all", "--inh-caps=-all"],
        [*nobody, f"--inh-caps={look}", f"--ambient-caps={look}", f"--bounding-set={look}"],
        ["setpriv", "--bounding-set=-all", "--inh-caps=-all"],
    ]


def is_possible(prefix: list[str]) -> bool:
    """Whether the interpreter of this process starts, and finds itself where it is."""
    look = "import sys, numpy, bms; print(sys.base_prefix, sys.executable)"
    try:
        done = subprocess.run(
            [*prefix, sys.executable, "-c", look], cwd="/", capture_output=True, check=False
        )
    except FileNotFoundError:  # no setpriv
        return False
    return done.stdout.decode().split("\n")[0] == f"{sys.base_prefix} {sys.executable}"


@pytest.fixture(scope="module")
def user() -> list[str]:
    """What a command begins with so that an ordinary user runs it."""
    possible = [prefix for prefix in ordinary_users() if is_possible(prefix)]
    if not possible:
        pytest.skip("not run: the superuser may write everything, and there is no setpriv")
    return possible[0]


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder of the user's own, and in it a home that he may not write."""
    # Not below pytest's, which is its owner's alone.
    base = Path(tempfile.mkdtemp(prefix="hard places "))
    base.chmod(0o755)
    own = base / "a folder with blanks"
    own.mkdir()
    (base / "home").mkdir(mode=0o555)
    yield own
    shutil.rmtree(base)


def environment(folder: Path) -> dict[str, str]:
    return {
        "PATH": os.environ["PATH"],
        "HOME": str(folder.parent / "home"),
        "LANG": "C",
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "COLUMNS": str(COLUMNS),
    }


def start(user: list[str], folder: Path, *words: str, program: str = MAIN) -> Started:
    if "--reuid" in user:
        for path in (folder, *folder.rglob("*")):
            os.chown(path, int(NOBODY), int(NOBODY))
    return subprocess.Popen(
        [*user, sys.executable, "-c", program, *words], cwd=folder, env=environment(folder),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def check(started: Started, code: int) -> str:
    """What a command printed, once it has ended as it should."""
    with started:
        try:
            # ASCII is what this locale knows; anything else would be noise on its terminal.
            out, err = (said.decode("ascii") for said in started.communicate(timeout=PATIENCE_S))
        finally:
            started.kill()
    assert started.returncode == code, out + err
    # Words of ours alone: how far it is, why not, or what the result is worth.
    assert [line for line in err.splitlines() if not line.startswith("bms: ")] == []
    assert code != 2 or err.count("\n") == 1
    assert "~" not in out, "something is cut off"
    rules = [line for line in out.splitlines() if re.fullmatch("[-+]+", line.strip())]
    assert all(len(line) <= COLUMNS for line in rules), "a table is wider than the terminal"
    return out


def arguments(text: str, folder: Path) -> list[str]:
    """Words with their places; what the command reads is put there."""
    if "run.csv" in text:
        write_recording(folder / "run.csv")
    if "DIR/form.toml" in text:
        (folder / "form.toml").write_text(form("my_cell"), encoding="utf-8")
    if "DIR/net" in text:
        kan = pytest.importorskip("kan", reason="not run: pykan is not installed")
        kan.KAN(width=[4, 1], grid=2, k=3, seed=1, auto_save=False).saveckpt(str(folder / "net"))
    if "IMAGE" in text:
        text = text.replace("IMAGE", str(built("mps2_an386")))
    words = text.replace("GOLDEN", str(GOLDEN)).replace("MODEL", str(MODEL)).split()
    # Split first: the folder has blanks.
    return [word.replace("DIR", str(folder)) for word in words]


def test_no_command_is_left_out() -> None:
    assert {name.split()[0] for name in COMMANDS} == {
        entry.name for entry in entry_points(group="bms.commands")
    }


def test_this_user_may_write_neither_home_nor_installation(user: list[str], folder: Path) -> None:
    try_home = "import pathlib; pathlib.Path.home().joinpath('x').touch()"
    done = subprocess.run(
        [*user, sys.executable, "-c", try_home], env=environment(folder), capture_output=True,
        check=False,
    )  # fmt: skip
    assert b"PermissionError" in done.stderr


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=MARKS.get(name, ()))
        for name in COMMANDS
        if name not in {"ecu", "plant"}
    ],
)
def test_command(name: str, user: list[str], folder: Path) -> None:
    if name in EXTRAS:
        pytest.importorskip(EXTRAS[name], reason=f"not run: {EXTRAS[name]} is not installed")
    code, text = COMMANDS[name]
    check(start(user, folder, *name.split(), *arguments(text, folder)), code)


def test_ecu_and_plant(user: list[str], folder: Path) -> None:
    started = {
        name: (start(user, folder, name, *arguments(text, folder)), code)
        for name, (code, text) in COMMANDS.items()
        if name in {"ecu", "plant"}
    }
    for process, code in started.values():
        check(process, code)


HELP = """
import sys
from bms.cli import main
for command in sys.argv[1:]:
    sys.argv = ["bms", *command.split(), "--help"]
    try:
        main()
    except SystemExit as end:
        assert not end.code, (command, end.code)
"""


def test_help(user: list[str], folder: Path) -> None:
    with start(user, folder, "", *COMMANDS, program=HELP) as started:
        out, err = (said.decode("ascii") for said in started.communicate(timeout=PATIENCE_S))
    assert (started.returncode, err) == (0, "")
    assert out.count("Example: bms") == 1 + len(COMMANDS)
    assert max(map(len, out.splitlines())) <= COLUMNS
    # A name may be cut in the list of options, a number may not.
    assert re.findall(r"(?<![\w:-])[\d.=<]+~", out) == []
