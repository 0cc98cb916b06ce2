"""Records that make no sense are refused at START, with what is wrong; random ones put out nothing before ARM and harm none."""

import zlib
from collections.abc import Callable, Iterator
from random import Random

import numpy as np
import pytest

from rig.tick.layout import TickArrays
from rig.wire.messages import ARM_KEY, Command, DeviceState, Parameter, Record
from tests.firmware.loop_client import LoopHost, copy_of, loop_host, settings_for, tick_for

PLACES = {name: place for place, name in enumerate(TickArrays._fields)}
SIZE, NUMBER, RANGE, NOT_A_NUMBER, RATE, VOLTAGE = range(1, 7)
NOT_ALLOWED = 2
CONSTANTS = 7  # arrays that a run reads only


@pytest.fixture(scope="module")
def host() -> Iterator[LoopHost]:
    with loop_host() as one:
        yield one


@pytest.fixture
def arrays(host: LoopHost) -> TickArrays:
    return tick_for(settings_for(0.2, 0.3), host.plant).arrays


def require_refused(host: LoopHost, name: str, reason: int) -> None:
    answer = host.ask(Command.START)
    assert answer.status == NOT_ALLOWED, name
    assert divmod(answer.value, 256) == (PLACES[name], reason)
    assert host.get(Parameter.TICK_FAULT) == answer.value
    assert host.get(Parameter.STATE) == DeviceState.IDLE
    assert not host.plant.volts


@pytest.mark.parametrize("name", TickArrays._fields)
def test_an_array_that_is_missing(host: LoopHost, arrays: TickArrays, name: str) -> None:
    host.set_up()
    for place, array in enumerate(arrays):
        assert host.set(Parameter.TICK_BYTES, array.nbytes * (place != PLACES[name]), place).status == 0
    require_refused(host, name, SIZE)


def test_sizes_that_no_whole_records_have_or_for_which_there_is_no_room(host: LoopHost, arrays: TickArrays) -> None:
    host.set_up()
    for place, array in enumerate(arrays):
        answer = host.set(Parameter.TICK_BYTES, array.nbytes + 1, place)
        assert (answer.status, answer.value) == (NOT_ALLOWED, array.nbytes)
        assert host.set(Parameter.TICK_BYTES, array.nbytes, place).status == 0
    room, item = host.get(Parameter.TICK_ROOM), arrays.history.itemsize
    taken = sum(-(-array.nbytes // 8) * 8 for array in arrays[:-1])
    answer = host.set(Parameter.TICK_BYTES, room, PLACES["history"])
    assert (answer.status, answer.value) == (NOT_ALLOWED, (room - taken) // item * item)
    assert host.set(Parameter.TICK_BYTES, 8, 16).status == 1
    assert host.set(Parameter.TICK_BYTES, 0, 0).status == 0
    assert [host.get(Parameter.TICK_BYTES, place) for place in range(16)] == [0] * 16


def one_more(name: str, *, less: bool = False) -> Callable[[TickArrays], TickArrays]:
    def change(arrays: TickArrays) -> TickArrays:
        array = getattr(arrays, name)
        return arrays._replace(**{name: array[:-1] if less else np.concatenate([array, array[-1:]])})

    return change


def with_field(name: str, field: str, value: float, index: int = 0) -> Callable[[TickArrays], TickArrays]:
    def change(arrays: TickArrays) -> TickArrays:
        inside = getattr(arrays, name)
        *outer, last = field.split(".")
        for one in outer:
            inside = inside[one]
        inside[last][index] = value
        return arrays

    return change


NUMBERS = [
    *((name, one_more(name)) for name in ("law", "rule", "limits", "inputs", "expected", "loop", "control", "guard")),
    *((name, one_more(name)) for name in ("watches", "plausibility", "settling", "progress", "outcomes", "history")),
    *((name, one_more(name, less=True)) for name in ("inputs", "watches", "outcomes", "history")),
    ("segments", with_field("progress", "segments", 5)),
    ("outcomes", one_more("segments")),
    ("history", with_field("loop", "delay_whole", 1)),
    ("history", with_field("loop", "delay_whole", -2)),
    ("history", with_field("loop", "delay_whole", 2**62)),
]


@pytest.mark.parametrize(("name", "change"), NUMBERS)
def test_numbers_of_records_that_do_not_fit(host: LoopHost, arrays: TickArrays, name: str, change: Callable) -> None:
    host.set_up()
    host.upload(change(arrays))
    require_refused(host, name, NUMBER)


def test_waveforms_that_are_no_whole_rows(host: LoopHost, arrays: TickArrays) -> None:
    host.set_up()
    host.upload(arrays._replace(waveforms=np.zeros((3, 7))))
    for period, is_whole in ((2, False), (21, True), (8, False), (2**31 - 1, False)):
        assert host.set(Parameter.TICK_PERIOD, period).status == 0
        if not is_whole:
            require_refused(host, "waveforms", NUMBER)
    assert host.set(Parameter.TICK_PERIOD, 0).status == NOT_ALLOWED


RANGES = [
    *(("law", f"detector.{field}", value) for field, value in (("kind", 3), ("kind", -1), ("harmonics", 13))),
    *(("law", "harmonics.highest", value) for value in (1, -1, 13, 2**60)),
    ("law", "harmonics.of_drive", 2),
    ("law", "frequency.law", 2),
    ("law", "amplitude.force.loop", 3),
    *(("rule", "average_periods", value) for value in (0, 65, 2**63 - 1)),
    ("rule", "amplitude", 0.0),
    *(("limits", name, 0.0) for name in ("voltage_v", "displacement_m", "lowest_rad_s", "slew_v_per_sample")),
    *(("limits", name, -1.0) for name in ("voltage_v", "resonance_rad_s", "integrator_gain", "integrator_leak")),
    *(("limits", name, 0) for name in ("overload_samples", "stuck_samples", "lost_samples", "ramp_down_samples")),
    ("limits", "highest_rad_s", 0.1),
    *(("inputs", name, 0.0) for name in ("unit_per_volt", "overload_v", "limit")),
    *(("inputs", name, 4) for name in ("role", "watch_displacement", "emergency_stop")),
    *(
        ("segments", name, -2)
        for name in ("kind", "drive", "amplitude_law", "waveform", "again", "on_failure", "samples")
    ),
    *(("segments", name, 8) for name in ("kind", "drive", "amplitude_law", "waveform", "again", "on_lost_lock")),
    ("segments", "periods", -1.0),
    ("waveforms", "", 1.0001),
    *(("loop", name, -1) for name in ("sample", "force_channel", "drive_channel", "queue_whole", "waveform", "play")),
    *(("loop", name, 4) for name in ("sample", "force_channel", "drive_channel", "drive", "waveform", "play")),
    *(("loop", "delay_fraction", value) for value in (-0.1, 1.0)),
    ("loop", "dt_s", -1e-4),
    *(("control", name, 9) for name in ("amplitude.law", "lock.state", "harmonics.stage")),
    *(("control", "frequency.omega", value) for value in (0.0, np.inf)),
    *(("guard", name, 4) for name in ("mode", "channel", "amplitude_v")),
    ("settling", "count", -1),
    *(("progress", name, 1) for name in ("segment", "entered", "finished", "sample", "n_refused")),
    ("progress", "held_back", 2),
    ("progress", "retries", 101),
    ("progress", "tries_left", 101),
    ("outcomes", "outcome", 14),
]


@pytest.mark.parametrize(("name", "field", "value"), RANGES)
def test_places_and_codes_out_of_range(host: LoopHost, arrays: TickArrays, name: str, field: str, value: float) -> None:
    if field:
        with_field(name, field, value)(arrays)
    else:
        getattr(arrays, name)[0] = value
    host.set_up()
    host.upload(arrays)
    require_refused(host, name, RANGE)


def doubles_of(dtype: np.dtype, before: str = "", at: int = 0) -> Iterator[tuple[str, int]]:
    """Path and offset of all numbers of double precision; of an array the first and the last."""
    for name in dtype.names or ():
        kind, offset = dtype.fields[name][:2]  # type: ignore[index]
        for index in sorted({0, int(np.prod(kind.shape, dtype=int)) - 1}):
            begin = at + offset + index * kind.base.itemsize
            path = f"{before}{name}[{index}]" if kind.shape else f"{before}{name}"
            if kind.base.names:
                yield from doubles_of(kind.base, f"{path}.", begin)
            elif kind.base.str[1:] in ("f8", "c16"):
                yield from ((path, begin + part) for part in range(0, kind.base.itemsize, 8))


@pytest.mark.parametrize("value", [np.nan, -np.nan, np.inf])
def test_a_number_that_is_none_wherever_it_stands(host: LoopHost, arrays: TickArrays, value: float) -> None:
    host.set_up()
    host.upload(arrays)
    seen = 0
    for place, (name, array) in enumerate(arrays._asdict().items()):
        raw = array.tobytes()
        last = (array.size - 1) * array.itemsize
        paths = list(doubles_of(array.dtype, at=last)) if array.dtype.names else [("", last)]
        for path, offset in paths:
            if name == "outcomes" or path == "last_v" or (np.isinf(value) and name in ("inputs", "control")):
                continue
            host.send(Record(place, offset, np.float64(value).tobytes()))
            require_refused(host, name, NOT_A_NUMBER)
            host.send(Record(place, offset, raw[offset : offset + 8]))
            seen += 1
    assert seen > 150
    host.require_uploaded(arrays)
    assert host.ask(Command.START).status == 0
    host.ask(Command.STOP)


def test_no_force_limit_and_harmonics_that_are_not_judged_yet_may_be_infinite(
    host: LoopHost, arrays: TickArrays
) -> None:
    host.set_up()
    arrays.inputs["limit"][-1] = np.inf
    assert np.isinf(arrays.control["harmonics"]["miss"][0])
    host.upload(arrays)
    assert host.ask(Command.START).status == 0
    host.ask(Command.STOP)


def test_another_rate_and_a_voltage_that_the_converter_does_not_reach(host: LoopHost, arrays: TickArrays) -> None:
    host.set_up()
    rate_hz = host.plant.rate_hz
    for wrong_hz in (rate_hz + 0.001, rate_hz - 0.001, 2.0 * rate_hz, 1e300):
        arrays.loop["dt_s"] = 1.0 / wrong_hz
        host.upload(arrays)
        require_refused(host, "loop", RATE)
    arrays.loop["dt_s"] = 1.0 / rate_hz
    arrays.limits["voltage_v"] = host.plant.output_range_v * 1.001
    host.upload(arrays)
    require_refused(host, "limits", VOLTAGE)
    arrays.limits["voltage_v"] = host.plant.output_range_v
    host.upload(arrays)
    assert host.ask(Command.START).status == 0
    host.ask(Command.STOP)


def test_a_piece_that_was_lost_or_damaged_shows_in_the_checksum(host: LoopHost, arrays: TickArrays) -> None:
    host.set_up()
    host.upload(arrays)
    host.require_uploaded(arrays)
    data = bytearray(arrays.settling.tobytes())
    data[700] ^= 4
    host.send(Record(PLACES["settling"], 512, bytes(data[512:1024])))
    assert host.get(Parameter.TICK_CRC, PLACES["settling"]) == zlib.crc32(data)


def test_pieces_beyond_an_array_are_not_taken(host: LoopHost, arrays: TickArrays) -> None:
    host.set_up()
    host.upload(arrays)
    for place, array in enumerate(arrays):
        for at, n in ((array.nbytes, 1), (array.nbytes - 7, 8), (2**32 - 1, 2), (2**32 - 512, 512)):
            host.send(Record(place, at, b"\xa5" * n))
    for place in (16, 255):
        host.send(Record(place, 0, b"\xa5" * 8))
    host.require_uploaded(arrays)


def test_a_block_for_which_there_is_no_room(host: LoopHost) -> None:
    host.set_up(loop=0)
    assert host.set(Parameter.LOOP, 2).value == 1
    assert host.set(Parameter.LOOP, 1).status == 0
    largest = host.get(Parameter.LARGEST_BLOCK)
    answer = host.set(Parameter.BLOCK, largest + 1)
    assert (answer.status, answer.value) == (NOT_ALLOWED, largest)


WORDS = (*range(-2, 15), 63, 64, 65, 2**31, 2**40, 2**62, 2**63 - 1, -(2**63))
FLOATS = (0.0, -0.0, 1e-320, 1e-9, 1.0, -1.0, 1e9, 1e300, -1e300, np.inf, np.nan)


def garbled(random: Random, arrays: TickArrays) -> TickArrays:
    """Records of which some words are others, or an array is noise."""
    out = copy_of(arrays)
    for _ in range(random.choice((1, 1, 2, 5))):
        raw = random.choice(out).reshape(-1).view(np.uint8)
        if random.random() < 0.1:
            raw[:] = np.frombuffer(random.randbytes(raw.size), np.uint8)
        words = raw.view(np.int64)
        at = random.randrange(words.size)
        choice = random.random()
        if choice < 0.5:
            words[at] = random.choice(WORDS)
        elif choice < 0.9:
            words.view(np.float64)[at] = random.choice(FLOATS)
        else:
            words[at] ^= 1 << random.randrange(62)
    return out


def run_garbled(host: LoopHost, arrays: TickArrays, random: Random) -> bool:
    """Upload such records and run them, if that is allowed; whether it was."""
    host.set_up()
    changed = garbled(random, arrays)
    host.upload(changed)
    started = host.ask(Command.START).status == 0
    assert not host.plant.volts
    if started:
        host.rows.clear()
        assert host.ask(Command.ARM, value=ARM_KEY).status == 0
        host.until(lambda: bool(host.rows) or host.get(Parameter.STATE) == DeviceState.LATCHED)
        assert np.abs(host.plant.volts).max(initial=0.0) <= host.plant.output_range_v * 1.0001
    host.ask(Command.STOP)
    host.ask(Command.CLEAR)
    host.until(lambda: not host.plant.volts)
    for place in range(CONSTANTS):  # what is read only was not written
        assert host.get(Parameter.TICK_CRC, place) == zlib.crc32(changed[place].tobytes())
    return started


def test_garbled_records_are_refused_or_run_and_harm_nothing(arrays: TickArrays) -> None:
    random = Random(51)
    with loop_host() as host:
        started = [run_garbled(host, arrays, random) for _ in range(60)]
    assert 5 < sum(started) < 55
