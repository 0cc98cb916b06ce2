"""Universal files of others, by every convention of their format that says something of the numbers; pyuff writes them."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification import FrequencyResponseMatrix, IdentificationError
from rig.exchange.child_reading import ImportFailed
from rig.exchange.proposal.proposal import proposed
from rig.exchange.reading import import_file
from rig.exchange.uff.reading import datasets_in
from rig.exchange.uff.responses import responses_in
from rig.exchange.uff.time_data import time_data_in
from tests.refused import refused
from tests.rig.exchange.test_universal_files import FREQUENCY, response, signal, units, written

G, POUND, INCH = 9.80665, 4.4482216152605, 0.0254  # m/s2, N, m
SAMPLES = np.random.default_rng(3).normal(size=64)
FORCE = {"code": 13, "label": "N"}
SYSTEMS = {1: (1.0, 1.0), 5: (1000.0, 1000.0), 7: (39.37007874015748, 0.2248089430997105), 10: (1000.0, 1.0)}
"""Divisors of lengths and forces that give m and N, by the code of dataset 164 (SI, mm and mN, inch and lbf, mm and N)."""


def with_nan(path: Path, *datasets: dict) -> Path:
    """A file with NaN in place of each 7777, which pyuff writes as 0."""
    text = written(path, *datasets).read_bytes()
    path.write_bytes(text.replace(b"   7.77700000000e+03", b"                 NaN"))
    assert b"NaN" in path.read_bytes()
    return path


def time_data(path: Path, assumed: str = ""):
    return time_data_in(datasets_in(path), assumed)


def matrix(path: Path, assumed: str = "") -> FrequencyResponseMatrix:
    (found,) = responses_in(datasets_in(path), assumed)
    assert isinstance(found, FrequencyResponseMatrix)
    return found


@settings(max_examples=40, deadline=None)
@given(
    unit=st.sampled_from([("m/s2", 12, 1.0), ("g", 12, G), ("in/s^2", 12, INCH), ("mm", 8, 1e-3), ("kN", 13, 1e3)]),
    seconds=st.sampled_from([("s", 1.0), ("ms", 1e-3), ("NONE", 1.0), ("min", 60.0)]),
    binary=st.booleans(),
    double=st.booleans(),
    start=st.sampled_from([0.0, 2.5]),
    by_label=st.booleans(),
    system=st.sampled_from([None, *SYSTEMS]),
)
def test_a_record_is_read_as_the_same_numbers_whatever_unit_abscissa_start_and_encoding_it_is_written_in(
    tmp_path_factory, unit, seconds, binary, double, start, by_label, system
):
    label, code, factor = unit
    by_label = by_label or system is None
    if not by_label:
        length, force = SYSTEMS[system]
        factor = 1.0 / (force if code == 13 else length)
    one = signal(SAMPLES / factor, code=code, label=label if by_label else "NONE")
    one |= {"x": (start + np.arange(64) / 2000.0) / seconds[1], "abscissa_axis_units_lab": seconds[0]}
    one |= {"abscissa_inc": 1 / 2000.0 / seconds[1], "abscissa_min": start / seconds[1], "binary": int(binary)}
    one |= {"ord_data_type": 4 if double else 2}
    head = [] if system is None else [units(system, *SYSTEMS[system])]
    path = written(tmp_path_factory.mktemp("uff") / "one.uff", *head, one)
    found = time_data(path, "labels" if by_label and system is not None else "")
    np.testing.assert_allclose(found.values["1+Z"][:, 0], SAMPLES, rtol=3e-5, atol=1e-6)
    assert found.sample_rate_hz == pytest.approx(2000.0, rel=1e-9)
    assert found.channels["1+Z"].start_s == pytest.approx(start, rel=1e-5)
    assert found.channels["1+Z"].unit == {8: "m", 12: "m/s2", 13: "N"}[code]


@settings(max_examples=30, deadline=None)
@given(
    labels=st.sampled_from(
        [
            *[("(m/s^2)/N", "NONE", 1.0), ("m/s2/N", "NONE", 1.0), ("g/N", "NONE", G), ("(m/s2)/(N)", "N", 1.0)],
            *[("(1/N)*(m/s²)", "NONE", 1.0), ("g/lbf", "NONE", G / POUND), ("in/s^2", "lbf", INCH / POUND)],
            *[("g", "N", G), ("mm/s2", "kN", 1e-6)],
        ]
    ),
    abscissa=st.sampled_from([("Hz", 1.0), ("NONE", 1.0), ("kHz", 1e3), ("rad/s", 0.5 / np.pi)]),
    binary=st.booleans(),
)
def test_an_accelerance_is_read_as_the_same_numbers_whatever_its_labels_are(tmp_path_factory, labels, abscissa, binary):
    value = SAMPLES[:20] + 1j * SAMPLES[20:40]
    one = response(value / labels[2], label=labels[0], force_label=labels[1], binary=int(binary))
    one |= {"x": FREQUENCY / abscissa[1], "abscissa_axis_units_lab": abscissa[0], "abscissa_spacing": 0}
    found = matrix(written(tmp_path_factory.mktemp("uff") / "one.uff", one))
    np.testing.assert_allclose(found.value[:, 0, 0], value, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY, rtol=1e-5)
    assert (found.outputs[0].unit, found.inputs[0].unit, found.outputs[0].role) == ("m/s2", "N", "drive")


@pytest.mark.parametrize("choice", ["", "labels", "file", "si"])
def test_a_ratio_as_a_label_is_read_by_every_choice_of_units(tmp_path, choice):
    path = written(tmp_path / "ratio.uff", units(), response(np.full(20, 2.0), label="(m/s^2)/N"))
    np.testing.assert_allclose(matrix(path, choice).value, 2.0)


def test_a_ratio_that_contradicts_the_label_of_its_denominator_or_the_units_of_the_file_is_refused(tmp_path):
    path = written(tmp_path / "two.uff", response(np.ones(20), label="g/N", force_label="V"))
    with refused(ImportFailed, "labelled-its-denominator-wanted-is-the-same"):
        matrix(path)
    path = written(tmp_path / "mm.uff", units(10, 1000.0, 1.0), response(np.ones(20), label="(m/s^2)/N"))
    with refused(ImportFailed, "mixed-units-the-ordinate-is-labelled"):
        matrix(path)
    np.testing.assert_allclose(matrix(path, "file").value, 1e-3)


def test_a_header_in_latin_1_keeps_its_letters(tmp_path):
    path = written(tmp_path / "latin.uff", response(np.full(20, 2.0), label="(1/N)*(m/s?)"))
    path.write_bytes(path.read_bytes().replace(b"m/s?", b"m/s\xb2"))
    np.testing.assert_allclose(matrix(path).value, 2.0)


def test_force_and_acceleration_of_one_node_are_channels_and_repeated_functions_are_records(tmp_path):
    parts = [one for k in (1, 2) for one in (signal(SAMPLES * k, **FORCE), signal(SAMPLES * k / G, label="g"))]
    found = time_data(written(tmp_path / "drive.uff", *parts))
    assert list(found.values) == ["1+Z force", "1+Z acceleration", "sets"]
    for name in ("1+Z force", "1+Z acceleration"):
        np.testing.assert_allclose(found.values[name], np.c_[SAMPLES, 2 * SAMPLES], rtol=1e-6, atol=1e-9)
    assert [found.channels[name].unit for name in found.channels] == ["N", "m/s2"]


@pytest.mark.parametrize(
    ("lines", "labels", "names"),
    [
        (("Acc 1", "Acc 2"), ("", ""), ["0 Acc 1", "0 Acc 2"]),
        (("NONE", "NONE"), ("left", "right"), ["0 left", "0 right"]),
        (("1x : m/s2", "mic 01.0"), ("", ""), ["0 1x", "0 mic 01 0"]),
        (("same", "same"), ("", ""), ["0"]),
    ],
)
def test_channels_of_node_0_are_named_by_what_tells_them_apart(tmp_path, lines, labels, names):
    parts = [
        signal(SAMPLES, node=0) | {"rsp_dir": 0, "id1": line, "ordinate_axis_lab": label or "NONE"}
        for line, label in zip(lines, labels, strict=True)
    ]
    found = time_data(written(tmp_path / "catman.uff", *parts))
    assert list(found.values)[:-1] == names


def test_a_proposed_mapping_of_a_drive_point_imports_with_the_units_of_the_file(tmp_path):
    path = written(tmp_path / "drive.uff", signal(SAMPLES, **FORCE), signal(SAMPLES / G, label="g"))
    text = proposed(path, (), "", "").text
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    records = import_file(path, mapping=tmp_path / "m.toml")
    assert [(c.role, c.unit) for c in records.channels] == [("force", "N"), ("drive", "m/s2")]
    np.testing.assert_allclose(records.records[0].samples, [SAMPLES, SAMPLES], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("choice", ["", "labels", "si"])
def test_a_channel_of_another_quantity_keeps_its_unit_and_blocks_nothing(tmp_path, choice):
    others = [("Pa", 15), ("degC", 5), ("NONE", 3), ("rpm", 19)]
    parts = [signal(SAMPLES * k, node=k, code=code, label=unit) for k, (unit, code) in enumerate(others, 2)]
    found = time_data(written(tmp_path / "mic.uff", signal(SAMPLES, **FORCE), *parts), choice)
    assert {name: facts.unit for name, facts in found.channels.items()} == {
        **{"1+Z": "N", "2+Z": "Pa", "3+Z": "degC", "4+Z": "", "5+Z": "rpm"}
    }
    np.testing.assert_allclose(found.values["2+Z"][:, 0], 2 * SAMPLES, rtol=1e-6)


def test_responses_of_another_quantity_and_functions_of_other_types_are_left_out_with_a_note(tmp_path):
    parts = [response(np.ones(20), label="m/s2", force_label="N")]
    parts += [response(np.ones(20), rsp=(2, 3), label="Pa", force_label="N", code=15)]
    parts += [response(np.ones(20), rsp=(1, 3)) | {"func_type": kind} for kind in (6, 2)]
    found = matrix(written(tmp_path / "more.uff", *parts))
    assert [channel.name for channel in found.outputs] == ["1+Z"]
    assert any("1 of type 6 (coherence), 1 of type 2 (auto spectrum)" in note for note in found.notes)
    assert any("1 frequency responses in Pa/N" in note for note in found.notes)


@pytest.mark.parametrize(("at_zero", "label"), [(0.0, "m/s2"), (7777.0, "m"), (5.0, "m/s2")])
def test_a_line_at_0_hz_that_says_nothing_is_left_out_with_a_note(tmp_path, at_zero, label):
    value = np.r_[at_zero, np.ones(19)]
    write = with_nan if at_zero == 7777.0 else written
    found = matrix(
        write(tmp_path / "zero.uff", response(value, label=label, force_label="N", code=0, x=FREQUENCY - 20.0))
    )
    np.testing.assert_allclose(found.frequency_hz, (FREQUENCY - 20.0)[1:])
    assert any("line at 0 Hz" in note for note in found.notes)


def test_a_displacement_at_0_hz_is_kept_and_a_nan_elsewhere_refused(tmp_path):
    x = FREQUENCY - 20.0
    path = written(tmp_path / "static.uff", response(np.ones(20), label="m", force_label="N", code=8, x=x))
    assert matrix(path).frequency_hz[0] == 0.0
    value = np.r_[np.ones(7), 7777.0, np.ones(12)]
    path = with_nan(tmp_path / "nan.uff", response(value, label="m", force_label="N", code=8, x=x))
    with refused(IdentificationError, "is-not-finite-at-7"):
        matrix(path)


def test_a_response_against_the_direction_of_the_force_is_turned(tmp_path):
    parts = [response(np.full(20, -2.0), rsp=(1, -3), label="m/s2", force_label="N")]
    parts += [response(np.full(20, 3.0), rsp=(2, -3), label="m/s2", force_label="N")]
    found = matrix(written(tmp_path / "minus.uff", *parts))
    assert [(c.name, c.role) for c in found.outputs] == [("1+Z", "drive"), ("2-Z", "response")]
    np.testing.assert_allclose(found.value[:, :, 0], [[2.0, 3.0]] * 20)
    assert any("1-Z is turned to 1+Z" in note for note in found.notes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"abscissa_axis_units_lab": "s"}, "the-abscissa-is-in-wanted-is-a-frequency"),
        ({"abscissa_axis_units_lab": "order"}, "the-abscissa-is-in-wanted-is-a-frequency"),
        ({"abscissa_spec_data_type": 20}, "the-abscissa-is-of-data-type"),
        ({"data": np.ones(20)}, "is-stored-as-real-numbers"),
    ],
)
def test_a_response_over_something_else_or_without_phases_is_refused(tmp_path, changes, message):
    path = written(tmp_path / "other.uff", response(np.ones(20), label="m/s2", force_label="N") | changes)
    with refused(ImportFailed, message):
        matrix(path)


def test_code_and_factors_of_dataset_164_that_disagree_are_refused_until_one_is_chosen(tmp_path):
    path = written(tmp_path / "code.uff", units(1, 1000.0, 1000.0), response(np.ones(20)))
    with refused(ImportFailed, "dataset-164-code-is-with-the-factors"):
        matrix(path)
    np.testing.assert_allclose(matrix(path, "file").value, 1.0)


def test_records_whose_channels_do_not_begin_together_are_lined_up_or_refused(tmp_path):
    late = signal(SAMPLES, node=2) | {"x": 0.01 + np.arange(64) / 1000.0, "abscissa_min": 0.01}
    found = time_data(written(tmp_path / "late.uff", signal(SAMPLES), late))
    assert [found.channels[name].start_s for name in ("1+Z", "2+Z")] == [0.0, pytest.approx(0.01)]
    path = written(tmp_path / "uneven.uff", signal(SAMPLES), late, signal(SAMPLES), signal(SAMPLES, node=2))
    with refused(ImportFailed, "wanted-is-the-same-time-between"):
        time_data(path)


def test_complex_samples_are_refused_where_they_are_mapped(tmp_path):
    path = written(tmp_path / "complex.uff", signal(SAMPLES), signal(SAMPLES + 1j, node=2))
    found = time_data(path)
    assert found.values["2+Z"].dtype.kind == "c"


@pytest.mark.parametrize("others", [(), ("Pa",)])
def test_a_proposed_mapping_of_accelerations_alone_imports_as_motions(tmp_path, others):
    parts = [signal(SAMPLES * k, node=k) for k in (1, 2, 3)]
    parts += [signal(SAMPLES, node=9, code=15, label=unit) for unit in others]
    path = written(tmp_path / "output_only.uff", *parts)
    (tmp_path / "m.toml").write_text(proposed(path, (), "", "").text, encoding="utf-8")
    records = import_file(path, mapping=tmp_path / "m.toml")
    assert [(c.role, c.unit) for c in records.channels] == [
        *[("drive", "m/s2"), ("response", "m/s2"), ("response", "m/s2")],
        *[("monitor", unit) for unit in others],
    ]
