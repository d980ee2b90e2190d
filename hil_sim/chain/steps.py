"""The steps from a preset to a calibration in flash; each refuses what the next would not take."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.commands.identify_surface import identify_surface
from bms.commands.surface_options import SurfaceOptions
from bms.errors import InputError
from bms.image import calibration_part, with_calibration
from bms.kan.settings import TrainingSettings
from bms.model.make import model_for_preset
from bms.model.model_file import KanModel, save_model
from bms.model.pair import load_pair
from bms.presets import Preset, load_preset
from bms.presets.authoring.complaints import complaints
from bms.presets.digest import digest
from bms.verification import PARTS
from bms.verification import verify as certify
from bms.verification.family import FAMILY_PARTS, verify_family
from bms.waiting import waiting
from codegen.calibration_source import CALIBRATION_FILE, calibration_source
from codegen.can_sources import can_sources
from hil_sim.chain.state import file_hash
from hil_sim.fault_matrix.matrix import load_matrix
from hil_sim.fault_matrix.report import MatrixResult, matrix_json, matrix_page
from hil_sim.fault_matrix.runner import MatrixSettings, play, play_all
from hil_sim.fault_matrix.verdict import Verdict
from hil_sim.logs.recorder import Recorder
from hil_sim.report.files import write_report
from hil_sim.report.folder import OutputFolder
from hil_sim.run.result import RunResult
from hil_sim.run.session import run_sil
from hil_sim.run.settings import Settings
from hil_sim.targets.catalog import DEFAULT_BOARD, find_board

PRESET, MODEL, CERTIFICATE = "preset.toml", "model.json", "verify.json"
IDENTIFICATION, FITS = "identify.txt", "identify"
"""What was fitted how well; the folder has a page with the fits."""
_MORE_TRIES = 2
"""Of a red row on clocks of its own."""
_LONGEST_CHARGE = 3.0
"""Of the time that the strongest current would take; the rest of it is an hour."""


@dataclass(frozen=True)
class Outcome:
    """What a step has to say in one line, the files that it wrote, and whether all was well.

    `is_lacking` tells that this machine cannot take the step, which is no failure.
    """

    said: str
    files: tuple[str, ...]
    passed: bool = True
    is_lacking: bool = False


@dataclass(frozen=True)
class Step:
    """A step by name: files of the folder that it reads, what it does there.

    `key` is of all else that it depends on.
    """

    name: str
    reads: tuple[str, ...]
    key: str
    run: Callable[[Path], Outcome]


@dataclass(frozen=True)
class Choices:
    """What the user chose for the steps after the preset."""

    seed: int
    jobs: int


def steps_after_preset(choices: Choices) -> tuple[Step, ...]:
    """What follows once there is a preset, in order."""
    pair, seed = (PRESET, MODEL), f"seed {choices.seed}"
    return (
        Step("train", (PRESET,), seed, lambda folder: _train(folder, choices.seed)),
        Step("verify", pair, "", _verify),
        Step("charge", (*pair, CERTIFICATE), seed, lambda folder: _charge(folder, choices.seed)),
        Step("faults", (*pair, CERTIFICATE), seed, lambda folder: _faults(folder, choices)),
        Step("export", (*pair, CERTIFICATE), "", _export),
        Step(
            "image", (*pair, CALIBRATION_FILE, "charge/can.log"), seed,
            lambda folder: _image(folder, choices.seed),
        ),
    )  # fmt: skip


def preset_from_file(source: Path) -> Step:
    """The first step where the preset is there already."""

    def take(folder: Path) -> Outcome:
        require_no_complaints(source)
        target = folder / PRESET
        if not target.exists() or not target.samefile(source):
            with OutputFolder(folder) as place:
                shutil.copyfile(source, place.path(PRESET))
                place.commit()
        preset = load_preset(target)
        return Outcome(f"{preset.name}: {preset.cell.capacity_Ah:g} A h", (PRESET,))

    return Step("preset", (), f"preset {file_hash(source)}", take)


def preset_from_recordings(files: Sequence[Path], chosen: SurfaceOptions) -> Step:
    """The first step where recordings of a cycler are what there is; `chosen` says how to read.

    Raises InputError for a file that cannot be read.
    """
    beside = [path for path in (chosen.check, chosen.entropy) if path is not None]
    hashes = [file_hash(path) for path in (*files, *beside)]

    def identify(folder: Path) -> Outcome:
        name, said = folder.resolve().name, StringIO()
        with OutputFolder(folder) as place, OutputFolder(folder / FITS) as page:
            own = replace(chosen, report=page.path("page").parent)
            with redirect_stdout(said):
                identify_surface(files, own, place.path(f"{name}.toml"), as_json=False)
            place.path(IDENTIFICATION).write_text(said.getvalue(), encoding="utf-8")
            place.path(f"{name}.toml").rename(place.path(PRESET))
            require_identified(files[0], place.path(PRESET))
            fits = sorted(path.name for path in page.path("page").parent.iterdir())
            page.commit()
            place.commit()
        preset = load_preset(folder / PRESET)
        lines = said.getvalue().strip().splitlines()
        checked = f"; {lines[-1]}" if chosen.check is not None else ""
        text = f"{preset.cell.capacity_Ah:g} A h, from {len(files)} recordings{checked}"
        return Outcome(text, (PRESET, IDENTIFICATION, *(f"{FITS}/{name}" for name in fits)))

    return Step("identify", (), digest([hashes, repr(chosen)]), identify)


def require_no_complaints(path: Path) -> None:
    """Raise InputError when 'bms preset check' would complain about the file."""
    if found := complaints(path):
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        first = found[0]
        raise InputError(
            f"{path}: {first.key}: {first.what}{more}; 'bms preset check FILE' tells all with "
            "remedies"
        )


def require_identified(recording: Path, path: Path) -> None:
    """Raise InputError when the preset that recordings gave would be complained about."""
    if found := complaints(path):
        told = "; ".join(f"{one.key}: {one.what}" for one in found)
        raise InputError(
            f"{recording}: the recordings give a cell that is none: {told}; check their units and "
            "that the slowest of them goes from full to empty"
        )


def _pair(folder: Path) -> tuple[Preset, KanModel]:
    return load_pair(folder / PRESET, folder / MODEL)


def _train(folder: Path, seed: int) -> Outcome:
    preset = load_preset(folder / PRESET)
    with waiting("training") as wait:
        model = model_for_preset(preset, TrainingSettings(seed=seed), wait.reach)
    save_model(model, folder / MODEL)
    test = model.errors["test"].overall
    return Outcome(
        f"RMSE {test.rmse_K:.4f} K on unseen profiles, e_max {model.error_bound_K:.4f} K", (MODEL,)
    )


def _verify(folder: Path) -> Outcome:
    preset, model = _pair(folder)
    reasons: list[str] = []
    if preset.cell.interval is not None:
        with waiting("verifying the family", FAMILY_PARTS, "parts") as wait:
            family = verify_family(preset, model, note=wait.begin)
        content, certified = family.as_dict(), family.certified
        for relation in family.relations:
            if not relation.holds:
                reasons.append(f"{relation.name} is {relation.has:.6g}, not {relation.needs:.6g}")
        for violation in family.violations:
            reasons.append(f"{violation.claim} by {violation.by:.3g}")
    else:
        with waiting("verifying", PARTS, "parts") as wait:
            result = certify(preset, model, note=wait.begin)
        content, certified = result.as_dict(), result.certified
        for name, finding in result.refusals.items():
            reasons.append(f"{name}: {finding.reason}; {finding.change}")
        # Safe, but no charge would begin or end: of no use to who charges a cell.
        for obstacle in result.obstacles:
            reasons.append(f"{obstacle.reason}; {obstacle.change}")
    del content["wall_time_s"]  # so that the same certificate is the same file
    with OutputFolder(folder) as place:
        place.path(CERTIFICATE).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        place.commit()
    verdict = "certified" if certified else "NOT certified"
    return Outcome("; ".join([verdict, *reasons]), (CERTIFICATE,), passed=not reasons)


def charge_of(preset: Preset, model: KanModel, seed: int) -> Settings:
    """The charge that the chain shows: the preset's own, with time enough to be full."""
    hours = preset.cell.capacity_Ah / -preset.limits.reference_current_A
    return Settings(
        preset, model=model, seed=seed, max_time_s=3600.0 * (1.0 + _LONGEST_CHARGE * hours)
    )


def _charge(folder: Path, seed: int) -> Outcome:
    settings = charge_of(*_pair(folder), seed)
    with OutputFolder(folder / "charge") as place:
        result = _charged(settings, place.path("can.log"))
        write_report(place, settings, [result])
        place.commit()
    names = ("can.log", "charge.png", "report.html", "summary.json")
    return _judged(result, tuple(f"charge/{name}" for name in names))


def _charged(settings: Settings, log: Path) -> RunResult:
    begin = settings.preset.initial.soc
    with waiting("charging, state of charge", completed=begin) as wait, Recorder(log) as recorder:
        return run_sil(settings, recorder, wait.reach)


def _judged(result: RunResult, files: tuple[str, ...], said: str = "") -> Outcome:
    summary = result.summary
    if summary.passed and summary.shortfall is None:
        text = (
            f"full in {summary.charge_time_s:.1f} s, core at most "
            f"{summary.max_core_temperature_K:.2f} K{said}"
        )
        return Outcome(text, files)
    reasons = [*summary.failures, *([summary.shortfall] if summary.shortfall else [])]
    return Outcome("; ".join(reasons), files, passed=False)


def _faults(folder: Path, choices: Choices) -> Outcome:
    preset, model = _pair(folder)
    settings = MatrixSettings(preset, model, seed=choices.seed)
    rows = load_matrix(None)
    start_s = time.perf_counter()
    with waiting("playing faults", len(rows), "rows") as wait:
        verdicts = play_all(settings, rows, choices.jobs, wait.advance)
    verdicts, again = _in_time(settings, verdicts)
    result = MatrixResult(settings, verdicts, time.perf_counter() - start_s)
    with OutputFolder(folder / "faults") as place:
        text = json.dumps(matrix_json(result), indent=2) + "\n"
        place.path("fault-matrix.json").write_text(text, encoding="utf-8")
        place.path("fault-matrix.html").write_text(matrix_page(result), encoding="utf-8")
        place.commit()
    late = f"; played again alone, for want of time: {', '.join(again)}" if again else ""
    red = "".join(f"; {verdict.row.name}: {', '.join(verdict.failures)}" for verdict in result.red)
    files = ("faults/fault-matrix.html", "faults/fault-matrix.json")
    return Outcome(result.sentence + late + red, files, passed=not result.red)


def _in_time(
    settings: MatrixSettings, verdicts: Sequence[Verdict]
) -> tuple[list[Verdict], tuple[str, ...]]:
    """The verdicts, and rows on clocks of their own that were red and went as expected alone.

    A busy machine misses periods of such a row, which then says nothing of the firmware. One that
    is red alone too, twice, stays so.
    """
    found, again = list(verdicts), []
    for place, verdict in enumerate(verdicts):
        for _ in range(_MORE_TRIES if verdict.row.realtime and not verdict.passed else 0):
            found[place] = play(settings, verdict.row)
            if found[place].passed:
                again.append(verdict.row.name)
                break
    return found, tuple(again)


def _export(folder: Path) -> Outcome:
    preset, model = _pair(folder)
    part = calibration_part(preset, model)
    sources = {**can_sources(), **calibration_source(preset, model)}
    with OutputFolder(folder / "sources") as place:
        for name, text in sources.items():
            place.path(name).write_text(text, encoding="utf-8")
        place.commit()
    with OutputFolder(folder) as place:
        place.path(CALIBRATION_FILE).write_bytes(part)
        place.commit()
    files = (CALIBRATION_FILE, *(f"sources/{name}" for name in sources))
    return Outcome(f"{CALIBRATION_FILE} of {len(part)} bytes, {len(sources)} C sources", files)


def _image(folder: Path, seed: int) -> Outcome:
    """The same charge against the image with this calibration, on an emulated board."""
    settings = charge_of(*_pair(folder), seed)
    try:
        board = find_board(DEFAULT_BOARD)
        board.require_place()
    except InputError as error:
        return Outcome(f"not run: {error}", (), is_lacking=True)
    part = (folder / CALIBRATION_FILE).read_bytes()
    with TemporaryDirectory() as temporary, OutputFolder(folder / "image") as place:
        image = Path(temporary) / "firmware.bin"
        image.write_bytes(with_calibration(board.image.read_bytes(), part))
        with board.start(image) as emulation:
            result = _charged(replace(settings, bus=emulation.bus), place.path("can.log"))
        write_report(place, settings, [result])
        is_same = place.path("can.log").read_bytes() == (folder / "charge/can.log").read_bytes()
        place.commit()
    files = tuple(f"image/{name}" for name in ("can.log", "charge.png", "summary.json"))
    said = f" on {DEFAULT_BOARD}, frame by frame as on this computer"
    if not is_same:
        text = "the image's frames differ from the host's; see image/can.log and charge/can.log"
        return Outcome(text, files, passed=False)
    return _judged(result, files, said)
