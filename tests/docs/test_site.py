"""The site builds without a warning, fetches nothing, and leads nowhere that is not there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import ROOT
from tools.site_hooks import PAGES, site_links

OUTSIDE = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["']?(?:https?:)?//"""
    r"""|<link\b(?![^>]*\brel=["']?canonical)[^>]*\bhref=["']?(?:https?:)?//"""
    r"""|url\(["']?(?:https?:)?//|@import"""
)


def build(config: Path, out: Path) -> "subprocess.CompletedProcess[str]":
    """What `make docs` runs, with another configuration and folder."""
    (recipe,) = re.findall(r"python -m (mkdocs build .*)", (ROOT / "Makefile").read_text())
    words = recipe.replace("build/site", str(out)).split()
    return subprocess.run(
        [sys.executable, "-m", *words, "--config-file", str(config)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_the_site_builds_with_a_page_of_each_header_and_fetches_nothing(tmp_path):
    done = build(ROOT / "mkdocs.yml", tmp_path)
    assert done.returncode == 0, done.stderr
    for page in PAGES.values():
        assert (tmp_path / page).with_suffix(".html").is_file()
    texts = [path for path in tmp_path.rglob("*") if path.suffix in {".html", ".css"}]
    found = {path.name: OUTSIDE.findall(path.read_text(encoding="utf-8")) for path in texts}
    assert {name: outside for name, outside in found.items() if outside} == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[there](missing.md)", "missing.md"),
        ("[there](#nowhere)", "#nowhere"),
        ("![there](missing.png)", "missing.png"),
        ("::: bms.firmware.Missing", "bms.firmware.Missing"),
    ],
)
def test_what_leads_nowhere_fails_the_build(tmp_path, text, complaint):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text(f"# Page\n\n{text}\n")
    config = tmp_path / "mkdocs.yml"
    config.write_text(
        f"INHERIT: {ROOT / 'mkdocs.yml'}\ndocs_dir: docs\nnav: [index.md]\nhooks: []\n"
        f"plugins: [{{mkdocstrings: {{handlers: {{python: {{paths: ['{ROOT}']}}}}}}}}]\n"
    )
    done = build(config, tmp_path / "site")
    assert done.returncode == 1
    assert complaint in done.stderr


@pytest.mark.parametrize(
    ("page", "link", "on_the_site"),
    [
        ("index.md", "[a](theory.md#top)", "[a](theory.md#top)"),
        ("index.md", "[a](../CONTRIBUTING.md)", "[a](contributing.md)"),
        ("decisions/index.md", "[a](../../CHANGELOG.md)", "[a](../changelog.md)"),
        ("reference/c.md", "[`b`](../../firmware_c/include/bms.h)", "[`b`](c/bms.md)"),
        ("reference/c.md", "[a](../architecture.md)", "[a](../architecture.md)"),
        ("contributing.md", "[a](docs/versions.md#when)", "[a](versions.md#when)"),
        ("contributing.md", "[a](CHANGELOG.md)", "[a](changelog.md)"),
        ("cost.md", "it is [a](../firmware_c/cost) here", "it is a here"),
        ("pykan.md", "[a](https://example.org/x)", "[a](https://example.org/x)"),
        ("index.md", "![a](images/charge.png)", "![a](images/charge.png)"),
        ("index.md", "[a](#test-engineer)", "[a](#test-engineer)"),
    ],
)
def test_links_of_the_repository_become_links_of_the_site(page, link, on_the_site):
    assert site_links(link, page) == on_the_site
