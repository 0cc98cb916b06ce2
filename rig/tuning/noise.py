"""The low-pass that noise leaves, and the lowest force that it leaves."""

from controller.tuning import LowPassChoice, PlantModel, low_pass_from_densities

__all__ = ["low_pass"]

LAG_STD_DEG = 0.75  # of the raw lag: the settle rule averages it over ten periods
RAISED = 3.0  # times the lowest force wanted


def low_pass(plant: PlantModel, densities: tuple[float, float], lowest_n: float) -> tuple[float, float, str]:
    """Largest low-pass (rad/s), the lowest force (N) that the lag can be told at with it, and why.

    The lag fluctuates by `LAG_STD_DEG` at that force. Where that is not more than `RAISED` times the force wanted, the
    force is raised rather than the low-pass lowered: a slow low-pass waits at every level.
    """
    omega = plant.lock_frequency_rad_s()
    accelerance = abs(complex(plant.accelerance(1j * omega)))

    def fluctuation(force_n: float) -> LowPassChoice:
        amplitudes = (densities[0], force_n, densities[1], force_n * accelerance)
        return low_pass_from_densities(omega, *amplitudes, lag_std_deg=LAG_STD_DEG)

    quickest = fluctuation(1e6 * lowest_n)  # bounded by the frequency alone
    needed_n = 1e6 * lowest_n * quickest.lag_std_deg / LAG_STD_DEG
    if needed_n <= lowest_n:
        choice = fluctuation(lowest_n)
        return (
            choice.low_pass_rad_s,
            lowest_n,
            f"the lag then fluctuates by {choice.lag_std_deg:.2g} deg at {lowest_n:.3g} N",
        )
    why = f"the lag then fluctuates by {LAG_STD_DEG:g} deg at"
    if needed_n <= RAISED * lowest_n:
        return quickest.low_pass_rad_s, needed_n, f"{why} {needed_n:.3g} N, the lowest level, raised for that"
    choice = fluctuation(lowest_n)
    force_n = lowest_n * max(1.0, choice.lag_std_deg / LAG_STD_DEG)
    return choice.low_pass_rad_s, force_n, f"{why} {force_n:.3g} N, the lowest level"
