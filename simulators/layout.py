"""Flags, codes and bundles of arrays that the kernels of the virtual rig read and write.

The module uses plain numpy only, so that Python code and kernels can share it. A bundle of state holds everything that a run
depends on; a copy of it is a checkpoint.
"""

from enum import IntEnum, IntFlag
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import record


class Flag(IntFlag):
    """Faults of a sample; ``sample`` returns these bits, or-ed."""

    LAW_RANGE = 1
    """The range of a law was left: a magnet beyond 0.7 of its gap (contact is not modelled), or an armature where the force
    factor has drooped to a half."""
    SENSOR_CLIPPED = 2
    """A sensor left its own range, or the range of the analogue-to-digital converter."""
    DAC_CLIPPED = 4
    """The demanded voltage is beyond the range of the digital-to-analogue converter, or not a number (then 0 V is held)."""
    DIVERGED = 8
    """The state is no longer finite. From then on it is held and every channel reads NaN."""
    AMPLIFIER_CLIPPED = 16
    """The demanded voltage would drive the amplifier beyond its limit."""


LAW_RANGE, SENSOR_CLIPPED, DAC_CLIPPED, DIVERGED, AMPLIFIER_CLIPPED = (int(flag) for flag in Flag)


class SiteKind(IntEnum):
    """Force laws of local sites without memory. Jenkins sites have a separate table."""

    MAGNET_ONE_SIDED = 0
    MAGNET_SYMMETRIC = 1
    CUBIC = 2
    CLEARANCE = 3
    USER = 4
    DROOP = 5
    FORCE_TABLE = 6
    DAMPING_TABLE = 7


MAGNET_ONE_SIDED, MAGNET_SYMMETRIC, CUBIC, CLEARANCE, USER, DROOP, FORCE_TABLE, DAMPING_TABLE = (
    int(kind) for kind in SiteKind
)
N_PARAMETER = 8  # numbers that a user's function is given; chosen
N_NODE = 513
"""Nodes of a table."""

PLANT = record(i8="n_state n_local n_joint substeps", f8="input_limit_v")
"""Sizes, and the voltage beyond which the amplifier clips (one record)."""

SITE = record(
    ("parameters", "f8", (N_PARAMETER,)),
    ("table", "f8", (2, N_NODE)),
    i8="kind partner address",
    f8="limit stiffness strength quadratic gap other_gap offset",
)
"""A local site. ``limit``: limit of validity (m). ``stiffness``: linear stiffness that the linear plant already contains (N/m).
``strength``: K0 (N m^4), k3 (N/m^3) or k (N/m). ``quadratic``: quadratic stiffness k2 (N/m^2). ``gap``, ``other_gap`` (m).
``offset``: force at rest that is subtracted (N). For a droop, ``quadratic`` is G b_1 and ``strength`` is G b_2. ``partner``
says how many sites before (negative: behind) stands the position that a droop or a damping depends on. ``address``: address
of a user's function, valid in the process that made the table; ``parameters``: the numbers passed to it.

``table``: of a force table, force (N) and its slope times the distance of the nodes, evenly from ``gap`` to ``other_gap``, with
the slopes ``quadratic`` below and ``strength`` above (N/m); of a damping table, the damping (N s/m) in the first row."""

CHANNEL = record(i8="delay", f8="noise_v range_v")
"""A sensor: noise of sensor and converter together (RMS, V), the sensor's own range (V), and the number of internal instants
back to its first tap."""

CONVERTER = record(i8="oversampling", f8="adc_step_v adc_codes_per_v adc_range_v dac_step_v dac_range_v dac_noise_v")
"""Internal instants per sample, steps and ranges, noise of the output (one record). A step of zero means no quantisation."""


class RigArrays(NamedTuple):
    """The rig's constant arrays for the kernels; never written to during a run.

    ``step`` [n_input, n_row]: column of the sub-step map per entry of the input vector ``[x, u, f_local, f_joint, d_local,
    d_joint]``, d being the last increments of the forces; its rows are ``[joint coordinates, local coordinates, x]``.
    ``correct`` [n_site, n_row]: contribution of the change of the increment of each site force. ``elements`` [2, n_element,
    n_joint]: stiffness and slip force of every Jenkins element; ``stuck`` [n_joint]: sum of the stiffnesses of a joint.
    ``sense`` [n_sensed, n_padded]: outputs (SI) from the same input vector as far as f_joint. Sensed inputs, rows, joints and
    channels (n_padded) are padded with zeros to whole vectors of the compiled loops.

    ``conditioning`` [5, n_padded]: coefficients hold, old and new of the low-pass that forms a sensor's high-pass, V per SI
    unit, and the sensor's range (V). ``noise_keys`` [1 + n_channel]: key of the output, then of each channel. ``sections``
    [n_section, 5, n_padded] and ``reconstruction`` [n_section, 5]: filters of sensors and output as second-order sections,
    b_0 b_1 b_2 a_1 a_2, at the internal rate; n_section is 0 without filters. ``taps`` [n_channel, n_tap]: weights that
    interpolate a skewed channel.
    """

    plant: NDArray[Any]
    step: NDArray[np.float64]
    correct: NDArray[np.float64]
    sites: NDArray[Any]
    elements: NDArray[np.float64]
    stuck: NDArray[np.float64]
    sense: NDArray[np.float64]
    channels: NDArray[Any]
    conditioning: NDArray[np.float64]
    converter: NDArray[Any]
    noise_keys: NDArray[np.uint64]
    sections: NDArray[np.float64]
    reconstruction: NDArray[np.float64]
    taps: NDArray[np.float64]


class RigState(NamedTuple):
    """Everything a run depends on, and the scratch space of its kernels.

    ``inputs`` [n_input]: the input vector ``[x, u, f_local, f_joint, d_local, d_joint]`` at the present instant.
    ``deflection`` [n_joint], its last ``increment`` [n_joint] and ``friction`` [n_element, n_joint]: state of the Jenkins
    elements. ``filters``
    [2, n_padded]: high-pass states (low-passed value, last value). ``counter`` [1]: index of the next sample, from
    which its noise is drawn. ``memory`` [n_section, 2, n_padded] and ``output_memory`` [n_section, 2]: state of the
    filters. ``history`` [n_ring, n_channel]: ring of conditioned volts at internal instants; its length is a power of two, or 0
    if no channel is skewed. The other fields carry nothing from one sample to the next.
    """

    inputs: NDArray[np.float64]
    deflection: NDArray[np.float64]
    increment: NDArray[np.float64]
    friction: NDArray[np.float64]
    filters: NDArray[np.float64]
    counter: NDArray[np.int64]
    memory: NDArray[np.float64]
    output_memory: NDArray[np.float64]
    history: NDArray[np.float64]
    rows: NDArray[np.float64]
    forces: NDArray[np.float64]
    joints: NDArray[np.float64]
    changes: NDArray[np.float64]
    increments: NDArray[np.float64]
    outputs: NDArray[np.float64]
