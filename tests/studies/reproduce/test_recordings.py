"""Recordings of a study: made once, finished where they were interrupted, each realisation a run of its own under scatter."""

import json

import numpy as np
import pytest

from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError, RecordingError
from rig.recording.reader import Recording
from simulators import VirtualRig
from studies.reproduce.folder import prepare
from studies.reproduce.options import Options
from studies.reproduce.recordings import multisines
from studies.reproduce.specimens import SPECIMENS
from tests.refused import refused

LIMIT_N = 1.4
"""Some realisations at 0.5 N RMS have peaks beyond it, some have not."""


def quiet(line):
    pass


@pytest.fixture
def short(monkeypatch):
    """Multisines of a second with three realisations."""

    def loaded(name):
        return load_plan(name).model_copy(update={"resolution_hz": 1.0, "realisations": 3, "periods": 1})

    monkeypatch.setattr("studies.reproduce.recordings.load_plan", loaded)


@pytest.fixture
def asked(tmp_path):
    def with_options(**changes):
        options = Options(
            **{
                "specimen": SPECIMENS["magnet-beam"],
                "bench": load_bench("magnet-beam"),
                "folder": tmp_path / "study",
                "levels": 1,
                **changes,
            }
        )
        prepare(options)
        return options

    return with_options


def test_what_is_recorded_is_not_recorded_again(asked, short):
    options = asked()
    first = multisines(options, quiet)
    files = {path: path.stat().st_mtime_ns for path in options.recordings.iterdir()}
    second = multisines(options, quiet)
    assert {path: path.stat().st_mtime_ns for path in options.recordings.iterdir()} == files
    assert list(first) == ["0.5 N"]
    assert len(first["0.5 N"]) == 3
    for one, other in zip(first["0.5 N"], second["0.5 N"], strict=True):
        assert np.array_equal(one.outputs, other.outputs)
        assert np.sqrt(np.mean(one.counted_inputs**2)) == pytest.approx(0.5, rel=0.05)


def test_under_scatter_every_realisation_has_phases_noise_and_a_specimen_of_its_own(asked, short):
    options = asked(scatter=0.001)
    found = multisines(options, quiet)["0.5 N"]
    assert len({one.inputs[0, :50].tobytes() for one in found}) == 3
    frequencies = []
    for path in sorted(options.recordings.glob("multisine-1-*.h5")):
        with Recording(path) as recording:
            table = recording.configuration["bench"]["driver"]["options"]
            assert table["scatter"] == {"frequency": 0.001}
            realised = VirtualRig.model_validate({k: v for k, v in table.items() if k in VirtualRig.model_fields})
            frequencies.append(realised.realised(recording.seed).linear_modes.frequency_hz[0])
    assert len(set(frequencies)) == 3
    assert 2e-4 < np.std(frequencies) / np.mean(frequencies) < 2e-3


def test_phases_that_trip_the_bench_are_drawn_anew(asked, short):
    bench = load_bench("magnet-beam")
    tight = bench.model_copy(update={"limits": bench.limits.model_copy(update={"force_n": LIMIT_N})})
    options = asked(scatter=0.001, bench=tight)
    assert len(multisines(options, quiet)["0.5 N"]) == 3
    phases = set()
    for path in options.recordings.glob("multisine-1-*.h5"):
        with Recording(path) as recording:
            phases.add(recording.configuration["plan"]["phase_seed"])
            force = max(point["force_rms_n"] for point in recording.latest.values())
            assert force < 1.75
    assert max(phases) > 100_000


def test_a_folder_of_other_settings_is_refused_and_what_differs_is_named(asked):
    options = asked()
    kept = json.loads((options.folder / "study.json").read_text())
    assert kept["scatter"] == 0.0
    with refused(RecordingError, "another-scatter-asked-for-is-choose"):
        asked(scatter=0.001)
    with refused(RecordingError, "another-iterations-asked-for-is"):
        asked(iterations=5)
    assert asked(input="voltage").models_folder != options.models_folder


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"models": 0}, {"says": "models-allowed-is-number-from-or"}),
        ({"models": "many"}, {"says": "models-many"}),
        ({"scatter": 0.2}, {"says": "scatter-allowed-is-to"}),
        ({"input": "acceleration"}, {"says": "input-acceleration-allowed-is-force-volt"}),
        ({"channel": "tip"}, {"says": "channel-tip-allowed-is-drive-acc"}),
        ({"levels": 4}, {"says": "levels-allowed-is-to"}),
        ({"without": frozenset({"tables"})}, {"says": "without-tables-allowed-is-steady-sweeps"}),
    ],
)
def test_what_cannot_be_studied_is_one_line(asked, changes, said):
    with refused(ConfigurationError, **said):
        asked(**changes)


def test_a_real_bench_is_refused_for_it_does_not_tell_the_truth(asked):
    bench = load_bench("magnet-beam")
    real = bench.model_copy(update={"driver": bench.driver.model_copy(update={"name": "serial"})})
    with refused(ConfigurationError, "which-only-virtual-bench-tells"):
        asked(bench=real)


def test_the_counts_of_the_paper(asked):
    assert asked(levels=None, models="paper").counts == {"0.5 N": 20, "2.6 N": 30, "5.2 N": 30, "mixed": 30}
