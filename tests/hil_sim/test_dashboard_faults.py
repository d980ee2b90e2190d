"""Each kind of fault does in the page what it does in Python, frame by frame."""

import pytest

from bms.model.model_file import load_shipped_model
from hil_sim.fault_matrix.matrix import load_matrix
from hil_sim.fault_matrix.place import Place, nominal_initial, nominal_onset
from hil_sim.fault_matrix.runner import MatrixSettings, run_settings
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from tests.hil_sim.dashboard_page import browser, dashboard, needs_browser

pytestmark = [needs_browser, pytest.mark.slow]

ROWS = {row.fault.kind: row for row in reversed(load_matrix()) if not row.realtime}
PLAY = """async (name) => {
  const get = async (path) => (await fetch(path)).json();
  const [database, preset, rows] = await Promise.all(
    ["database", "paper_calibrated", "paper_calibrated.rows"].map((of) => get(`data/${of}.json`)));
  const module = await WebAssembly.compile(await (await fetch("page.wasm")).arrayBuffer());
  const [script] = performance.getEntriesByType("resource").filter((e) => /worker/.test(e.name));
  const worker = new Worker(script.name, { type: "module" });
  const row = rows.find((one) => one.name === name);
  const { soc, temperature_K, cooling_power_W } = row.start;
  const factors = { resistance_factor: 1, capacity_factor: 1 };
  const start = { seed: 0, soc, temperature_K, cooling_power_W, ...factors };
  const { reference_A } = preset.limits;
  const request = { mode: "fixed", reference_A, full_by_s: 0, cooling_W: cooling_power_W };
  let verdict = null;
  const log = await new Promise((resolve, reject) => {
    worker.onmessage = ({ data }) => {
      if (data.type === "error") reject(data.message);
      if (data.type === "log") resolve(data.lines.join(""));
      const [now] = data.type === "snapshot" ? data.snapshot.verdicts : [];
      if (verdict === null && now !== undefined && now.outcome !== "running") {
        verdict = now.outcome;
        worker.postMessage({ type: "run", isRunning: false });
        worker.postMessage({ type: "log" });
      }
    };
    worker.postMessage({ type: "load", module, database, preset });
    worker.postMessage({ type: "speed", factor: Infinity });
    worker.postMessage({ type: "begin", start, request, isBeside: false, row });
    worker.postMessage({ type: "run", isRunning: true });
  });
  worker.terminate();
  return [verdict, log];
}"""


@pytest.fixture(scope="module")
def page():
    with dashboard() as (address, _), browser() as started:
        page = started.new_page()
        page.goto(address)
        page.wait_for_selector("#rows li")
        yield page


@pytest.mark.parametrize("kind", sorted(ROWS))
def test_a_kind_of_fault_gives_the_frames_and_the_verdict_of_the_matrix(
    page, preset, tmp_path, kind
):
    row = ROWS[kind]
    place = Place(nominal_initial(preset, row.start), nominal_onset(preset, row.start))
    settings = MatrixSettings(preset, load_shipped_model(preset.name))
    path = tmp_path / "can.log"
    with Recorder(path) as recorder:
        run_both(run_settings(settings, row, place), recorder)
    verdict, log = page.evaluate(PLAY, row.name)
    expected = path.read_text()
    assert len(expected) > 10_000
    assert log[: len(expected)] == expected
    assert verdict == "passed"
