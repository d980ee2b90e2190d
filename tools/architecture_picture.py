"""Draws docs/images/architecture.svg: the layers that pyproject.toml has import-linter hold.

    python -m tools.architecture_picture

A row is a layer; it may import from the rows below it in its wing and from the wings below.
"""

from __future__ import annotations

import html
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "images" / "architecture.svg"
WINGS = {
    "hil_sim": "what surrounds the ECU",
    "codegen": "database, preset and model to C",
    "bms": "the battery and its ECU, from Python",
}
CORE = (
    ("port/   carries frames, tells the time", "boot/   image/   what stands in flash"),
    (
        "bms   the ECU application",
        "network   pace   monitor   planner   calibration",
        "kan   history   thermal   rcbf   soc   request",
        "e2e   codec",
    ),
    ("generated/   what codegen writes",),
)
"""The C core from its ports down: folders, and files of src/ and include/."""

ROW, GAP, WIDTH, CORE_LEFT, CORE_WIDTH = 32, 5, 500, 570, 360
FILLS = {"commands": "#eceff1", "studies": "#ffe8c2", "product": "#dbe9fb", "core": "#d9f0df"}


def picture(contracts: list[dict[str, object]]) -> str:
    """The SVG for these contracts of import-linter."""
    layers = {c["id"]: c["layers"] for c in contracts if c.get("type") == "layers"}
    drawn, y, tops = [], 20, {}
    for wing, title in WINGS.items():
        rows = layers[wing]
        assert isinstance(rows, list)
        tops[wing] = y
        drawn += _frame(20, y, WIDTH + 20, len(rows), f"{wing}/", title)
        y += 40
        for row in rows:
            kind = row if row in FILLS else "product"
            drawn += _row(30, y, WIDTH, _names(wing, row), FILLS[kind])
            y += ROW + GAP
        y += 25
    drawn += _core(tops["codegen"])
    drawn += _legend(tops["hil_sim"])
    return "\n".join([_HEAD.format(height=y), *drawn, "</svg>"]) + "\n"


def _names(wing: str, row: str) -> str:
    if row != "studies":
        return row.replace(" | ", "   ")
    folders = sorted(path.parent.name for path in (ROOT / wing / row).glob("*/__init__.py"))
    return f"studies:  {'   '.join(folders)}"


def _core(top: int) -> list[str]:
    rows = sum(map(len, CORE))
    drawn = _frame(
        CORE_LEFT - 10, top, CORE_WIDTH + 20, rows, "firmware_c/", "the ECU in C99", 2 * 2 * GAP
    )
    y = top + 40
    for group in CORE:
        for name in group:
            drawn += _row(CORE_LEFT, y, CORE_WIDTH, name, FILLS["core"])
            y += ROW + GAP
        y += 2 * GAP
    y += ROW
    for line in (
        "bms/firmware calls it by cffi, the ports",
        "compile the same sources for a target.",
    ):
        drawn.append(f'<text x="{CORE_LEFT}" y="{y}">{line}</text>')
        y += 26
    return drawn


def _legend(top: int) -> list[str]:
    drawn, y = [], top + 40
    for kind, text in (
        ("commands", "what a user calls"),
        ("studies", "studies: compare, measure, reproduce"),
        ("product", "product"),
        ("core", "product, on the target too"),
    ):
        drawn += _row(CORE_LEFT, y, CORE_WIDTH, text, FILLS[kind])
        y += ROW + GAP
    for line in ("Imports go down: to lower rows,", "and to wings below."):
        y += 26
        drawn.append(f'<text x="{CORE_LEFT}" y="{y}">{line}</text>')
    return drawn


def _frame(
    x: int, y: int, width: int, rows: int, name: str, title: str, extra: int = 0
) -> list[str]:
    height = 45 + rows * (ROW + GAP) + extra
    return [
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" class="wing"/>',
        f'<text x="{x + 12}" y="{y + 27}"><tspan class="name">{name}</tspan>  {title}</text>',
    ]


def _row(x: int, y: int, width: int, text: str, fill: str) -> list[str]:
    return [
        f'<rect x="{x}" y="{y}" width="{width}" height="{ROW}" rx="4" fill="{fill}"/>',
        f'<text x="{x + 12}" y="{y + 22}">{html.escape(text)}</text>',
    ]


_HEAD = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 960 {height}" role="img">
<title>Layers of the three wings and of the C core</title>
<style>
text {{ font: 17px sans-serif; fill: #1c2733; white-space: pre }}
.name {{ font-weight: bold; font-size: 20px }}
.wing {{ fill: #f7f9fb; stroke: #90a4ae; stroke-width: 1.5 }}
</style>
<rect width="100%" height="100%" fill="#ffffff"/>"""


def main() -> None:
    """Write the picture."""
    content = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = content["tool"]["importlinter"]["contracts"]
    PICTURE.write_text(picture(contracts), encoding="utf-8")


if __name__ == "__main__":
    main()
