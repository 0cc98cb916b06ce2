"""Channels through which an exciter drives a model."""

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.experiments.simulators import Driven


def driven_rows(model: Driven) -> tuple[int, int]:
    """Return the rows of the force among the inputs, and of the drive point among the outputs.

    Raises `IdentificationError` if there is none, or there are other inputs.
    """
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
    if len(forces) != 1:
        raise IdentificationError(
            f"model: has {len(forces)} forces among its inputs, needs one, which the exciter makes"
        )
    others = [channel.name for row, channel in enumerate(model.inputs) if row != forces[0]]
    if others:
        raise IdentificationError(
            f"model: has inputs beside its force ({', '.join(others)}), whose values a run with an exciter does not know; "
            "needs a model of the force alone"
        )
    return forces[0], find_role(model.outputs, "drive")
