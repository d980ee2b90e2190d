"""Logs of other tools: read whole, or counted, or refused; never a frame more or fewer."""

import codecs

import pytest

from bms.errors import InputError
from hil_sim.logs import LogFrame, Selection, Unread, read_log
from tests.hil_sim.dialects import DIALECTS, asc, candump_log
from tests.hil_sim.dialects.asc import ASC_HEADER

FRAMES = (
    LogFrame(0.0, 0x080, b"", received=False),
    LogFrame(0.0, 0x100, bytes.fromhex("CD40EFA7F505"), received=False),
    LogFrame(0.1, 0x7FF, bytes.fromhex("0001020304050607")),
    LogFrame(0.100001, 0x1ABCDEF0, bytes.fromhex("FF"), is_extended=True),
    LogFrame(12.345678, 0x185, bytes.fromhex("A417AB199D380200")),
    LogFrame(12.4, 0x180, bytes.fromhex("CF40EF07")),
)

each_dialect = pytest.mark.parametrize("name", DIALECTS)


def read(tmp_path, name, content, selection=None):
    path = tmp_path / f"can{DIALECTS[name].suffix}"
    path.write_bytes(content)
    return read_log(path, *([selection] if selection else []))


def expected(name, frames=FRAMES):
    kept = DIALECTS[name].keeps_direction
    return [frame if kept else frame._replace(received=True) for frame in frames]


def lines_of(content: bytes) -> list[bytes]:
    return content.splitlines(keepends=True)


# --- Whole logs ----------------------------------------------------------------------------------


@each_dialect
def test_every_frame_is_read_with_the_first_and_the_last(tmp_path, name):
    log = read(tmp_path, name, DIALECTS[name].write(FRAMES))
    assert list(log) == expected(name)
    kinds = {Unread.OTHER_ENTRIES} if name == "CANoe, relative times" else set()
    assert set(log.unread) == kinds


@pytest.mark.parametrize(
    ("name", "line"), [(name, line) for name, one in DIALECTS.items() for line in one.foreign]
)
@pytest.mark.parametrize("place", [-4, None])
def test_a_foreign_entry_is_counted_and_changes_nothing_else(tmp_path, name, line, place):
    dialect = DIALECTS[name]
    lines = lines_of(dialect.write(FRAMES))
    # Before a frame with the time of the frame before that; None is the end.
    at = len(lines) + (place or 0)
    time_s = (FRAMES[place - 1] if place else FRAMES[-1]).time_s
    ending = b"\r\n" if lines[0].endswith(b"\r\n") else b"\n"
    entry = line.format(
        time=f"{time_s:.6f}", time_ms=f"{1e3 * time_s:.3f}", time_us=round(1e6 * time_s)
    )
    log = read(tmp_path, name, b"".join([*lines[:at], entry.encode() + ending, *lines[at:]]))
    kind, count = dialect.foreign[line]
    assert list(log) == expected(name)
    assert dict(log.unread) == {kind: count}


@pytest.mark.parametrize("name", [name for name in DIALECTS if DIALECTS[name].suffix != ".blf"])
@pytest.mark.parametrize(
    "change",
    [
        lambda content: codecs.BOM_UTF8 + content,
        lambda content: content.decode().encode("utf-16"),
        lambda content: content.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n"),
        lambda content: content.replace(b"\r\n", b"\n").replace(b"\n", b"\n\n"),
        lambda content: content.replace(b"\n", b"\n// Pr\xfcfstand\n"),
        lambda content: content.replace(b"\n", b"\n# \xfc\xb0\n"),
        lambda content: b"".join(line.rstrip() + b" \t\n" for line in lines_of(content)),
    ],
    ids=["BOM", "UTF-16", "CRLF", "blank lines", "Latin-1", "comments", "trailing blanks"],
)
def test_encoding_line_ends_and_comments_do_not_matter(tmp_path, name, change):
    assert list(read(tmp_path, name, change(DIALECTS[name].write(FRAMES)))) == expected(name)


@pytest.mark.parametrize(
    "content",
    [
        "sep=;\r\ntimestamp;arbitration_id;extended;remote;error;dlc;data\r\n0,5;100;0;0;0;2;AQI=\r\n",
        "timestamp\tarbitration_id\textended\tremote\terror\tdlc\tdata\n0.5\t0x100\t0\t0\t0\t2\tAQI=\n",
        '"timestamp","arbitration_id","extended","remote","error","dlc","data"\n'
        '"0.5","0x100","0","0","0","2","AQI="\n',
        "Time Stamp;ID;Extended;Dir;Bus;LEN;D1;D2;D3;D4;D5;D6;D7;D8\n"
        "500000;100;FALSE;Rx;0;2;1;2;;;;;;\n",
        "time stamp,id,extended,dir,bus,len,d1,d2\n500000,0x100,False,rx,0,2,0x01,0x02\n",
        "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
        "500000,00000100,false,Rx,0,2,01,02,00,00,00,00,00,00\n",
    ],
)  # fmt: skip
def test_a_table_may_have_been_through_a_spreadsheet(tmp_path, content):
    log = read(tmp_path, "SavvyCAN", content.encode())
    assert list(log) == [LogFrame(0.5, 0x100, bytes([1, 2]))]


# --- Cut logs ------------------------------------------------------------------------------------


@each_dialect
def test_a_log_that_is_cut_off_anywhere_gives_its_first_frames_or_is_refused(tmp_path, name):
    frames = FRAMES[1:4]
    whole = DIALECTS[name].write(frames)
    for length in range(len(whole)):
        try:
            log = read(tmp_path, name, whole[:length])
        except InputError as refused:
            assert "\n" not in str(refused)
            continue
        count = len(log.frames)
        assert list(log) == expected(name, frames)[:count]
        # Nothing of what is there is left out: each line is a frame, a header or counted.
        ends = whole[:length].count(b"\n")
        before = len(lines_of(whole)) - len(frames)
        if name != "CANoe, relative times":
            assert count + before in (ends, ends + 1)


@each_dialect
def test_the_last_line_needs_no_end_where_it_can_be_no_other(tmp_path, name):
    """At 8 bytes, or with the number of bytes or the direction said, nothing can be missing."""
    if DIALECTS[name].suffix == ".blf":
        return
    content = DIALECTS[name].write(FRAMES).rstrip()
    if name == "candump -L":
        with pytest.raises(InputError, match=r"line 6: it has no end.*cut off.*echo >> "):
            read(tmp_path, name, content)
    elif name == "CANoe, decimal":  # the last byte could have a third digit, but here it has none
        with pytest.raises(InputError, match=r"line 8: it has no end.*cut off.*echo >> "):
            read(tmp_path, name, content)
    else:
        assert list(read(tmp_path, name, content)) == expected(name)


# --- Channels and times --------------------------------------------------------------------------


def two_channels() -> bytes:
    one, other = (candump_log(FRAMES, channel=channel) for channel in ("can0", "vcan1"))
    return b"".join(a + b for a, b in zip(lines_of(one), lines_of(other)))


def test_frames_of_two_channels_are_not_mixed(tmp_path):
    counts = r"2 channels .* can0 \(6 frames\), vcan1 \(6 frames\).* --channel can0"
    with pytest.raises(InputError, match=counts):
        read(tmp_path, "candump -L", two_channels())
    for channel in ("can0", "vcan1"):
        log = read(tmp_path, "candump -L", two_channels(), Selection(channel))
        assert list(log) == list(FRAMES)
        assert dict(log.unread) == {Unread.OTHER_CHANNEL_FRAMES: len(FRAMES)}


def test_a_channel_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    with pytest.raises(InputError, match=r"'can7' .* can0 \(6 frames\)"):
        read(tmp_path, "candump -L", candump_log(FRAMES), Selection("can7"))


@pytest.mark.parametrize("interface", ["can0", "vcan12", "slcan0", "any", "can-fd_1", "0"])
def test_any_name_of_an_interface_will_do(tmp_path, interface):
    content = candump_log(FRAMES, channel=interface)
    assert list(read(tmp_path, "candump -L", content)) == list(FRAMES)


def test_times_before_the_trigger_are_negative(tmp_path):
    log = read(tmp_path, "CANoe", asc(FRAMES, start_s=-1.05))
    assert [f.time_s for f in log] == [round(f.time_s - 1.05, 6) for f in FRAMES]


def test_times_that_count_from_the_line_before_are_added_up_when_that_is_said(tmp_path):
    before = (FRAMES[0], *FRAMES)
    deltas = [f._replace(time_s=f.time_s - b.time_s) for f, b in zip(FRAMES, before)]
    content = candump_log(deltas)
    with pytest.raises(InputError, match="line 4, frame 4: time goes back") as refused:
        read(tmp_path, "candump -L", content)
    assert "--delta-times" in str(refused.value)
    log = read(tmp_path, "candump -L", content, Selection(delta_times=True))
    assert list(log) == list(FRAMES)


def test_relative_times_count_from_every_line_not_only_from_frames(tmp_path):
    content = DIALECTS["CANoe, relative times"].write(FRAMES)
    assert list(read(tmp_path, "CANoe, relative times", content)) == list(FRAMES)


def test_dates_as_candump_shows_them_are_times(tmp_path):
    lines = "".join(f" (2026-06-05 06:24:0{n}.250000)  can0  123   [1]  0{n}\n" for n in range(3))
    log = read(tmp_path, "candump -t a", lines.encode())
    assert [b.time_s - a.time_s for a, b in zip(log.frames, log.frames[1:])] == [1.0, 1.0]


def test_what_candump_shows_with_ascii_is_read(tmp_path):
    line = b" (0.100000)  can0  123   [3]  41 27 42                  'A'B'\n"
    assert list(read(tmp_path, "candump -t a", line)) == [LogFrame(0.1, 0x123, b"A'B")]


def test_what_candump_shows_without_times_says_how_to_record(tmp_path):
    with pytest.raises(InputError, match=r"no times in it.*candump -L"):
        read(tmp_path, "candump -t a", b"  can0  123   [2]  01 02\n")


# --- Refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("candump -L", "(0.1) can0 123#0"),
        ("candump -L", "(0.1) can0 123##1AAB"),
        ("candump -L", "(0.1) can0 123#112233_9"),
        ("candump -L", "(0.1) can0 F0000000#11"),
        ("candump -L", f"DROPCOUNT: dropped {'9' * 5000} CAN frames on 'can0' socket"),
        ("candump -L", "x" * 100_000),
        ("candump -L", "(0.1) can0 123#\x07\u2028#"),
        ("candump -t a", " (0.1)  can0  123   [3]  01 02"),
        ("candump -t a", " (0.1)  can0  123   [2]  01`02"),
        ("CANoe", "   0.1 1  123  Rx   d 3 01 02"),
        ("CANoe", "   0.1 1  123  Rx   d 2 01 XY"),
        ("CANoe", "   0.1 1  123  Rx   d 1F 01"),
        ("CANoe", "   0.1 1  123  Ry   Tx d 1 01"),
        ("CANoe", "1  123  Rx   d 1 01"),
        ("CANoe", "   0.1 CANFD   1 Rx  123   0 0 2  2 01"),
        ("CANoe", "   0.1 CANFD   1 Rx  123   0 0 2  1 01  130000  130  0 0 0 0 0 0"),
        ("python-can as CSV", "0.1,0x123,0,0,0,2,AQ=="),
        ("python-can as CSV", "0.1,0x123,0,0,0,2,\u00e9\u00e9"),
        ("python-can as CSV", "0.1,0x123,0,0,2,AQI="),
        ("python-can as CSV", "0.1,0x123,maybe,0,0,2,AQI="),
        ("SavvyCAN", "100000,00000123,false,Rx,0,3,01,02,"),
        ("SavvyCAN", "100000,00000123,false,Rx,0,1,01,02,"),
        ("SavvyCAN", "0.1,00000123,false,Rx,0,1,01,"),
        ("SavvyCAN", "\u00b2,00000123,false,Rx,0,1,01,"),
        ("SavvyCAN", f"{10**30},00000123,false,Rx,0,1,01,"),
        ("PEAK 1.1", "     3)         1.0  Rx         0123  3  01 02"),
        ("PEAK 2.1", "      3         1.000 XX  1     0123 Rx -  1    01"),
        ("PEAK 2.1", "      3         1.000 DT  1     0123 Rx"),
    ],
)  # fmt: skip
def test_a_damaged_line_is_refused_with_its_number(tmp_path, name, line):
    lines = lines_of(DIALECTS[name].write(FRAMES[:2]))
    content = b"".join([*lines, line.encode() + b"\n"])
    where = rf": line {len(lines) + 1}: cannot be read as '\.\w+'"
    with pytest.raises(InputError, match=where) as refused:
        read(tmp_path, name, content)
    assert str(refused.value).isprintable()


def test_names_in_the_place_of_identifiers_are_named(tmp_path):
    line = b"   0.1 1  EngineData  Rx   d 1 01\n"
    with pytest.raises(InputError, match=r"'EngineData' is not an identifier.*not as names"):
        read(tmp_path, "CANoe", "\n".join(ASC_HEADER).encode() + b"\n" + line)


def test_other_columns_are_refused_with_those_that_are_wanted(tmp_path):
    with pytest.raises(InputError, match=r"timestamp,arbitration_id.*Time Stamp,ID,Extended"):
        read(tmp_path, "SavvyCAN", b"time,signal,value\n0.1,Current,3.5\n")


def test_an_unknown_version_of_a_format_is_named(tmp_path):
    with pytest.raises(InputError, match=r"version 3\.0 .*1\.0, 1\.1, 1\.2, 1\.3, 2\.0, 2\.1"):
        read(tmp_path, "PEAK 2.1", b";$FILEVERSION=3.0\n1 1.0 DT 1 0123 Rx - 1 01\n")


def test_foreign_entries_alone_are_counted_in_the_refusal(tmp_path):
    content = b"(0.1) can0 123##1AABB\n(0.2) can0 123#R\n(0.3) can0 123#R\n"
    with pytest.raises(InputError, match=r"empty.*2 remote frames, 1 CAN FD frame"):
        read(tmp_path, "candump -L", content)
