"""Models driven by a force or a voltage, PNLSS and structured ones: what predictions ask them."""

from typing import Any

from identification import (
    CoupledMotion,
    CoupledRun,
    Exciter,
    PnlssModel,
    SteadyPrediction,
    SteadyStates,
    StructuredModel,
    pnlss_coupled_run,
    pnlss_frequency_response,
    pnlss_steady_state,
    structured_coupled_run,
    structured_frequency_response,
    structured_steady_state,
)

DrivenModel = PnlssModel | StructuredModel


def frequency_response_at(model: DrivenModel, level: float, **how: Any) -> SteadyPrediction:
    """Return the response at a constant level; ``how`` as `identification.pnlss_frequency_response`."""
    if isinstance(model, StructuredModel):
        return structured_frequency_response(model, level, **how)
    return pnlss_frequency_response(model, level, **how)


def steady_state_at(model: DrivenModel, level: float, frequency_hz: float, **how: Any) -> SteadyStates:
    """Return the vibration at one level and frequency; ``how`` as `identification.pnlss_steady_state`."""
    if isinstance(model, StructuredModel):
        return structured_steady_state(model, level, frequency_hz, **how)
    return pnlss_steady_state(model, level, frequency_hz, **how)


def coupled_run(
    model: DrivenModel, exciter: Exciter, voltage_v: Any, *, lowest_hz: float
) -> CoupledRun | CoupledMotion:
    """Return the run with the exciter, from the voltage."""
    if isinstance(model, StructuredModel):
        return structured_coupled_run(model, exciter, voltage_v, lowest_hz=lowest_hz)
    return pnlss_coupled_run(model, exciter, voltage_v, lowest_hz=lowest_hz)
