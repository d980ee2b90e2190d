"""What the server of the page hands out, to whom, and how it ends; without a browser."""

import http.client
import json
import re
import socket
import threading
import time
from dataclasses import replace
from urllib.parse import urlsplit

import pytest

from bms.errors import BusError, InputError
from bms.model.model_file import shipped_model_path
from bms.presets import load_preset
from hil_sim.bus.buses import Frame
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.dashboard import build as page_build
from hil_sim.dashboard.feed import BusFeed
from hil_sim.dashboard.page_data import config_data, preset_data
from hil_sim.dashboard.site import write_site
from hil_sim.dashboard.ziggurat import ziggurat_tables
from hil_sim.monitor.presets import preset_finder
from hil_sim.nodes.clock import WallClock
from tests.hil_sim.dashboard_page import dashboard, needs_page
from tests.hil_sim.slcan_hub import SlcanHub

PATIENCE_S = 10.0


@pytest.fixture(scope="module")
def hub():
    with SlcanHub() as hub:
        yield hub


@pytest.fixture(scope="module")
def address(hub):
    with dashboard("--bus", hub.bus) as (address, _):
        yield address


def get(address, path="/", **headers):
    place = urlsplit(address)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.headers, content


def feed_of(address, **options):
    from websockets.sync.client import connect  # noqa: PLC0415 (where it is skipped)

    return connect(f"ws{address.removeprefix('http')}feed", open_timeout=PATIENCE_S, **options)


@needs_page
def test_it_listens_on_loopback_alone(address):
    port = urlsplit(address).port
    own = socket.gethostbyname(socket.gethostname())
    assert urlsplit(address).hostname == "127.0.0.1"
    if not own.startswith("127."):
        with pytest.raises(OSError, match="refused"):
            socket.create_connection((own, port), timeout=PATIENCE_S)


@needs_page
def test_every_answer_keeps_a_browser_to_this_origin(address):
    for path in ("/", "/page.wasm", "/data/config.json", "/not-there"):
        _, headers, _ = get(address, path)
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self' 'wasm-unsafe-eval';")
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"


@needs_page
def test_another_name_for_this_machine_is_refused(address):
    assert get(address, Host="evil.example")[0] == 400
    assert get(address, Host="localhost")[0] == 200


@needs_page
def test_nothing_outside_of_the_page_is_handed_out(address):
    for path in (
        "/../server.py",
        "/%2e%2e/server.py",
        "/data/../../x.json",
        "/data/nothing.json",
        "/limits/x.json",
    ):
        assert get(address, path)[0] == 404
    assert get(address, "/limits/nothing.json")[0] == 404


@needs_page
def test_limits_may_be_lowered_and_what_follows_from_them_is_made_anew(address, tmp_path):
    status, _, content = get(address, "/limits/lin2014.json?max_voltage_V=3.5")
    made = json.loads(content)
    (tmp_path / "preset.toml").write_text(made["file"])
    preset = load_preset(tmp_path / "preset.toml")
    own = load_preset("lin2014")
    assert preset == replace(own, limits=replace(own.limits, max_voltage_V=3.5))
    assert status == 200
    assert made["preset"] == json.loads(json.dumps(preset_data(str(tmp_path / "preset.toml"))))


@needs_page
@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("max_voltage_V=3.7", "limits.max_voltage_V: 3.7 is looser than the preset's 3.6"),
        ("max_voltage_V=x", "limits.max_voltage_V: 'x' is no positive number; at most 3.6"),
        ("max_soc=nan", "limits.max_soc: 'nan' is no positive number"),
        ("completion_soc=-1", "limits.completion_soc: '-1' is no positive number"),
        ("max_soc=0.5", "completion_soc"),
        ("reference_current_A=-10", "limits.reference_current_A: cannot be changed here"),
    ],
)
def test_limits_that_cannot_be_are_refused_in_one_line(address, query, said):
    message = json.loads(get(address, f"/limits/lin2014.json?{query}")[2])["error"]
    assert said in message
    assert len(message.splitlines()) == 1


@needs_page
def test_a_websocket_of_another_origin_is_refused(address):
    from websockets.exceptions import InvalidStatus  # noqa: PLC0415 (where it is skipped)

    for origin in ("http://evil.example", "null", f"{address[:-1]}0", "https://127.0.0.1"):
        with pytest.raises(InvalidStatus, match="403"):
            feed_of(address, origin=origin).__enter__()
    with feed_of(address, origin=address.rstrip("/")) as feed:
        assert "snapshot" in json.loads(feed.recv(PATIENCE_S))


@needs_page
def test_what_a_browser_says_reaches_no_bus_and_a_client_that_vanishes_leaves_the_others(
    address, hub
):
    with feed_of(address) as feed:
        feed.send('{"id": 256, "data": "00"}')
        feed.recv(PATIENCE_S)
        rude = feed_of(address).__enter__()
        rude.recv(PATIENCE_S)
        rude.socket.close()  # no farewell, as of a tab that is killed
        for _ in range(3):
            assert "snapshot" in json.loads(feed.recv(PATIENCE_S))
    assert get(address)[0] == 200
    assert not [command for command in hub.commands[0] if command[:1] in b"tTrR"]


@needs_page
def test_it_ends_in_time_though_a_feed_is_open(hub):
    with dashboard("--bus", hub.bus) as (address, process):
        feed = feed_of(address).__enter__()
        feed.recv(PATIENCE_S)
        begin_s = time.monotonic()
        process.terminate()
        process.wait(PATIENCE_S)
        assert time.monotonic() - begin_s < 5.0
        feed.socket.close()


class FailingListener:
    """In the place of a Listener: hands over some frames, and fails when it is told to."""

    fails = threading.Event()

    def __init__(self, bus):
        self.left = [
            Frame(0x100, b"\0\0\0\0\0\0"),
            Frame(0x7FF, b""),
            ForeignFrame.REMOTE,
            Frame(0x185, bytes(3)),
        ]

    def receive(self, timeout_s):
        if self.left:
            return self.left.pop(0)
        if self.fails.wait(timeout_s):
            raise BusError("bus 'x': the line is gone")
        return None

    def close(self):
        pass


def wait_until(holds):
    end_s = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def test_malformed_frames_are_counted_and_a_lost_bus_is_told(monkeypatch):
    monkeypatch.setattr("hil_sim.dashboard.feed.Listener", FailingListener)
    with BusFeed("x", preset_finder(None), WallClock()) as feed:
        wait_until(lambda: feed.message()["snapshot"]["frames"] == 4)
        snapshot = feed.message()["snapshot"]
        assert snapshot["foreign"] == 2
        refused = {one["name"]: one["refused"] for one in snapshot["messages"] if one["refused"]}
        assert refused == {"CellElectrical": 1, "Identity": 1}
        FailingListener.fails.set()
        wait_until(lambda: feed.message() == {"error": "bus 'x': the line is gone"})
        FailingListener.fails.clear()
        wait_until(lambda: feed.message().get("snapshot", {}).get("frames") == 8)


@needs_page
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--bus", "virtual:bms"), "one process only"),
        (("--bus", "socketcan:not_there9"), "cannot be opened"),
        (("--preset", "nothing"), "nothing"),
        (("--preset", "lin2014", "--model", shipped_model_path("paper_calibrated")), "trained for"),
        (("--port", "70000"), "--port"),
        (("--for-s", "0"), "--for-s"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(bms, arguments, said):
    code, out, err = bms("dashboard", *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


@needs_page
def test_a_port_that_is_taken_is_refused(bms):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, _, err = bms("dashboard", "--port", port)
    assert code == 2
    assert f"--port {port}" in err


def test_without_its_packages_or_its_page_it_says_how_to_get_them(bms, monkeypatch, tmp_path):
    monkeypatch.setattr("hil_sim.commands.dashboard._NEEDED", ("starlette", "not_there"))
    code, _, err = bms("dashboard")
    assert code == 2
    assert "not_there not installed" in err and "kan-rcbf-bms[dashboard]" in err
    with pytest.raises(InputError, match="make page"):
        page_build.require_page(tmp_path)
    (tmp_path / "built-from").write_text("other sources\n")
    with pytest.raises(InputError, match="other sources; build it with 'make page'"):
        page_build.require_page(tmp_path)


@needs_page
def test_as_files_it_has_what_the_server_hands_out(address, tmp_path, monkeypatch):
    monkeypatch.setattr("hil_sim.dashboard.page_data.preset_names", lambda: ["lin2014"])
    write_site(tmp_path)
    names = config_data(None)["presets"]
    paths = [f"data/{name}{end}.json" for name in names for end in ("", ".rows")]
    config = json.loads((tmp_path / "data" / "config.json").read_text())
    assert config["bus"] is None
    made = {
        (name, limit, value): json.loads(
            (tmp_path / "limits" / name / f"{limit}={value}.json").read_text()
        )
        for name, limits in config["limits"].items()
        for limit, values in limits.items()
        for value in values
    }
    assert len(made) == len(list(tmp_path.rglob("limits/*/*.json"))) == 16
    assert ("lin2014", "max_core_temperature_K", "318") in made
    for (name, limit, value), tighter in list(made.items())[::5]:
        served = json.loads(get(address, f"/limits/{name}.json?{limit}={value}")[2])
        assert tighter == served and "error" not in served
    for path in ["index.html", "page.wasm", "data/database.json", *paths]:
        assert get(address, f"/{path}")[2] == (tmp_path / path).read_bytes()
    assert len(paths) == 4
    text = (tmp_path / "index.html").read_text()
    assert not re.search(r'(src|href)="(https?:|/)', text)


def test_the_tables_of_the_noise_are_those_of_a_ziggurat():
    """Strips of one area under the density of the normal distribution, the last with the tail."""
    tables = ziggurat_tables()
    edge = [step * 2**52 for step in tables["step"]]
    areas = [
        edge[i] * (tables["density"][i - 1] - tables["density"][i]) for i in range(2, len(edge))
    ]
    assert max(areas) - min(areas) < 1e-14
    assert tables["tail"] == edge[-1]
    assert edge[0] * tables["density"][-1] == pytest.approx(areas[0], rel=1e-12)
    inside = [round(edge[i - 1] / edge[i] * 2**52) for i in range(2, len(edge))]
    assert all(abs(a - b) <= 1 for a, b in zip(inside, tables["inside"][2:]))
