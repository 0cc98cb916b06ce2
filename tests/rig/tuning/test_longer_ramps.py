"""How much longer the ramps of a plan become after a trial."""

from rig.campaigns.backbone.ramps import Ramp
from rig.tuning.longer_ramps import ramp_factors


def test_ramps_in_which_the_trial_lagged_are_longer():
    levels = [1.0, 2.0, 4.0, 8.0]

    def factors(*lagged, then=(1.0, 1.0, 3.0, 0.1), levels=levels):
        return ramp_factors(
            [Ramp(1.0, 2.0, 1.0, 1.0, 9.9, 0.1), Ramp(2.0, 4.0, *lagged), Ramp(4.0, 8.0, *then)], levels
        )

    assert factors(1.0, 1.0, 9.9, 0.0) == ()
    assert factors(1.0, 1.0, 12.0, 1.0) == ()  # noise
    assert factors(1.0, 1.0, 12.0, 0.0) == (1.0, 1.0, 3.0, 1.0)
    assert factors(2.0, 3.0, 12.0, 0.0) == (1.0, 1.0, 6.0, 1.0)  # longer already, and not enough
    assert factors(2.0, 3.0, 6.0, 0.0, then=(2.0, 2.0, 2.0, 0.0)) == (1.0, 1.0, 2.0, 1.0)  # long enough
    assert factors(1.0, 1.0, 90.0, 0.0) == (1.0, 1.0, 10.0, 1.0)
    slower = (1.0, 2.5, 9.0, 0.0)  # after a lag in the ramp before
    assert factors(1.0, 1.0, 12.0, 0.0, then=slower) == (1.0, 1.0, 3.0, 2.5)
    assert factors(1.0, 1.0, 12.0, 0.0, then=(1.0, 9.0, 9.0, 0.0)) == (1.0, 1.0, 3.0, 3.0)
    half = [1.0, 2.0, 2.0 * 2.0**0.5, 4.0]  # steps half as large
    assert factors(1.0, 1.0, 16.0, 0.0, levels=half) == (1.0, 1.0, 2.0, 2.0)
    assert ramp_factors([], levels) == ()
