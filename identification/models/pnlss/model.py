"""Nonlinear state-space models in discrete time, in particular polynomial ones (PNLSS).

    x(k+1) = A x(k) + B u(k) + E phi(x(k), u(k)),    y(k) = C x(k) + D u(k) + F chi(x(k), u(k)),

Paduart et al., Automatica 46, 2010; Scheel et al., Eq. (1). `features` lists the features phi and chi.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.experiments.simulation import Simulation, use_of
from identification.linear.subspace import StateSpace
from identification.models.pnlss.features import Features
from identification.models.pnlss.kernels import Matrices, simulate, workspace
from identification.storage import stored
from identification.validation import convert_fields, finite_array, positive, read_only
from vibrolock.arrays import Float
from vibrolock.results import Result

MATRICES = ("a", "b", "e", "c", "d", "f")
"""Names of the matrices, in the order of the kernels."""
_UNBOUNDED = 1e4
"""A simulation counts as unbounded once a state exceeds this multiple of its largest value in the training data."""


def _upgrade(arrays: dict[str, NDArray[Any]], attributes: dict[str, Any]) -> None:
    """Give features a group of attributes; earlier files named their functions beside those of the model."""
    for name in ("state_features", "output_features"):
        functions = attributes.pop(f"{name}/functions", [])
        if {"a", "b"} <= arrays.keys():
            variables = arrays["a"].shape[0] + arrays["b"].shape[-1]
            attributes.setdefault(name, {"variables": variables, "functions": functions})


@stored(upgrade=_upgrade)
@dataclass(frozen=True, eq=False, kw_only=True)
class PnlssModel(Result):
    """A nonlinear state-space model, in the units of its channels.

    Raises `IdentificationError` if the matrices have NaN or infinite entries, or shapes do not agree.

    Parameters
    ----------
    a, b, e
        float[n_states, n_states], float[n_states, n_inputs], float[n_states, n_state_features].
    c, d, f
        float[n_outputs, n_states], float[n_outputs, n_inputs], float[n_outputs, n_output_features].
    state_features, output_features
        Features phi of the state equation and chi of the output equation.
    sample_rate_hz
        Sample rate of the model.
    inputs, outputs
        Input and output channels.
    state_range, input_range
        float[n_states], float[n_inputs]: largest magnitudes in the training data; NaN if unknown.
    excited_hz
        Band in which the training data was excited; None if unknown.
    training
        Names of the training experiments, one line each.
    specimen
        Name of the test specimen.
    notes
        Remarks on the model, one line each.
    """

    a: Float
    b: Float
    c: Float
    d: Float
    e: Float
    f: Float
    state_features: Features
    output_features: Features
    sample_rate_hz: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    state_range: Float
    input_range: Float
    excited_hz: tuple[float, float] | None = None
    training: tuple[str, ...] = ()
    specimen: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "inputs", "outputs", "training", "notes")
        positive("sample_rate_hz", self.sample_rate_hz, "Hz")
        for name in MATRICES:
            object.__setattr__(self, name, finite_array(name, getattr(self, name), np.float64, 2))
        convert_fields(self, read_only, "state_range", "input_range")
        n, m, outputs = self.a.shape[0], len(self.inputs), len(self.outputs)
        expected: dict[str, tuple[int, ...]] = {
            "a": (n, n),
            "b": (n, m),
            "e": (n, self.state_features.count),
            "c": (outputs, n),
            "d": (outputs, m),
            "f": (outputs, self.output_features.count),
            "state_range": (n,),
            "input_range": (m,),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise IdentificationError(f"shape {getattr(self, name).shape}", field=name, allowed=f"{shape}")
        for name, features in (("state_features", self.state_features), ("output_features", self.output_features)):
            if features.variables != n + m:
                raise IdentificationError(
                    f"are of {features.variables} variables", field=name, allowed=f"{n} states and {m} inputs"
                )

    @classmethod
    def linear(
        cls,
        matrices: StateSpace,
        *,
        sample_rate_hz: float,
        inputs: tuple[Channel, ...],
        outputs: tuple[Channel, ...],
        specimen: str = "",
        notes: tuple[str, ...] = (),
    ) -> "PnlssModel":
        """Create a linear model, without any features."""
        n, m = matrices.b.shape
        none = Features.none(n, m)
        return cls(
            **matrices._asdict(),
            e=np.zeros((n, 0)),
            f=np.zeros((len(outputs), 0)),
            state_features=none,
            output_features=none,
            sample_rate_hz=sample_rate_hz,
            inputs=inputs,
            outputs=outputs,
            state_range=np.full(n, np.nan),
            input_range=np.full(m, np.nan),
            specimen=specimen,
            notes=notes,
        )

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.a.shape[0])

    @property
    def linear_part(self) -> StateSpace:
        """The matrices A, B, C and D."""
        return StateSpace(self.a, self.b, self.c, self.d)

    @property
    def matrices(self) -> Matrices:
        """The matrices in the form that the kernels use."""
        return Matrices(*(np.ascontiguousarray(getattr(self, name)) for name in MATRICES))

    @property
    def nonlinear_coefficients(self) -> int:
        """Number of coefficients in E and F."""
        return int(self.e.size + self.f.size)

    def with_features(self, state_features: Features, output_features: Features | None = None) -> "PnlssModel":
        """Return the linear part with features whose coefficients are zero; no output features if not given."""
        chi = Features.none(self.states, len(self.inputs)) if output_features is None else output_features
        return replace(
            self,
            state_features=state_features,
            output_features=chi,
            e=np.zeros((self.states, state_features.count)),
            f=np.zeros((len(self.outputs), chi.count)),
        )

    def scaled(self, *, states: ArrayLike, inputs: ArrayLike, outputs: ArrayLike) -> "PnlssModel":
        """Return the same model for ``x / states``, ``u / inputs``, ``y / outputs`` (one scale above zero for each)."""
        sx, su, sy = (np.asarray(values, dtype=float) for values in (states, inputs, outputs))
        variables = np.concatenate([sx, su])
        phi, of_phi = self.state_features.scaled(variables)
        chi, of_chi = self.output_features.scaled(variables)
        return replace(
            self,
            a=self.a * sx / sx[:, None],
            b=self.b * su / sx[:, None],
            e=self.e * of_phi / sx[:, None],
            c=self.c * sx / sy[:, None],
            d=self.d * su / sy[:, None],
            f=self.f * of_chi / sy[:, None],
            state_features=phi,
            output_features=chi,
            state_range=self.state_range / sx,
            input_range=self.input_range / su,
        )

    def bounded(self, factor: float = 1.0) -> "PnlssModel":
        """Return the same model with monomials that clip every variable at ``factor`` times its trained range.

        Inside the trained range the model is unchanged. Beyond it the features stay finite, so a simulation stays bounded if
        the linear part is stable; it need not be accurate. Raises `IdentificationError` if the range is unknown.
        """
        limits = positive("factor", factor) * np.concatenate([self.state_range, self.input_range])
        if not np.all(np.isfinite(limits)):
            raise IdentificationError("is unknown, so the states have no limits to be held at", field="state_range")
        return replace(
            self,
            state_features=self.state_features.bounded(limits),
            output_features=self.output_features.bounded(limits),
        )

    def simulate(self, inputs: ArrayLike, *, initial_state: ArrayLike | None = None) -> Simulation:
        """Simulate the response to ``inputs`` (float[n_inputs, n]) from an initial state (float[n_states]; rest if None).

        A simulation that becomes unbounded ends at that sample, and `Simulation.unbounded_at` records it. Raises
        `IdentificationError` if values are NaN or infinite, or shapes do not agree.
        """
        u = finite_array("inputs", inputs, np.float64, 2)
        if u.shape[0] != len(self.inputs):
            raise IdentificationError(f"shape {u.shape}", field="inputs", allowed=f"{len(self.inputs)} rows")
        begin = np.zeros(self.states) if initial_state is None else initial_state
        x0 = np.array(finite_array("initial_state", begin, np.float64, 1))
        if x0.size != self.states:
            raise IdentificationError(f"has {x0.size} values", field="initial_state", allowed=self.states)
        x, y = np.empty((u.shape[1], self.states)), np.empty((u.shape[1], len(self.outputs)))
        m, tables = self.matrices, (self.state_features.table, self.output_features.table)
        count = simulate(m, *tables, np.ascontiguousarray(u.T), x0, self.bound, workspace(m), x, y)
        x[count:], y[count:] = np.nan, np.nan
        return Simulation(
            outputs=y.T,
            states=x.T,
            state_use=use_of(np.max(np.abs(x[:count]), axis=0, initial=0.0), self.state_range),
            input_use=use_of(np.max(np.abs(u), axis=1, initial=0.0), self.input_range),
            unbounded_at=None if count == u.shape[1] else int(count),
        )

    @property
    def bound(self) -> Float:
        """float[n_states]: magnitude beyond which a run counts as unbounded."""
        return np.where(np.isfinite(self.state_range) & (self.state_range > 0.0), _UNBOUNDED * self.state_range, 1e100)
