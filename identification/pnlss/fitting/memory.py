"""What a fit will hold in memory, compared beforehand with what there is."""

import os
from collections.abc import Sequence
from pathlib import Path

from identification.errors import IdentificationError
from identification.pnlss.experiment import Experiment
from identification.pnlss.fitting.normal_equations import BLOCK
from identification.pnlss.fitting.parameters import Parameters

__all__ = ["available_bytes", "check_memory", "needed_bytes"]

_SQUARES = 6
"""Matrices of all parameters by all parameters at once: normal equations, those of one experiment, eigenvectors and room."""


def needed_bytes(parameters: Parameters, experiments: Sequence[Experiment], by_frequency: bool) -> dict[str, int]:
    """Estimate of what a fit holds at its fullest, by what it is for."""
    outputs = len(parameters.start.outputs)
    columns = parameters.shared - parameters.start.states * max(parameters.estimated - 1, 0)
    widest = max(e.inputs.shape[1] for e in experiments)
    need = {
        "data": 8 * sum(e.inputs.size + e.outputs.size for e in experiments),
        "simulation": 8 * widest * (2 * outputs + parameters.start.states),
        "normal equations": 8 * _SQUARES * parameters.count**2,
        "blocks": 16 * outputs * BLOCK * columns,
    }
    if by_frequency:
        need["Jacobian of a period"] = 8 * (outputs + 1) * max(e.period_samples for e in experiments) * columns
    return need


def available_bytes() -> int | None:
    """Memory that programs can still have, caches included; None where the system does not tell."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def check_memory(parameters: Parameters, experiments: Sequence[Experiment], by_frequency: bool) -> None:
    """Raise `IdentificationError` where a fit would need more than there is."""
    need, there = needed_bytes(parameters, experiments, by_frequency), available_bytes()
    if there is None or sum(need.values()) <= there:
        return
    parts = ", ".join(f"{name} {value / 1e9:.2f}" for name, value in need.items())
    advice = "leave the frequency weighting out, or " if by_frequency else ""
    raise IdentificationError(
        f"memory: the fit needs {sum(need.values()) / 1e9:.2f} GB ({parts}), {there / 1e9:.2f} GB are free; "
        f"{advice}give shorter experiments or take fewer features"
    )
