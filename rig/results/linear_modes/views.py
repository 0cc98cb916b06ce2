"""Table, figure and exchange of a linear modal analysis."""

from functools import partial
from typing import Any

import numpy as np

from identification import FrequencyResponseMatrix, LinearModes, ModalAnalysis, StabilisationDiagram
from identification.common import decode, encode
from rig.drawing.areas import areas
from rig.drawing.curves import Curves, View, transfer_curves
from rig.drawing.lines import draw_poles, pooled, without_wraps
from rig.drawing.style import (
    COLOURS,
    MAIN,
    REJECTED,
    Axes,
    Figure,
    legend_above,
    say_why_empty,
    shade,
    title,
    unit_text,
)
from rig.results.kind import Exchange, Table
from rig.text.column import Column
from rig.text.console import number, print_rows
from rig.text.contents import Contents


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
    names = [f"shape {name}" for name in summary["channels"]]
    found = enumerate(zip(summary["modes"], summary["shapes"], strict=True), 1)
    print_rows(
        [{"mode": index, **mode, **dict(zip(names, shape, strict=True))} for index, (mode, shape) in found],
        Column("mode", "mode"),
        Column("frequency_hz", "frequency", "Hz", ".4f"),
        Column("frequency_std_hz", "+-", "", ".4f", 1.96),
        Column("damping_ratio", "damping", "%", ".4f", 100.0),
        Column("damping_ratio_std", "+-", "", ".4f", 196.0),
        *(Column(name, name, "", ".5f") for name in names),
    )


TABLE = Table(_summarise, _say)


_MOST_OUTPUTS = 4
"""Largest number of outputs that are drawn; chosen for legibility."""
_MOST_DOTS = 4000
"""Largest number of dots of a curve; chosen for the size of the file."""


def draw_linear_modes(page: Figure, found: ModalAnalysis) -> None:
    """Draw the modes, and the responses and the stabilisation diagram if the file has them.

    ``page`` is an empty figure, about 11 by 8 inches.
    """
    modes, responses, stabilisation = found.modes, found.responses, found.stabilisation
    left, right = areas(page, (3, 4), (1.35, 1.0), beside=True)
    responses_on(left, modes, responses)
    top, middle, bottom = right.subplots(3, 1, height_ratios=(1.1, 1.0, 1.0))
    _stabilisation(top, modes, stabilisation, responses)
    _shapes(middle, modes)
    _mac(bottom, modes)
    level = "" if not np.isfinite(modes.force_rms_n) else f", {modes.force_rms_n:.3g} {modes.force_unit} RMS"
    level = ", extrapolated to zero force" if modes.force_rms_n == 0.0 else level
    title(page, f"{modes.specimen or 'specimen'}: linear modal analysis, {modes.frequency_hz.size} modes{level}")


def responses_on(page: Any, modes: LinearModes, responses: FrequencyResponseMatrix | None) -> None:
    """Draw amplitude and phase of the measured responses and of the model, and the standard errors of the measured ones."""
    size, phase = page.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    if responses is None:
        say_why_empty(size, "no frequency responses in the file")
        say_why_empty(phase, "")
        return
    frequency = responses.frequency_hz
    fitted = modes.response_matrix(
        _fine_hz(modes, frequency[0], frequency[-1]), decay_rate_1_s=responses.decay_rate_1_s
    )
    every = slice(None, None, max(1, frequency.size // _MOST_DOTS))
    known = {channel.name for channel in modes.channels}
    errors = responses.total_std if np.isfinite(responses.total_std).any() else responses.noise_std
    for row, (channel, colour) in enumerate(zip(responses.outputs[:_MOST_OUTPUTS], COLOURS, strict=False)):
        measured = responses.value[every, row, 0]
        label = f"{channel.name}, {unit_text(f'{channel.unit}/{responses.inputs[0].unit}')}"
        size.semilogy(frequency[every], np.abs(measured), ".", color=colour, alpha=0.5, label=label)
        if np.isfinite(errors[:, row, 0]).any():
            size.semilogy(frequency[every], pooled(errors[:, row, 0])[every], color=colour, lw=0.6, alpha=0.6, ls="--")
        phase.plot(frequency[every], np.degrees(np.angle(measured)), ".", color=colour, alpha=0.5)
        if channel.name in known:
            model = fitted.path(channel.name)
            size.semilogy(fitted.frequency_hz, np.abs(model), color=colour, lw=1.0)
            phase.plot(fitted.frequency_hz, without_wraps(np.degrees(np.angle(model))), color=colour, lw=1.0)
    size.plot([], [], color=REJECTED, lw=1.0, label="model")
    size.plot([], [], color=REJECTED, lw=0.6, ls="--", label="standard error")
    size.set(ylabel=f"frequency response ({responses.estimator})")
    size.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, handlelength=1.2, borderaxespad=0.2)
    size.tick_params(labelbottom=False)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))


def _fine_hz(modes: LinearModes, low: float, high: float) -> np.ndarray:
    """Return frequencies, Hz, within the band of the modes, close together where a mode resonates."""
    width = modes.damping_ratio * modes.frequency_hz
    peaks = modes.frequency_hz[:, None] + width[:, None] * np.linspace(-12.0, 12.0, 97)
    fine = np.union1d(np.geomspace(max(low, 1e-3), high, 2000), peaks)
    return np.asarray(fine[(fine >= modes.lowest_hz) & (fine <= modes.highest_hz)])


def curves(found: ModalAnalysis, view: View) -> Curves:
    """Return size and phase of the response from the force to the channel, as the modes have it within their band."""
    modes = found.modes
    fine = _fine_hz(modes, modes.lowest_hz, modes.highest_hz)
    return transfer_curves({"": modes.response_matrix(fine)}, view, origin="model")


def _stabilisation(
    axis: Axes,
    modes: LinearModes,
    diagram: StabilisationDiagram | None,
    responses: FrequencyResponseMatrix | None,
) -> None:
    if diagram is None:
        say_why_empty(axis, "no stabilisation diagram: modes were given")
        return
    if responses is not None:
        behind = axis.twinx()
        behind.semilogy(responses.frequency_hz, np.abs(responses.value).sum(axis=(1, 2)), color="#cccccc", lw=0.7)
        behind.set_axis_off()
        axis.set_zorder(behind.get_zorder() + 1)
        axis.patch.set_visible(False)
    draw_poles(axis, diagram, "stable in frequency", "stable in all")
    for frequency in modes.frequency_hz:
        axis.axvline(frequency, color=MAIN, lw=0.5, alpha=0.4)
    axis.set(xlabel="frequency, Hz", ylabel="model order", ylim=(0, 1.05 * diagram.orders.max()))
    legend_above(axis, 2)


def _shapes(axis: Axes, modes: LinearModes) -> None:
    """Draw the shape of every mode, one group of bars per channel, with 95 % intervals."""
    count = modes.frequency_hz.size
    width = 0.8 / count
    at = np.arange(len(modes.channels))
    for mode in range(count):
        label = f"{modes.frequency_hz[mode]:.2f} Hz, {100 * modes.damping_ratio[mode]:.3f} %"
        error = 1.96 * np.nan_to_num(modes.shapes_std[:, mode])
        colour = shade(mode, count)
        x = at + (mode - 0.5 * (count - 1)) * width
        axis.bar(x, modes.shapes[:, mode], 0.9 * width, yerr=error, color=colour, label=label, capsize=2)
    axis.axhline(0.0, color=REJECTED, lw=0.8)
    axis.set_xticks(at, [channel.name for channel in modes.channels])
    axis.set_ylabel("shape, kg$^{-1/2}$" if modes.normalised else "shape over its largest")
    legend_above(axis, min(count, 2))


def _mac(axis: Axes, modes: LinearModes) -> None:
    unit = modes.shapes / np.linalg.norm(modes.shapes, axis=0)
    mac = (unit.T @ unit) ** 2
    axis.imshow(mac, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    names = [f"{frequency:.1f}" for frequency in modes.frequency_hz]
    axis.set_xticks(range(len(names)), names)
    axis.set_yticks(range(len(names)), names)
    axis.set(xlabel="mode, Hz", ylabel="mode, Hz")
    axis.grid(False)
    axis.set_title("MAC at these sensors")
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": "small" if len(mac) < 9 else "xx-small"}
    for (row, column), value in np.ndenumerate(mac):
        axis.text(column, row, f"{value:.2f}", color="white" if value > 0.6 else "black", **look)


def _linear_modes(modes: LinearModes) -> Contents:
    arrays, attributes = encode(modes)
    names = tuple(channel.name for channel in modes.channels)
    shapes = {name: 1 for name in arrays if name.startswith("shapes")}
    rows = {name: 0 for name, array in arrays.items() if array.shape == modes.frequency_hz.shape and name not in _SIDES}
    units: dict[str, Any] = {"lower": "1/kg", "upper": "s2/kg", "force_rms_n": "N", "residues": "1/kg"}
    units["small_terms"] = np.array(["1/(kg s)", "1/(kg s2)", "s3/kg"])
    labels = dict.fromkeys(shapes, (names,))
    return Contents("linear-modes", modes.specimen, arrays, attributes, rows | shapes, units, labels)


_SIDES = ("lower", "upper")  # one value per channel, not per mode


def objects_of(found: ModalAnalysis) -> list[LinearModes | FrequencyResponseMatrix]:
    """Return the modes, and the responses in which they were identified if the file holds them."""
    return [found.modes] if found.responses is None else [found.modes, found.responses]


EXCHANGE = Exchange("linear-modes", LinearModes, _linear_modes, partial(decode, LinearModes))
