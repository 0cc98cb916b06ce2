"""Benches from files that start from other benches."""

import pytest

from rig.bench import load_bench
from rig.errors import ConfigurationError
from tests.refused import refused


def test_a_bench_may_start_from_a_file_beside_it_that_starts_from_a_shipped_one(tmp_path):
    (tmp_path / "mine.toml").write_text('base = "magnet-beam"\nname = "mine"\n[limits]\nforce_n = 3.0\n')
    (tmp_path / "quiet.toml").write_text('base = "mine.toml"\nname = "quiet"\n[driver.options]\nnoise_scale = 0.0\n')
    bench = load_bench(tmp_path / "quiet.toml")
    assert bench.name == "quiet"
    assert bench.limits.force_n == 3.0
    assert bench.driver.options == {"specimen": "magnet-beam", "noise_scale": 0.0}
    assert bench.channels == load_bench("magnet-beam").channels


def test_benches_that_start_from_each_other_are_refused(tmp_path):
    (tmp_path / "a.toml").write_text('base = "b.toml"\n')
    (tmp_path / "b.toml").write_text('base = "a.toml"\n')
    with refused(ConfigurationError, "start-from-each-other", field="base", value="b.toml"):
        load_bench(tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ("[[elements]]\nkind = 'cubik'\nat = 'tip'", "elements[0].kind = 'cubik'; allowed: 'magnet-one-sided'"),
        ("[[elements]]\nat = 'tip'", "elements[0].kind: is missing"),
        ("[[elements]]\nkind='clearance'\nat='tip'\ncontact_stiffness_n_m=1.0\ngap_mm=1.0", "did you mean gap_m?"),
    ],
)
def test_faults_inside_parts_are_named_by_their_keys_alone(tmp_path, changes, fault):
    from rig.bench.configuration import read_toml, validated
    from simulators import VirtualRig

    (tmp_path / "rig.toml").write_text('specimen = "magnet-beam"\n' + changes)
    with pytest.raises(ConfigurationError) as caught:
        validated(VirtualRig, read_toml(tmp_path / "rig.toml"), "rig.toml")
    assert fault in str(caught.value).replace("`", "")
    assert "clearance." not in str(caught.value)
    assert "too short" not in str(caught.value).lower()
