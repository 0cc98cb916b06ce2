"""The files of a reference study are found, or one line says what is missing and where it is."""

import hashlib
from pathlib import Path

import pytest

from rig.errors import ConfigurationError, RecordingError
from studies.reproduce.references import brake_reuss
from studies.reproduce.references.data import DataFile, DataSet, found
from studies.reproduce.references.studies import STUDIES
from tests.refused import refused

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "brake-reuss-mapping.toml"
CONTENTS = b"measured"
DATA = DataSet(
    name="study",
    files=(DataFile(name="a.mat", sha256=hashlib.sha256(CONTENTS).hexdigest(), aliases=("b.mat",)),),
    source="https://example.org/data",
    citation="N. N.",
)


@pytest.mark.parametrize("name", ["a.mat", "b.mat"])
def test_a_file_is_known_by_its_contents_under_any_of_its_names(tmp_path, name):
    (tmp_path / name).write_bytes(CONTENTS)
    assert found(DATA, tmp_path) == (tmp_path / name,)


def test_the_right_file_is_taken_beside_another_of_the_other_name(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"of another program")
    (tmp_path / "b.mat").write_bytes(CONTENTS)
    assert found(DATA, tmp_path) == (tmp_path / "b.mat",)


def test_what_is_missing_or_another_is_named_with_its_source(tmp_path):
    with refused(ConfigurationError, "study-needs-folder-with-mat-from", field="data"):
        found(DATA, None)
    with refused(ConfigurationError, "nowhere-is-no-folder-study-needs"):
        found(DATA, tmp_path / "nowhere")
    with refused(ConfigurationError, "has-no-mat-or-mat-get"):
        found(DATA, tmp_path)
    (tmp_path / "a.mat").write_bytes(b"shortened")
    digest = hashlib.sha256(b"shortened").hexdigest()
    with refused(RecordingError, where=str(tmp_path / "a.mat"), reason=lambda text: digest in text):
        found(DATA, tmp_path)


@pytest.mark.parametrize("name", STUDIES)
def test_the_command_says_in_one_line_what_it_needs(command, tmp_path, name):
    out = tmp_path / "out"
    for line, said in (
        (f"reproduce {name} -o {out}", f"--data: {name} needs a folder with {STUDIES[name].data.files[0].name}"),
        (f"reproduce {name} -o {out} --data {tmp_path}", f"has no {STUDIES[name].data.files[0].name}"),
        (
            f"reproduce {name} -o {out} --data {tmp_path} --levels 1",
            f"--levels: is of the paper's campaign, not of {name}",
        ),
        (f"reproduce {name} -o {out} --data {tmp_path} --models paper", "--models paper: allowed is a number from 1"),
    ):
        done = command(line)
        assert done.status == 1
        assert said in done.err
        assert len(done.err.splitlines()) == 1
        assert STUDIES[name].data.source in done.err or "leave it out" in done.err or "allowed" in done.err
    assert not out.exists()


def test_data_are_refused_beside_the_papers_campaign(command, tmp_path):
    done = command(f"reproduce magnet-beam -o {tmp_path / 'out'} --data {tmp_path}")
    assert (done.status, "silverbox, bouc-wen, brake-reuss" in done.err) == (1, True)


def test_the_mapping_of_the_study_is_the_one_in_the_documentation():
    mapping = Path(brake_reuss.__file__).with_name("brake-reuss-mapping.toml")
    assert mapping.read_text() == EXAMPLE.read_text()
