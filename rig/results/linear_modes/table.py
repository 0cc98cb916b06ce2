"""Files of linear modal analyses: the modes, and the responses in which they were identified."""

from typing import Any

from identification import ModalAnalysis
from rig.results.kind import Table
from rig.text.console import number, print_table


def _summarise(analysis: ModalAnalysis) -> dict[str, Any]:
    modes = analysis.modes
    return {
        "specimen": modes.specimen,
        "channels": [channel.name for channel in modes.channels],
        "estimator": None if analysis.responses is None else analysis.responses.estimator,
        "band_hz": [modes.lowest_hz, modes.highest_hz],
        "force_rms_n": modes.force_rms_n,
        "force_unit": modes.force_unit,
        "fit_residual": modes.fit_residual,
        "modes": modes.table(),
        "shapes": modes.shapes.T.tolist(),
        "shapes_std": modes.shapes_std.T.tolist(),
        "notes": list(modes.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    low, high = summary["band_hz"]
    source = f"{summary['estimator']}, " if summary["estimator"] else ""
    level = f", {summary['force_rms_n']:.3g} {summary['force_unit']} RMS" if summary["force_rms_n"] > 0.0 else ""
    residual = summary["fit_residual"]
    left = "" if residual != residual else f"; residual {number(residual, '.2f')} times that expected from noise"
    print(f"{source}{low:g} to {high:g} Hz{level}{left}")
    print_table(
        ("mode", "frequency Hz", "+-", "damping %", "+-", *(f"shape {name}" for name in summary["channels"])),
        [
            (
                str(index + 1),
                number(m["frequency_hz"], ".4f"),
                number(m["frequency_std_hz"], ".4f", 1.96),
                number(m["damping_ratio"], ".4f", 100.0),
                number(m["damping_ratio_std"], ".4f", 196.0),
                *(number(value, ".5f") for value in summary["shapes"][index]),
            )
            for index, m in enumerate(summary["modes"])
        ],
    )


TABLE = Table(_summarise, _say)
