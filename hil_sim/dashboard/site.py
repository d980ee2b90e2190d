"""Writes the page as files, which any server can hand out; `make docs` puts it on the site.

python -m hil_sim.dashboard.site FOLDER
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from bms.presets import load_preset
from hil_sim.dashboard.build import STATIC, require_page
from hil_sim.dashboard.limits import steps
from hil_sim.dashboard.pack_scenario import packs_data
from hil_sim.dashboard.page_data import (
    config_data,
    database_data,
    preset_data,
    rows_data,
    tightened_data,
)


def write_site(out: Path) -> None:
    """The page with the data of all shipped presets; InputError where no page has been built."""
    require_page()
    shutil.copytree(STATIC, out, dirs_exist_ok=True)
    names = config_data(bus=None)["presets"]
    made = {name: steps(load_preset(name)) for name in names}
    config = config_data(bus=None, limits=made)
    files: dict[str, object] = {"data/config": config, "data/database": database_data()}
    files[f"data/{config['packs']}.packs"] = packs_data(config["packs"])
    for name in names:
        files[f"data/{name}"] = preset_data(name)
        files[f"data/{name}.rows"] = rows_data(name)
        for limit, values in made[name].items():
            for value in values:
                tighter = tightened_data(name, None, {limit: value})
                files[f"limits/{name}/{limit}={value}"] = tighter
    for name, content in files.items():
        path = out / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content), encoding="utf-8")


if __name__ == "__main__":
    write_site(Path(sys.argv[1]))
