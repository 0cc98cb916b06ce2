"""Files of ``rig new``: they load as they are, say what their keys mean, and replace nothing."""

import json
import re
import shutil

import pytest

from rig.authoring.new_files import new_driver, new_file
from rig.authoring.schemas import schema_of
from rig.bench import load_bench
from rig.bench.cross_checks import cautions
from rig.campaigns.kinds import KINDS
from rig.campaigns.plans import bench_of, load_plan
from rig.drivers import make_daq
from rig.errors import ConfigurationError, RecordingError
from tests.refused import refused
from tests.rig.authoring.test_schemas import of, read


def uncommented(text):
    """A file with all optional keys that have a default, and the tables that such keys stand in."""
    keys = re.sub(r"^#(\w+ = \S)", r"\1", text, flags=re.MULTILINE)
    assert keys != text
    return keys


def first_line(path):
    return path.read_text(encoding="utf-8").partition("\n")[0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_plan_loads_and_its_bench_can_do_it(kind, tmp_path):
    path = tmp_path / "plan.toml"
    assert new_file("plan", path, kind=kind) == tmp_path / f"{kind}.schema.json"
    assert first_line(path) == f"#:schema ./{kind}.schema.json"
    plan = load_plan(path)
    plan.check(bench_of(plan, path))
    of(kind).validate(read(path))
    assert json.loads((tmp_path / f"{kind}.schema.json").read_text(encoding="utf-8")) == schema_of(kind)


def test_a_new_plan_for_another_bench_says_whose_numbers_it_has(tmp_path):
    new_file("plan", tmp_path / "plan.toml", kind="dwell", bench="magnet-beam")
    plan = load_plan(tmp_path / "plan.toml")
    assert plan.bench == "magnet-beam"
    assert "the bench friction-beam" in plan.description
    new_file("plan", tmp_path / "other.toml", kind="sweep", bench="friction-beam")
    assert load_plan(tmp_path / "other.toml").description == "begun from the shipped plan friction-beam/sweep-1"


def test_a_new_rig_loads_its_driver_accepts_it_and_nothing_is_amiss(tmp_path):
    path = tmp_path / "mine.toml"
    new_file("rig", path)
    bench = load_bench(path)
    assert bench.name == "mine"
    daq = make_daq(bench)
    assert not daq.remarks
    assert cautions(bench) == ()
    of("bench").validate(read(path))


def test_a_new_bench_loads_and_a_run_says_in_one_line_what_is_to_be_filled_in(command, tmp_path):
    done = command("new bench -o laboratory.toml")
    assert done == (0, "laboratory.toml: a bench to begin with, checked by bench.schema.json\n", "")
    assert load_bench("laboratory.toml").name == "laboratory"
    (filter_is_unknown,) = cautions(load_bench("laboratory.toml"))
    assert filter_is_unknown.startswith("`channels[0].anti_alias_hz` = 0 Hz: ")
    of("bench").validate(read(tmp_path / "laboratory.toml"))
    status, out, err = command("check --bench laboratory.toml -o check.h5")
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert "NAME-OF-THE-DEVICE" in err


@pytest.mark.parametrize(("what", "kind"), [("bench", ""), ("rig", ""), *(("plan", kind) for kind in KINDS)])
def test_comments_explain_every_key_of_a_file_and_name_the_units(what, kind, tmp_path):
    path = tmp_path / "file.toml"
    new_file(what, path, kind=kind)
    text = path.read_text(encoding="utf-8")
    schema = schema_of(kind or "bench")
    for key, field in schema["properties"].items():
        words = " ".join(field["description"].split())
        assert words[:40] in " ".join(text.replace("\n# ", " ").split()), key
    assert all(len(line) < 128 for line in text.splitlines() if line.startswith("# "))
    if what != "plan":
        assert "# Range of the output converter, V. [above 0 to 100]\noutput_range_v = " in text
        assert "# Sample rate of the loop, Hz. [above 0 to 1e+06]\nsample_rate_hz = 5000.0" in text


@pytest.mark.parametrize("what", ["bench", "rig"])
def test_defaults_in_the_comments_are_those_of_the_program(what, tmp_path):
    path = tmp_path / "file.toml"
    new_file(what, path)
    before = load_bench(path)
    path.write_text(uncommented(path.read_text(encoding="utf-8")), encoding="utf-8")
    assert load_bench(path).model_dump(exclude={"driver"}) == before.model_dump(exclude={"driver"})


@pytest.mark.parametrize("kind", KINDS)
def test_defaults_in_the_comments_of_a_plan_are_those_of_the_program(kind, tmp_path):
    path = tmp_path / "file.toml"
    new_file("plan", path, kind=kind)
    before = load_plan(path)
    path.write_text(uncommented(path.read_text(encoding="utf-8")), encoding="utf-8")
    assert load_plan(path) == before


def test_a_new_driver_is_the_template_with_a_bench_that_an_editor_checks(tmp_path):
    new_driver(tmp_path / "box")
    assert first_line(tmp_path / "box" / "box-bench.toml") == "#:schema ./bench.schema.json"
    assert load_bench(tmp_path / "box" / "box-bench.toml").driver.name == "box"
    assert (tmp_path / "box" / "vibrolock_box" / "driver.py").exists()
    of("bench").validate(read(tmp_path / "box" / "box-bench.toml"))
    with refused(RecordingError, "exists-already"):
        new_driver(tmp_path / "box")
    shutil.rmtree(tmp_path / "box" / "tests")
    new_driver(tmp_path / "box", overwrite=True)
    assert (tmp_path / "box" / "tests").is_dir()


def test_nothing_is_replaced_without_being_told_to(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("name = 'mine'\n", encoding="utf-8")
    with refused(RecordingError, "mine-toml-exists-already-choose-another"):
        new_file("bench", path)
    assert path.read_text(encoding="utf-8") == "name = 'mine'\n"
    assert not (tmp_path / "bench.schema.json").exists()
    (tmp_path / "bench.schema.json").write_text("{}", encoding="utf-8")
    with refused(RecordingError, "bench-schema-json-exists-already"):
        new_file("bench", tmp_path / "other.toml")
    assert not (tmp_path / "other.toml").exists()
    new_file("bench", path, overwrite=True)
    assert load_bench(path).name == "mine"
    new_file("rig", tmp_path / "third.toml")  # the schema is there and is the same


def test_the_schema_stands_where_it_is_wanted_and_the_file_refers_to_it(tmp_path):
    (tmp_path / "schemas").mkdir()
    new_file("bench", tmp_path / "mine.toml", schema_file=tmp_path / "schemas" / "b.json")
    assert first_line(tmp_path / "mine.toml") == "#:schema ./schemas/b.json"
    assert (tmp_path / "schemas" / "b.json").exists()


def test_commands_refuse_another_word_and_print_a_schema(command, tmp_path):
    status, _, err = command("new benhc -o x.toml")
    assert status == 1
    assert "bench, plan, rig, sensors" in err
    with refused(ConfigurationError, field="kind", value="backbones"):
        new_file("plan", tmp_path / "x.toml", kind="backbones")
    assert json.loads(command("schema plan").succeeded().out) == schema_of("plan")
    command("schema backbone -o backbone.schema.json").succeeded()
    assert json.loads((tmp_path / "backbone.schema.json").read_text(encoding="utf-8")) == schema_of("backbone")
