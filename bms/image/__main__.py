"""`python -m bms.image`: the step between linker and image; run by the rules of the ports."""

from __future__ import annotations

import argparse
from pathlib import Path

from bms.firmware.calibration import used_bytes
from bms.image.seal import sealed_boot, sealed_headers


def main() -> None:
    """Seal a boot stage, cut a calibration block, or make the headers of a linked image."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("what", choices=("boot", "calibration", "parts"))
    parser.add_argument("binary", type=Path, help="what objcopy made of the linked file")
    parser.add_argument("--out", type=Path, required=True, help="folder for the sealed files")
    arguments = parser.parse_args()
    linked = arguments.binary.read_bytes()
    if arguments.what == "parts":
        made = sealed_headers(linked)
    else:
        make = sealed_boot if arguments.what == "boot" else used_bytes
        made = {arguments.what: make(linked)}
    for name, content in made.items():
        (arguments.out / f"{name}.bin").write_bytes(content)


if __name__ == "__main__":
    main()
