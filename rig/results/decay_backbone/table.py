"""Files of free decays: modal frequency and damping over the amplitude."""

from typing import Any

from identification import DecayBackbone
from rig.results.kind import Table
from rig.text.console import number, print_table


def _summarise(found: DecayBackbone) -> dict[str, Any]:
    modes = [
        {
            "reference": mode.reference,
            "start_s": mode.start_s,
            "stop_s": mode.stop_s,
            "floor_m": mode.floor_m,
            "drive_mode_shape": mode.drive_mode_shape,
            "points": mode.table(),
        }
        for mode in found.modes
    ]
    return {"specimen": found.specimen, "modes": modes, "notes": list(found.notes)}


def _say(summary: dict[str, Any]) -> None:
    for mode in summary["modes"]:
        print(
            f"decay of {mode['reference']} from {mode['start_s']:.4g} to {mode['stop_s']:.4g} s, "
            f"noise {1e3 * mode['floor_m']:.3g} mm"
        )
        print_table(
            ("amplitude mm", "modal frequency Hz", "+-", "damping %", "+-", "at s"),
            [
                (
                    number(p["amplitude_m"], ".5f", 1e3),
                    number(p["modal_frequency_hz"], ".4f"),
                    number(p["modal_frequency_bound_95_hz"], ".4f"),
                    number(p["damping_ratio"], ".4f", 100.0),
                    number(p["damping_ratio_bound_95"], ".4f", 100.0),
                    number(p["time_s"], ".3f"),
                )
                for p in mode["points"]
            ],
        )


TABLE = Table(_summarise, _say)
