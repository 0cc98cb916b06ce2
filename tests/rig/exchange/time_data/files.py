"""Files of time data, made by the programs of others: a force in newtons and an acceleration, white noise through a filter."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import hdf5storage
import numpy as np
import openpyxl
import pandas as pd
import pyuff
import scipy.io
import soundfile
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # mat-io sets an option that pandas calls deprecated
    from matio import save_to_mat

RATE_HZ = 2048.0
N = 4000
GRAVITY = 9.80665  # m/s2, standard
INSTANTS = np.arange(N) / RATE_HZ
FORCE = np.random.default_rng(7).normal(0.0, 3.0, N)
ACCELERATION = scipy.signal.lfilter([1.0], [1.0, -1.8, 0.9], FORCE)  # m/s2
FULL_SCALE = 200.0


def mat4(path: Path) -> None:
    scipy.io.savemat(path, {"F": FORCE, "a": ACCELERATION / GRAVITY, "fs": RATE_HZ}, format="4")


def mat5(path: Path) -> None:
    scipy.io.savemat(path, {"test": {"F": FORCE, "a": ACCELERATION / GRAVITY}, "t": INSTANTS}, do_compression=True)


def mat73(path: Path) -> None:
    test = {"F": FORCE, "a": np.c_[ACCELERATION / GRAVITY, ACCELERATION], "name": "beam"}
    hdf5storage.savemat(str(path), {"test": test, "dt": 1.0 / RATE_HZ}, format="7.3")


def csv(path: Path) -> None:
    columns = np.c_[INSTANTS, FORCE, ACCELERATION / GRAVITY]
    np.savetxt(path, columns, fmt="%.17g", delimiter=";", header="time;F;a\ns;N;g", comments="")


def comma(path: Path) -> None:
    rows = "\n".join(f"{f:.15g}\t{a:.15g}".replace(".", ",") for f, a in zip(FORCE, ACCELERATION, strict=True))
    path.write_text(f"Recorder 1.2\nStarted on a Monday\n{rows}\n")


def universal(path: Path) -> None:
    file = pyuff.UFF(str(path))
    for node, (values, kind, unit) in enumerate(((FORCE, 13, "N"), (ACCELERATION / GRAVITY, 12, "g")), 1):
        axes = {"abscissa": (17, "s"), "ordinate": (kind, unit), "orddenom": (0, "NONE"), "z_axis": (0, "NONE")}
        about: dict[str, Any] = {
            **{"type": 58, "func_type": 1, "func_id": 0, "binary": 0, "data": values, "x": INSTANTS, "num_pts": N},
            **{
                "rsp_node": node,
                "rsp_dir": 3,
                "ref_node": 1,
                "ref_dir": 3,
                "rsp_ent_name": "NONE",
                "ref_ent_name": "NONE",
            },
            **{"abscissa_spacing": 1, "abscissa_min": 0.0, "abscissa_inc": 1.0 / RATE_HZ, "z_axis_value": 0.0},
            **{f"id{number}": "measured" for number in range(1, 6)},
            **{"ver_num": 0, "load_case_id": 0},
        }
        for axis, (code, label) in axes.items():
            about |= {f"{axis}_spec_data_type": code, f"{axis}_axis_units_lab": label, f"{axis}_axis_lab": "NONE"}
            about |= {f"{axis}_{of}_unit_exp": 0 for of in ("len", "force", "temp")}
        file.write_sets([about], mode="overwrite" if node == 1 else "add")


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("run 1/daq")
        group.attrs["fs"] = RATE_HZ
        group.create_dataset("Force [N]", data=FORCE[None], compression="gzip")
        group.create_dataset("acc.drive", data=ACCELERATION / GRAVITY).attrs["units"] = "g"


def wav(path: Path) -> None:
    soundfile.write(path, np.c_[FORCE, ACCELERATION] / FULL_SCALE, int(RATE_HZ), subtype="PCM_24")


def tdms(path: Path) -> None:
    told = {"wf_increment": 1.0 / RATE_HZ}
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("Daq", "Force", FORCE, properties={**told, "unit_string": "N"}),
                ChannelObject("Daq", "Acc.1", ACCELERATION / GRAVITY, properties={**told, "unit_string": "g"}),
            ]
        )


def mdf4(path: Path) -> None:
    with MDF(version="4.10") as file:
        file.append([Signal(FORCE, INSTANTS, name="Force", unit="N")])
        file.append([Signal(ACCELERATION / GRAVITY, INSTANTS, name="Acc", unit="g")])
        file.save(path, overwrite=True)


def series() -> list[dict[str, Any]]:
    return [
        {"data": FORCE, "name": "F", "unit_str": "N", "fs": RATE_HZ},
        {"data": ACCELERATION / GRAVITY, "name": "a", "unit_str": "g", "time": INSTANTS},
    ]


def sep005(path: Path) -> None:
    plain = [{key: v.tolist() if isinstance(v, np.ndarray) else v for key, v in one.items()} for one in series()]
    path.write_text(json.dumps(plain))


def lvm(path: Path) -> None:
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
    head += "X_Columns\tOne\n***End_of_Header***\t\n\t\n"
    about = {"Channels": ["2", ""], "Samples": [N, N], "Y_Unit_Label": ["N", "g"], "X0": ["0,0E+0"] * 2}
    about["Delta_X"] = [f"{1.0 / RATE_HZ:.17g}".replace(".", ",")] * 2
    lines = ["\t".join([key, *map(str, values), ""]) for key, values in about.items()]
    lines += ["***End_of_Header***\t\t\t", "X_Value\tForce\tAcc\tComment"]
    columns = zip(INSTANTS, FORCE, ACCELERATION / GRAVITY, strict=True)
    lines += [f"{t:.6f}\t{f:.17g}\t{a:.17g}".replace(".", ",") for t, f, a in columns]
    path.write_text(head + "\n".join(lines) + "\n", newline="\r\n", encoding="utf-8")


def npz(path: Path) -> None:
    np.savez_compressed(path, F=FORCE, a=ACCELERATION / GRAVITY, F_unit="N", a_unit="g", fs=RATE_HZ)


def xlsx(path: Path) -> None:
    book = openpyxl.Workbook()
    for row in (["Recorder 1.2"], ["time", "F", "a"], ["s", "N", "g"]):
        book.active.append(row)
    for row in np.c_[INSTANTS, FORCE, ACCELERATION / GRAVITY].tolist():
        book.active.append(row)
    book.save(path)


def rattlesnake(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time_data"] = np.stack([FORCE, ACCELERATION / GRAVITY])
        file.attrs["sample_rate"] = int(RATE_HZ)
        for name, texts in {"unit": ["N", "g"], "node_number": ["7", "7"], "node_direction": ["Z+", "Z+"]}.items():
            file.create_dataset(f"channels/{name}", data=texts, dtype=h5py.string_dtype())


def classic(path: Path) -> None:
    with scipy.io.netcdf_file(path, "w") as file:
        file.createDimension("sample", N)
        file.sample_rate = RATE_HZ
        for name, values, unit in (("F", FORCE, "N"), ("a", ACCELERATION / GRAVITY, "g")):
            variable = file.createVariable(name, "f8", ("sample",))
            variable[:], variable.units = values, unit


def timetable(path: Path) -> None:
    index = pd.to_timedelta(np.round(INSTANTS * 1e9).astype(np.int64), unit="ns")
    table = pd.DataFrame({"F": FORCE, "a": ACCELERATION / GRAVITY}, index=index.rename("Time"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it writes in seconds what is in nanoseconds, and says so
        save_to_mat(str(path), {"data": table, "fs": RATE_HZ}, version="v7")


FILES: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "v4.mat": (mat4, "F", "a"),
    "v5.mat": (mat5, "test.F", "test.a"),
    "v73.mat": (mat73, "test.F", "test.a"),
    "table.csv": (csv, "F", "a"),
    "comma.txt": (comma, "column1", "column2"),
    "universal.uff": (universal, "1+Z", "2+Z"),
    "lab.h5": (hdf5, "run 1/daq/Force [N]", "run 1/daq/acc.drive"),
    "sound.wav": (wav, "channel1", "channel2"),
    "labview.tdms": (tdms, "Daq/Force", "Daq/Acc.1"),
    "car.mf4": (mdf4, "Force", "Acc"),
    "series.json": (sep005, "F", "a"),
    "labview.lvm": (lvm, "Force", "Acc"),
    "archive.npz": (npz, "F", "a"),
    "book.xlsx": (xlsx, "F", "a"),
    "rattlesnake.nc4": (rattlesnake, "time_data[0]", "time_data[1]"),
    "classic.nc": (classic, "F", "a"),
    "timetable.mat": (timetable, "data.F", "data.a"),
}
"""By name: who writes the file, and the paths of force and acceleration in it."""
