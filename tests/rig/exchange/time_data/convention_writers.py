"""Writers of the same record with each convention of each format; by independent packages or by hand."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import scipy.io
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter

N = 64
VALUES = np.round(np.random.default_rng(3).normal(0.0, 1.0, (2, N)), 6)
GRAVITY, POUND, INCH = 9.80665, 4.4482216152605, 0.0254  # m/s2, N, m
UNEVEN = np.arange(N) ** 1.3 / 2048.0
WITH_NAN = np.where(np.arange(N) == 5, np.nan, VALUES[0])
UNITS = {"N": 1.0, "kN": 1e3, "lbf": POUND, "Newtons": 1.0, "mN": 1e-3}
MOTIONS = {"g": GRAVITY, "m/s²": 1.0, "m/s/s": 1.0, "mm/s^2": 1e-3, "in/s2": INCH, "ms-2": 1.0}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "milliseconds": 1e-3}
RATES = (128.0, 2048.0, 5000.0, 25600.0, 51200.0)

Case = Mapping[str, Any]
case = st.fixed_dictionaries(
    {
        "force": st.sampled_from(sorted(UNITS)),
        "motion": st.sampled_from(sorted(MOTIONS)),
        "time": st.sampled_from(sorted(TIMES)),
        "rate": st.sampled_from(RATES),
        "scale": st.sampled_from((1e-3, 0.25, -2.0, 3.0)),
        "offset": st.sampled_from((0.0, -1.5, 20.0)),
        "late": st.integers(0, 9),
    }
)


def _instants(of: Case, begin: float = 0.0) -> Any:
    return begin / TIMES[of["time"]] + np.arange(N) / of["rate"] / TIMES[of["time"]]


def _plain(of: Case) -> Case:
    """Return a case in which the mapping says what the file does not."""
    return {**of, "force": "N", "motion": "m/s2"}


def csv_units(path: Path, of: Case) -> Case:
    rows = np.c_[_instants(of), *VALUES]
    head = f"Time,F,a\n{of['time']},{of['force']},{of['motion']}"
    np.savetxt(path, rows, fmt="%.15g", delimiter=",", header=head, comments="", encoding="utf-8")
    return {**of, "paths": ("F", "a"), "more": 'time = "Time"'}


def csv_brackets(path: Path, of: Case) -> Case:
    names = [f"Time [{of['time']}]", f"F [{of['force']}]", f"a [{of['motion']}]"]
    np.savetxt(
        path,
        np.c_[_instants(of), *VALUES],
        fmt="%.15g",
        delimiter=";",
        header=";".join(names),
        comments="",
        encoding="utf-8",
    )
    return {**of, "paths": tuple(names[1:]), "more": f"time = {json.dumps(names[0])}"}


def csv_rounded(path: Path, of: Case) -> Case:
    np.savetxt(
        path,
        np.c_[np.arange(N) / of["rate"], *VALUES],
        fmt=["%.6f", "%.9g", "%.9g"],
        delimiter=",",
        header="t,F,a",
        comments="",
    )
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def mat_units(path: Path, of: Case) -> Case:
    units = {"F": of["force"], "a": of["motion"], "t": of["time"]}
    scipy.io.savemat(path, {"F": VALUES[0], "a": VALUES[1], "t": _instants(of), "units": units})
    return {**of, "paths": ("F", "a"), "more": 'time = "t"'}


def mat_single(path: Path, of: Case) -> Case:
    t = (100.0 + np.arange(N) / of["rate"]).astype(np.float32)
    scipy.io.savemat(path, {"F": VALUES[0], "a": VALUES[1], "t": t})
    coarse = float(np.spacing(np.float32(100.0))) > 1.0 / of["rate"] / 2.0
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"', "coarse": coarse}


def _hdf5(path: Path, of: Case, force: Any, **attributes: Any) -> Case:
    with h5py.File(path, "w") as file:
        file["x/F"], file["x/a"], file["x/t"] = force, VALUES[1], _instants(of)
        for name, unit in (("F", of["force"]), ("a", of["motion"]), ("t", of["time"])):
            file[f"x/{name}"].attrs["units"] = unit
        for key, value in attributes.items():
            file["x/F"].attrs[key] = value
    return {**of, "paths": ("x/F", "x/a"), "more": 'time = "x/t"'}


def hdf5_units(path: Path, of: Case) -> Case:
    return _hdf5(path, of, VALUES[0])


def hdf5_scaled(path: Path, of: Case) -> Case:
    stored = (VALUES[0] - of["offset"]) / of["scale"]
    return _hdf5(path, of, stored, scale_factor=of["scale"], add_offset=of["offset"])


def hdf5_by_dots(path: Path, of: Case) -> Case:
    return {**hdf5_scaled(path, of), "paths": ("x.F", "x.a")}


def hdf5_gain(path: Path, of: Case) -> Case:
    return _hdf5(path, of, VALUES[0], gain=1000.0)


def _hdf5_begun(path: Path, of: Case, late_s: float) -> Case:
    """Without instants; the force begins at noon."""
    with h5py.File(path, "w") as file:
        for name, values, unit, begin in (("F", VALUES[0], of["force"], 0.0), ("a", VALUES[1], of["motion"], late_s)):
            file[f"x/{name}"] = values
            about = {"units": unit, "sample_rate": of["rate"], "start_time": f"2026-03-01T12:00:{begin:09.6f}+00:00"}
            file[f"x/{name}"].attrs.update(about)
    return {**of, "paths": ("x/F", "x/a")}


def hdf5_starts(path: Path, of: Case) -> Case:
    of = {**of, "rate": 5000.0}
    return _hdf5_begun(path, of, of["late"] / 5000.0)


def hdf5_starts_between_samples(path: Path, of: Case) -> Case:
    return _hdf5_begun(path, of, 0.1)


def hdf5_missing(path: Path, of: Case) -> Case:
    return _hdf5(path, of, np.where(np.arange(N) == 5, -999.0, VALUES[0]), _FillValue=-999.0)


def hdf5_valid_range(path: Path, of: Case) -> Case:
    return _hdf5(path, of, VALUES[0], valid_range=np.array([-0.1, 0.1]))


def hdf5_unsigned(path: Path, of: Case) -> Case:
    return _hdf5(path, of, np.arange(N, dtype=np.int16), _Unsigned="true")


def _tdms(path: Path, of: Case, force: Any, *, start: bool = False, **properties: Any) -> Case:
    begin = np.datetime64("2026-03-01T12:00:00.000000")
    told: dict[str, Any] = {"wf_increment": 1.0 / of["rate"] / TIMES[of["time"]], "wf_xunit_string": of["time"]}
    late = of["late"] if start else 0
    of_force = {**told, "unit_string": of["force"], **properties}
    of_motion = {**told, "unit_string": of["motion"]}
    if start:
        of_force["wf_start_time"] = begin
        of_motion["wf_start_time"] = begin + np.timedelta64(round(1e6 * late / of["rate"]), "us")
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("d", "F", force, of_force), ChannelObject("d", "a", VALUES[1], of_motion)])
    return {**of, "paths": ("d/F", "d/a"), "late": late}


def tdms_units(path: Path, of: Case) -> Case:
    return _tdms(path, of, VALUES[0])


def tdms_starts(path: Path, of: Case) -> Case:
    return _tdms(path, {**of, "rate": 5000.0}, VALUES[0], start=True)


def tdms_starts_between_samples(path: Path, of: Case) -> Case:
    return _tdms(path, {**of, "rate": 2048.0, "late": 204.8}, VALUES[0], start=True)


def _scaled(kind: str, of: Case) -> dict[str, Any]:
    about = {f"Linear_{key}": value for key, value in (("Slope", of["scale"]), ("Y_Intercept", of["offset"]))}
    about = {"Scale_Type": kind, **about, "Linear_Input_Source": 0xFFFFFFFF}
    return {"NI_Number_Of_Scales": 1} | {f"NI_Scale[0]_{key}": value for key, value in about.items()}


def tdms_scaled(path: Path, of: Case) -> Case:
    return _tdms(path, of, (VALUES[0] - of["offset"]) / of["scale"], **_scaled("Linear", of))


def tdms_unknown_scale(path: Path, of: Case) -> Case:
    return _tdms(path, of, VALUES[0], **_scaled("Fantasy", of))


def _mdf(path: Path, of: Case, force: Any, *, late: int = 0, t: Any = None, **more: Any) -> Case:
    instants = np.arange(N) / of["rate"]
    with MDF(version="4.10") as file:
        file.append([Signal(force, instants if t is None else t, name="F", unit=of["force"], **more)])
        file.append([Signal(VALUES[1], instants + late / of["rate"], name="a", unit=of["motion"])])
        file.save(path, overwrite=True)
    return {**of, "paths": ("F", "a"), "late": late}


def mdf_units(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0])


def mdf_starts(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0], late=of["late"])


def mdf_scaled(path: Path, of: Case) -> Case:
    conversion = from_dict({"a": of["scale"], "b": of["offset"]})
    return _mdf(path, of, (VALUES[0] - of["offset"]) / of["scale"], conversion=conversion)


def mdf_formula(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0], conversion=from_dict({"formula": "X1 * 2"}))


def mdf_uneven(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0], t=np.arange(N) ** 1.3 / of["rate"])


def mdf_invalid(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0], invalidation_bits=np.arange(N) == 3)


def _sep005(path: Path, of: Case, **more: Any) -> Case:
    told = ({"name": "F", "unit_str": of["force"]}, {"name": "a", "unit_str": of["motion"], **more})
    series = [{**one, "data": v.tolist(), "fs": of["rate"]} for one, v in zip(told, VALUES, strict=True)]
    if more:
        series[0]["start_timestamp"] = "2026-03-01T12:00:00+00:00"
    path.write_text(json.dumps(series))
    return {**of, "paths": ("F", "a"), "in_si": True}


def sep005_units(path: Path, of: Case) -> Case:
    return {**_sep005(path, of), "late": 0}


def sep005_starts(path: Path, of: Case) -> Case:
    of = {**of, "rate": 5000.0}
    return _sep005(path, of, start_timestamp=f"2026-03-01T12:00:00.{round(1e6 * of['late'] / 5000.0):06d}+00:00")


def sep005_starts_between_samples(path: Path, of: Case) -> Case:
    return _sep005(path, of, start_timestamp="2026-03-01T12:00:00.100000+00:00")


def _sep005_over_time(path: Path, of: Case, instants: Any) -> Case:
    units = {"F": of["force"], "a": of["motion"]}
    series = [
        {"name": name, "unit_str": unit, "data": v.tolist(), "time": instants.tolist()}
        for (name, unit), v in zip(units.items(), VALUES, strict=True)
    ]
    path.write_text(json.dumps(series))
    return {**of, "paths": ("F", "a"), "in_si": True}


def sep005_rounded(path: Path, of: Case) -> Case:
    return _sep005_over_time(path, of, np.round(np.arange(N) / of["rate"], 6))


def sep005_uneven(path: Path, of: Case) -> Case:
    return _sep005_over_time(path, of, UNEVEN)


def mdf_starts_between_samples(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0], late=0.4)


def mdf_rounded(path: Path, of: Case) -> Case:
    return _mdf(path, of, VALUES[0], t=np.round(np.arange(N) / of["rate"], 6))


def hdf5_single(path: Path, of: Case) -> Case:
    return _retimed(hdf5_units, path, {**of, "time": "s"}, (np.arange(N) / of["rate"]).astype(np.float32))


def hdf5_uneven(path: Path, of: Case) -> Case:
    return _retimed(hdf5_units, path, of, UNEVEN)


def _retimed(write: "Writer", path: Path, of: Case, instants: Any) -> Case:
    told = write(path, of)
    with h5py.File(path, "a") as file:
        unit = file["x/t"].attrs["units"]
        del file["x/t"]
        file["x/t"] = instants
        file["x/t"].attrs["units"] = unit
    return told


def mat_uneven(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, {"F": VALUES[0], "a": VALUES[1], "t": UNEVEN})
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def mat_not_a_number(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, {"F": WITH_NAN, "a": VALUES[1], "t": _instants(of), "units": {"t": of["time"]}})
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def mat_instant_not_a_number(path: Path, of: Case) -> Case:
    scipy.io.savemat(path, {"F": VALUES[0], "a": VALUES[1], "t": np.where(np.arange(N) == 5, np.nan, UNEVEN)})
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def csv_uneven(path: Path, of: Case) -> Case:
    np.savetxt(path, np.c_[UNEVEN, VALUES.T], delimiter=",", header="t,F,a", comments="")
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def csv_not_a_number(path: Path, of: Case) -> Case:
    np.savetxt(path, np.c_[np.arange(N) / 100.0, WITH_NAN, VALUES[1]], delimiter=",", header="t,F,a", comments="")
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def tdms_not_a_number(path: Path, of: Case) -> Case:
    return _tdms(path, of, WITH_NAN)


def sep005_not_a_number(path: Path, of: Case) -> Case:
    told = _sep005(path, of)
    path.write_text(path.read_text().replace(str(VALUES[0][5]), "NaN", 1))
    return told


def npz_units(path: Path, of: Case) -> Case:
    np.savez(
        path, F=VALUES[0], F_unit=of["force"], a=VALUES[1], a_units=of["motion"], t=_instants(of), t_unit=of["time"]
    )
    return {**of, "paths": ("F", "a"), "more": 'time = "t"'}


def npz_single(path: Path, of: Case) -> Case:
    np.savez(path, F=VALUES[0], a=VALUES[1], t=(np.arange(N) / of["rate"]).astype(np.float32))
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def npz_uneven(path: Path, of: Case) -> Case:
    np.savez(path, F=VALUES[0], a=VALUES[1], t=UNEVEN)
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def npz_not_a_number(path: Path, of: Case) -> Case:
    np.savez(path, F=WITH_NAN, a=VALUES[1], t=np.arange(N) / 100.0)
    return {**_plain(of), "paths": ("F", "a"), "more": 'time = "t"'}


def _workbook(path: Path, of: Case, instants: Any, values: Any, units: bool = True) -> Case:
    book = openpyxl.Workbook()
    rows = [["Time", "F", "a"], *([[of["time"], of["force"], of["motion"]]] if units else [])]
    for row in [*rows, *np.c_[instants, *values].tolist()]:
        book.active.append(row)
    book.save(path)
    return {**(of if units else _plain(of)), "paths": ("F", "a"), "more": 'time = "Time"'}


def xlsx_units(path: Path, of: Case) -> Case:
    return _workbook(path, of, _instants(of), VALUES)


def xlsx_rounded(path: Path, of: Case) -> Case:
    return _workbook(path, of, np.round(np.arange(N) / of["rate"], 6), VALUES, units=False)


def xlsx_uneven(path: Path, of: Case) -> Case:
    return _workbook(path, of, UNEVEN, VALUES, units=False)


def xlsx_text(path: Path, of: Case) -> Case:
    told = xlsx_units(path, of)
    book = openpyxl.load_workbook(path)
    book.active["B8"] = "OVER"
    book.save(path)
    return told


def _lvm(path: Path, of: Case, begins: float = 0.0, instants: Any = None) -> Case:
    """By hand, from the specification of the format."""
    step = 1.0 / of["rate"]
    about = {"Samples": [str(N)] * 2, "Date": ["2026/02/03"] * 2, "Time": ["10:00:00.0", f"10:00:{begins:.13f}"]}
    about |= {"Y_Unit_Label": [of["force"], of["motion"]], "X_Dimension": ["Time"] * 2}
    about |= {"X0": ["0.0"] * 2, "Delta_X": [repr(step)] * 2}
    lines = ["LabVIEW Measurement\t", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tOne", "Time_Pref\tAbsolute"]
    lines += ["***End_of_Header***\t", "\t", "Channels\t2\t\t"]
    lines += ["\t".join([key, *two, ""]) for key, two in about.items()]
    lines += ["***End_of_Header***\t\t\t", "X_Value\tF\ta\tComment"]
    at = step * np.arange(N) if instants is None else instants
    lines += [f"{t:.6f}\t{force!r}\t{motion!r}" for t, force, motion in np.c_[at, *VALUES].tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return {**of, "paths": ("F", "a")}


def lvm_units(path: Path, of: Case) -> Case:
    return {**_lvm(path, of), "late": 0}


def lvm_starts(path: Path, of: Case) -> Case:
    return _lvm(path, of, of["late"] / of["rate"])


def lvm_starts_between_samples(path: Path, of: Case) -> Case:
    return _lvm(path, of, 0.1)


def lvm_uneven(path: Path, of: Case) -> Case:
    return _lvm(path, of, instants=UNEVEN)


Writer = Callable[[Path, Case], Case]
USED: dict[tuple[str, str], tuple[Writer, ...]] = {
    ("MAT", "units"): (mat_units,), ("MAT", "unit of time"): (mat_units,), ("MAT", "rounded instants"): (mat_single,),
    ("CSV", "units"): (csv_units, csv_brackets), ("CSV", "unit of time"): (csv_units, csv_brackets),
    ("CSV", "rounded instants"): (csv_rounded,),
    ("HDF5", "units"): (hdf5_units,), ("HDF5", "unit of time"): (hdf5_units,),
    ("HDF5", "scale, offset"): (hdf5_scaled, hdf5_by_dots),
    ("TDMS", "units"): (tdms_units,), ("TDMS", "unit of time"): (tdms_units,), ("TDMS", "scale, offset"): (tdms_scaled,),
    ("TDMS", "start time"): (tdms_starts,),
    ("HDF5", "rounded instants"): (hdf5_single,), ("MDF 4", "rounded instants"): (mdf_rounded,),
    ("SEP005", "rounded instants"): (sep005_rounded,),
    ("MAT", "start time"): (mat_units,), ("CSV", "start time"): (csv_units,), ("HDF5", "start time"): (hdf5_units, hdf5_starts),
    ("MDF 4", "units"): (mdf_units,), ("MDF 4", "scale, offset"): (mdf_scaled,), ("MDF 4", "start time"): (mdf_starts,),
    ("SEP005", "units"): (sep005_units,), ("SEP005", "start time"): (sep005_starts,),
    ("NumPy", "units"): (npz_units,), ("NumPy", "unit of time"): (npz_units,), ("NumPy", "start time"): (npz_units,),
    ("NumPy", "rounded instants"): (npz_single,),
    ("workbook", "units"): (xlsx_units,), ("workbook", "unit of time"): (xlsx_units,),
    ("workbook", "start time"): (xlsx_units,), ("workbook", "rounded instants"): (xlsx_rounded,),
    ("LabVIEW", "units"): (lvm_units,), ("LabVIEW", "start time"): (lvm_starts,),
}  # fmt: skip
REFUSED: dict[tuple[str, str], tuple[tuple[Writer, str], ...]] = {
    ("HDF5", "scale, offset"): ((hdf5_gain, "has the attribute gain (1000)"),),
    ("HDF5", "missing, invalid"): (
        (hdf5_missing, "has 1 missing values (_FillValue -999.0)"),
        (hdf5_valid_range, "outside its valid range, -0.1 to 0.1"),
        (hdf5_unsigned, "is marked _Unsigned"),
    ),
    ("TDMS", "scale, offset"): ((tdms_unknown_scale, "is scaled by Fantasy, which npTDMS does not know"),),
    ("TDMS", "start time"): ((tdms_starts_between_samples, "begins 204.80 samples before another"),),
    ("MDF 4", "scale, offset"): ((mdf_formula, "is converted by a formula, which is not evaluated"),),
    ("MDF 4", "start time"): ((mdf_starts_between_samples, "samples before another"),),
    ("SEP005", "start time"): ((sep005_starts_between_samples, "begins 204.80 samples before another"),),
    ("SEP005", "uneven instants"): ((sep005_uneven, "allowed are evenly spaced instants"),),
    ("HDF5", "start time"): ((hdf5_starts_between_samples, "samples before another"),),
    ("HDF5", "uneven instants"): ((hdf5_uneven, "is not evenly spaced"),),
    ("CSV", "uneven instants"): ((csv_uneven, "is not evenly spaced"),),
    ("MAT", "uneven instants"): ((mat_uneven, "is not evenly spaced"),),
    ("MAT", "missing, invalid"): (
        (mat_not_a_number, "value at [5] is nan"),
        (mat_instant_not_a_number, "instant [5] is nan"),
    ),
    ("CSV", "missing, invalid"): ((csv_not_a_number, "value at [5] is nan"),),
    ("TDMS", "missing, invalid"): ((tdms_not_a_number, "value at [5] is nan"),),
    ("SEP005", "missing, invalid"): ((sep005_not_a_number, "value at [5, 0] is nan"),),
    ("MDF 4", "uneven instants"): ((mdf_uneven, "is not evenly sampled; resample it"),),
    ("MDF 4", "missing, invalid"): ((mdf_invalid, "has 1 samples that are marked as invalid"),),
    ("NumPy", "uneven instants"): ((npz_uneven, "is not evenly spaced"),),
    ("NumPy", "missing, invalid"): ((npz_not_a_number, "value at [5] is nan"),),
    ("workbook", "uneven instants"): ((xlsx_uneven, "is not evenly spaced"),),
    ("workbook", "missing, invalid"): ((xlsx_text, "cell B8: 'OVER' is not a number"),),
    ("LabVIEW", "start time"): ((lvm_starts_between_samples, "samples before another"),),
}
