"""What the paper tested and how it identified it, and what stands for that here."""

from collections.abc import Mapping
from dataclasses import dataclass

from rig.errors import ConfigurationError

__all__ = ["SPECIMENS", "Specimen", "specimen_of"]


@dataclass(frozen=True, kw_only=True)
class Specimen:
    """A specimen of Scheel et al. with the shipped plans of its campaign."""

    name: str
    """Name of its bench, and the folder of its plans."""
    levels: Mapping[str, str]
    """Multisine plans by level (force, RMS), lowest first."""
    paper_models: Mapping[str, int]
    """Number of models that the paper identified, by training set."""
    states: int
    """States of the paper's models."""
    degrees: tuple[int, ...]
    """Degrees of their monomials, in states and outputs."""
    rate_hz: float
    """Sample rate of the models."""
    excited_hz: tuple[float, float]
    """Band of the multisines. The force has distortion beyond it, which is no excitation for a linear start."""
    outputs: tuple[str, ...]
    """Motions that the models have as outputs, the drive point first."""
    band_hz: tuple[float, float]
    """Frequencies between which steady responses are followed."""
    forces_n: tuple[float, ...]
    """Forces of steady predictions, peak."""
    sweeps: tuple[str, ...]
    """Sweep plans."""
    iterations: int
    """Of a fit, at most."""
    patience: int
    """Iterations without a smaller validation error after which a fit ends."""
    every: int = 1
    """One of so many samples makes the Hessian of a step."""
    backbone: str = "backbone-fine"
    """Plan of the backbone whose points can be trained on beside the multisines."""
    exciter: str = "exciter"
    """Plan for the exciter model, with which a constant force is one that an exciter makes."""


SPECIMENS = {
    "magnet-beam": Specimen(
        name="magnet-beam",
        levels={"0.5 N": "multisine-1", "2.6 N": "multisine-2", "5.2 N": "multisine-3"},
        paper_models={"0.5 N": 20, "2.6 N": 30, "5.2 N": 30, "mixed": 30},
        states=2,
        degrees=(2, 3),
        rate_hz=800.0,
        excited_hz=(15.0, 35.0),
        # The paper has two accelerometers; with the true drive point for one of them an exciter can be coupled.
        outputs=("drive", "acc_magnet"),
        band_hz=(22.0, 27.0),
        forces_n=(0.25, 0.55),
        iterations=60,
        patience=20,
        sweeps=("sweep-1", "sweep-2", "sweep-3"),
    ),
    "friction-beam": Specimen(
        name="friction-beam",
        levels={"10 N": "multisine-1", "20 N": "multisine-2", "30 N": "multisine-3", "50 N": "multisine-4"},
        paper_models={"10 N": 30, "20 N": 30, "30 N": 30, "50 N": 30, "mixed": 30},
        states=4,
        degrees=(2, 3),
        rate_hz=5000.0,  # the paper has 6400 Hz: the bench records 5000
        excited_hz=(75.0, 225.0),
        outputs=("drive", "acc_left", "acc_right"),  # the paper has one more
        band_hz=(138.0, 158.0),
        forces_n=(2.0, 5.0, 15.0),
        # Validation errors are least after 5 to 15 iterations; what comes later fits the training data alone.
        iterations=30,
        patience=10,
        every=8,
        sweeps=("sweep-1", "sweep-2"),
    ),
}
"""By the name that ``rig reproduce`` takes."""


def specimen_of(name: str) -> Specimen:
    """A specimen by name; `ConfigurationError` for any other."""
    if name not in SPECIMENS:
        raise ConfigurationError(f"specimen {name!r}: allowed is {', '.join(SPECIMENS)}")
    return SPECIMENS[name]
