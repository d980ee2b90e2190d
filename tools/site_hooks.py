"""MkDocs hooks: pages that are made from files outside docs/, and links to files there.

To be run as `python -m mkdocs` in the repository, so that this package is found.

The C headers become pages of the reference, CONTRIBUTING.md and CHANGELOG.md pages of the site. A
page links by paths in the repository, so that it reads well there too; on the site such a link
leads to the page of that file, and is plain text when the file has none.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

from tools.header_page import header_page

ROOT = Path(__file__).parents[1]
DOCS = "docs/"
_LINK = re.compile(r"\[([^\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")

PAGES = {name: name.lower() for name in ("CONTRIBUTING.md", "CHANGELOG.md")} | {
    str(path.relative_to(ROOT)): f"reference/c/{path.stem}.md"
    for path in sorted((ROOT / "firmware_c" / "include").glob("*.h"))
}
"""Path in the repository, and of the page on the site."""
_SOURCES = {page: path for path, page in PAGES.items()}


def on_files(files: Any, config: Any) -> Any:
    """Add the pages; a header that says nothing of itself ends the build."""
    for path, page in PAGES.items():
        text = (ROOT / path).read_text(encoding="utf-8")
        try:
            content = header_page(Path(path).name, text) if path.endswith(".h") else text
        except ValueError as error:
            raise PluginError(str(error)) from None
        files.append(File.generated(config, page, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links of the repository as links of the site."""
    return site_links(markdown, page.file.src_uri)


def site_links(markdown: str, page: str) -> str:
    """The text of a page with its links to other files of the repository as the site needs them."""
    folder = posixpath.dirname(_SOURCES.get(page, DOCS + page))

    def link(found: re.Match[str]) -> str:
        text, target, anchor = found[1], found[2], found[3] or ""
        path = posixpath.normpath(posixpath.join(folder, target))
        uri = path[len(DOCS) :] if path.startswith(DOCS) else PAGES.get(path)
        if uri is None:
            return text
        return f"[{text}]({posixpath.relpath(uri, posixpath.dirname(page) or '.')}{anchor})"

    return _LINK.sub(link, markdown)
