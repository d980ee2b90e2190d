"""Writes the page as files, which any server can hand out; `make docs` puts it on the site.

python -m hil_sim.dashboard.site FOLDER
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from hil_sim.dashboard.build import STATIC, require_page
from hil_sim.dashboard.pack_scenario import packs_data
from hil_sim.dashboard.page_data import config_data, database_data, preset_data, rows_data


def write_site(out: Path) -> None:
    """The page with the data of all shipped presets; InputError where no page has been built."""
    require_page()
    shutil.copytree(STATIC, out, dirs_exist_ok=True)
    config = config_data(bus=None)
    data: dict[str, object] = {"config": config, "database": database_data()}
    data[f"{config['packs']}.packs"] = packs_data(config["packs"])
    for name in config["presets"]:
        data[name] = preset_data(name)
        data[f"{name}.rows"] = rows_data(name)
    (out / "data").mkdir(exist_ok=True)
    for name, content in data.items():
        (out / "data" / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")


if __name__ == "__main__":
    write_site(Path(sys.argv[1]))
