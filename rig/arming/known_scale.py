"""What a run may compare the scale and the phase of its sensors with, and a remark on what nothing proves."""

from collections.abc import Mapping

from rig.arming.bench_memory import fingerprint, memory_of
from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench


def known_scale(
    bench: Bench, identity: Mapping[str, str], given: CheckedScale | None, *, virtual: bool
) -> tuple[CheckedScale | None, str]:
    """Return the scale of the last check of the bench, or the ``given`` one, and why the scale is unproven if there is none.

    Nothing is remembered of a virtual bench, and nothing is said of it. A check of other channels or another device does not
    count. ``identity`` is what the driver says of its device.
    """
    if given is not None or virtual:
        return given, ""
    check = memory_of(bench).check
    if check is None:
        why = "the bench was never checked"
    elif check.fingerprint != fingerprint(bench, identity):
        why = "the last check was of other channels, another rate, another driver or another device"
    elif check.scale is None:
        why = "the last check kept no numbers of it"
    else:
        return check.scale, ""
    return None, (
        f"the scale of force and motion is unproven: {why}; a sensitivity that is wrong by a factor would not be seen "
        "(run `rig check` with this bench)"
    )


def unproven_phase(bench: Bench, *, virtual: bool) -> str:
    """Return why nothing proves the phase of the drive sensor; an empty string if something does, or on a virtual bench."""
    shapes = [channel for channel in bench.channels if channel.role == "response" and channel.mode_shape]
    if virtual or (shapes and bench.specimen.drive_mode_shape is not None):
        return ""
    drive = bench.channels[bench.index_of("drive")].name
    return (
        f"the phase of {drive} is unproven: the bench has no response with a mode_shape to compare it with, so a delay of its "
        "conditioner would not be seen"
    )
