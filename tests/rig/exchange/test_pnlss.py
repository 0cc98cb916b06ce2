"""Nonlinear state-space models go out as matrices and come back to the bit; those of toolboxes come in by a mapping."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from identification import Channel, Features, PnlssModel, StateSpace
from identification.common import encode
from rig.errors import RecordingError
from rig.exchange.child_reading import ImportFailed
from rig.exchange.export import export_file
from rig.exchange.reading import import_file
from rig.results.files import load, save
from tests.refused import refused

FORCE, DRIVE, TIP = Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m")
MAPPING = """
kind = "pnlss"
sample_rate = "fs"
inputs = [{ name = "force", role = "force", unit = "N" }]
outputs = [{ name = "drive", role = "drive", unit = "g" }, { name = "tip", role = "response", unit = "mm" }]
"""


def model(states: int = 2, saturating: int = 0) -> PnlssModel:
    random = np.random.default_rng(states)
    linear = PnlssModel.linear(
        StateSpace(*(0.3 * random.normal(size=s) for s in ((states, states), (states, 1), (2, states), (2, 1)))),
        sample_rate_hz=800.0,
        inputs=(FORCE,),
        outputs=(DRIVE, TIP),
        specimen="beam",
        notes=("of a test",),
    )
    weights = random.normal(size=(saturating, states + 2))
    phi = replace(Features.monomials(states, 1, [2, 3]), weights=weights, limits=np.full(states + 1, 3.0))
    found = linear.with_features(phi, Features.monomials(states, 1, [3]))
    return replace(
        found,
        e=random.normal(size=found.e.shape),
        f=random.normal(size=found.f.shape),
        state_range=random.random(states),
        training=("realisation 0", "realisation 1"),
    )


@pytest.mark.parametrize(("states", "saturating"), [(1, 0), (2, 0), (3, 2)])
def test_a_model_comes_back_to_the_bit(states, saturating, tmp_path):
    sent = model(states, saturating)
    save(sent, tmp_path / "sent.h5")
    export_file(tmp_path / "sent.h5", tmp_path / "m.mat", "mat")
    found = import_file(tmp_path / "m.mat")
    (arrays, attributes), (wanted, others) = encode(found), encode(sent)
    assert attributes == others
    for name, array in wanted.items():
        assert arrays[name].dtype == array.dtype
        assert np.array_equal(arrays[name], array, equal_nan=True)
    save(found, tmp_path / "back.h5")
    assert load(tmp_path / "back.h5").fit is None


def test_the_structure_has_the_fields_of_toolboxes(tmp_path):
    save(model(), tmp_path / "m.h5")
    export_file(tmp_path / "m.h5", tmp_path / "m.mat", "mat")
    fields = loadmat(tmp_path / "m.mat", simplify_cells=True)["pnlss"]
    x, u = np.array([0.3, -0.2]), 0.7
    monomials = np.prod(np.array([*x, u]) ** fields["xpowers"], axis=1)
    after = fields["A"] @ x + fields["B"] * u + fields["E"] @ monomials
    outputs = fields["C"] @ x + fields["D"] * u + fields["F"] @ np.prod(np.array([*x, u]) ** fields["ypowers"], axis=1)
    run = model().simulate([[u, 0.0]], initial_state=x)
    np.testing.assert_allclose(run.states[:, 1], after, rtol=1e-13)
    np.testing.assert_allclose(run.outputs[:, 0], outputs, rtol=1e-13)
    assert (fields["n"], fields["m"], fields["p"], fields["fs"]) == (2, 1, 2, 800)
    assert (fields["nx"].tolist(), fields["ny"]) == ([2, 3], 3)


@pytest.mark.parametrize("states", [1, 2])
def test_a_toolbox_model_comes_in_by_a_mapping_in_si(states, tmp_path):
    sent = replace(model(states), state_features=Features.monomials(states, 1, [2, 3]))
    mat = {name.upper(): getattr(sent, name) for name in "abcdef"}
    mat |= {"xpowers": sent.state_features.exponents.astype(float), "nx": [2.0, 3.0]}
    mat |= {"ypowers": sent.output_features.exponents.astype(float), "ny": 3.0}
    savemat(tmp_path / "toolbox.mat", {"model": mat, "fs": 800.0})
    (tmp_path / "map.toml").write_text(MAPPING)
    found = import_file(tmp_path / "toolbox.mat", mapping=tmp_path / "map.toml")
    u = np.random.default_rng(0).normal(size=(1, 3)) * 0.1
    wanted = sent.simulate(u).outputs * np.array([[9.80665], [1e-3]])
    np.testing.assert_allclose(found.simulate(u).outputs, wanted, rtol=1e-12)
    assert any("range" in note for note in found.notes)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"E": np.zeros((2, 5))}, {"says": "shape-2", "field": "E"}),
        ({"xpowers": np.full((1, 3), 1.5)}, {"says": "are-no-whole-numbers", "field": "xpowers"}),
        ({"xpowers": np.zeros((2, 5))}, {"says": "shape-2", "field": "xpowers"}),
        (
            {"xpowers": np.ones((3, 4)), "E": np.ones((2, 4))},
            {"says": "shape", "field": "xpowers", "allowed": "3 columns: states, then inputs"},
        ),
        ({"A": "text"}, {"says": "model-holds-no-real-numbers"}),
        ({"C": np.full((2, 2), np.nan)}, {"field": "c"}),
    ],
)
def test_what_is_no_such_model_is_named(change, said, tmp_path):
    sent = model()
    mat = {name.upper(): getattr(sent, name) for name in "abcdef"}
    mat |= {"xpowers": sent.state_features.exponents.astype(float)}
    mat |= {"ypowers": sent.output_features.exponents.astype(float)}
    savemat(tmp_path / "toolbox.mat", {"model": mat | change, "fs": 800.0})
    (tmp_path / "map.toml").write_text(MAPPING)
    with refused(ImportFailed, **said):
        import_file(tmp_path / "toolbox.mat", mapping=tmp_path / "map.toml")


@pytest.mark.parametrize("format_", ["csv", "uff"])
def test_formats_of_tables_have_no_place_for_matrices(format_, tmp_path):
    save(model(), tmp_path / "m.h5")
    with refused(RecordingError, "is-matrices-and-no-table"):
        export_file(tmp_path / "m.h5", tmp_path / f"m.{format_}", format_)
    assert not (tmp_path / f"m.{format_}").exists()
