"""Structured models go out as MAT and come back to the bit, with tables of the elements' forces."""

import json

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from identification import NonlinearElement
from identification.models import BoucWen, Jenkins
from rig.errors import RecordingError
from rig.exchange.child_reading import ImportFailed
from rig.exchange.export import export_file
from rig.exchange.reading import import_file
from rig.results.files import save
from tests.refused import refused
from tests.rig.exchange.structured_models import structure


def test_a_model_comes_back_to_the_bit(tmp_path):
    sent = structure()
    save(sent, tmp_path / "sent.h5")
    export_file(tmp_path / "sent.h5", tmp_path / "m.mat", "mat")
    found = import_file(tmp_path / "m.mat")
    u = np.random.default_rng(0).normal(size=(1, 300))
    assert np.array_equal(found.simulate(u).outputs, sent.simulate(u).outputs)
    assert [law.as_dict() for e in found.elements for law in e.laws] == [
        law.as_dict() for e in sent.elements for law in e.laws
    ]
    assert found.training == sent.training
    assert [element.largest for element in found.elements] == [1.1, None]


def test_the_tables_hold_the_forces_at_rest_and_at_the_reach(tmp_path):
    save(structure(), tmp_path / "sent.h5")
    export_file(tmp_path / "sent.h5", tmp_path / "m.mat", "mat")
    fields = loadmat(tmp_path / "m.mat", simplify_cells=True)["structured"]
    np.testing.assert_allclose(fields["displacement_m"][:, [0, -1]], [[-3e-3, 3e-3], [-4e-3, 4e-3]])
    # 3 x^2 + 1.5 x^3 + 0.1 x^4, the stop beyond 0.4, and the magnet at x = 0.8 of its gap and a line from there
    magnet = 0.1 * (5.0**4 + 4.0 * 5.0**5 * 0.2 - 1.0 - 4.0)
    assert fields["spring_n"][0, -1] == pytest.approx(27.0 + 40.5 + 8.1 + 0.7 * 2.6 + magnet)
    assert fields["damper_n_s_m"][0, 0] == pytest.approx(0.4 * 3.0 + 0.1 * 9.0)
    assert not fields["spring_n"][1].any()
    assert set(fields["slider_element"]) == {2}
    assert fields["slider_stiffness_n_m"].sum() == pytest.approx((0.5 + 0.2) / 2e-3)
    assert fields["slider_strength_n"][0] == pytest.approx(0.5 * 0.3)


def test_a_hysteresis_comes_back_with_its_numbers_in_the_table_of_sliders(tmp_path):
    element = NonlinearElement(
        direction=[0.9, -0.1], scale_m=1e-3, laws=(Jenkins(0.5, 0.3), BoucWen(2.0, 0.4, 1.5, -0.5))
    )
    sent = structure(elements=(element,))
    save(sent, tmp_path / "sent.h5")
    export_file(tmp_path / "sent.h5", tmp_path / "m.mat", "mat")
    found, u = import_file(tmp_path / "m.mat"), np.random.default_rng(0).normal(size=(1, 300))
    assert np.array_equal(found.simulate(u).outputs, sent.simulate(u).outputs)
    fields = loadmat(tmp_path / "m.mat", simplify_cells=True)["structured"]
    np.testing.assert_allclose(fields["slider_yield_n"], [0.0, 0.8])
    np.testing.assert_allclose(fields["slider_exponent"], [0.0, 1.5])
    np.testing.assert_allclose(fields["slider_gamma"], [0.0, -0.5])
    np.testing.assert_allclose(fields["slider_strength_n"], [0.15, 0.8 * 0.5 ** (-1.0 / 1.5)])


def test_a_damaged_file_is_named(tmp_path):
    save(structure(), tmp_path / "sent.h5")
    export_file(tmp_path / "sent.h5", tmp_path / "m.mat", "mat")
    fields = loadmat(tmp_path / "m.mat", simplify_cells=True)["structured"]
    told = json.loads(fields["attributes_json"])
    fields["attributes_json"] = json.dumps(told | {"attributes": told["attributes"] | {"wrong": 1}})
    savemat(tmp_path / "damaged.mat", {"structured": fields})
    with refused(ImportFailed, "missing-or-unknown", field="structured"):
        import_file(tmp_path / "damaged.mat")


@pytest.mark.parametrize("format_", ["csv", "uff"])
def test_formats_of_tables_have_no_place_for_matrices(format_, tmp_path):
    save(structure(), tmp_path / "m.h5")
    with refused(RecordingError, "is-matrices-and-no-table"):
        export_file(tmp_path / "m.h5", tmp_path / f"m.{format_}", format_)
