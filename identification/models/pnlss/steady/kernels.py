"""Compiled values and derivatives of a nonlinear state-space model along a period."""

import numpy as np

from identification.models.pnlss.kernels import (
    Matrices,
    Table,
    feature_derivatives,
    feature_values,
    outputs_at,
    state_after,
)
from vibrolock.compiled import kernel


@kernel
def along_period(
    m: Matrices,
    state_table: Table,
    output_table: Table,
    v: np.ndarray,
    features: np.ndarray,
    slope: np.ndarray,
    steep: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    x_slope: np.ndarray,
    y_slope: np.ndarray,
) -> None:
    """Evaluate the model at ``v`` (float[n, n_variables]): next states ``x`` (float[n, n_states]), outputs ``y``, derivatives.

    ``x_slope`` (float[n, n_states, n_variables]) and ``y_slope`` (float[n, n_outputs, n_variables]) are derivatives with
    respect to v. ``features``, ``slope`` (float[n_features, n_variables]) and ``steep`` are work arrays, sized for the longer
    table.
    """
    states, variables = m.a.shape[0], v.shape[1]
    phi, chi = m.e.shape[1], m.f.shape[1]
    for k in range(v.shape[0]):
        feature_values(state_table, v[k], features[:phi])
        state_after(m, features[:phi], v[k], x[k])
        feature_derivatives(state_table, v[k], slope[:phi], steep)
        for i in range(states):
            for j in range(variables):
                total = m.a[i, j] if j < states else m.b[i, j - states]
                for feature in range(phi):
                    total += m.e[i, feature] * slope[feature, j]
                x_slope[k, i, j] = total
        feature_values(output_table, v[k], features[:chi])
        outputs_at(m, features[:chi], v[k], y[k])
        feature_derivatives(output_table, v[k], slope[:chi], steep)
        for i in range(m.c.shape[0]):
            for j in range(variables):
                total = m.c[i, j] if j < states else m.d[i, j - states]
                for feature in range(chi):
                    total += m.f[i, feature] * slope[feature, j]
                y_slope[k, i, j] = total
