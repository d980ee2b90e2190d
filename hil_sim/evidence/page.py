"""The evidence as a page, as numbers and as an archive of its records; the same bytes each time."""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

from hil_sim.evidence.collect import Evidence, Item
from hil_sim.report.page import render_page

LONGEST_DETAIL = 6000
"""Characters of numbers beyond which the page leaves them to the other files."""
_NO_DATE = (1980, 1, 1, 0, 0, 0)


def page(evidence: Evidence, date: str | None) -> str:
    """Self-contained HTML."""
    sections = [
        {"title": s.title, "text": s.text, "items_shown": [_shown(item) for item in s.items]}
        for s in evidence.sections
    ]
    shown = {
        "versions": evidence.versions,
        "tools": evidence.tools,
        "sources": evidence.sources,
        "sections": sections,
    }
    return render_page(
        "evidence.html.j2",
        evidence=shown,
        open=evidence.open_items(),
        count=sum(len(s.items) for s in evidence.sections),
        date=date,
    )


def numbers(evidence: Evidence, date: str | None) -> str:
    """All of it as JSON."""
    return json.dumps(evidence.as_json(date), indent=1, ensure_ascii=False) + "\n"


def archive(evidence: Evidence) -> bytes:
    """Every record, under its path in the repository."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        for path, content in evidence.records().items():
            entry = zipfile.ZipInfo(path, _NO_DATE)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(entry, content)
    return buffer.getvalue()


def _shown(item: Item) -> dict[str, Any]:
    text = "" if item.numbers is None else json.dumps(item.numbers, indent=1, ensure_ascii=False)
    return {**vars(item), "detail": text if len(text) <= LONGEST_DETAIL else ""}
