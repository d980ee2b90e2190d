"""Plants by name: those of this project, and those that other packages register."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points

from bms.errors import InputError
from bms.presets import Preset
from hil_sim.plant.disturbances import Source
from hil_sim.plant.plant import Plant
from hil_sim.plant.seam import PlantLike, PlantMaker

ENTRY_POINTS = "kan_rcbf_bms.plants"
DEFAULT_PLANT = "two-mass"


def make_plant(spec: str, preset: Preset, disturbance: Source) -> PlantLike:
    """The plant of a text NAME or NAME:ARGUMENT, at the initial state of the preset.

    Raises InputError for an unknown name, an argument that cannot be used and a missing extra.
    """
    name, _, argument = spec.partition(":")
    if name in _OWN:
        return _OWN[name]()(argument, preset, disturbance)
    registered = {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}
    if name not in registered:
        raise InputError(
            f"--plant {spec}: no plant '{name}'; take one of "
            f"{', '.join([*_OWN, *sorted(registered)])}, or install a package that registers "
            f"'{name}' as an entry point of the group {ENTRY_POINTS}"
        )
    try:
        maker: PlantMaker = registered[name].load()
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"--plant {spec}: '{registered[name].value}' cannot be loaded ({error}); "
            "mend or reinstall the package that registers it"
        ) from None
    return maker(argument, preset, disturbance)


def _two_mass(argument: str, preset: Preset, disturbance: Source) -> PlantLike:
    if argument:
        raise InputError(f"--plant {DEFAULT_PLANT}:{argument}: takes nothing after its name")
    return Plant(preset, disturbance)


def _pybamm() -> PlantMaker:
    # Imported on demand: PyBaMM takes seconds and is optional.
    from hil_sim.plant.pybamm_plant import make  # noqa: PLC0415

    return make


def _recorded() -> PlantMaker:
    from hil_sim.plant.recorded_plant import make  # noqa: PLC0415

    return make


_OWN: dict[str, Callable[[], PlantMaker]] = {
    DEFAULT_PLANT: lambda: _two_mass,
    "pybamm": _pybamm,
    "recorded": _recorded,
}
