"""Specimens of the paper, with its identification settings and the shipped plans that correspond to its tests."""

from collections.abc import Mapping
from dataclasses import dataclass

from identification.models import Law, MagnetSpring, Masing


@dataclass(frozen=True, kw_only=True)
class Specimen:
    """A specimen of Scheel et al. with the shipped plans of its campaign."""

    name: str
    """Name of the specimen's bench and of the folder of its plans."""
    levels: Mapping[str, str]
    """Multisine plans by level (force, RMS), lowest first."""
    paper_models: Mapping[str, int]
    """Number of models identified in the paper, by training set."""
    states: int
    """Number of states of the paper's models."""
    degrees: tuple[int, ...]
    """Degrees of the monomials, in states and outputs."""
    rate_hz: float
    """Sample rate of the models, Hz."""
    excited_hz: tuple[float, float]
    """Band of the multisines, Hz. Beyond it the force contains only distortion, which cannot be used for the linear start."""
    outputs: tuple[str, ...]
    """Motions that the models have as outputs, the drive point first."""
    band_hz: tuple[float, float]
    """Frequency range of steady responses, Hz."""
    forces_n: tuple[float, ...]
    """Forces of steady predictions, N peak."""
    sweeps: tuple[str, ...]
    """Sweep plans."""
    iterations: int
    """Largest number of iterations of a fit."""
    patience: int
    """Iterations without a smaller validation error after which a fit ends."""
    modes_plan: str
    """Plan that gives a structured model its modes."""
    modes: int
    """Number of modes that the plan shows."""
    laws: tuple[Law, ...]
    """Laws of the nonlinear element of a structured model."""
    support: bool
    """Whether a structured model has the static force of the exciter, by the stiffness of its suspension as it was identified.
    Only a spring that is not symmetric makes it visible."""
    beside: tuple[str, ...] = ("backbone-fine",)
    """Plans whose points can be used for training together with the multisines."""
    exciter: str = "exciter"
    """Plan of the multisine for the exciter model. With this model, a constant force has the harmonics that an exciter makes.
    """


SPECIMENS = {
    "magnet-beam": Specimen(
        name="magnet-beam",
        levels={"0.5 N": "multisine-1", "2.6 N": "multisine-2", "5.2 N": "multisine-3"},
        paper_models={"0.5 N": 20, "2.6 N": 30, "5.2 N": 30, "mixed": 30},
        states=2,
        degrees=(2, 3),
        rate_hz=800.0,
        excited_hz=(15.0, 35.0),
        # The paper has two accelerometers. One of them is replaced by the true drive point, so that an exciter can be coupled.
        outputs=("drive", "acc_magnet"),
        band_hz=(22.0, 27.0),
        forces_n=(0.25, 0.55),
        iterations=60,
        patience=20,
        sweeps=("sweep-1", "sweep-2", "sweep-3"),
        modes_plan="multisine-1",
        modes=1,
        laws=(MagnetSpring(), Masing()),
        support=True,
        beside=("backbone-fine", "harmonics-varied"),
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
        # Validation errors are smallest after 5 to 15 iterations; later iterations fit the training data alone.
        iterations=30,
        patience=10,
        sweeps=("sweep-1", "sweep-2"),
        modes_plan="modal",
        modes=4,
        laws=(Masing(),),
        support=False,
    ),
}
"""Specimens by the name that ``rig reproduce`` takes."""
