"""A small nonlinear system with realisations at two levels, and stand-ins for an identification."""

import numpy as np

from identification import Channel, Experiment, Features, IdentificationError, PnlssModel

RATE_HZ = 100.0
FORCE = Channel("force", "force", "N")
DRIVE = Channel("drive", "drive", "m/s^2")


def system(cubic: float = -0.02) -> PnlssModel:
    """One state, ``x(k+1) = 0.9 x + 0.1 u + cubic x^3``, ``y = x``."""
    return PnlssModel(
        a=np.array([[0.9]]),
        b=np.array([[0.1]]),
        c=np.array([[1.0]]),
        d=np.array([[0.0]]),
        e=np.array([[cubic]]),
        f=np.zeros((1, 0)),
        state_features=Features.monomials(1, 1, [3], of=[0]),
        output_features=Features.none(1, 1),
        sample_rate_hz=RATE_HZ,
        inputs=(FORCE,),
        outputs=(DRIVE,),
        state_range=np.array([1.0]),
        input_range=np.array([1.0]),
    )


def realisations(level: float, count: int, seed: int = 0) -> list[Experiment]:
    random = np.random.default_rng([seed, round(10 * level)])
    found = []
    for index in range(count):
        u = level * random.standard_normal((1, 400))
        y = system().simulate(u).outputs
        found.append(
            Experiment(
                inputs=u,
                outputs=y,
                sample_rate_hz=RATE_HZ,
                input_channels=(FORCE,),
                output_channels=(DRIVE,),
                counted_from=100,
                name=f"{level:g} N {index}",
                level=level,
            )
        )
    return found


def identify_by_name(training, *, validation):
    """Not a fit: says what it was given, and fails where the first is realisation 1."""
    if training[0].name.endswith(" 1"):
        raise IdentificationError("training: cannot be fitted")
    if training[0].name.endswith(" 2"):
        raise ZeroDivisionError("by accident")
    return tuple(one.name for one in training), tuple(one.name for one in validation)
