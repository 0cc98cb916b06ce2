"""Measurements in memory become models, and models become predictions. No files, no figures.

First::

    import identification
    import rig

    backbone = rig.run("magnet-beam/backbone").backbone()
    mode = identification.nonlinear_mode(backbone)
    curve = identification.frequency_response(mode, force_n=0.1)

Names by topic; ``help(identification.linear_modes)`` says more of one, ``rig docs linear_modes`` opens its page:

Measurements
    PeriodicVibration, Channel, Backbone, FrequencyResponse, pack_frequency_responses, unpack_frequency_responses,
    IdentificationError
Signals
    periodic_vibration, demodulate, Transient, zero_crossings, HalfPeriods, decimated, force_drop_out, ForceDropOut
Multisine
    MultisineDesign, periodic_spectra, PeriodicSpectra, InstrumentResponse, best_linear_approximation, coherence,
    distortion_levels, DistortionLevels
Linear modes
    linear_modes, LinearModes, ModalAnalysis, FrequencyResponseMatrix, stabilisation, StabilisationDiagram,
    extrapolated_to_zero, fit_state_space, StateSpaceFit, subspace, StateSpace, ModeShapes, mac, mac_matrix
Hammer tests
    hammer_test, HammerTest, Hit
Nonlinear modes
    nonlinear_mode, NonlinearMode, single_point_mode, stepped_sine_mode, repeatability, Repeatability, combined
Short points and continuous backbones
    slow_flow, SlowFlow, short_point, ShortPoint, continuous_backbone, ContinuousBackbone
Free decays
    decay_backbone, DecayBackbone, DecayMode
Response-controlled tests
    force_surface, ForceSurface, ConstantForceCurve
Prediction with nonlinear modes
    frequency_response, steady_predictions, SteadyPrediction, Predictions, ModalProperties, ExtrapolationError,
    response_band, ResponseBand, identify_exciter, Exciter, VoltagePath, predict_sweep, VoltageSweep,
    SweepPrediction, compare_sweep, compare, Comparison, PredictionError, error_table, recorded_force_response
Nonlinear state-space models (PNLSS)
    identify_pnlss, PnlssModel, Experiment, FitSettings, FitProgress, Features, linear_pnlss, best_linear_responses,
    fit_pnlss, PnlssFit, FitHistory, Simulation
Responses and errors of PNLSS models
    pnlss_frequency_response, pnlss_response, pnlss_steady_state, PnlssResponse, SteadyStates, pnlss_coupled_run,
    CoupledRun, simulated_run, SimulatedRun, estimated_initial_state, pnlss_errors, PnlssErrors, error_spectra,
    ErrorSpectra, output_stretch, OutputStretch, ErrorTable, identify_many, ModelJob, IdentifiedModel,
    realisation_combinations
Structured models
    fit_structured, StructuredModel, StructuredFit, NonlinearElement, ElementPlan, ElementTrial,
    structured_backbone, structured_frequency_response, structured_response, structured_steady_state,
    structured_coupled_run, CoupledMotion, structured_mode, bound_of, Bound
Changes from run to run
    fit_with_scatter, RunScatter, OutputBand
Measurements of others
    map_backbone, BackboneMapping, map_frequency_responses, FrequencyResponseMapping, map_hammer_test,
    HammerTestMapping, map_multisine, MultisineMapping, map_nonlinear_mode, NonlinearModeMapping, map_pnlss,
    PnlssMapping, map_response_matrix, ResponseMatrixMapping, map_time_data, TimeDataMapping, TimeRecords, TimeRecord,
    time_experiments, time_responses, time_spectra
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.backbones import Backbone
    from identification.channels import Channel
    from identification.decays.backbone import decay_backbone
    from identification.decays.result import DecayBackbone, DecayMode
    from identification.errors import IdentificationError
    from identification.frequency_responses import (
        FrequencyResponse,
        pack_frequency_responses,
        unpack_frequency_responses,
    )
    from identification.hammer.hammer_test import hammer_test
    from identification.hammer.result import HammerTest, Hit
    from identification.linear.extrapolation import extrapolated_to_zero
    from identification.linear.modal_analysis import ModalAnalysis, linear_modes
    from identification.linear.mode_shapes import ModeShapes, mac
    from identification.linear.modes import LinearModes, mac_matrix
    from identification.linear.response_matrix import FrequencyResponseMatrix
    from identification.linear.stabilisation import StabilisationDiagram, stabilisation
    from identification.linear.state_space_fit import StateSpaceFit, fit_state_space
    from identification.linear.subspace import StateSpace, subspace
    from identification.mapping.backbone import BackboneMapping, map_backbone
    from identification.mapping.hammer_test import HammerTestMapping, map_hammer_test
    from identification.mapping.multisine import MultisineMapping, map_multisine
    from identification.mapping.nonlinear_mode import NonlinearModeMapping, map_nonlinear_mode
    from identification.mapping.pnlss import PnlssMapping, map_pnlss
    from identification.mapping.response_matrix import ResponseMatrixMapping, map_response_matrix
    from identification.mapping.stepped_sine import FrequencyResponseMapping, map_frequency_responses
    from identification.mapping.time_data import TimeDataMapping
    from identification.mapping.time_records import map_time_data
    from identification.measurements import PeriodicVibration
    from identification.multisine.best_linear_approximation import best_linear_approximation, coherence
    from identification.multisine.design import MultisineDesign
    from identification.multisine.distortion import DistortionLevels, distortion_levels
    from identification.multisine.spectra import InstrumentResponse, PeriodicSpectra, periodic_spectra
    from identification.nonlinear.nonlinear_modes import NonlinearMode
    from identification.nonlinear.phase_resonance import nonlinear_mode
    from identification.nonlinear.repeatability import Repeatability, combined, repeatability
    from identification.nonlinear.single_points import single_point_mode
    from identification.nonlinear.stepped_sine import stepped_sine_mode
    from identification.pnlss.best_linear import best_linear_responses
    from identification.pnlss.coupled.run import CoupledRun, pnlss_coupled_run
    from identification.pnlss.error_table import ErrorTable
    from identification.pnlss.errors import PnlssErrors, estimated_initial_state, pnlss_errors
    from identification.pnlss.experiment import Experiment
    from identification.pnlss.features import Features
    from identification.pnlss.fitting.fit import fit_pnlss
    from identification.pnlss.fitting.result import FitHistory, PnlssFit
    from identification.pnlss.fitting.settings import FitProgress, FitSettings
    from identification.pnlss.identify import identify_pnlss
    from identification.pnlss.linear_model import linear_pnlss
    from identification.pnlss.many import IdentifiedModel, ModelJob, identify_many, realisation_combinations
    from identification.pnlss.model import PnlssModel
    from identification.pnlss.runs import error_spectra, output_stretch, simulated_run
    from identification.pnlss.simulation import Simulation
    from identification.pnlss.steady.response import pnlss_frequency_response, pnlss_response, pnlss_steady_state
    from identification.pnlss.steady.states import PnlssResponse, SteadyStates
    from identification.prediction.comparison import Comparison, PredictionError, compare, error_table
    from identification.prediction.exciter import Exciter, VoltagePath
    from identification.prediction.exciter_fit import identify_exciter
    from identification.prediction.frequency_response import frequency_response, steady_predictions
    from identification.prediction.predictions import Predictions
    from identification.prediction.properties import ExtrapolationError, ModalProperties
    from identification.prediction.recorded_force import recorded_force_response
    from identification.prediction.simulated_runs import ErrorSpectra, OutputStretch, SimulatedRun
    from identification.prediction.steady_prediction import SteadyPrediction
    from identification.prediction.sweep_inputs import VoltageSweep
    from identification.prediction.sweep_prediction import SweepPrediction, compare_sweep
    from identification.prediction.sweeps import predict_sweep
    from identification.prediction.uncertainty import ResponseBand, response_band
    from identification.response_control.curves import ConstantForceCurve
    from identification.response_control.force_surface import ForceSurface, force_surface
    from identification.scatter.fit import fit_with_scatter
    from identification.scatter.run_scatter import OutputBand, RunScatter
    from identification.signals.decimation import decimated
    from identification.signals.fourier import periodic_vibration
    from identification.signals.half_periods import HalfPeriods, zero_crossings
    from identification.signals.sweeps import ForceDropOut, force_drop_out
    from identification.signals.transients import Transient, demodulate
    from identification.slow_flows.continuous import ContinuousBackbone, continuous_backbone
    from identification.slow_flows.short_points import ShortPoint, short_point
    from identification.slow_flows.slow_flow import SlowFlow, slow_flow
    from identification.structured.bound import Bound, bound_of
    from identification.structured.coupled.run import CoupledMotion, structured_coupled_run
    from identification.structured.element_trials import ElementTrial
    from identification.structured.elements import NonlinearElement
    from identification.structured.fit import StructuredFit, fit_structured
    from identification.structured.further import ElementPlan
    from identification.structured.model import StructuredModel
    from identification.structured.steady.backbone import structured_backbone
    from identification.structured.steady.mode import structured_mode
    from identification.structured.steady.response import (
        structured_frequency_response,
        structured_response,
        structured_steady_state,
    )
    from identification.time_data.experiments import time_experiments
    from identification.time_data.records import TimeRecord, TimeRecords
    from identification.time_data.responses import time_responses, time_spectra
else:
    __getattr__, __dir__ = on_use(
        __name__,
        {
            "Backbone": "backbones",
            "BackboneMapping": "mapping.backbone",
            "Bound": "structured.bound",
            "Channel": "channels",
            "Comparison": "prediction.comparison",
            "ConstantForceCurve": "response_control.curves",
            "ContinuousBackbone": "slow_flows.continuous",
            "CoupledMotion": "structured.coupled.run",
            "CoupledRun": "pnlss.coupled.run",
            "DecayBackbone": "decays.result",
            "DecayMode": "decays.result",
            "DistortionLevels": "multisine.distortion",
            "ElementPlan": "structured.further",
            "ElementTrial": "structured.element_trials",
            "ErrorSpectra": "prediction.simulated_runs",
            "ErrorTable": "pnlss.error_table",
            "Exciter": "prediction.exciter",
            "Experiment": "pnlss.experiment",
            "ExtrapolationError": "prediction.properties",
            "Features": "pnlss.features",
            "FitHistory": "pnlss.fitting.result",
            "FitProgress": "pnlss.fitting.settings",
            "FitSettings": "pnlss.fitting.settings",
            "ForceDropOut": "signals.sweeps",
            "ForceSurface": "response_control.force_surface",
            "FrequencyResponse": "frequency_responses",
            "FrequencyResponseMapping": "mapping.stepped_sine",
            "FrequencyResponseMatrix": "linear.response_matrix",
            "HalfPeriods": "signals.half_periods",
            "HammerTest": "hammer.result",
            "HammerTestMapping": "mapping.hammer_test",
            "Hit": "hammer.result",
            "IdentificationError": "errors",
            "IdentifiedModel": "pnlss.many",
            "InstrumentResponse": "multisine.spectra",
            "LinearModes": "linear.modes",
            "ModalAnalysis": "linear.modal_analysis",
            "ModalProperties": "prediction.properties",
            "ModeShapes": "linear.mode_shapes",
            "ModelJob": "pnlss.many",
            "MultisineDesign": "multisine.design",
            "MultisineMapping": "mapping.multisine",
            "NonlinearElement": "structured.elements",
            "NonlinearMode": "nonlinear.nonlinear_modes",
            "NonlinearModeMapping": "mapping.nonlinear_mode",
            "OutputBand": "scatter.run_scatter",
            "OutputStretch": "prediction.simulated_runs",
            "PeriodicSpectra": "multisine.spectra",
            "PeriodicVibration": "measurements",
            "PnlssErrors": "pnlss.errors",
            "PnlssFit": "pnlss.fitting.result",
            "PnlssMapping": "mapping.pnlss",
            "PnlssModel": "pnlss.model",
            "PnlssResponse": "pnlss.steady.states",
            "PredictionError": "prediction.comparison",
            "Predictions": "prediction.predictions",
            "Repeatability": "nonlinear.repeatability",
            "ResponseBand": "prediction.uncertainty",
            "ResponseMatrixMapping": "mapping.response_matrix",
            "RunScatter": "scatter.run_scatter",
            "ShortPoint": "slow_flows.short_points",
            "SimulatedRun": "prediction.simulated_runs",
            "Simulation": "pnlss.simulation",
            "SlowFlow": "slow_flows.slow_flow",
            "StabilisationDiagram": "linear.stabilisation",
            "StateSpace": "linear.subspace",
            "StateSpaceFit": "linear.state_space_fit",
            "SteadyPrediction": "prediction.steady_prediction",
            "SteadyStates": "pnlss.steady.states",
            "StructuredFit": "structured.fit",
            "StructuredModel": "structured.model",
            "SweepPrediction": "prediction.sweep_prediction",
            "TimeDataMapping": "mapping.time_data",
            "TimeRecord": "time_data.records",
            "TimeRecords": "time_data.records",
            "Transient": "signals.transients",
            "VoltagePath": "prediction.exciter",
            "VoltageSweep": "prediction.sweep_inputs",
            "best_linear_approximation": "multisine.best_linear_approximation",
            "best_linear_responses": "pnlss.best_linear",
            "bound_of": "structured.bound",
            "coherence": "multisine.best_linear_approximation",
            "combined": "nonlinear.repeatability",
            "compare": "prediction.comparison",
            "compare_sweep": "prediction.sweep_prediction",
            "continuous_backbone": "slow_flows.continuous",
            "decay_backbone": "decays.backbone",
            "decimated": "signals.decimation",
            "demodulate": "signals.transients",
            "distortion_levels": "multisine.distortion",
            "error_spectra": "pnlss.runs",
            "error_table": "prediction.comparison",
            "estimated_initial_state": "pnlss.errors",
            "extrapolated_to_zero": "linear.extrapolation",
            "fit_pnlss": "pnlss.fitting.fit",
            "fit_state_space": "linear.state_space_fit",
            "fit_structured": "structured.fit",
            "fit_with_scatter": "scatter.fit",
            "force_drop_out": "signals.sweeps",
            "force_surface": "response_control.force_surface",
            "frequency_response": "prediction.frequency_response",
            "hammer_test": "hammer.hammer_test",
            "identify_exciter": "prediction.exciter_fit",
            "identify_many": "pnlss.many",
            "identify_pnlss": "pnlss.identify",
            "linear_modes": "linear.modal_analysis",
            "linear_pnlss": "pnlss.linear_model",
            "mac": "linear.mode_shapes",
            "mac_matrix": "linear.modes",
            "map_backbone": "mapping.backbone",
            "map_hammer_test": "mapping.hammer_test",
            "map_frequency_responses": "mapping.stepped_sine",
            "map_multisine": "mapping.multisine",
            "map_nonlinear_mode": "mapping.nonlinear_mode",
            "map_pnlss": "mapping.pnlss",
            "map_response_matrix": "mapping.response_matrix",
            "map_time_data": "mapping.time_records",
            "nonlinear_mode": "nonlinear.phase_resonance",
            "output_stretch": "pnlss.runs",
            "pack_frequency_responses": "frequency_responses",
            "periodic_spectra": "multisine.spectra",
            "periodic_vibration": "signals.fourier",
            "pnlss_coupled_run": "pnlss.coupled.run",
            "pnlss_errors": "pnlss.errors",
            "pnlss_frequency_response": "pnlss.steady.response",
            "pnlss_response": "pnlss.steady.response",
            "pnlss_steady_state": "pnlss.steady.response",
            "predict_sweep": "prediction.sweeps",
            "realisation_combinations": "pnlss.many",
            "recorded_force_response": "prediction.recorded_force",
            "repeatability": "nonlinear.repeatability",
            "response_band": "prediction.uncertainty",
            "short_point": "slow_flows.short_points",
            "simulated_run": "pnlss.runs",
            "single_point_mode": "nonlinear.single_points",
            "slow_flow": "slow_flows.slow_flow",
            "stabilisation": "linear.stabilisation",
            "steady_predictions": "prediction.frequency_response",
            "stepped_sine_mode": "nonlinear.stepped_sine",
            "structured_backbone": "structured.steady.backbone",
            "structured_coupled_run": "structured.coupled.run",
            "structured_frequency_response": "structured.steady.response",
            "structured_mode": "structured.steady.mode",
            "structured_response": "structured.steady.response",
            "structured_steady_state": "structured.steady.response",
            "subspace": "linear.subspace",
            "time_experiments": "time_data.experiments",
            "time_responses": "time_data.responses",
            "time_spectra": "time_data.responses",
            "unpack_frequency_responses": "frequency_responses",
            "zero_crossings": "signals.half_periods",
        },
    )

__all__ = [
    "Backbone",
    "BackboneMapping",
    "Bound",
    "Channel",
    "Comparison",
    "ConstantForceCurve",
    "ContinuousBackbone",
    "CoupledMotion",
    "CoupledRun",
    "DecayBackbone",
    "DecayMode",
    "DistortionLevels",
    "ElementPlan",
    "ElementTrial",
    "ErrorSpectra",
    "ErrorTable",
    "Exciter",
    "Experiment",
    "ExtrapolationError",
    "Features",
    "FitHistory",
    "FitProgress",
    "FitSettings",
    "ForceDropOut",
    "ForceSurface",
    "FrequencyResponse",
    "FrequencyResponseMapping",
    "FrequencyResponseMatrix",
    "HalfPeriods",
    "HammerTest",
    "HammerTestMapping",
    "Hit",
    "IdentificationError",
    "IdentifiedModel",
    "InstrumentResponse",
    "LinearModes",
    "ModalAnalysis",
    "ModalProperties",
    "ModeShapes",
    "ModelJob",
    "MultisineDesign",
    "MultisineMapping",
    "NonlinearElement",
    "NonlinearMode",
    "NonlinearModeMapping",
    "OutputBand",
    "OutputStretch",
    "PeriodicSpectra",
    "PeriodicVibration",
    "PnlssErrors",
    "PnlssFit",
    "PnlssMapping",
    "PnlssModel",
    "PnlssResponse",
    "PredictionError",
    "Predictions",
    "Repeatability",
    "ResponseBand",
    "ResponseMatrixMapping",
    "RunScatter",
    "ShortPoint",
    "SimulatedRun",
    "Simulation",
    "SlowFlow",
    "StabilisationDiagram",
    "StateSpace",
    "StateSpaceFit",
    "SteadyPrediction",
    "SteadyStates",
    "StructuredFit",
    "StructuredModel",
    "SweepPrediction",
    "TimeDataMapping",
    "TimeRecord",
    "TimeRecords",
    "Transient",
    "VoltagePath",
    "VoltageSweep",
    "best_linear_approximation",
    "best_linear_responses",
    "bound_of",
    "coherence",
    "combined",
    "compare",
    "compare_sweep",
    "continuous_backbone",
    "decay_backbone",
    "decimated",
    "demodulate",
    "distortion_levels",
    "error_spectra",
    "error_table",
    "estimated_initial_state",
    "extrapolated_to_zero",
    "fit_pnlss",
    "fit_state_space",
    "fit_structured",
    "fit_with_scatter",
    "force_drop_out",
    "force_surface",
    "frequency_response",
    "hammer_test",
    "identify_exciter",
    "identify_many",
    "identify_pnlss",
    "linear_modes",
    "linear_pnlss",
    "mac",
    "mac_matrix",
    "map_backbone",
    "map_frequency_responses",
    "map_hammer_test",
    "map_multisine",
    "map_nonlinear_mode",
    "map_pnlss",
    "map_response_matrix",
    "map_time_data",
    "nonlinear_mode",
    "output_stretch",
    "pack_frequency_responses",
    "periodic_spectra",
    "periodic_vibration",
    "pnlss_coupled_run",
    "pnlss_errors",
    "pnlss_frequency_response",
    "pnlss_response",
    "pnlss_steady_state",
    "predict_sweep",
    "realisation_combinations",
    "recorded_force_response",
    "repeatability",
    "response_band",
    "short_point",
    "simulated_run",
    "single_point_mode",
    "slow_flow",
    "stabilisation",
    "steady_predictions",
    "stepped_sine_mode",
    "structured_backbone",
    "structured_coupled_run",
    "structured_frequency_response",
    "structured_mode",
    "structured_response",
    "structured_steady_state",
    "subspace",
    "time_experiments",
    "time_responses",
    "time_spectra",
    "unpack_frequency_responses",
    "zero_crossings",
]
