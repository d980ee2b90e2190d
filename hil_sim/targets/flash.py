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
    floor_of,
    foreign_content,
    make_command,
    port_name,
    with_calibration,
    with_floor,
)

_LINKED_FILES = {b"\x7fELF": "an ELF file", b":": "an Intel HEX file"}


class Flash:
    """Flash of one target in a file. Whatever is refused leaves it as it was."""

    def __init__(self, path: Path, target: str) -> None:
        self.path = path
        self._target = target

    def program(
        self,
        image: Path | None = None,
        calibration: Path | None = None,
        allow_older: bool = False,
    ) -> None:
        """Take over a whole image, a calibration part, or both at once.

        From then on the board takes no older firmware; with allow_older it takes this one, however
        old it is. Raises InputError for what the boot stage would not start, and for a calibration
        whose content is not that of the model and preset that it names, where these ship.
        """
        content = self._content() if image is None else self._read(image)
        for start, kind in _LINKED_FILES.items():
            if content.startswith(start):
                raise InputError(f"{image}: is {kind}; give the binary that lies beside it")
        origin = str(image or self.path)
        if image is not None:
            content = self._with_own_floor(content, allow_older)
        if calibration is None:
            check_image(content, self._target, origin)
        else:
            part = self._read(calibration)
            check_application(content, self._target, origin)
            check_calibration(part, content, str(calibration))
            content = with_calibration(content, part)
        present = Header.parse(calibration_of(content))
        hashes = f"{present.model_hash:08x}", f"{present.preset_hash:08x}"
        foreign = foreign_content(*hashes, present.content_hash)
        if foreign is not None:
            raise InputError(f"{calibration or origin}: {foreign}")
        self._write(content)

    def headers(self) -> tuple[Header, Header]:
        """Headers of application and calibration; InputError for what would not start."""
        image = self._content()
        check_image(image, self._target, str(self.path))
        application = image[MEMORY_MAP.application.address :]
        return Header.parse(application), Header.parse(calibration_of(image))

    def _with_own_floor(self, image: bytes, allow_older: bool) -> bytes:
        """The image with the oldest version that the board takes from now on.

        A board whose record is damaged takes none without being asked to; an image with a damaged
        one is left as it is, and so refused.
        """
        start = MEMORY_MAP.application.address
        if len(image) < MEMORY_MAP.application.end:
            return image  # is refused for its length
        version = Header.parse(image[start:]).firmware_version
        if allow_older:
            return with_floor(image, version)
        try:
            given = floor_of(image)
        except ValueError:
            return image
        try:
            present = floor_of(self._content()) if self.path.exists() else 0
        except ValueError as error:
            raise InputError(
                f"{self.path}: the oldest firmware that the board takes is not known ({error}); "
                "take this one all the same by --allow-older"
            ) from None
        return with_floor(image, max(version, given, present))

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
