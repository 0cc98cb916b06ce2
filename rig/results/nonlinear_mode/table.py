"""Files of nonlinear-mode models."""

from typing import Any

from identification import NonlinearMode
from rig.results.kind import Table
from rig.text.console import number, print_table


def _summarise(mode: NonlinearMode) -> dict[str, Any]:
    return {
        "specimen": mode.specimen,
        "source": mode.source,
        "frequency_shift": mode.frequency_shift,
        "drive_mode_shape": mode.drive_mode_shape,
        "drive_mode_shape_std": mode.drive_mode_shape_std,
        "drive_mode_shape_source": mode.drive_mode_shape_source,
        "points": mode.table(),
        "notes": list(mode.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    print_table(
        ("force N", "amplitude mm", "modal frequency Hz", "+-", "damping %", "+-", "all harmonics %", "phase lag deg"),
        [
            (
                number(p["force_n"], ".4f"),
                number(p["amplitude_m"], ".5f", 1e3),
                number(p["modal_frequency_hz"], ".4f"),
                number(p["modal_frequency_bound_95_hz"], ".4f"),
                number(p["damping_ratio"], ".4f", 100.0),
                number(p["damping_ratio_bound_95"], ".4f", 100.0),
                number(p["damping_ratio_total_power"], ".4f", 100.0),
                number(p["phase_lag_deg"], ".2f"),
            )
            for p in summary["points"]
        ],
    )
    print(f"frequency, last point over first: {100.0 * summary['frequency_shift']:+.2f} %")
    if summary["drive_mode_shape"] is not None:
        std, source = summary["drive_mode_shape_std"], summary["drive_mode_shape_source"]
        bound = "" if std is None else f" +- {1.96 * std:.2g}"
        print(
            f"mode shape at the drive point: {summary['drive_mode_shape']:.5g}{bound} kg^-1/2"
            + (f", {source}" if source else "")
        )


TABLE = Table(_summarise, _say)
