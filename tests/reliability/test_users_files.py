"""Files of the user's beside the program's own, or under a name that it is given: none is removed, overwritten or changed."""

import os

import pytest

import rig
from rig.bench import load_bench
from rig.cli.emulate import WRITTEN, _check_bench_file
from rig.drawing.page import check_replaceable, page_for
from rig.emulator.plant import OutputLog, VirtualPlant
from rig.emulator.ports import named
from rig.errors import ConfigurationError, RecordingError
from rig.hil.results import Results
from rig.rehearsal.rehearsal import discard_draws
from studies.reproduce.folder import prepare
from studies.reproduce.options import Options
from studies.reproduce.references.output import prepared
from studies.reproduce.specimens import SPECIMENS
from tests.recorded import recorded
from tests.refused import refused
from tests.rig.rigs import bench_with
from vibrolock import kernel_cache

TEXT = "years of work"


@pytest.fixture
def users(tmp_path):
    """A function that makes a file of the user's; all that it made is looked at once the test is over."""
    made = []

    def make(name):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(TEXT)
        path.chmod(0o640)
        made.append(path)
        return path

    yield make
    assert made
    for path in made:
        assert path.read_text() == TEXT
        assert path.stat().st_mode & 0o777 == 0o640


def test_files_whose_names_begin_as_that_of_the_output_survive_an_overwriting_run(users, tmp_path):
    output = tmp_path / "a.h5"
    for end in ("part", "before", "tmp", "new", "bak", "damaged", "draws"):
        users(f"a.h5.{end}")
    rig.run("magnet-beam/backbone-short", output=output)
    rig.run("magnet-beam/backbone-short", output=output, overwrite=True)


def test_a_link_under_the_name_of_a_half_written_file_is_not_written_through(users, tmp_path):
    thesis = users("thesis.txt")
    for name in ("a.h5.part", "a.h5.vibrolock-part"):
        (tmp_path / name).symlink_to(thesis)
    rig.run("magnet-beam/backbone-short", output=tmp_path / "a.h5")


def test_what_has_a_journals_name_and_is_none_stays_even_if_it_may_be_overwritten(users, tmp_path):
    users("a.h5.journal")
    with refused(RecordingError, "not-a-journal-of-this-program"):
        rig.run("magnet-beam/backbone-short", output=tmp_path / "a.h5", overwrite=True)


def test_what_has_the_name_of_a_rehearsals_draws_and_is_none_stays(users, tmp_path):
    with refused(RecordingError, "holds-no-draws-of-a-rehearsal"):
        discard_draws(users("r.h5.draws"))
    ours = tmp_path / "ours.draws"
    for text in ("", '{"rehe', '{"rehearsal": "0123"}\n'):
        ours.write_text(text)
        discard_draws(ours)
        assert not ours.exists()
    discard_draws(ours)


def test_an_emulator_replaces_its_own_bench_log_and_link_alone(users, tmp_path):
    bench = users("bench.toml")
    with refused(ConfigurationError, "was-not-written-by-rig-emulate"):
        _check_bench_file(bench)
    ours = tmp_path / "ours.toml"
    ours.write_text(f"{WRITTEN}\nblock = 10\n")
    _check_bench_file(ours)
    with refused(ConfigurationError, "no-log-of-an-emulator", field="log_output"):
        OutputLog(users("notes.log"))
    log = tmp_path / "log"
    for _ in range(2):
        plant = VirtualPlant(bench_with())
        plant.log = OutputLog(log)
        plant.reset()
        assert len(log.read_text().splitlines()) == 1
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "on a disk that is not mounted")
    with refused(ConfigurationError, "leads-to", field="link"), named("/dev/pts/999", link):
        pass
    assert link.readlink() == tmp_path / "on a disk that is not mounted"
    link.unlink()
    link.symlink_to("/dev/pts/998")
    with named("/dev/pts/999", link):
        assert str(link.readlink()) == "/dev/pts/999"


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_a_figure_replaces_figures_of_this_program_alone(users, tmp_path, suffix, command):
    recording = recorded("magnet-beam/backbone-short")
    photo = users(f"photo{suffix}")
    assert "not a figure of this program" in command(f"plot {recording} -o {photo}").err
    assert "not a figure of this program" in command(f"analyse modes --bench magnet-beam -o {photo}").err
    ours = tmp_path / f"ours{suffix}"
    for _ in range(2):
        with page_for(ours, (2.0, 2.0)):
            pass
        check_replaceable(ours)
    other = tmp_path / f"other{suffix}"
    other.write_text(TEXT)
    command(f"plot {recording} -o {other} --overwrite").succeeded()
    check_replaceable(other)


def test_a_study_begins_in_no_folder_with_other_files(users, tmp_path):
    users("study/errors.csv")
    options = Options(specimen=SPECIMENS["magnet-beam"], bench=load_bench("magnet-beam"), folder=tmp_path / "study")
    with refused(RecordingError, "holds-files-that-are-of-no"):
        prepare(options)
    with refused(RecordingError, "holds-files-that-are-of-no"):
        prepared(tmp_path / "study")


def test_results_of_tests_and_rows_of_a_matrix_replace_such_files_alone(users, tmp_path, command):
    with refused(pytest.UsageError, "no-such-result"):
        Results(str(users("results.json")))
    Results(str(tmp_path / "new.json"))
    assert "rows" in command(f"doctor --daq magnet-beam -o {users('rows.json')}").err


def test_the_cache_of_machine_code_loses_nothing_but_machine_code(users, tmp_path, monkeypatch):
    digest = 24 * "a"
    ours = [tmp_path / f"vibrolock/kernels/f-{digest}.py311.{end}" for end in ("nbi", "1.nbc", "nbi.lock")]
    files = [users(f"vibrolock/{name}") for name in ("thesis/a.tex", "kernels/a.nbi", "kernels/a.txt", "notes")]
    for path in ours:
        path.touch()
    for path in (*ours, *files, *(path.parent for path in files)):
        os.utime(path, (1e9, 1e9))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_folder", None)
    assert kernel_cache.kernel_cache_folder() == tmp_path / "vibrolock" / "kernels"
    assert not any(path.exists() for path in ours)
