"""The targets by name: where their programs are built, and how to replay recordings on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

from bms.errors import InputError
from bms.image import TARGETS as BOARDS
from bms.image import calibration_part, make_command, port_name, with_calibration
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from hil_sim.bus.buses import open_bus
from hil_sim.replay.engine import replay
from hil_sim.replay.identity import choose_pair
from hil_sim.replay.recording import LAST_MESSAGE, Answer, Recording
from hil_sim.targets.linux import replay_on_linux, require_interface
from hil_sim.targets.qemu import Emulation, require_emulator
from hil_sim.targets.remote import RemoteEcu

BUILD = Path("build") / "firmware"
QEMU = "qemu:"
LINUX = "linux"
BOARD_NAMES = tuple(f"{QEMU}{board}" for board in sorted(BOARDS, reverse=True))
DEFAULT_BOARD = f"{QEMU}mps2-an386"
"""Whatever other boards there are."""
NAMES = (LINUX, *BOARD_NAMES)


class Target(Protocol):
    """A place where the firmware runs."""

    @property
    def name(self) -> str:
        """Name on the command line, one of NAMES."""
        ...

    def require_place(self) -> None:
        """Raise InputError where this machine lacks what the target runs on."""
        ...

    def replay(self, recordings: Sequence[Recording]) -> Iterable[list[Answer]]:
        """What the firmware answers there to each recording in lock step, started anew for each.

        Raises InputError or BusError.
        """
        ...


@dataclass(frozen=True)
class LinuxTarget:
    """The native program of `make firmware` as a process on vcan0."""

    name: str
    program: Path

    def require_place(self) -> None:
        """Raise InputError where there is neither vcan0 nor the guest that has one."""
        require_interface()

    def replay(self, recordings: Sequence[Recording]) -> list[list[Answer]]:
        """Answers of a process that is started anew for each recording."""
        return replay_on_linux(self.program, recordings)


@dataclass(frozen=True)
class QemuTarget:
    """An image on a board in QEMU.

    A recording of another preset or model than the default gets their calibration put into the
    image.
    """

    name: str
    board: str
    image: Path

    def require_place(self) -> None:
        """Raise InputError where QEMU is not installed."""
        require_emulator()

    @contextmanager
    def start(self, image: Path | None = None) -> Iterator[Emulation]:
        """A freshly started board, with another image than its own if given.

        Raises InputError when there is no QEMU and BusError when the board does not start.
        """
        with Emulation(image or self.image, self.board) as board:
            board.await_line()
            yield board

    def replay(self, recordings: Sequence[Recording]) -> Iterator[list[Answer]]:
        """Answers of a board that is started anew for each recording."""
        with TemporaryDirectory() as folder:
            for recording in recordings:
                last_id = recording.database[LAST_MESSAGE].frame_id
                image = self._calibrated(recording, Path(folder))
                with self.start(image) as board, open_bus(board.bus) as bus:
                    yield replay(recording, RemoteEcu(bus, last_id))

    def _calibrated(self, recording: Recording, folder: Path) -> Path:
        pair = choose_pair(recording, None, None)
        if pair == (DEFAULT_PRESET, None):
            return self.image
        image = folder / self.image.name
        part = calibration_part(*load_pair(*pair))
        image.write_bytes(with_calibration(self.image.read_bytes(), part))
        return image


def find_target(name: str, build: Path = BUILD) -> LinuxTarget | QemuTarget:
    """A target by its name, with what `make firmware` has built for it.

    Raises InputError for an unknown name, and when it has not been built.
    """
    if name not in NAMES:
        raise InputError(f"target '{name}': unknown; choose one of {', '.join(NAMES)}")
    if name == LINUX:
        return LinuxTarget(name, _built(build / LINUX / "bms_ecu", LINUX))
    board = name.removeprefix(QEMU)
    folder = built_folder(board, build)
    return QemuTarget(name, board, _built(folder / "firmware.bin", folder.name))


def built_folder(board: str, build: Path = BUILD) -> Path:
    """Where `make` builds for a board; its name is that of the port."""
    return build / port_name(board)


def find_board(name: str, build: Path = BUILD) -> QemuTarget:
    """A board by its name; InputError as find_target, and for a target that is no board."""
    target = find_target(name, build)
    if isinstance(target, QemuTarget):
        return target
    raise InputError(f"target '{name}': not a board; start it, then 'bms plant --bus BUS'")


def board_name(target: str) -> str:
    """The board of a target, mps2-an386 of qemu:mps2-an386; InputError when it is none."""
    if target not in BOARD_NAMES:
        raise InputError(f"target '{target}': unknown; choose one of {', '.join(BOARD_NAMES)}")
    return target.removeprefix(QEMU)


def _built(path: Path, port: str) -> Path:
    if not path.is_file():
        raise InputError(f"{path}: no such file; run '{make_command(port)}' first")
    return path
