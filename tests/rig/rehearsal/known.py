"""A small rig that a test knows completely, and knowledge of it without any measurement."""

import numpy as np

from rig.rehearsal.knowledge import Knowledge
from rig.rehearsal.linear.fit import posterior
from rig.rehearsal.linear.model import Prior

MODE = {"frequency_hz": 24.37, "damping_ratio": 0.004, "drive_shape": 0.908}
EXCITER = {
    "force_per_volt_n_v": 5.3 / 1.5,
    "coil_time_constant_s": 1e-4,
    "moving_mass_kg": 0.18,
    "exciter_damping_n_s_m": 30.7,
    "suspension_stiffness_n_m": 6000.0,
    "stinger_stiffness_n_m": 6.28e6,
}
RATIOS = {"acc_drive": 1.113, "acc_magnet": 1.588}


def knowledge_of_the_magnet_beam(log_std=1e-3, **changes):
    """What the shipped magnet beam is made of, each parameter within a relative standard deviation."""
    values = {**MODE, **EXCITER, **changes}
    priors = {name: Prior(value, log_std) for name, value in values.items()}
    priors |= {f"ratio {name}": Prior(value, log_std) for name, value in RATIOS.items()}
    priors |= {"drive_shape low": Prior(1e-3, log_std), "drive_shape high": Prior(0.5, log_std)}
    linear = posterior(tuple(RATIOS), values, priors, None)
    return Knowledge(
        linear=linear, noise_rms={}, loop_delay_samples=None, shape_measured=True, mode=None, sources=("stated",)
    )


def generator(seed=0):
    return np.random.default_rng(seed)
