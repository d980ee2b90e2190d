"""The emulated flash of a board: a file that holds an image from one start to the next."""

from __future__ import annotations

from pathlib import Path

from bms.errors import InputError
from bms.files import write_bytes
from bms.image import (
    MEMORY_MAP,
    Header,
    calibration_of,
    check_application,
    check_calibration,
    check_image,
    make_command,
    port_name,
    with_calibration,
)

_LINKED_FILES = {b"\x7fELF": "an ELF file", b":": "an Intel HEX file"}


class Flash:
    """Flash of one target in a file. Whatever is refused leaves it as it was."""

    def __init__(self, path: Path, target: str) -> None:
        self.path = path
        self._target = target

    def program(self, image: Path | None = None, calibration: Path | None = None) -> None:
        """Take over a whole image, a calibration part, or both at once.

        Raises InputError for what the boot stage would not start.
        """
        content = self._content() if image is None else self._read(image)
        for start, kind in _LINKED_FILES.items():
            if content.startswith(start):
                raise InputError(f"{image}: is {kind}; give the binary that lies beside it")
        origin = str(image or self.path)
        if calibration is None:
            check_image(content, self._target, origin)
        else:
            part = self._read(calibration)
            check_application(content, self._target, origin)
            check_calibration(part, content, str(calibration))
            content = with_calibration(content, part)
        self._write(content)

    def headers(self) -> tuple[Header, Header]:
        """Headers of application and calibration; InputError for what would not start."""
        image = self._content()
        check_image(image, self._target, str(self.path))
        application = image[MEMORY_MAP.application.address :]
        return Header.parse(application), Header.parse(calibration_of(image))

    def _content(self) -> bytes:
        if not self.path.exists():
            raise InputError(f"{self.path}: the flash is empty; program it with --image first")
        return self._read(self.path)

    def _read(self, path: Path) -> bytes:
        """Content of a file, as far as an image can be long; one byte more tells a longer one."""
        try:
            with path.open("rb") as file:
                return file.read(MEMORY_MAP.calibration.end + 1)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); images are made by "
                f"'{make_command(port_name(self._target))}', calibration parts by "
                "'bms export --out out/export'"
            ) from None

    def _write(self, image: bytes) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot be written ({error.strerror}); choose a folder that can"
            ) from None
        write_bytes(self.path, image)
