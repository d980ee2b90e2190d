"""A page of the documentation from a C header: its comments and declarations, as they stand there.

The header begins with a comment. A comment right above a declaration belongs to it, one inside or
behind it stays in the code. Include guards, includes and `extern "C"` are left out.
"""

from __future__ import annotations

import html
import re
from collections import defaultdict
from collections.abc import Iterator

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CONSTANT = re.compile(r"#\s*define\s+\w+(?:\([^)]*\))?[ \t]+\S")
_NOT_SHOWN = re.compile(r'extern\s+"C"\s*\{|\}')
_TYPE = re.compile(r"(\w+)\s*;\s*$")
_FUNCTION = re.compile(r"(\w+)\s*\([^()]*\)\s*[;{]")
_OBJECT = re.compile(r"(\w+)\s*(?:\[[^\]]*\])*\s*;")


def header_page(name: str, text: str) -> str:
    """Markdown of a header; ValueError when it has no comment of its own or is not understood."""
    first = _COMMENT.match(text)
    if first is None:
        raise ValueError(f"{name}: no comment at its beginning; say in one what it is for")
    parts: dict[str, list[str]] = defaultdict(list)
    for comment, code in _declarations(name, text[first.end() :]):
        bare = _COMMENT.sub("", code).strip()
        if _CONSTANT.match(bare):
            parts["Constants"].append("\n".join(filter(None, (comment, code))))
            continue
        kind, pattern = "Types", _TYPE
        if not bare.startswith("typedef"):
            kind, pattern = ("Functions", _FUNCTION) if "(" in bare else ("Objects", _OBJECT)
        found = pattern.search(bare)
        if found is None:
            raise ValueError(f"{name}: not a declaration that a page can be made of: {bare[:60]}")
        parts[kind] += [f"### {found[1]}", f"```c\n{code}\n```", *filter(None, [_prose(comment)])]
    if "Constants" in parts:
        parts["Constants"] = ["```c\n" + "\n".join(parts["Constants"]) + "\n```"]
    page = [f"# {name}", _prose(first[0])]
    for kind in ("Functions", "Types", "Constants", "Objects"):
        page += [f"## {kind}", *parts[kind]] if kind in parts else []
    return "\n\n".join(page).rstrip() + "\n"


def _declarations(name: str, text: str) -> Iterator[tuple[str, str]]:
    """Comment above, or nothing, and code of each declaration and each constant."""
    comment, place = "", 0
    while place < len(text):
        rest = text[place:]
        if found := re.match(r"[ \t]*\n|[ \t]+", rest):
            comment = "" if found[0].endswith("\n") else comment
        elif found := _COMMENT.match(rest):
            comment = found[0]
            found = re.match(re.escape(comment) + r"[ \t]*\n?", rest)
        elif found := re.match(r"#(?:[^\n\\]|\\\n)*\n?", rest):
            if _CONSTANT.match(found[0]):
                yield comment, found[0].rstrip()
            comment = ""
        elif found := _NOT_SHOWN.match(rest):
            comment = ""
        else:
            code = rest[: _end(name, rest)]
            yield comment, code
            comment, place = "", place + len(code)
            continue
        assert found is not None
        place += found.end()


def _end(name: str, text: str) -> int:
    """Where the declaration at the beginning of the text ends, a comment behind it included."""
    depth = 0
    for found in re.finditer(r"/\*.*?\*/|[{};]", text, re.DOTALL):
        depth += {"{": 1, "}": -1}.get(found[0], 0)
        is_body = found[0] == "}" and "(" in text[: text.index("{")]
        if depth == 0 and (found[0] == ";" or is_body):
            behind = re.match(r"[ \t]*/\*.*?\*/", text[found.end() :], re.DOTALL)
            return found.end() + (behind.end() if behind else 0)
    raise ValueError(f"{name}: a declaration has no end: {text[:60]}")


def _prose(comment: str) -> str:
    lines = (re.sub(r"^[ \t]*\*? ?", "", line) for line in comment[2:-2].splitlines())
    return re.sub(r"([*_])", r"\\\1", html.escape("\n".join(lines).strip(), quote=False))
