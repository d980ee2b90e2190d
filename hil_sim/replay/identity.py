"""Which preset and model a recorded ECU had, by the hashes that it sent."""

from __future__ import annotations

from pathlib import Path

from bms.errors import InputError
from bms.model.model_file import KanModel, load_model, shipped_model_path, shipped_models
from bms.presets import Preset, load_preset, preset_names
from hil_sim.bus.catalog import Message
from hil_sim.bus.identity import Identity
from hil_sim.replay.recording import Recording
from hil_sim.replay.versions import first_identity


def choose_pair(
    recording: Recording, preset: str | None, model: Path | None
) -> tuple[str, Path | None]:
    """Preset and model as Ecu takes them: those given, else the shipped ones of the recorded ECU.

    A preset that is given alone brings its own model. Raises InputError when the log does not
    tell, or names hashes of something that does not ship.
    """
    if preset is not None:
        return preset, model
    recorded = recorded_identity(recording)
    name = _shipped_preset(recording.path, recorded.preset_hash)
    if model is None:
        return name, _shipped_model(recording.path, recorded.model_hash, name)
    return name, model


def identity_to_ignore(recording: Recording, preset: Preset, model: KanModel) -> tuple[int, ...]:
    """Identifiers of what says who the ECU is, for a replay with another preset or model.

    Then it differs by intent, and only what follows from that is of interest.
    """
    if is_of_pair(recording, preset, model):
        return ()
    return tuple(recording.database[name].frame_id for name in (Message.IDENTITY, Message.START))


def is_of_pair(recording: Recording, preset: Preset, model: KanModel) -> bool:
    """Whether the recorded ECU said that it has this preset and model."""
    recorded = _first_identity(recording)
    return (
        recorded is not None
        and model.hash.startswith(recorded.model_hash)
        and preset.hash.startswith(recorded.preset_hash)
    )


def recorded_identity(recording: Recording) -> Identity:
    """What the recorded ECU said first that it has; InputError when it never did."""
    identity = _first_identity(recording)
    if identity is not None:
        return identity
    raise InputError(
        f"{recording.path}: no Identity frame is in it, so its ECU was not this firmware; "
        "give --preset to replay it all the same"
    )


def _first_identity(recording: Recording) -> Identity | None:
    frames = (frame for answer in recording.answers for frame in answer)
    return first_identity(frames, recording.database)


def _shipped_preset(path: Path, wanted: str) -> str:
    for name in preset_names():
        if load_preset(name).hash.startswith(wanted):
            return name
    raise InputError(
        f"{path}: recorded with a preset of hash {wanted}..., which no shipped one has; "
        "give it as --preset FILE"
    )


def _shipped_model(path: Path, wanted: str, preset: str) -> Path | None:
    for candidate in shipped_models():
        if load_model(candidate).hash.startswith(wanted):
            return None if candidate == shipped_model_path(preset) else candidate
    raise InputError(
        f"{path}: recorded with a model of hash {wanted}..., which no shipped one has; "
        "give it as --model FILE"
    )
