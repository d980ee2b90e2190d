"""Self-contained HTML pages from the templates in this folder."""

from __future__ import annotations

import base64
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from bms import __version__


def render_page(template: str, **values: Any) -> str:
    """Page from a template, with the version of this project and everything escaped."""
    environment = Environment(
        loader=PackageLoader("hil_sim", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(version=__version__, **values)


def data_url(png: bytes) -> str:
    """A picture as an address that holds the picture itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")
