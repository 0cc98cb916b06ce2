"""Files of exciter models."""

from typing import Any

import numpy as np

from identification import Exciter
from identification.exciter_coupling import PARAMETERS
from rig.results.kind import Table
from rig.text.console import number, print_table

_SHOWN = {
    "force_per_volt_n_v": ("force per volt, blocked", "N/V"),
    "coil_time_constant_s": ("time constant of the coil", "s"),
    "moving_mass_kg": ("moving mass", "kg"),
    "suspension_damping_n_s_m": ("damping of the suspension", "N s/m"),
    "suspension_stiffness_n_m": ("stiffness of the suspension", "N/m"),
    "back_emf_damping_n_s_m": ("damping by the back-EMF", "N s/m"),
    "damping_n_s_m": ("damping by both", "N s/m"),
    "stinger_compliance_m_n": ("compliance of the stinger", "m/N"),
    "stinger_damping_time_s": ("damping over stiffness of the stinger", "s"),
}


def _summarise(exciter: Exciter) -> dict[str, Any]:
    std = exciter.std
    found = {name: (getattr(exciter, name), std[name]) for name in PARAMETERS} | {
        "damping_n_s_m": exciter.damping_n_s_m
    }
    return {
        "specimen": exciter.source,
        "band_hz": [exciter.lowest_hz, exciter.highest_hz],
        "fit_residual": exciter.fit_residual,
        "parameters": {
            name: {"value": value, "std": error if np.isfinite(error) else None}
            for name, (value, error) in ((name, found[name]) for name in _SHOWN)
        },
        "notes": list(exciter.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    low, high = summary["band_hz"]
    print(f"{low:g} to {high:g} Hz; residual {number(summary['fit_residual'], '.2f')} times that expected from noise")
    print_table(
        ("", "value", "+-", "unit"),
        [
            (_SHOWN[name][0], number(p["value"], ".5g"), number(p["std"], ".2g", 1.96), _SHOWN[name][1])
            for name, p in summary["parameters"].items()
        ],
    )


TABLE = Table(_summarise, _say)
