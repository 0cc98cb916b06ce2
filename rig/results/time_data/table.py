"""Files of time records that were measured with other systems."""

from typing import Any

import numpy as np

from identification import TimeRecords
from identification.experiments import period_remark
from rig.results.kind import Table
from rig.text.console import number, print_table


def _summarise(data: TimeRecords) -> dict[str, Any]:
    rate, size = data.sample_rate_hz, data.period_samples
    return {
        "specimen": data.specimen,
        "source": data.source,
        "sample_rate_hz": rate,
        "period_samples": size,
        "resolution_hz": rate / size if size else None,
        "ahead_periods": data.ahead_periods if size else None,
        "excited_hz": None if data.excited_hz is None else list(data.excited_hz),
        "at_rest": data.at_rest,
        "instrument": data.instrument,
        "channels": [
            {
                **vars(channel),
                "rms": float(np.sqrt(np.mean([np.mean(one.samples[row] ** 2) for one in data.records]))),
                "largest": max(float(np.abs(one.samples[row]).max()) for one in data.records),
                "mean": float(np.mean([one.samples[row].mean() for one in data.records])),
            }
            for row, channel in enumerate(data.channels)
        ],
        "level_unit": data.level_unit,
        "records": [
            {
                "name": one.name,
                "level": None if np.isnan(one.level) else one.level,
                "samples": one.samples.shape[1],
                "periods": one.samples.shape[1] // size if size else None,
                "duration_s": one.samples.shape[1] / rate,
            }
            for one in data.records
        ],
        "notes": list(dict.fromkeys([*data.notes, *filter(None, [period_remark(data)])])),
    }


def _say(summary: dict[str, Any]) -> None:
    records, band = summary["records"], summary["excited_hz"]
    periodic = f"periods of {summary['period_samples']} samples" if summary["period_samples"] else "not periodic"
    excited = "" if band is None else f", excited {band[0]:g} to {band[1]:g} Hz"
    rest = ", from rest" if summary["at_rest"] and not summary["period_samples"] else ""
    many = "1 record" if len(records) == 1 else f"{len(records)} records"
    print(f"{many} at {summary['sample_rate_hz']:g} Hz, {periodic}{rest}{excited}")
    print_table(
        ("channel", "role", "unit", "RMS", "largest", "mean"),
        [
            (c["name"], c["role"], c["unit"], *(number(c[name], ".4g") for name in ("rms", "largest", "mean")))
            for c in summary["channels"]
        ],
    )
    print_table(
        ("record", "samples", "periods", "s"),
        [
            (one["name"], str(one["samples"]), number(one["periods"], ".0f"), number(one["duration_s"], ".4g"))
            for one in records
        ],
    )


TABLE = Table(_summarise, _say)
