"""The corpora of the fuzz targets, written from what each seed is for.

    python -m tests.firmware.fuzz.seeds

Replaces tests/firmware/fuzz/corpus; what a byte means is told by the targets in C.
"""

from __future__ import annotations

import shutil
import struct
from collections.abc import Iterator

from bms.firmware._firmware import ffi
from tests.firmware.fuzz.build import CORPUS

_NAN = 0x80
_FLUSH, _TAKE, _SEND, _AGAIN = b"\xf0", b"\xf1", b"\xf2", b"\xf3"


# --- session: what a charge's partner does (session_target.c) ------------------------------------


def _run(periods: int) -> bytes:
    return bytes((0, periods - 1))


def _request(choice: int) -> bytes:
    return bytes((1, choice))


def _silence(messages: int, periods: int) -> bytes:
    return bytes((2, messages, periods - 1))


def _wrong(value: int, by: int, periods: int) -> bytes:
    return bytes((3, value, by & 255, periods - 1))


_START = bytes((0x50, 0x50)) + _run(12) + _request(1) + _run(30)


def _session() -> Iterator[tuple[str, bytes]]:
    yield "charge", bytes((0x40, 0x50)) + _run(12) + _request(1) + _run(250)
    yield "full", bytes((0xF6, 0x50)) + _run(12) + _request(1) + _run(250) + _request(0) + _run(5)
    yield "modes", bytes((0x40, 0x50)) + _run(12) + _request(3) + _run(99) + _request(11) + _run(99)
    yield "off", _START + _request(0) + _run(9) + _request(1) + _run(30)
    yield "restart in a charge", _START + bytes((10,)) + _run(60)
    yield "nothing comes", _START + bytes((8, 7)) + _run(9)
    for message in range(5):
        yield f"message {message} missing", _START + _silence(1 << message, 5) + _run(9)
        yield f"message {message} flipped", _START + bytes((9, message, 20)) + _run(9)
        counter = bytes((7, message, 9))
        yield f"message {message} counts anew", _START + counter + _run(9)
        yield f"message {message} repeated", _START + bytes((6, message)) * 3 + _run(9)
    for value in range(10):
        yield f"value {value} none", _START + _wrong(value, _NAN, 2) + _run(20)
        yield f"value {value} high", _START + _wrong(value, 90, 2) + _run(20)
    yield "less is asked for", _START + _wrong(5, 44, 9) + _run(20)
    yield "current beside the command", _START + _wrong(0, 20, 9) + _run(20)
    yield "hot", _START + bytes((11, 0x50, 0xA0)) + _run(30)
    yield "long frame", _START + bytes((4, 0x00, 0x01, 200)) + bytes(8) + _run(5)
    yield "short frame", _START + bytes((4, 0x00, 0x01, 1)) + bytes(8) + _run(5)
    yield (
        "forged",
        _START + b"".join(bytes((5, m)) + b"\x7f" * 6 + b"\x11" for m in range(5)) + _run(9),
    )
    yield "at once", bytes((0x50, 0x50)) + _request(1) + _run(60)


# --- clock (clock_target.c) ----------------------------------------------------------------------

_ON, _OFF, _SYNC = bytes((13,)), bytes((5,)), bytes((4,))


def _clock() -> Iterator[tuple[str, bytes]]:
    def origin(time_ms: int) -> bytes:
        return struct.pack("<I", time_ms)

    def jump(by_ms: int) -> bytes:
        return b"\x03" + struct.pack("<I", by_ms & 0xFFFFFFFF)

    charge = bytes((0, 12)) + _ON + bytes((0, 30))
    yield "own clock", origin(5) + charge + bytes((0, 99))
    yield "lock step", origin(5) + bytes((1, 12)) + _ON + bytes((1, 60))
    yield "the clock wraps around", origin(0xFFFFFC00) + charge
    yield "foreign SYNC", origin(5) + charge + _SYNC * 9 + bytes((0, 20))
    yield (
        "SYNC ends",
        origin(5) + bytes((1, 12)) + _ON + bytes((1, 30)) + jump(6000) + bytes((0, 9)),
    )
    yield "SYNC is late", origin(5) + _SYNC + bytes((2, 1))
    yield "stall", origin(5) + charge + jump(30_000) + bytes((0, 9))
    yield "time goes back", origin(50_000) + charge + jump(-20_000) + bytes((0, 9))
    yield "time stands", origin(5) + charge + b"\x07\x07\x07" + b"\x02\x00" * 9
    yield "late", origin(5) + charge + b"\x02\x28\x07\x02\x28" * 9 + b"\x02\xff" * 3
    yield "another frame first", origin(5) + bytes((6, 0x23, 0x01, 2, 7, 7)) + b"\x02\x64" * 9


# --- slcan (slcan_target.c) ----------------------------------------------------------------------


def _slcan() -> Iterator[tuple[str, bytes]]:
    open_, frame = b"O\r", b"t1232ABCD\r"
    yield "frames", b"\x00" + open_ + frame + b"t7FF80102030405060708\r" + _FLUSH + _TAKE
    yield "twelve bits", b"\x00" + open_ + b"t8000\rtFFF100\r" + _FLUSH
    yield "nine bytes", b"\x00" + open_ + b"t1009" + b"00" * 9 + b"\rt100F" + b"0" * 16 + b"\r"
    yield (
        "short and long",
        b"\x00" + open_ + b"t\rt1\rt1231\rt12310\rt1231000\rt1230\r" + b"0" * 40 + b"\r",
    )
    yield "no digits", b"\x00" + open_ + b"t12G0\rt123x\rt1231g0\rt1231/:\r"
    yield "closed", b"\x00" + frame + open_ + frame + b"C\r" + frame + _FLUSH
    yield "commands", b"\x00S6\rs0\rZ1\rL\rF\rV\rN\rT00000001100\rr1230\rX\r\r" + _TAKE
    yield "sent", b"\x00" + open_ + _FLUSH + (_SEND + b"\x23\x01\x02\xab\xcd") * 3 + _TAKE
    yield "sent while closed", b"\x00" + _SEND + b"\x23\x01\x02\xab\xcd" + _TAKE
    yield (
        "nobody reads",
        b"\x20"
        + open_
        + _FLUSH
        + (_SEND + b"\xff\x07\x08" + bytes(8)) * 60
        + _TAKE
        + _FLUSH
        + _TAKE,
    )
    yield (
        "nobody takes",
        b"\x20" + open_ + frame + _AGAIN + b"x\xff" + b"\r" + frame * 3 + _FLUSH + frame + _FLUSH,
    )
    yield (
        "cut off",
        b"\x20" + open_ + _AGAIN + b"\r\xcb" + b"\r" * 6 + frame * 2 + _FLUSH + frame + _FLUSH,
    )
    yield "many answers", b"\x20" + b"V\r" * 170 + _FLUSH + b"V\r" * 9 + _FLUSH + _TAKE


# --- image and calibration (image_target.c, calibration_target.c) --------------------------------

_HEADER = ffi.sizeof("image_header_t")
_FIXED = _HEADER + ffi.offsetof("bms_calibration_t", "kan") + ffi.offsetof("kan_model_t", "tables")


def _patches(*changes: tuple[int, int | float]) -> bytes:
    """Changes at offsets in bytes, a float as its bits."""
    words = b"".join(
        struct.pack("<Hf" if isinstance(value, float) else "<HI", offset // 4, value)
        for offset, value in changes
    )
    return bytes((len(changes),)) + words


def _image() -> Iterator[tuple[str, bytes]]:
    def field(name: str) -> int:
        return ffi.offsetof("image_header_t", name)

    def calibration(length: int, *changes: tuple[int, int | float], choice: int = 0) -> bytes:
        return bytes((choice,)) + struct.pack("<H", length) + _patches(*changes)

    def application(
        length: int,
        *changes: tuple[int, int],
        floor: tuple[int, int] = (0xFFFFFFFF, 0xFFFFFFFF),
        choice: int = 1,
    ) -> bytes:
        start = bytes((choice,)) + struct.pack("<H", length)
        return start + _patches(*changes) + struct.pack("<2I", *floor)

    layers = _HEADER + ffi.offsetof("bms_calibration_t", "kan")
    yield "calibration", calibration(0)
    for length in (1, 48, 56, 60, 64, 1000, layers, _FIXED - 4, _FIXED, _FIXED + 4):
        yield f"calibration of {length} bytes", calibration(length)
    yield "no layers, no model", calibration(layers, (layers, 0xFFFFFFFF))
    yield "damaged calibration", calibration(0, (200, 7), choice=4)
    yield "edited calibration", calibration(0, (200, 7), choice=12)
    for name in (
        "magic",
        "length",
        "header_layout",
        "target",
        "firmware_version",
        "calibration_layout",
    ):
        yield f"calibration with another {name}", calibration(0, (field(name), 1))
        yield f"application with another {name}", application(192, (field(name), 129))
    for name in ("calibration_length", "model_hash", "preset_hash"):
        yield f"calibration with another {name}", calibration(0, (field(name), 1))
    yield "block of another layout", calibration(0, (_HEADER, 4))
    yield "another number of layers", calibration(0, (layers, 1))
    yield "application", application(192)
    yield "damaged application", application(192, (180, 1), choice=5)
    yield "edited application", application(192, (180, 1), choice=13)
    for length in (0, 48, 128, 132, 136):
        yield f"application of {length} bytes", application(length, (8, length))
    yield "application cut off", application(188)
    for top in (0x20000000, 0x20001004, 0x20001008, 0x1FFFFFF8):
        yield f"stack at {top:08x}", application(192, (128, top))
    for start in (0x1000, 0x1001, 0x1080, 0x107F, 0x10C1, 0x10BF):
        yield f"start at {start:08x}", application(192, (132, start))
    yield "at the floor", application(192, floor=(4, 0xFFFFFFFB))
    yield "below the floor", application(192, floor=(5, 0xFFFFFFFA))
    yield "damaged floor", application(192, floor=(3, 0xFFFFFFFB))
    for length in (0, 1, 3, 4, 8, 40):
        yield f"boot stage of {length} bytes", b"\x02" + bytes(range(length))
    yield "damaged boot stage", b"\x06" + bytes(range(40))


_RAISED = {
    "reference_current_A": -4000.0,
    "sampling_period_s": 11.0,
    "completion_soc": 1.5,
    "current_growth_A": 4000.0,
    "soc_error": -1.0,
    "rcbf.max_soc": 1e30,
    "rcbf.capacity_As": 1e-3,
    "rcbf.max_voltage_V": 4.6,
    "rcbf.max_core_temperature_K": 449.0,
    "rcbf.max_surface_temperature_K": 449.0,
    "rcbf.estimation_error_bound_K": -1.0,
    "rcbf.ohmic_resistance_ohm": 0.0,
    "rcbf.a3_K_per_A2s": 0.0,
    "plausibility.voltage_overshoot_V": 1e30,
    "plausibility.temperature_overshoot_K": 1e30,
}
"""A number that the envelope refuses, for some of the fields of a calibration."""


def _calibration() -> Iterator[tuple[str, bytes]]:
    def offset(path: str) -> int:
        return ffi.offsetof("bms_calibration_t", *path.split("."))

    charge = bytes((0x50, 0x60, 0x78))
    for choice, name in enumerate(("one cell", "family")):
        yield name, bytes((choice,)) + _patches() + charge
        yield f"{name}, fastest", bytes((choice | 4,)) + _patches() + charge
        yield f"{name}, disturbed", bytes((choice,)) + _patches() + charge + bytes(range(60))
        kan = offset("kan")
        for word in range(4):
            patches = _patches((kan + 4 * word, 0x7FFFFFFF))
            yield f"{name}, size {word} of the model", bytes((choice,)) + patches + charge
    yield "nothing", b""
    yield "zeros", b"\x02" + _patches() + charge
    yield "raw and short", b"\x03\x00" + bytes(16)
    for path, value in _RAISED.items():
        yield f"{path} beyond", b"\x00" + _patches((offset(path), value)) + charge
        yield f"{path} none", b"\x00" + _patches((offset(path), float("nan"))) + charge
    points = offset("rcbf.ocv_points")
    yield "points beyond the table", b"\x00" + _patches((points, 100_000)) + charge
    yield "no points", b"\x00" + _patches((points, 0)) + charge
    yield "steep", b"\x00" + _patches((offset("rcbf.ocv_V") + 8, 1e-40)) + charge
    yield "layout", b"\x00" + _patches((0, 4)) + charge


def corpora() -> dict[str, dict[str, bytes]]:
    """Every seed by target and file name."""
    made = {
        "session": _session(),
        "clock": _clock(),
        "slcan": _slcan(),
        "image": _image(),
        "calibration": _calibration(),
    }
    return {
        target: {name.replace(" ", "-").replace(",", ""): content for name, content in seeds}
        for target, seeds in made.items()
    }


if __name__ == "__main__":
    shutil.rmtree(CORPUS, ignore_errors=True)
    for target, files in corpora().items():
        (CORPUS / target).mkdir(parents=True)
        for name, content in files.items():
            (CORPUS / target / name).write_bytes(content)
