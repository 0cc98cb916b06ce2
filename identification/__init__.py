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
Prediction with models of any kind
    frequency_response, harmonic_response, steady_state, backbone, steady_predictions, coupled_run, response_band,
    SteadyPrediction, HarmonicResponse, SteadyStates, ResponseBand, DynamicModel, dynamic_model, Predictions
Prediction with nonlinear modes
    ModalProperties, ExtrapolationError, identify_exciter, Exciter, VoltagePath, predict_sweep, VoltageSweep,
    SweepPrediction, compare_sweep, compare, Comparison, PredictionError, error_table, recorded_force_response
Nonlinear state-space models (PNLSS)
    identify_pnlss, PnlssModel, Experiment, FitSettings, FitProgress, Features, linear_pnlss, best_linear_responses,
    fit_pnlss, PnlssFit, FitHistory, Simulation
Responses and errors of PNLSS models
    CoupledRun, simulated_run, SimulatedRun, estimated_initial_state, pnlss_errors, PnlssErrors, error_spectra,
    ErrorSpectra, output_stretch, OutputStretch, ErrorTable, identify_many, ModelJob, IdentifiedModel,
    realisation_combinations
Structured models
    fit_structured, StructuredModel, StructuredFit, NonlinearElement, ElementPlan, ElementTrial, MissingForce,
    CoupledMotion, structured_mode, bound_of, Bound
Changes from run to run
    fit_with_scatter, RunScatter, OutputBand
Measurements of others
    map_backbone, BackboneMapping, map_frequency_responses, FrequencyResponseMapping, map_hammer_test,
    HammerTestMapping, map_multisine, MultisineMapping, map_nonlinear_mode, NonlinearModeMapping, map_pnlss,
    PnlssMapping, map_response_matrix, ResponseMatrixMapping, map_time_data, TimeDataMapping, TimeRecords, TimeRecord,
    time_experiments, time_responses, time_spectra
Former names, which warn
    pnlss_frequency_response, pnlss_response, pnlss_steady_state, pnlss_coupled_run,
    structured_frequency_response, structured_response, structured_steady_state, structured_backbone,
    structured_coupled_run
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.backbones import Backbone as Backbone
    from identification.channels import Channel as Channel
    from identification.decays.backbone import decay_backbone as decay_backbone
    from identification.decays.result import DecayBackbone as DecayBackbone, DecayMode as DecayMode
    from identification.deprecated import (
        pnlss_coupled_run as pnlss_coupled_run,
        pnlss_frequency_response as pnlss_frequency_response,
        pnlss_response as pnlss_response,
        pnlss_steady_state as pnlss_steady_state,
        structured_backbone as structured_backbone,
        structured_coupled_run as structured_coupled_run,
        structured_frequency_response as structured_frequency_response,
        structured_response as structured_response,
        structured_steady_state as structured_steady_state,
    )
    from identification.errors import (
        ExtrapolationError as ExtrapolationError,
        IdentificationError as IdentificationError,
    )
    from identification.exciter_coupling.exciter import Exciter as Exciter, VoltagePath as VoltagePath
    from identification.exciter_coupling.exciter_fit import identify_exciter as identify_exciter
    from identification.experiments.errors import PnlssErrors as PnlssErrors
    from identification.experiments.experiment import Experiment as Experiment
    from identification.experiments.simulation import Simulation as Simulation
    from identification.experiments.time_experiments import time_experiments as time_experiments
    from identification.experiments.time_records import TimeRecord as TimeRecord, TimeRecords as TimeRecords
    from identification.experiments.time_responses import time_responses as time_responses, time_spectra as time_spectra
    from identification.fitting.result import FitProgress as FitProgress
    from identification.frequency_responses import (
        FrequencyResponse as FrequencyResponse,
        pack_frequency_responses as pack_frequency_responses,
        unpack_frequency_responses as unpack_frequency_responses,
    )
    from identification.hammer.hammer_test import hammer_test as hammer_test
    from identification.hammer.result import HammerTest as HammerTest, Hit as Hit
    from identification.harmonic_balance.states import (
        HarmonicResponse as HarmonicResponse,
        SteadyStates as SteadyStates,
    )
    from identification.linear.extrapolation import extrapolated_to_zero as extrapolated_to_zero
    from identification.linear.modal_analysis import ModalAnalysis as ModalAnalysis, linear_modes as linear_modes
    from identification.linear.mode_shapes import ModeShapes as ModeShapes, mac as mac
    from identification.linear.modes import LinearModes as LinearModes, mac_matrix as mac_matrix
    from identification.linear.response_matrix import FrequencyResponseMatrix as FrequencyResponseMatrix
    from identification.linear.stabilisation import (
        StabilisationDiagram as StabilisationDiagram,
        stabilisation as stabilisation,
    )
    from identification.linear.state_space_fit import StateSpaceFit as StateSpaceFit, fit_state_space as fit_state_space
    from identification.linear.subspace import StateSpace as StateSpace, subspace as subspace
    from identification.mapping.backbone import BackboneMapping as BackboneMapping, map_backbone as map_backbone
    from identification.mapping.hammer_test import (
        HammerTestMapping as HammerTestMapping,
        map_hammer_test as map_hammer_test,
    )
    from identification.mapping.multisine import MultisineMapping as MultisineMapping, map_multisine as map_multisine
    from identification.mapping.nonlinear_mode import (
        NonlinearModeMapping as NonlinearModeMapping,
        map_nonlinear_mode as map_nonlinear_mode,
    )
    from identification.mapping.pnlss import PnlssMapping as PnlssMapping, map_pnlss as map_pnlss
    from identification.mapping.response_matrix import (
        ResponseMatrixMapping as ResponseMatrixMapping,
        map_response_matrix as map_response_matrix,
    )
    from identification.mapping.stepped_sine import (
        FrequencyResponseMapping as FrequencyResponseMapping,
        map_frequency_responses as map_frequency_responses,
    )
    from identification.mapping.time_data import TimeDataMapping as TimeDataMapping
    from identification.mapping.time_records import map_time_data as map_time_data
    from identification.measurements import PeriodicVibration as PeriodicVibration
    from identification.models.dynamic_model import DynamicModel as DynamicModel, dynamic_model as dynamic_model
    from identification.models.modal.properties import ModalProperties as ModalProperties
    from identification.models.modal.recorded_force import recorded_force_response as recorded_force_response
    from identification.models.modal.sweep_inputs import VoltageSweep as VoltageSweep
    from identification.models.modal.sweep_prediction import (
        SweepPrediction as SweepPrediction,
        compare_sweep as compare_sweep,
    )
    from identification.models.modal.sweeps import predict_sweep as predict_sweep
    from identification.models.pnlss.best_linear import best_linear_responses as best_linear_responses
    from identification.models.pnlss.coupled import CoupledRun as CoupledRun
    from identification.models.pnlss.error_table import ErrorTable as ErrorTable
    from identification.models.pnlss.errors import (
        estimated_initial_state as estimated_initial_state,
        pnlss_errors as pnlss_errors,
    )
    from identification.models.pnlss.features import Features as Features
    from identification.models.pnlss.fitting.fit import fit_pnlss as fit_pnlss
    from identification.models.pnlss.fitting.result import (
        FitHistory as FitHistory,
        FitSettings as FitSettings,
        PnlssFit as PnlssFit,
    )
    from identification.models.pnlss.identify import identify_pnlss as identify_pnlss
    from identification.models.pnlss.linear_model import linear_pnlss as linear_pnlss
    from identification.models.pnlss.many import (
        IdentifiedModel as IdentifiedModel,
        ModelJob as ModelJob,
        identify_many as identify_many,
        realisation_combinations as realisation_combinations,
    )
    from identification.models.pnlss.model import PnlssModel as PnlssModel
    from identification.models.predictions import Predictions as Predictions
    from identification.models.responses import (
        backbone as backbone,
        coupled_run as coupled_run,
        frequency_response as frequency_response,
        harmonic_response as harmonic_response,
        response_band as response_band,
        steady_predictions as steady_predictions,
        steady_state as steady_state,
    )
    from identification.models.simulated_runs import (
        error_spectra as error_spectra,
        output_stretch as output_stretch,
        simulated_run as simulated_run,
    )
    from identification.models.structured.bound import Bound as Bound, bound_of as bound_of
    from identification.models.structured.coupled import CoupledMotion as CoupledMotion
    from identification.models.structured.element_trials import ElementPlan as ElementPlan, ElementTrial as ElementTrial
    from identification.models.structured.elements import NonlinearElement as NonlinearElement
    from identification.models.structured.fit import StructuredFit as StructuredFit, fit_structured as fit_structured
    from identification.models.structured.missing import MissingForce as MissingForce
    from identification.models.structured.mode import structured_mode as structured_mode
    from identification.models.structured.model import StructuredModel as StructuredModel
    from identification.multisine.best_linear_approximation import (
        best_linear_approximation as best_linear_approximation,
        coherence as coherence,
    )
    from identification.multisine.design import MultisineDesign as MultisineDesign
    from identification.multisine.distortion import (
        DistortionLevels as DistortionLevels,
        distortion_levels as distortion_levels,
    )
    from identification.multisine.spectra import (
        InstrumentResponse as InstrumentResponse,
        PeriodicSpectra as PeriodicSpectra,
        periodic_spectra as periodic_spectra,
    )
    from identification.nonlinear.nonlinear_modes import NonlinearMode as NonlinearMode
    from identification.nonlinear.phase_resonance import nonlinear_mode as nonlinear_mode
    from identification.nonlinear.repeatability import (
        Repeatability as Repeatability,
        combined as combined,
        repeatability as repeatability,
    )
    from identification.nonlinear.single_points import single_point_mode as single_point_mode
    from identification.nonlinear.stepped_sine import stepped_sine_mode as stepped_sine_mode
    from identification.prediction.comparison import (
        Comparison as Comparison,
        PredictionError as PredictionError,
        compare as compare,
        error_table as error_table,
    )
    from identification.prediction.simulated_runs import (
        ErrorSpectra as ErrorSpectra,
        OutputStretch as OutputStretch,
        SimulatedRun as SimulatedRun,
    )
    from identification.prediction.steady_prediction import (
        ResponseBand as ResponseBand,
        SteadyPrediction as SteadyPrediction,
    )
    from identification.response_control.curves import ConstantForceCurve as ConstantForceCurve
    from identification.response_control.force_surface import (
        ForceSurface as ForceSurface,
        force_surface as force_surface,
    )
    from identification.scatter.fit import fit_with_scatter as fit_with_scatter
    from identification.scatter.run_scatter import OutputBand as OutputBand, RunScatter as RunScatter
    from identification.signals.decimation import decimated as decimated
    from identification.signals.fourier import periodic_vibration as periodic_vibration
    from identification.signals.half_periods import HalfPeriods as HalfPeriods, zero_crossings as zero_crossings
    from identification.signals.sweeps import ForceDropOut as ForceDropOut, force_drop_out as force_drop_out
    from identification.signals.transients import Transient as Transient, demodulate as demodulate
    from identification.slow_flows.continuous import (
        ContinuousBackbone as ContinuousBackbone,
        continuous_backbone as continuous_backbone,
    )
    from identification.slow_flows.short_points import ShortPoint as ShortPoint, short_point as short_point
    from identification.slow_flows.slow_flow import SlowFlow as SlowFlow, slow_flow as slow_flow
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
