"""The firmware with the compiled tick runs a plan itself: rows to the bit those of the loop in Python, and every way to 0 V."""

import signal

import numpy as np
import pytest

from controller import AmplitudeLaw, PhaseLockedLoop, preset
from rig.firmware.machine_code import kernels_digest
from rig.tick.layout import TickArrays
from rig.tick.safety.layout import GUARD, EndReason, GuardMode
from rig.tick.sequencer.layout import Outcome, SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment, SettleRule
from rig.tick.tick import Tick, TickSettings
from rig.wire.can.frames import Frame
from rig.wire.can.slcan_lines import encode_line
from rig.wire.messages import (
    ARM_KEY,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Output,
    Parameter,
    Record,
    Request,
    Rows,
    State,
)
from rig.wire.parameter_words import as_text
from tests.firmware.loop_client import (
    BLOCK,
    WatchedPlant,
    bench_for_loop,
    copy_of,
    joined,
    loop_host,
    rows_of,
    run_in_python,
    settings_for,
    tick_for,
)
from tests.firmware.test_host_board import NODE, asked, board, frames_in, is_answer
from tests.rig.rigs import point_segments

QUICK = SettleRule(phase_deg=45, amplitude=0.5, average_periods=2, settled_periods=2, longest_periods=30)
UNKNOWN, NOT_ALLOWED, WRONG_STATE, LATCHED = 1, 2, 3, 4


def law_with(**changes) -> PhaseLockedLoop:
    """The paper's law, which takes a lock for one at once."""
    lock = {"locked_deg": 45.0, "locked_periods": 2, "lost_deg": 90.0}
    return PhaseLockedLoop.model_validate(preset("magnet-beam").model_dump() | {"lock": lock} | changes)


def all_kinds() -> TickSettings:
    """A plan with every kind of segment and every source of the frequency, which ends by itself."""
    tone, wave = Excitation(25.0), Excitation(25.0, waveform=1)
    kinds = SegmentKind
    points = [
        Segment(kinds.START, -1, 0.2, 4.0),
        Segment(kinds.RAMP, 0, 0.3, 2.0),
        Segment(kinds.SETTLE, 0, 0.3, 30.0),
        Segment(kinds.RECORD, 0, 0.3, 3.0),
        Segment(kinds.LEVEL_SWEEP, 1, 0.4, 3.0),
        Segment(kinds.HOLD, 2, 0.3, 1.0, excitation=tone),
        Segment(kinds.SWEEP, 2, 0.3, 1.0, excitation=Excitation(26.0, rate=5.0)),
        Segment(kinds.HOLD, 3, 0.2, 2.0, excitation=wave),
        Segment(kinds.RELEASE, 4, 0.0, 3.0),
    ]
    played = np.sin(2.0 * np.pi * np.outer((1, 2), np.arange(200)) / 200)
    return settings_for(segments=points, waveforms=played, settle=QUICK, law=law_with())


def with_levels_in_newtons() -> TickSettings:
    """Levels in newtons, an adaptive detector and the harmonics loop."""
    law = law_with(detector="adaptive", k3=1.5, k4=1.0, harmonics={"highest": 5})
    points = [
        Segment(SegmentKind.START, -1, 0.3, 5.0, amplitude_law=AmplitudeLaw.VOLTAGE),
        Segment(SegmentKind.RAMP, 0, 0.1, 4.0),
        Segment(SegmentKind.SETTLE, 0, 0.1, 20.0),
    ]
    return settings_for(segments=points, law=law, amplitude_law=AmplitudeLaw.FORCE, settle=QUICK)


def in_python(settings: TickSettings, n: int, before: int = 0, **kwargs) -> tuple[np.ndarray, np.ndarray, TickArrays]:
    """Readings and rows of n samples as the loop makes them here, after ``before`` ones at 0 V, and its arrays after them."""
    plant = WatchedPlant(bench_for_loop())
    plant.step(np.zeros(before))
    tick = tick_for(settings, plant)
    return *run_in_python(tick, plant, n, **kwargs), tick.arrays


def require_equal(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, ...]) -> None:
    """Readings and rows are equal to the bit."""
    for name in one[1].dtype.names:
        assert one[1][name].tobytes() == other[1][name].tobytes(), name
    assert one[0].tobytes() == other[0].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("plan", [all_kinds, with_levels_in_newtons])
def test_in_lockstep_a_whole_plan_is_to_the_bit_that_of_the_loop_in_python(plan):
    settings = plan()
    with loop_host("host") as host:
        host.begin(tick_for(settings, host.plant).arrays)
        found = host.run_until_off()
        expected = in_python(settings, len(found[1]))
        require_equal(found, expected)
        assert set(found[1]["segment"]) == {-1, *range(len(settings.segments))}
        assert np.abs(found[1]["output_v"]).max() > 0.1
        assert expected[2].guard["reason"][0] == EndReason.COMPLETED
    assert not any(host.counters.values())


def test_states_say_what_the_records_are_at_the_end_of_their_blocks():
    settings = all_kinds()
    with loop_host("host") as host:
        arrays = tick_for(settings, host.plant).arrays
        told = copy_of(arrays)
        host.begin(arrays)
        n = len(host.run_until_off()[1])
        _, _, after = in_python(settings, n)
    assert [type(one) for one in host.told] == [State, Rows] * (n // BLOCK)
    for state, block in zip(host.states, host.rows, strict=False):
        assert state.sample == block.first + BLOCK
        for piece in state.pieces:
            view = told[piece.array].view(np.uint8).reshape(-1)
            view[piece.offset : piece.offset + len(piece.data)] = np.frombuffer(piece.data, np.uint8)
    for name in ("loop", "guard", "progress", "outcomes"):
        assert getattr(told, name).tobytes() == getattr(after, name).tobytes(), name
    for name in ("vibration", "frequency"):
        assert told.control[name].tobytes() == after.control[name].tobytes(), name
    assert (told.outcomes["outcome"] == Outcome.DONE).all()


def test_a_state_comes_with_every_so_manieth_block_and_with_one_in_which_a_segment_ends():
    settings, every = all_kinds(), 7
    with loop_host("host") as host:
        host.begin(tick_for(settings, host.plant).arrays, state_blocks=every)
        assert host.get(Parameter.STATE_BLOCKS) == every
        rows = host.run_until_off()[1]
        told = {state.sample // BLOCK - 1 for state in host.states}
    ends = np.arange(BLOCK - 1, rows.size, BLOCK)
    seen = list(zip(rows["segment"][ends], rows["guard"][ends], strict=True))
    due, since = {0}, 0
    for block in range(1, len(seen)):
        since += 1
        if since == every or seen[block] != seen[block - 1]:
            due.add(block)
            since = 0
    assert due <= told
    assert len(told) < 0.5 * len(seen)
    assert len(told - due) <= len(settings.segments)  # segments within the tick go on with the next sample's row


def test_the_first_sample_of_a_segment_that_begins_with_a_block_is_told_with_that_block():
    """Blocks of one sample: every segment begins with one, and ends with the one before."""
    settings = all_kinds()
    with loop_host("host") as host:
        host.begin(tick_for(settings, host.plant).arrays, block=1, state_blocks=1000)
        rows = host.run_until_off()[1]
        told = {state.sample for state in host.states}
    # the row at which a segment ends has the next one's number, which begins with the sample after it
    begins = [int(np.argmax(rows["segment"] == k)) + 1 for k in range(1, len(settings.segments))]
    assert len(set(begins)) > 5
    assert {begin + 1 for begin in begins} <= told


@pytest.mark.slow
def test_it_tells_the_digest_of_the_loop_that_is_linked_in_and_its_room():
    with loop_host() as host:
        host.set_up(loop=0)
        words = [host.get(Parameter.TICK_DIGEST, item) for item in range(16)]
        assert as_text(words) == kernels_digest()
        assert host.ask(Command.GET, Parameter.TICK_DIGEST, 16).status == UNKNOWN
        assert host.get(Parameter.TICK_ROOM) == 1 << 20
        assert host.get(Parameter.LOOP) == 0


def test_without_the_tick_over_classical_can_and_in_version_1_it_knows_nothing_of_a_loop():
    asks = [Request(1, Command.GET, one) for one in range(80, 88)]
    asks += [Request(1, Command.SET, one, 0, 1) for one in range(80, 88)]
    asks += [Request(1, Command.RAMP), Request(1, Command.RELEASE)]

    def require_unknown(answers: list[Answer]) -> None:
        assert [answer.status for answer in answers] == [UNKNOWN] * len(asks)

    with board(lockstep=True) as plain:
        plain.began()
        require_unknown([asked(plain, one._replace(number=n))[-1] for n, one in enumerate(asks, 1)])
    with loop_host() as host:
        require_unknown([host.ask(*one[1:]) for one in asks])
    with loop_host(wire="can", fd=False, node=NODE) as host:
        line = host.board
        line.send(b"O\r")
        seen = []
        for number, one in enumerate(asks, 1):
            line.send(encode_line(Frame(0x20 + NODE, bytes((number, *one[1:4])) + one.value.to_bytes(4, "little"))))
            seen += frames_in(line.until(lambda data: any(map(is_answer, frames_in(data)))))
    assert [frame.data[1] for frame in seen if is_answer(frame)] == [UNKNOWN] * len(asks)


def test_it_begins_with_the_first_arm_and_goes_on_after_disarm_at_0_v():
    settings = settings_for(0.3)
    with loop_host() as host:
        host.begin(tick_for(settings, host.plant).arrays, armed=False)
        for _ in range(10):
            host.get(Parameter.PING)
        assert not host.rows
        assert host.ask(Command.ARM, value=ARM_KEY).status == 0
        found = host.run_to(1500)
        require_equal(found, in_python(settings, len(found[1])))
        host.ask(Command.DISARM)
        volts = len(host.plant.volts)
        rows = host.run_to(volts + 500)[1]
        assert any(host.plant.volts[:volts])
        assert not any(host.plant.volts[volts:])
        assert np.abs(rows["output_v"][-100:]).max() > 0.01  # what the loop would put out


def test_a_stop_is_0_v_and_what_was_run_must_be_uploaded_again_to_run_in_the_same_way():
    settings = settings_for(0.3)
    with loop_host() as host:
        arrays = tick_for(settings, host.plant).arrays
        host.begin(arrays)
        first = host.run_to(1000)[1][:1000]
        assert host.ask(Command.STOP).value == DeviceState.IDLE
        host.pump()
        host.rows.clear()
        answer = host.ask(Command.START)
        assert (answer.status, answer.value) == (NOT_ALLOWED, 1)
        assert host.get(Parameter.TICK_FAULT) == 1
        host.begin(arrays)
        assert host.get(Parameter.TICK_FAULT) == 0
        assert host.run_to(1000)[1][:1000].tobytes() == first.tobytes()


@pytest.mark.parametrize("by", ["message", "signal"])
def test_an_emergency_stop_is_0_v_at_once_and_the_rows_go_on(by):
    with loop_host() as host:
        host.begin(tick_for(settings_for(0.3), host.plant).arrays)
        host.run_to(1500)
        if by == "message":
            host.send(EmergencyStop())
        else:
            host.board.child.send_signal(signal.SIGUSR1)
        host.until(lambda: bool(host.rows[-1].flags & DeviceFlag.EMERGENCY_STOP))
        stopped = host.rows[-1].first + BLOCK
        host.run_to(stopped + 500)
        assert any(host.plant.volts[:stopped])
        assert not any(host.plant.volts[stopped:])
        assert host.beats[-1].state == DeviceState.LATCHED
        assert host.ask(Command.START).status == LATCHED


def test_a_ramp_that_is_asked_for_ends_the_plan_as_in_python():
    settings = settings_for(0.3)
    with loop_host() as host:
        host.begin(tick_for(settings, host.plant).arrays)
        host.run_to(2500)
        assert host.ask(Command.RAMP).status == 0
        found = host.run_until_off()
        begins = int(np.flatnonzero(found[1]["guard"] == GuardMode.RAMPING)[0])
        require_equal(found, in_python(settings, len(found[1]), at={begins: Tick.request_stop}))
        assert begins >= 2500
        guard = np.frombuffer(host.states[-1].pieces[1].data, GUARD)[0]
        assert guard["reason"] == EndReason.STOP_REQUESTED


def test_a_start_that_is_held_back_ends_once_it_is_released():
    points = [Segment(SegmentKind.START, -1, 0.3, 3.0), *point_segments(0.4)]
    settings = settings_for(segments=points, start_judged=True)
    with loop_host() as host:
        host.begin(tick_for(settings, host.plant).arrays)
        rows = host.run_to(2000)[1]
        assert set(rows["segment"]) == {0}
        assert host.ask(Command.RELEASE).status == 0
        host.until(lambda: rows_of(host.rows[-1])["segment"][-1] == 1)
        found = joined(host.rows)
        first = int(np.flatnonzero(found[1]["segment"] == 1)[0])
        require_equal(found, in_python(settings, len(found[1]), at={first: Tick.release_start}))


def test_ramp_and_release_belong_to_a_loop_that_runs():
    with loop_host() as host:
        host.set_up()
        for command in (Command.RAMP, Command.RELEASE):
            answer = host.ask(command)
            assert (answer.status, answer.value) == (WRONG_STATE, DeviceState.IDLE)
        host.set(Parameter.LOOP, 0)
        host.ask(Command.START)
        assert host.ask(Command.RAMP).status == WRONG_STATE


def test_outputs_and_records_that_come_while_it_runs_change_nothing():
    settings = settings_for(0.3)
    with loop_host() as host:
        host.begin(tick_for(settings, host.plant).arrays)
        for sample in range(0, 20 * BLOCK, BLOCK):
            host.send(Output(sample, np.full(BLOCK, 9999, np.int16)))
            host.send(Record(7, 0, bytes(200)))
            host.get(Parameter.PING)  # they are there
        found = host.run_to(1000)
        require_equal(found, in_python(settings, len(found[1])))
        counted = host.counted()
    assert counted["bad_outputs"] == counted["malformed"] == "20"


def test_by_the_clock_it_runs_the_same_loop_from_arm_on():
    settings = settings_for(0.3)
    with loop_host("host", lockstep=False) as host:
        host.begin(tick_for(settings, host.plant).arrays)
        found = host.run_to(1500)
        volts = np.array(host.plant.volts)
    plant = WatchedPlant(bench_for_loop())
    run_in_python(tick_for(settings, plant), plant, 1500)
    before = int(np.flatnonzero(volts)[0] - np.flatnonzero(plant.volts)[0])  # samples between START and ARM
    assert not volts[:before].any()
    require_equal(found, in_python(settings, len(found[1]), before=before))
