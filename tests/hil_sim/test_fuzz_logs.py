"""No damaged log hangs a reader, crashes it, or is read short without a word.

`make fuzz` runs the same a hundred times as long, with other seeds.
"""

import importlib.util
import time

import pytest

from hil_sim.logs import Unread, reader
from hil_sim.logs.candump import CandumpParser
from hil_sim.logs.frame import Entry
from hil_sim.logs.peak_trc import TrcParser
from tests.hil_sim import fuzz_logs
from tests.hil_sim.fuzz_logs import fuzz

HAS_ASAMMDF = importlib.util.find_spec("asammdf") is not None


@pytest.mark.slow
def test_ten_thousand_damaged_logs_are_read_whole_or_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    findings = fuzz(10_000, seed=20_261_126, with_mdf4=HAS_ASAMMDF)
    assert findings.wrong == []
    suffixes = {suffix for suffix, _ in findings.outcomes}
    assert {"read", "refused"} == {outcome for _, outcome in findings.outcomes} - {
        "ended the process"  # asammdf's own, in which it alone may crash
    }
    assert len(suffixes) == 9 + HAS_ASAMMDF


class ForgetsRemoteFrames(CandumpParser):
    def parse(self, line):
        entry = super().parse(line)
        return None if entry and entry.unread is Unread.REMOTE_FRAMES else entry


class TakesCutLinesForShortFrames(TrcParser):
    def parse(self, line):
        try:
            return super().parse(line)
        except Exception:
            return Entry(0.0)


class Crashes(CandumpParser):
    def parse(self, line):
        return super().parse(line) if line.startswith("(") else int(line)


class IsSlow(CandumpParser):
    def parse(self, line):
        end_s = time.process_time() + 0.002
        while time.process_time() < end_s:
            pass
        return super().parse(line)


@pytest.mark.parametrize(
    ("suffix", "broken", "said"),
    [
        (".log", ForgetsRemoteFrames, "entries are accounted for"),
        (".trc", TakesCutLinesForShortFrames, "not its first ones"),
        (".log", Crashes, "ValueError"),
        (".log", IsSlow, "takes 0."),
    ],
)
def test_a_broken_reader_is_found(tmp_path, monkeypatch, suffix, broken, said):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fuzz_logs, "DIALECTS", {
        name: one for name, one in fuzz_logs.DIALECTS.items() if one.suffix == suffix
    })  # fmt: skip
    intact = fuzz_logs.seeds(tmp_path, with_mdf4=False)
    monkeypatch.setattr(fuzz_logs, "seeds", lambda *_: intact)
    monkeypatch.setattr(fuzz_logs, "LONGEST_S", 0.02)
    monkeypatch.setattr(reader, "_PARSERS", {**reader._PARSERS, suffix: broken})
    findings = fuzz(60 if broken is IsSlow else 300, seed=1, with_mdf4=False)
    assert any(said in fault for fault in findings.wrong), findings.wrong[:3]
