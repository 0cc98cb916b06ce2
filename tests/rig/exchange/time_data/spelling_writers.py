"""Writers of the same record where units, unit of time and rate stand in other places: names, lists, groups, properties."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
import scipy.io.wavfile
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from tests.rig.exchange.time_data.convention_writers import (
    TIMES,
    VALUES,
    Case,
    N,
    Writer,
    csv_units,
    hdf5_starts,
    lvm_units,
    mdf_units,
    sep005_units,
    xlsx_units,
)

IN_MATRIX = {"paths": ("x/data", "x/data"), "matrix": True}
STEM = {"s": "time", "ms": "time.ms", "us": "t_us", "min": "time_min", "milliseconds": "TIME_MS"}
"""A name of instants in each unit."""


def _named_instants(of: Case) -> tuple[str, Any]:
    return STEM[of["time"]], np.arange(N) / of["rate"] / TIMES[of["time"]]


def csv_named_instants(path: Path, of: Case) -> Case:
    name, t = _named_instants(of)
    np.savetxt(path, np.c_[t, *VALUES], fmt="%.15g", delimiter=",", header=f"{name},F,a", comments="")
    return {**of, "force": "N", "motion": "m/s2", "paths": ("F", "a"), "more": f'time = "{name}"'}


def hdf5_named_instants(path: Path, of: Case) -> Case:
    name, t = _named_instants(of)
    with h5py.File(path, "w") as file:
        file["F"], file["a"], file[name] = *VALUES, t
    return {**of, "force": "N", "motion": "m/s2", "paths": ("F", "a"), "more": f'time = "{name}"'}


def mat_named_instants(path: Path, of: Case) -> Case:
    name, t = _named_instants(of)
    above, _, last = name.rpartition(".")
    scipy.io.savemat(path, {"F": VALUES[0], "a": VALUES[1], **({above: {last: t}} if above else {last: t})})
    return {**of, "force": "N", "motion": "m/s2", "paths": ("F", "a"), "more": f'time = "{name}"'}


def npz_named_instants(path: Path, of: Case) -> Case:
    name, t = _named_instants(of)
    np.savez(path, F=VALUES[0], a=VALUES[1], **{name: t})
    return {**of, "force": "N", "motion": "m/s2", "paths": ("F", "a"), "more": f'time = "{name}"'}


def hdf5_group_unit(path: Path, of: Case) -> Case:
    with h5py.File(path, "w") as file:
        file["x/F"], file["y/a"] = VALUES
        file["x"].attrs["units"], file["y"].attrs["Unit"] = of["force"], of["motion"]
    return {**of, "paths": ("x/F", "y/a")}


def hdf5_pytables(path: Path, of: Case) -> Case:
    """As PyTables writes a table whose columns have units."""
    table = np.zeros(N, dtype=[("F", "f8"), ("a", "f8")])
    table["F"], table["a"] = VALUES
    with h5py.File(path, "w") as file:
        file["run/table"] = table
        about = {"FIELD_0_NAME": "F", "FIELD_0_UNITS": of["force"], "FIELD_1_NAME": "a", "FIELD_1_UNITS": of["motion"]}
        file["run/table"].attrs.update(about)
    return {**of, "paths": ("run/table/F", "run/table/a")}


def hdf5_matrix_units(path: Path, of: Case) -> Case:
    with h5py.File(path, "w") as file:
        file["x/data"] = VALUES.T
        file["x/data"].attrs["units"] = f"{of['force']}, {of['motion']}"
    return {**of, **IN_MATRIX}


def hdf5_list_beside(path: Path, of: Case) -> Case:
    with h5py.File(path, "w") as file:
        file["x/data"] = VALUES.T
        file.create_dataset("x/units", data=[of["force"], of["motion"]], dtype=h5py.string_dtype())
    return {**of, **IN_MATRIX}


def mat_cell_of_units(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, {"x": {"data": VALUES.T, "units": np.array([of["force"], of["motion"]], dtype=object)}})
    return {**of, **IN_MATRIX, "paths": ("x.data", "x.data")}


def mat_list_of_records(path: Path, of: Case) -> Case:
    """A list of structures, each with the units of its signals."""
    records = np.zeros(1, dtype=[(key, object) for key in ("F", "a", "F_unit", "a_unit")])
    records[0] = (*VALUES, of["force"], of["motion"])
    scipy.io.savemat(path, {"runs": {"list": np.concatenate([records, records])}})
    return {**of, "paths": ("F", "a"), "more": 'records = "runs.list"'}


def npz_list_of_units(path: Path, of: Case) -> Case:
    np.savez(path, data=VALUES.T, units=np.array([of["force"], of["motion"]]))
    return {**of, **IN_MATRIX, "paths": ("data", "data")}


def _tdms(path: Path, of: Case, channel: dict[str, Any], group: dict[str, Any], root: dict[str, Any]) -> Case:
    units = ({"unit_string": of["force"]}, {"unit_string": of["motion"]})
    channels = [
        ChannelObject("d", name, values, {**unit, **channel})
        for name, values, unit in zip("Fa", VALUES, units, strict=True)
    ]
    with TdmsWriter(path) as writer:
        writer.write_segment([RootObject(root), GroupObject("d", group), *channels])
    return {**of, "paths": ("d/F", "d/a")}


def tdms_step_of_group(path: Path, of: Case) -> Case:
    return _tdms(path, of, {}, {"wf_increment": 1.0 / of["rate"]}, {})


def tdms_rate_of_channel(path: Path, of: Case) -> Case:
    return _tdms(path, of, {"SampleRate": of["rate"]}, {}, {})


def tdms_rate_of_file(path: Path, of: Case) -> Case:
    return _tdms(path, of, {}, {}, {"Sampling Frequency (kHz)": of["rate"] / 1e3})


def tdms_two_rates(path: Path, of: Case) -> Case:
    return _tdms(path, of, {"wf_increment": 1.0 / of["rate"]}, {"SampleRate": of["rate"] / 2.0}, {})


def tdms_sensitivity(path: Path, of: Case) -> Case:
    return _tdms(path, of, {"wf_increment": 1.0 / of["rate"], "Sensitivity": 0.01}, {}, {})


def _two_clocks(path: Path, of: Case, late_s: float) -> Case:
    """A table in which each signal has instants of its own."""
    t = np.arange(N) / of["rate"]
    columns = np.c_[t, VALUES[0], t + late_s, VALUES[1]]
    np.savetxt(path, columns, fmt="%.15g", delimiter=",", header="t1,F,t2,a", comments="")
    return {**of, "force": "N", "motion": "m/s2", "paths": ("F", "a"), "more": 'time = "t1"'}


def csv_starts(path: Path, of: Case) -> Case:
    return _two_clocks(path, of, of["late"] / of["rate"])


def csv_starts_between_samples(path: Path, of: Case) -> Case:
    return _two_clocks(path, {**of, "rate": 2048.0}, 0.1)


def wav_full_scale(path: Path, of: Case) -> Case:
    """Without units: a mapping gives them, here with a factor of 1."""
    scipy.io.wavfile.write(path, int(of["rate"]), VALUES.T)
    return {**of, "force": "N", "motion": "m/s2", "paths": ("channel1", "channel2")}


def _beside(of: Case, **rate: float) -> dict[str, Any]:
    return {"F": VALUES[0], "a": VALUES[1], "t": np.arange(N) / of["rate"], **rate}


def _instants_at(of: Case) -> Case:
    return {**of, "force": "N", "motion": "m/s2", "paths": ("F", "a"), "more": 'time = "t"'}


def mat_rate_beside(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, _beside(of, fs=of["rate"]))
    return _instants_at(of)


def npz_step_beside(path: Path, of: Case) -> Case:
    np.savez(path, **_beside(of, dt=1.0 / of["rate"]))
    return _instants_at(of)


def mat_other_rate_beside(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, _beside(of, fs=of["rate"] / 2.0))
    return _instants_at(of)


def npz_other_rate_beside(path: Path, of: Case) -> Case:
    np.savez(path, **_beside(of, dt=2.0 / of["rate"]))
    return _instants_at(of)


def hdf5_other_rate_beside(path: Path, of: Case) -> Case:
    with h5py.File(path, "w") as file:
        for name, value in _beside(of).items():
            file[name] = value
        file.attrs["Sample Rate"] = of["rate"] / 2.0
    return _instants_at(of)


def mat_gain_beside(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, {**_beside(of), "F_gain": 10.0})
    return _instants_at(of)


def npz_sensitivity_beside(path: Path, of: Case) -> Case:
    np.savez(path, **_beside(of), F_sensitivity=0.01)
    return _instants_at(of)


USED_AS_WELL: dict[tuple[str, str], tuple[Writer, ...]] = {
    ("CSV", "unit of time"): (csv_named_instants,), ("HDF5", "unit of time"): (hdf5_named_instants,),
    ("MAT", "unit of time"): (mat_named_instants,), ("NumPy", "unit of time"): (npz_named_instants,),
    ("HDF5", "units"): (hdf5_group_unit, hdf5_pytables, hdf5_matrix_units, hdf5_list_beside),
    ("MAT", "units"): (mat_cell_of_units, mat_list_of_records), ("NumPy", "units"): (npz_list_of_units,),
    ("TDMS", "rate"): (tdms_step_of_group, tdms_rate_of_channel, tdms_rate_of_file), ("CSV", "start time"): (csv_starts,),
    ("WAV", "rate"): (wav_full_scale,), ("WAV", "scale, offset"): (wav_full_scale,), ("HDF5", "rate"): (hdf5_starts,),
    ("CSV", "rate"): (csv_units,), ("workbook", "rate"): (xlsx_units,), ("MDF 4", "rate"): (mdf_units,),
    ("LabVIEW", "rate"): (lvm_units,), ("SEP005", "rate"): (sep005_units,),
    ("MAT", "rate"): (mat_rate_beside,), ("NumPy", "rate"): (npz_step_beside,),
}  # fmt: skip
OTHER_RATE = "in the file says 1024 Hz"
REFUSED_AS_WELL: dict[tuple[str, str], tuple[tuple[Writer, str], ...]] = {
    ("TDMS", "rate"): ((tdms_two_rates, "has several rates (wf_increment 2048 Hz, SampleRate 1024 Hz)"),),
    ("TDMS", "scale, offset"): ((tdms_sensitivity, "has the property Sensitivity (0.01)"),),
    ("CSV", "start time"): ((csv_starts_between_samples, "begins 204.80 samples before another"),),
    ("MAT", "rate"): ((mat_other_rate_beside, f"'fs' {OTHER_RATE}"),),
    ("NumPy", "rate"): ((npz_other_rate_beside, f"'dt' {OTHER_RATE}"),),
    ("HDF5", "rate"): ((hdf5_other_rate_beside, f"'@Sample Rate' {OTHER_RATE}"),),
    ("MAT", "scale, offset"): ((mat_gain_beside, "has beside it gain (10)"),),
    ("NumPy", "scale, offset"): ((npz_sensitivity_beside, "has beside it sensitivity (0.01)"),),
}
