"""Exciter model of a study, identified from a separate multisine."""

from collections.abc import Callable

from identification import Exciter, identify_exciter
from rig.measurements import spectra
from rig.recording.reader import Recording
from studies.reproduce.options import Options
from studies.reproduce.recordings import recorded


def exciter_of(options: Options, say: Callable[[str], None]) -> Exciter:
    """Identify the exciter that is coupled to models whose input is the force."""
    with Recording(recorded(options, options.specimen.exciter, say)) as recording:
        measured = next(iter(spectra(recording).values()))
        rate_hz = float(recording.configuration["bench"]["sample_rate_hz"])
    return identify_exciter(measured, sample_rate_hz=rate_hz)
