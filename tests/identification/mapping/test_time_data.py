"""Time data of others, as arrays of any layout, become records."""

import sys
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from identification import IdentificationError, TimeDataMapping, TimeRecords, map_time_data
from identification.storage import decode, encode
from tests.refused import refused

RATE = 512.0
SIZE, PERIODS, REALISATIONS, LEVELS = 64, 4, 3, 2
RANDOM = np.random.default_rng(11)
NEARLY_ONE = 1.0 + 1e-3 * np.arange(PERIODS)[:, None]  # every period of the force can be told from the others
FORCE = RANDOM.normal(size=(LEVELS, REALISATIONS, 1, SIZE)) * NEARLY_ONE * np.array([1.0, 3.0])[:, None, None, None]
MOTION = RANDOM.normal(size=(LEVELS, REALISATIONS, PERIODS, SIZE))
AXES = ("level", "realisation", "period", "sample")


@pytest.fixture(autouse=True)
def draws_of_its_own(monkeypatch):
    """Each test draws the same numbers, whatever has run before it."""
    monkeypatch.setattr(sys.modules[__name__], "RANDOM", np.random.default_rng(12))


def told(force: dict[str, Any] | None = None, motion: dict[str, Any] | None = None, **more: Any) -> TimeDataMapping:
    table: dict[str, Any] = {
        "kind": "time-data",
        "sample_rate_hz": RATE,
        **more,
        "channels": [
            {"name": "force", "role": "force", "unit": "N", "value": "u", **(force or {})},
            {"name": "tip", "role": "drive", "unit": "mm", "value": "y", **(motion or {})},
        ],
    }
    return TimeDataMapping(**{key: value for key, value in table.items() if value is not None})


@pytest.mark.parametrize("order", [(3, 2, 1, 0), (0, 1, 2, 3), (2, 3, 0, 1)])
def test_dimensions_in_any_order_are_the_same_records(order):
    data = {"u": np.transpose(FORCE, order), "y": np.transpose(MOTION, order)}
    found = map_time_data(data, told(axes=[AXES[at] for at in order], transient_periods=1))
    assert (len(found.records), found.period_samples, found.ahead_periods) == (6, SIZE, 1)
    for number, record in enumerate(found.records):
        level, one = divmod(number, REALISATIONS)
        np.testing.assert_array_equal(record.samples[0], FORCE[level, one, 1:].ravel())
        np.testing.assert_allclose(record.samples[1], 1e-3 * MOTION[level, one, 1:].ravel(), rtol=1e-15)
        assert record.level == pytest.approx(np.sqrt(np.mean(FORCE[level, :, 1:] ** 2)), rel=1e-5)
    assert [record.name[-13:] for record in found.records[:2]] == ["realisation 1", "realisation 2"]


def test_channels_of_one_matrix_are_told_by_their_number():
    data = {"all": np.stack([FORCE[0, 0].ravel(), MOTION[0, 0].ravel(), MOTION[0, 1].ravel()])}
    of = {"value": "all", "axes": ["channel", "sample"]}
    found = map_time_data(data, told(of, {**of, "index": 3}))
    np.testing.assert_allclose(found.records[0].samples[1], 1e-3 * MOTION[0, 1].ravel(), rtol=1e-15)
    with refused(IdentificationError, "the-array-has-to", field="channels.tip.index", value=4):
        map_time_data(data, told(of, {**of, "index": 4}))


def test_a_structure_for_each_record_gives_a_record_each():
    data = {"runs": [{"u": one.ravel(), "y": two.ravel()} for one, two in zip(FORCE[0], MOTION[0], strict=True)]}
    found = map_time_data(data, told(records="runs", period_samples=SIZE, levels=[5.0, 6.0, 5.0]))
    assert [record.level for record in found.records] == [5.0, 6.0, 5.0]
    assert list(found.levels()) == [5.0, 6.0]
    assert len(found.levels()[5.0].records) == 2


def test_what_is_said_to_be_periodic_and_is_not_is_refused_and_a_doubtful_period_remarked_on():
    u, y = RANDOM.normal(size=(2, 4 * SIZE))
    with refused(IdentificationError, "in-record-realisation-such-periods-of", field="period_samples", value=64):
        map_time_data({"u": u, "y": y}, told(period_samples=SIZE))
    settling = np.tile(u[:SIZE], 4) * (1.0 - 0.5 * np.exp(-np.arange(4 * SIZE) / SIZE))
    (note,) = map_time_data({"u": settling, "y": y}, told(period_samples=SIZE)).notes
    assert note.startswith("periods of channel 'force' differ by up to 1")
    assert map_time_data({"u": settling, "y": y}, told(period_samples=SIZE, transient_periods=3)).notes == ()


def runs_of(*sizes):
    """A list of structures, as MATLAB's struct arrays are read, with a force of each size."""
    made = [(size * RANDOM.choice([-1.0, 1.0], SIZE), RANDOM.normal(size=SIZE)) for size in sizes]
    return {"runs": [{"u": force, "y": motion} for force, motion in made]}


@pytest.mark.parametrize("periodic", [SIZE, None])
def test_records_of_one_list_at_two_levels_are_two_levels(periodic):
    found = map_time_data(runs_of(2.0, 8.0, 2.1, 7.9), told(records="runs", period_samples=periodic))
    what = "realisation" if periodic else "record"
    assert [record.name for record in found.records] == [
        f"2.051 N RMS, {what} 1",
        f"7.95 N RMS, {what} 1",
        f"2.051 N RMS, {what} 2",
        f"7.95 N RMS, {what} 2",
    ]
    assert [len(one.records) for one in found.levels().values()] == [2, 2]
    assert found.notes == ("2 levels by the RMS of the force, 2.051 to 7.95 N; the key `levels` tells others",)


def test_columns_at_two_levels_are_two_levels_and_realisations_stay_together():
    u = np.array([size * RANDOM.choice([-1.0, 1.0], SIZE) for size in (1.0, 1.05, 0.95, 4.0)]).T
    found = map_time_data({"u": u, "y": RANDOM.normal(size=u.shape)}, told(period_samples=SIZE))
    assert [len(one.records) for one in found.levels().values()] == [3, 1]


@pytest.mark.parametrize("levels", [[2.0, 8.0], [8.0, 2.0], [2.0, 8.0, 2.0, 8.0]])
def test_levels_of_a_list_are_named_by_their_size_or_one_by_one(levels):
    found = map_time_data(runs_of(1.9, 7.7, 1.8, 7.9), told(records="runs", period_samples=SIZE, levels=levels))
    assert [record.level for record in found.records] == [2.0, 8.0, 2.0, 8.0]
    each = map_time_data(runs_of(1.0, 3.0), told(records="runs", period_samples=SIZE, levels=[7.0, 6.0]))
    assert [record.level for record in each.records] == [7.0, 6.0]  # one for each record: in their order
    one = map_time_data(runs_of(1.9, 7.7), told(records="runs", period_samples=SIZE, levels=[5.0]))
    assert [record.level for record in one.records] == [5.0, 5.0]
    with refused(IdentificationError, "has-numbers-the-data-has-levels", field="levels"):
        map_time_data(runs_of(1.9, 7.7, 1.8, 7.9), told(records="runs", period_samples=SIZE, levels=[1.0, 2.0, 3.0]))


def test_stretches_of_a_long_record_become_records():
    u, y = RANDOM.normal(size=(2, 1000))
    stretches = [
        {"start_samples": 100, "samples": 128, "repeat": 3, "step_samples": 150, "level": 2.0},
        {"start_s": 800 / RATE, "duration_s": 128 / RATE},
    ]
    found = map_time_data({"u": u, "y": y}, told(stretches=stretches, period_samples=SIZE, transient_periods=1))
    begins = [100, 250, 400, 800]
    for record, begin in zip(found.records, begins, strict=True):
        np.testing.assert_array_equal(record.samples[0], u[begin + SIZE : begin + 128])
    assert [record.level for record in found.records[:3]] == [2.0, 2.0, 2.0]
    assert found.records[3].level == pytest.approx(np.sqrt(np.mean(u[800 + SIZE : 928] ** 2)), rel=1e-5)


def test_samples_behind_the_last_whole_period_are_left_out_and_counted():
    found = map_time_data({"u": FORCE[0, 0].ravel()[:150], "y": MOTION[0, 0].ravel()[:150]}, told(period_samples=SIZE))
    assert found.records[0].samples.shape == (2, 128)
    assert found.notes == ("22 samples at the end of a record are not a whole period and were left out",)


def test_scale_and_offset_turn_stored_numbers_into_the_unit():
    stored = 2.5 + 0.1 * np.sin(np.arange(256.0))
    found = map_time_data(
        {"u": stored, "y": stored}, told({"scale": -20.0, "offset": 2.5}, {"scale": 4.0, "offset": "mean"})
    )
    np.testing.assert_allclose(found.records[0].samples[0], -2.0 * np.sin(np.arange(256.0)), atol=1e-12)
    np.testing.assert_allclose(found.records[0].samples[1], 4e-3 * (stored - stored.mean()), atol=1e-15)


def test_channels_that_begin_at_different_instants_are_lined_up():
    u, y = RANDOM.normal(size=(2, 300))
    data = {"u": u, "y": y, "__rates_hz__": {"u": RATE, "y": RATE}, "__starts_s__": {"u": 0.0, "y": 20 / RATE}}
    found = map_time_data(data, told(sample_rate_hz=None))
    np.testing.assert_array_equal(found.records[0].samples[0], u[20:])
    np.testing.assert_allclose(found.records[0].samples[1], 1e-3 * y[:-20], rtol=1e-15)
    data["__starts_s__"] = {"u": 0.0, "y": 20.4 / RATE}
    with refused(IdentificationError, "begins-samples-before-another", field="channels.force"):
        map_time_data(data, told(sample_rate_hz=None))


def test_a_further_file_may_be_longer_and_begin_later():
    u, y = RANDOM.normal(size=(2, 300))
    mapping = told({"start_samples": 7}, {"file": "y.mat"})
    found = map_time_data({"u": u}, mapping, {"y.mat": {"y": y}})
    np.testing.assert_array_equal(found.records[0].samples[0], u[7:])
    np.testing.assert_allclose(found.records[0].samples[1], 1e-3 * y[:293], rtol=1e-15)


def test_decimation_keeps_what_is_slow_and_drops_what_would_alias():
    t = np.arange(4096) / RATE
    slow, fast = np.sin(2 * np.pi * 20.0 * t), np.sin(2 * np.pi * 180.0 * t)  # half the new rate is 64 Hz
    found = map_time_data({"u": slow + fast, "y": slow}, told(new_rate_hz=128.0))
    assert found.sample_rate_hz == 128.0
    samples = found.records[0].samples
    at = 32 / 128.0 + np.arange(samples.shape[1]) / 128.0  # the filter spoils 32 samples at either end
    np.testing.assert_allclose(samples[0], np.sin(2 * np.pi * 20.0 * at), atol=2e-4)


def test_periods_are_resampled_without_error():
    t = np.arange(4 * SIZE) / RATE
    signal = np.cos(2 * np.pi * 24.0 * t + 0.3) + np.cos(2 * np.pi * 200.0 * t)
    found = map_time_data({"u": signal, "y": signal}, told(period_samples=SIZE, new_rate_hz=128.0))
    at = np.arange(found.records[0].samples.shape[1]) / 128.0
    assert (found.period_samples, at.size) == (16, 64)
    np.testing.assert_allclose(found.records[0].samples[0], np.cos(2 * np.pi * 24.0 * at + 0.3), atol=1e-13)


@pytest.mark.parametrize("unit", ["V", "1"])
def test_forces_and_motions_without_a_better_unit_keep_theirs(unit):
    found = map_time_data({"u": FORCE[0, 0].ravel(), "y": MOTION[0, 0].ravel()}, told({"unit": unit}, {"unit": unit}))
    assert [channel.unit for channel in found.channels] == [unit, unit]
    assert found.level_unit == unit
    assert found.channels[1].motion == "displacement"


def test_records_come_back_from_arrays_as_they_were():
    data = {"u": FORCE[0].reshape(3, -1).T, "y": MOTION[0].reshape(3, -1).T}
    one = map_time_data(data, told(period_samples=SIZE, lowest_hz=8.0, highest_hz=200.0))
    two = decode(TimeRecords, *encode(one))
    assert (two.channels, two.excited_hz, two.period_samples) == (one.channels, (8.0, 200.0), SIZE)
    for first, second in zip(one.records, two.records, strict=True):
        np.testing.assert_array_equal(first.samples, second.samples)
        assert (first.name, first.level) == (second.name, second.level)


def test_too_many_axes_are_named_with_the_shape():
    with refused(IdentificationError, "has-shape-axes-names-dimensions"):
        map_time_data({"u": FORCE[0, 0].T, "y": MOTION[0, 0].T}, told(axes=["sample", "period", "realisation"]))
    with refused(ValidationError, "each-may-be-named-once", field="axes"):
        told(axes=["sample", "sample"])
