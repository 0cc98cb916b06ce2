"""Broken and hostile files of time data are refused in one line that names what is wrong."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import hdf5storage
import numpy as np
import pytest
import scipy.io
from asammdf import MDF, Signal

from rig.errors import RigError
from rig.exchange.reading import import_file
from tests.refused import refused
from tests.rig.exchange.time_data import files
from tests.rig.exchange.time_data.files import ACCELERATION, FORCE, INSTANTS, RATE_HZ


def cut(write: Callable[[Path], None], share: float) -> Callable[[Path], None]:
    def written(path: Path) -> None:
        write(path)
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])

    return written


def text(content: str) -> Callable[[Path], None]:
    return lambda path: path.write_text(content) and None


def noise(path: Path) -> None:
    path.write_bytes(np.random.default_rng(3).bytes(5000))


def mat(**arrays: Any) -> Callable[[Path], None]:
    return lambda path: scipy.io.savemat(path, {"F": FORCE, "a": ACCELERATION, **arrays})


def linked(path: Path) -> None:
    with h5py.File(path.with_name("secret.h5"), "w") as file:
        file["F"] = FORCE
    with h5py.File(path, "w") as file:
        file["F"] = h5py.ExternalLink("secret.h5", "F")
        file["a"] = ACCELERATION


def virtual(path: Path) -> None:
    with h5py.File(path.with_name("secret.h5"), "w") as file:
        file["F"] = FORCE
    layout = h5py.VirtualLayout(FORCE.shape, "f8")
    layout[:] = h5py.VirtualSource("secret.h5", "F", FORCE.shape)
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("F", layout)
        file["a"] = ACCELERATION


def endless(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("F", (10**12,), "f8", chunks=(10**6,), fillvalue=1.0)


def in_a_circle(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("F")
        group["F"] = group
        file["a"] = ACCELERATION


def old_mdf(path: Path) -> None:
    with MDF(version="3.30") as file:
        file.append([Signal(FORCE, INSTANTS, name="F", unit="N")])
        made = file.save(path.with_suffix(".mdf"), overwrite=True)
    Path(made).rename(path)


def uneven(path: Path) -> None:
    with MDF(version="4.10") as file:
        file.append([Signal(FORCE, INSTANTS**1.5, name="F"), Signal(FORCE, INSTANTS**1.5, name="a")])
        file.save(path, overwrite=True)


def at_two_rates(path: Path) -> None:
    with MDF(version="4.10") as file:
        file.append([Signal(FORCE, INSTANTS, name="F", unit="N")])
        file.append([Signal(ACCELERATION, 2.0 * INSTANTS, name="a", unit="m/s2")])
        file.save(path, overwrite=True)


def nested(path: Path) -> None:
    value: Any = FORCE
    for _ in range(60):
        value = {"F": value}
    hdf5storage.savemat(str(path), {"F": value, "a": ACCELERATION}, format="7.3")


def fifo(path: Path) -> None:
    os.mkfifo(path)


RATE = f"sample_rate_hz = {RATE_HZ}"
BROKEN: dict[str, tuple[str, Callable[[Path], None], str, str]] = {
    "a MAT file cut short": ("x.mat", cut(files.mat5, 0.5), RATE, r"is no MAT file, or a damaged one"),
    "a MAT file of version 7.3 cut short": ("x.mat", cut(files.mat73, 0.6), RATE, r"is no MAT file, or a damaged one"),
    "text called MAT": ("x.mat", text("F a\n1 2\n"), RATE, r"is no MAT file, or a damaged one"),
    "a folder": ("x.mat", lambda path: path.mkdir(), RATE, r"is a folder, allowed is a regular file"),
    "a FIFO": ("x.csv", fifo, RATE, r"is a FIFO, allowed is a regular file"),
    "a MAT file without the variable": (
        "x.mat",
        mat(F=FORCE[:0]),
        RATE,
        r"channels\.force: has shape \(0.*two samples",
    ),
    "NaN in a signal": (
        "x.mat",
        mat(a=np.where(INSTANTS > 1.0, np.nan, 1.0)),
        RATE,
        r"channels\.acc: value at \[2049\] is nan",
    ),
    "complex numbers": ("x.mat", mat(a=ACCELERATION + 1j), RATE, r"channels\.acc: is complex; allowed: real numbers"),
    "text for a signal": ("x.mat", mat(a="loud"), RATE, r"channels\.acc: is no array of numbers"),
    "unequal lengths": (
        "x.mat",
        mat(a=ACCELERATION[:-1]),
        RATE,
        r"unequal lengths \(.*force 1 x 1 x 4000, acc 1 x 1 x 3999\)",
    ),
    "three dimensions": (
        "x.mat",
        mat(F=np.ones((8, 5, 2))),
        RATE,
        r"channels\.force: has shape \(8, 5, 2\), `axes` names 2",
    ),
    "no sample rate": ("x.mat", mat(), "", "`?sample_rate_hz`?: is missing; give it, or time"),
    "uneven instants": ("x.mat", mat(t=INSTANTS**2), 'time = "t"', r"time 't': is not evenly spaced"),
    "instants that contradict": (
        "x.mat",
        mat(t=INSTANTS),
        'time = "t"\nsample_rate_hz = 2000',
        r"disagrees \(.*2000 Hz, time 2048",
    ),
    "a period longer than the record": (
        "x.mat",
        mat(),
        f"{RATE}\nperiod_samples = 5000",
        r"record 1: has 4000 samples, needs",
    ),
    "a stretch beyond the end": (
        "x.mat",
        mat(),
        f"{RATE}\nstretches = [{{ samples = 4001 }}]",
        r"`?stretches\[0\]`?: ends at sample 4001",
    ),
    "levels that do not fit": (
        "x.mat",
        mat(),
        f"{RATE}\nlevels = [1.0, 2.0]",
        "`?levels`?: has 2 numbers, the data has 1",
    ),
    "structures nested without end": ("x.mat", nested, RATE, r"it is nested deeper than 32"),
    "a row too short": ("x.csv", text("F,a\n1,2\n3\n"), RATE, r"line 3: 1 values for 2 names"),
    "decimal commas": (
        "x.csv",
        text("F;a\n1,5;2,5\n1,5;2,5\n"),
        RATE,
        r"'1,5' is not a number; write decimals with a point",
    ),
    "a binary file called CSV": ("x.csv", noise, RATE, r"is not UTF-8 text"),
    "a universal file cut short": (
        "x.uff",
        cut(files.universal, 0.7),
        "",
        r"is cut short: the last dataset has no end",
    ),
    "an HDF5 file cut short": ("x.h5", cut(files.hdf5, 0.7), RATE, r"is no HDF5 file, or a damaged one"),
    "a link to another file": ("x.h5", linked, RATE, r"channels\.force: is no array of numbers"),
    "data in another file": ("x.h5", virtual, RATE, r"channels\.force: is no array of numbers"),
    "more than memory": ("x.h5", endless, RATE, r"x.h5: holds more than 67108864 bytes"),
    "a group in itself": ("x.h5", in_a_circle, RATE, r"channels\.force: is no array of numbers"),
    "a WAV file cut short": ("x.wav", cut(files.wav, 0.7), "", r"is no WAV file, or a damaged one"),
    "noise called WAV": ("x.wav", noise, "", r"is no WAV file, or a damaged one"),
    "a TDMS file cut within its head": ("x.tdms", cut(files.tdms, 0.002), "", r"is no TDMS file, or a damaged one"),
    "noise called TDMS": ("x.tdms", noise, "", r"is no TDMS file, or a damaged one"),
    "noise called MDF": ("x.mf4", noise, "", r"is no MDF 4 file, or a damaged one"),
    "MDF of version 3": ("x.mf4", old_mdf, "", r"it is of MDF version 3\.30, allowed is 4"),
    "MDF without a rate": ("x.mf4", uneven, "", r"`channels\.force`: 'F' is not evenly sampled; resample it"),
    "MDF at two rates": (
        "x.mf4",
        at_two_rates,
        "",
        r"`?sample_rate_hz`?: disagrees \(file \(F\) 2048 Hz, file \(a\) 1024 Hz\)",
    ),
    "no JSON": ("x.json", text("[{"), "", r"is not JSON"),
    "no list of series": ("x.json", text('{"a": 1}'), "", r"is not a list of SEP005 time series"),
    "a series without data": ("x.json", text(json.dumps([{"name": "F", "unit_str": "N"}])), "", r"series\[0\]\.data"),
    "another ending": ("x.dat", noise, "", r"the ending says no format; give `format`, one of mat, uff, csv, hdf5"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_broken_is_refused_in_one_line(tmp_path, what):
    name, write, more, message = BROKEN[what]
    write(tmp_path / name)
    channels = '[{ name = "force", role = "force", unit = "N", value = "F" }, '
    channels += '{ name = "acc", role = "drive", unit = "m/s2", value = "a" }]'
    (tmp_path / "m.toml").write_text(f'kind = "time-data"\n{more}\nchannels = {channels}\n')
    with pytest.raises(RigError, match=message) as caught:
        import_file(tmp_path / name, mapping=tmp_path / "m.toml")
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('unit = "N"', 'unit = "stone"'), {"says": "unit-stone-of-channel-force-allowed", "field": "channels[0]"}),
        (('role = "drive"', 'role = "shaker"'), {"field": "channels[1].role", "value": "shaker"}),
        (
            ('kind = "time-data"', 'kind = "time-data"\naxes = ["period"]'),
            {"says": "sample-must-be-among-them", "field": "axes", "value": ["period"]},
        ),
        (
            ('kind = "time-data"', 'kind = "time-data"\ntransient_periods = 1'),
            {"says": "for-periodic-data", "field": "transient_periods"},
        ),
        (('kind = "time-data"', 'kind = "time-data"\nlowest_hz = 1.0'), {"says": "lowest-hz-and-highest-hz-give"}),
        (
            ('kind = "time-data"', 'kind = "time-data"\ninstrument = "u"'),
            {"field": "instrument", "value": "u", "allowed": "force, acc"},
        ),
        (
            ('kind = "time-data"', 'kind = "time-data"\nstretches = [{ repeat = 3 }]'),
            {"says": "repeat", "field": "stretches[0].repeat", "allowed": "samples or duration_s"},
        ),
        (('name = "acc"', 'name = "force"'), {"says": "force-is-the-name-of-two", "field": "channels"}),
        (
            ('unit = "N"', 'unit = "N"\nscale = 0.0'),
            {"says": "scale-of-channel-force-allowed-is", "field": "channels[0]"},
        ),
        (('unit = "N"', 'unit = "mm"'), {"says": "force-is-given-in-or", "field": "unit", "value": "m"}),
    ],
)
def test_a_mapping_that_cannot_be_meant_is_named(tmp_path, change, message):
    mat()(tmp_path / "x.mat")
    told = f"""kind = "time-data"
{RATE}
[[channels]]
name = "force"
role = "force"
unit = "N"
value = "F"
[[channels]]
name = "acc"
role = "drive"
unit = "m/s2"
value = "a"
"""
    assert change[0] in told
    (tmp_path / "m.toml").write_text(told.replace(*change, 1))
    with refused(RigError, **message):
        import_file(tmp_path / "x.mat", mapping=tmp_path / "m.toml")
