"""The plant's side of the bus: late and foreign answers, and an ECU that starts later."""

import can
import pytest

from bms.errors import BusError
from bms.firmware import ReceptionCounts
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.bus.database import COUNTER_MODULUS
from hil_sim.bus.e2e import Sender
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.plant import CONNECT_ATTEMPTS, PlantNode, Request
from hil_sim.nodes.turns import LockStep
from hil_sim.plant.sensors import Readings

READINGS = Readings(-1.0, 3.3, 300.0, 299.0, 1.0)
PERIODS_TO_TRUST = 3
WINDOW_PERIODS = 5
REQUEST = Request(charge=False, reference_current_A=-23.0, plug_in_soc=0.1)


class Wire:
    """A plant node on a bus whose other end a test plays by hand."""

    def __init__(self, name, database, serve, recorder=None):
        self.near, self.far = open_bus(name), open_bus(name)
        self.heard = []
        self._command = Sender(database["ChargeCommand"])
        self._serve = serve
        self.node = PlantNode(self.near, database, LockStep(0.1, 0.005, self._respond), recorder)

    def _respond(self):
        heard = []
        while (frame := self.far.receive(0.0)) is not None:
            heard.append(frame)
        self.heard.append(heard)
        self._serve(self)

    def trusted(self):
        """After the periods that make the charge command valid."""
        serve, self._serve = self._serve, lambda wire: wire.command(-0.5)
        answers = [self.node.exchange(n, READINGS, REQUEST) for n in range(PERIODS_TO_TRUST)]
        commands_A = [answer.usable_command_A for answer in answers]
        assert commands_A == [None] * (PERIODS_TO_TRUST - 1) + [pytest.approx(-0.5)]
        self.heard.clear()
        self._serve = serve
        return self

    def exchange(self):
        return self.node.exchange(len(self.heard), READINGS, REQUEST)

    def command(self, current_A):
        self.far.send(self._command.frame({"CommandCurrent": current_A, "CommandState": 2}))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.near.__exit__(None, None, None)
        self.far.__exit__(None, None, None)


def test_what_an_ecu_says_is_told_before_a_charger_may_use_it(database):
    with Wire("virtual:told", database, lambda wire: wire.command(-1.0)) as wire:
        answer = wire.exchange()
    assert answer.command_A == pytest.approx(-1.0)
    assert answer.usable_command_A is None


def test_measurements_come_before_sync(database):
    with Wire("virtual:order", database, lambda wire: wire.command(-1.0)) as wire:
        answer = wire.trusted().exchange()
    assert [frame.frame_id for frame in wire.heard[0]] == [0x100, 0x101, 0x102, 0x103, 0x080]
    assert answer.usable_command_A == pytest.approx(-1.0)
    assert answer.state == "charging"


def test_an_answer_that_comes_too_late_is_not_taken_for_the_next_one(database):
    with Wire("virtual:late", database, lambda wire: wire.command(-1.0)) as wire:
        wire.trusted()._serve = lambda wire: None
        assert wire.exchange().usable_command_A is None
        wire.command(-7.0)
        wire._serve = lambda wire: wire.command(-2.0)
        assert wire.exchange().usable_command_A == pytest.approx(-2.0)
        assert wire.exchange().usable_command_A == pytest.approx(-2.0)


def test_a_repeated_or_corrupt_command_is_none(database):
    frames = []

    def repeat(wire):
        if not frames:
            frames.append(wire._command.frame({"CommandCurrent": -5.0}))
        wire.far.send(frames[0])

    def corrupt(wire):
        frame = wire._command.frame({"CommandCurrent": -5.0})
        wire.far.send(frame._replace(data=flipped(frame.data, 3)))

    with Wire("virtual:repeat", database, repeat) as wire:
        assert wire.trusted().exchange().usable_command_A == pytest.approx(-5.0)
        assert wire.exchange().usable_command_A is None
        wire._serve = corrupt
        assert wire.exchange().usable_command_A is None
        assert wire.node.command_counts == ReceptionCounts(0, 1, 1, 0, 0)


COMMAND_LENGTH = 5


def flipped(data, position):
    return data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :]


def command_beside_a_damaged_one(wire):
    wire.far.send(Frame(0x180, bytes(COMMAND_LENGTH)))
    wire.command(-1.0 - len(wire.heard))


def test_a_damaged_command_from_elsewhere_does_not_end_the_answer(database):
    """Otherwise each such frame would leave the plant one more period ahead of the ECU."""
    with Wire("virtual:damaged", database, command_beside_a_damaged_one) as wire:
        wire.trusted()
        for period in range(2):
            assert wire.exchange().usable_command_A == pytest.approx(-2.0 - period)


@pytest.mark.parametrize("every", [1, 3, 4])
def test_a_masquerade_with_a_frozen_counter_neither_makes_commands_late_nor_is_obeyed(
    database, every
):
    """Where the frozen counter is one of the next three it is in sequence; so is the true one."""
    codec = database["ChargeCommand"]
    frozen = Frame(codec.frame_id, codec.encode({"CommandCurrent": -20.0}, PERIODS_TO_TRUST - 1))

    def serve(wire):
        if len(wire.heard) % every == 0:
            wire.far.send(frozen)
        wire.command(-0.1 * len(wire.heard))

    with Wire("virtual:masquerade", database, serve) as wire:
        wire.trusted()
        commands_A = [wire.exchange().usable_command_A for _ in range(64)]
    own = sum(
        command_A == pytest.approx(-0.1 * period) for period, command_A in enumerate(commands_A, 1)
    )
    assert own + commands_A.count(0.0) + commands_A.count(None) == 64
    assert own >= 64 - 8 * 64 / COUNTER_MODULUS, "a contradiction ends with its window"


@pytest.mark.parametrize("place", ["ahead", "behind"])
@pytest.mark.parametrize("steps_ahead", [0, 1, 2, 3])
@pytest.mark.parametrize("pattern", [(1,), (1, 0), (1, 1, 0)])
@pytest.mark.parametrize("own_A", [0.0, -2.0])
def test_a_command_of_somebody_else_never_makes_the_charger_stronger(
    database, place, steps_ahead, pattern, own_A
):
    """It has a running counter and the right CRC; what the ECU says meanwhile still holds."""
    codec = database["ChargeCommand"]

    def foreign(wire):
        period = len(wire.heard) - 1
        if pattern[period % len(pattern)]:
            counter = (PERIODS_TO_TRUST + period + steps_ahead) % COUNTER_MODULUS
            data = codec.encode({"CommandCurrent": -23.0, "CommandState": 2}, counter)
            wire.far.send(Frame(codec.frame_id, data))

    def serve(wire):
        if place == "ahead":
            foreign(wire)
        wire.command(own_A)
        if place == "behind":
            foreign(wire)

    with Wire(f"virtual:rival {place} {steps_ahead}", database, serve) as wire:
        wire.trusted()
        usable_A = [wire.exchange().usable_command_A for _ in range(30)]
    assert min(command_A for command_A in usable_A if command_A is not None) >= own_A - 1e-6
    if pattern == (1,):
        assert usable_A[4:] == [0.0] * 26, "contradiction stops the charger"


@pytest.mark.parametrize("ahead", [0, 1], ids=["before the ECU's own", "after it, for the next"])
def test_after_one_command_that_passes_for_the_ecus_the_next_are_those_of_their_own_periods(
    database, ahead
):
    """It stops the charger for a window of periods, is never obeyed, and delays none."""
    codec = database["ChargeCommand"]

    def serve(wire):
        period = len(wire.heard)
        counter = (PERIODS_TO_TRUST + period - 1 + ahead) % COUNTER_MODULUS
        forged = Frame(codec.frame_id, codec.encode({"CommandCurrent": -20.0}, counter))
        own = wire._command.frame({"CommandCurrent": -0.1 * period})
        both = [own, forged] if ahead else [forged, own]
        wire.far.send(*(both if period == 2 else [own]))

    with Wire("virtual:forged", database, serve) as wire:
        wire.trusted()
        commands_A = [wire.exchange().usable_command_A for _ in range(20)]
    expected_A = [-0.1 * period for period in range(1, 21)]
    contested = slice(1 + ahead, 1 + ahead + WINDOW_PERIODS)
    expected_A[contested] = [0.0] * WINDOW_PERIODS
    assert commands_A == pytest.approx(expected_A)


def test_an_ecu_that_restarts_is_followed_after_one_wait(database):
    with Wire("virtual:restart", database, lambda wire: wire.command(-1.0)) as wire:
        wire.trusted()
        for _ in range(5):
            wire.exchange()
        wire._command = Sender(database["ChargeCommand"])
        assert wire.exchange().usable_command_A is None
        for _ in range(4):
            assert wire.exchange().usable_command_A == pytest.approx(-1.0)
        assert wire.node.command_counts == ReceptionCounts(0, 0, 0, 8, 0)


def test_a_charger_does_not_rely_on_a_command_that_comes_often_damaged(database):
    """Three bad periods of the last five, though a good frame came in each as well."""
    with Wire("virtual:disturbed", database, command_beside_a_damaged_one) as wire:
        wire.trusted()
        refused = [wire.exchange().usable_command_A is None for _ in range(4)]
        assert refused == [False, False, True, True]
        wire._serve = lambda wire: wire.command(-3.0)
        back = [wire.exchange().usable_command_A for _ in range(4)]
        assert back == [None, None, None, pytest.approx(-3.0)]
        assert wire.node.command_counts.wrong_crc == 4


def test_a_random_intact_command_out_of_sequence_is_refused(database):
    """One random frame in 256 passes the CRC; the counter has to follow as well."""
    codec = database["ChargeCommand"]

    def serve(wire):
        wire.far.send(Frame(codec.frame_id, codec.encode({"CommandCurrent": -20.0}, counter=11)))

    with Wire("virtual:random", database, serve) as wire:
        assert wire.trusted().exchange().usable_command_A is None


def test_an_ecu_that_starts_later_hears_the_first_period_as_if_it_were_sent_once(
    database, tmp_path
):
    with Recorder(tmp_path / "can.log") as recorder:
        asleep = iter([True, True, False, False])

        def serve(wire):
            if not next(asleep):
                wire.command(0.0)

        with Wire("virtual:start", database, serve, recorder) as wire:
            wire.node.exchange(0, READINGS, REQUEST)
            wire.node.exchange(1, READINGS, REQUEST)
    assert wire.heard[0] == wire.heard[1] == wire.heard[2] != wire.heard[3]
    with can.LogReader(tmp_path / "can.log") as reader:
        assert len(list(reader)) == 2 * 6


def test_an_ecu_that_never_starts_is_an_error_with_the_remedy(database):
    with (
        Wire("virtual:alone", database, lambda wire: None) as wire,
        pytest.raises(BusError, match="bms ecu --bus virtual:alone"),
    ):
        wire.node.exchange(0, READINGS, REQUEST)
    assert len(wire.heard) == CONNECT_ATTEMPTS
