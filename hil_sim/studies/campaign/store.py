"""The folder of a campaign: finished pieces appear whole or not at all, and none is lost."""

from __future__ import annotations

import csv
import json
import os
import shutil
from pathlib import Path
from typing import Any

from bms.errors import InputError
from bms.validation import read_json
from hil_sim.studies.campaign.rows import header
from hil_sim.studies.campaign.settings import CampaignSettings


class CampaignFolder:
    """`campaign.json` says what the campaign is, `chunks/` holds finished pieces until all are.

    Then `runs.csv` has every run in order, whoever did them and in however many sessions.
    """

    def __init__(self, path: Path, settings: CampaignSettings, resume: bool) -> None:
        """Raises InputError for a folder that holds a campaign unless it is the one to resume."""
        self.path = path
        self._settings = settings
        self._chunks = path / "chunks"
        identity = path / "campaign.json"
        if resume:
            self._check_same(identity)
        elif identity.exists():
            raise InputError(f"{path}: holds a campaign; add --resume or choose another --out")
        try:
            self._chunks.mkdir(parents=True, exist_ok=True)
            if not resume:
                self.write(identity.name, json.dumps(settings.identity(), indent=2) + "\n")
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written ({error.strerror}); choose another --out"
            ) from None

    def unfinished(self) -> list[range]:
        """Pieces that are still to be run."""
        if self._runs_path.exists():
            return []
        return [chunk for chunk in self._settings.chunks() if not self._chunk_path(chunk).exists()]

    def store(self, chunk: range, lines: str) -> None:
        """Write the rows of a finished piece, whole or not at all."""
        self._write(self._chunk_path(chunk), lines)

    def finish(self) -> None:
        """Join the pieces, in the order of their runs, to runs.csv."""
        if not self._runs_path.exists():
            pieces = map(self._chunk_path, self._settings.chunks())
            text = header(self._settings.family) + "".join(
                piece.read_text(encoding="utf-8") for piece in pieces
            )
            self._write(self._runs_path, text)
        shutil.rmtree(self._chunks, ignore_errors=True)

    def rows(self) -> list[dict[str, str]]:
        """Every run of a finished campaign, by column."""
        with self._runs_path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    def write(self, name: str, text: str) -> None:
        """Write another file of the campaign."""
        self._write(self.path / name, text)

    @property
    def _runs_path(self) -> Path:
        return self.path / "runs.csv"

    def _chunk_path(self, chunk: range) -> Path:
        return self._chunks / f"{chunk.start:08d}.csv"

    def _check_same(self, identity: Path) -> None:
        if not identity.exists():
            raise InputError(f"{self.path}: holds no campaign; leave out --resume to start one")
        stored: dict[str, Any] = read_json(identity)
        for key, value in self._settings.identity().items():
            if stored.get(key) != value:
                raise InputError(
                    f"{identity}: {key}: the campaign has {stored.get(key)!r}, not {value!r}; "
                    "resume it with the options that it was begun with"
                )

    @staticmethod
    def _write(path: Path, text: str) -> None:
        unfinished = path.with_name(f".{path.name}.writing")
        with unfinished.open("w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
