"""A structured model with elements of all laws, for tests of files."""

from identification import Channel, NonlinearElement, StructuredModel
from identification.models import Iwan, Jenkins, MagnetSpring, PolynomialDamper, PolynomialSpring, SplineSpring, Stop


def structure(**changes) -> StructuredModel:
    """Two modes, an element of springs and a damper, and one of joints."""
    smooth = (PolynomialSpring((3.0, 1.5, 0.1)), SplineSpring(), Stop(0.7, 0.4, "both"), MagnetSpring(0.1, 3.0))
    elements = (
        NonlinearElement(
            direction=[0.9, -0.1], scale_m=1e-3, laws=(*smooth, PolynomialDamper((0.4, 0.1))), largest=1.1
        ),
        NonlinearElement(direction=[1.4, 0.7], scale_m=2e-3, laws=(Jenkins(0.5, 0.3), Iwan(0.2)), reach=2.0),
    )
    numbers = {
        "frequency_hz": [25.0, 140.0],
        "damping_ratio": [0.01, 0.02],
        "input_shapes": [[0.9], [1.6]],
        "output_shapes": [[0.9, 1.6], [1.4, -0.5]],
        "direct": [[0.01], [1.0 / 3.0]],
        "elements": elements,
        "sample_rate_hz": 800.0,
        "inputs": (Channel("force", "force", "N"),),
        "outputs": (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m")),
        "support_n_m": 800.0,
        "specimen": "beam",
        "training": ("realisation 1", "realisation 2"),
    }
    return StructuredModel(**(numbers | changes))
