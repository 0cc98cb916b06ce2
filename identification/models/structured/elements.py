"""Nonlinear elements of a structured model: laws along a direction in the space of the modes, and their tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError
from identification.models.structured.laws import Damper, Joint, Law, Spring
from identification.storage import stored
from identification.validation import convert_fields, finite_array, positive
from vibrolock.arrays import Complex, Float

NODES = 513
"""Nodes of a table. Between them a cubic follows a polynomial of degree 5 to 1e-8 of its largest force."""
_DELTA = 1e-5
"""Distance of the two forces that give the slope at a node, relative to the reach."""
_NUDGE = 1e-4
"""Step of the central differences by the numbers of a law; exact where the law is linear in them, else 1e-8."""


@stored(inline=("direction",))
@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearElement:
    """Springs, dampers and joints that act on one displacement.

    With the element's displacement ``z = direction . q`` relative to its scale, ``x = z / scale_m``, the forces of all laws
    add up (`laws`). Beyond ``|x| = reach`` dampers stay constant, and springs go on as straight lines
    with the mean slope of both ends, within limits that `StructuredModel` states.

    Raises `IdentificationError` if a number is not finite, a damping is below zero, there is no law, or scale or reach are not
    above zero.

    Parameters
    ----------
    direction
        float[n_modes], displacement of the element per modal coordinate, kg^-1/2.
    scale_m
        Displacement for which x is 1.
    laws
        Springs, dampers and joints.
    reach
        Largest ``|x|`` of springs and dampers.
    largest
        Largest ``|x|`` in the training data; None if unknown.
    driven
        How far the forces of the training data drive the element (`trained_range.driven`), over ``largest``; None if unknown.
    between
        Outputs between which, or at which, the element acts; empty if its direction was found.
    """

    direction: Float
    scale_m: float
    laws: tuple[Law, ...]
    reach: float = 3.0
    largest: float | None = None
    driven: float | None = None
    between: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", finite_array("element: direction", self.direction, np.float64, 1))
        convert_fields(self, tuple, "laws", "between")
        for name in ("scale_m", "reach"):
            object.__setattr__(self, name, positive(f"element: {name}", getattr(self, name)))
        for name in ("largest", "driven"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, float(getattr(self, name)))
        IdentificationError.raise_if(not self.laws, "laws is empty", field="element", allowed="one at least")

    @property
    def phi(self) -> Float:
        """float[n_modes]: x per modal coordinate, kg^-1/2 m^-1."""
        return np.asarray(self.direction / self.scale_m)

    @property
    def at_rest(self) -> tuple[float, float]:
        """Stiffness (J) and damping (J s) for small x, with all sliders stuck but those of dry friction."""
        near = _DELTA * self.reach
        slope = sum(
            float(np.diff(one.force(np.array([-near, near])))[0]) for one in self.laws if isinstance(one, Spring)
        )
        damping = sum(float(one.damping(np.zeros(1))[0]) for one in self.laws if isinstance(one, Damper))
        stuck = float(np.sum(self.sliders([law for law in self.laws if isinstance(law, Joint) and law.sticks])[:, 0]))
        return slope * self.scale_m / (2.0 * near) + stuck, damping * self.scale_m**2

    @property
    def nodes(self) -> Float:
        """float[NODES]: the displacements x of the tables."""
        return np.linspace(-self.reach, self.reach, NODES)

    def spring(self, laws: Sequence[Law]) -> Float:
        """float[3, NODES]: force (J), slope times distance of the nodes (J) and potential (J) of the springs among ``laws``."""
        table, x = np.zeros((3, NODES)), self.nodes
        distance, near = 2.0 * self.reach / (NODES - 1), _DELTA * self.reach
        for law in laws:
            if isinstance(law, Spring):
                table[0] += law.force(x)
                table[1] += (law.force(x + near) - law.force(x - near)) * (0.5 * distance / near)
        force, slope = table[:2]
        cells = distance * (0.5 * (force[1:] + force[:-1]) + (slope[:-1] - slope[1:]) / 12.0)
        middle = NODES // 2
        table[2, middle + 1 :] = np.cumsum(cells[middle:])
        table[2, :middle] = -np.cumsum(cells[:middle][::-1])[::-1]
        return np.asarray(table * self.scale_m)

    def damper(self, laws: Sequence[Law]) -> Float:
        """float[NODES]: damping of the dampers among ``laws``, J s."""
        found = np.zeros(NODES)
        for law in laws:
            if isinstance(law, Damper):
                found = found + law.damping(self.nodes)
        return np.asarray(found * self.scale_m**2)

    def sliders(self, laws: Sequence[Law]) -> Float:
        """float[n_sliders, 2]: stiffness and largest force of the sliders of the joints among ``laws``, J."""
        found = [law.sliders().T for law in laws if isinstance(law, Joint)]
        return np.concatenate([np.zeros((0, 2)), *found]) * self.scale_m

    def bends(self, laws: Sequence[Law], step_s: float = 0.0) -> Float:
        """float[n_sliders, 3]: yield force (J), exponent and ratio of the same; zeros for a Jenkins slider.

        Speeds of dry friction become ways of a step; without a step it is that at rest.
        """
        found = np.concatenate([np.zeros((0, 3)), *(law.bends().T for law in laws if isinstance(law, Joint))])
        found[found[:, 1] < 0.0, 2] *= step_s
        return np.asarray(found * [self.scale_m, 1.0, 1.0])


class Tables(NamedTuple):
    """What the kernels know of all elements."""

    springs: np.ndarray
    """float[n_elements, 3, NODES]."""
    dampers: np.ndarray
    """float[n_elements, NODES]."""
    limits: np.ndarray
    """float[n_elements, 3]: reach, and slopes of the springs below and above it."""
    sliders: np.ndarray
    """float[n_sliders, 2]: stiffness and largest force."""
    bends: np.ndarray
    """float[n_sliders, 3]: yield force, exponent and ratio of a hysteresis; zeros for Jenkins, an exponent of -1 between
    sliding force and way of a step at Stribeck's speed for dry friction."""
    first: np.ndarray
    """int[n_elements + 1]: first slider of every element."""
    bent: np.ndarray
    """bool[n_elements]: whether an element has other joints than Jenkins sliders."""


class DerivativeTables(NamedTuple):
    """Derivatives of `Tables` by the numbers of the laws: first those of all springs, then of dampers, then of joints."""

    element: np.ndarray
    """int[P]: element of each number."""
    springs: np.ndarray
    """float[P_springs, 3, NODES]."""
    limits: np.ndarray
    """float[P_springs, 3]: the reach, and derivatives of the slopes."""
    dampers: np.ndarray
    """float[P_dampers, NODES]."""
    sliders: np.ndarray
    """float[P_joints, n_sliders, 2]."""
    bends: np.ndarray
    """float[P_joints, n_sliders, 3]."""
    first: np.ndarray
    """int[P_joints]: first slider that a number changes."""
    last: np.ndarray
    """int[P_joints]: end of the sliders that it changes."""


def tables_of(elements: Sequence[NonlinearElement], softest: Float, stiffest: Float, step_s: float) -> Tables:
    """Return the tables for steps of ``step_s``.

    ``softest`` and ``stiffest``, float[n_elements], limit the slopes (J) beyond the reach.
    """
    springs = np.array([element.spring(element.laws) for element in elements]).reshape(-1, 3, NODES)
    sliders = [element.sliders(element.laws) for element in elements]
    limits = [
        [element.reach, *np.repeat(np.clip(_end_slope(element, table), least, most), 2)]
        for element, table, least, most in zip(elements, springs, softest, stiffest, strict=True)
    ]
    return Tables(
        springs=springs,
        dampers=np.array([element.damper(element.laws) for element in elements]).reshape(-1, NODES),
        limits=np.array(limits).reshape(-1, 3),
        sliders=np.concatenate([np.zeros((0, 2)), *sliders]),
        bends=np.concatenate([np.zeros((0, 3)), *(element.bends(element.laws, step_s) for element in elements)]),
        first=np.cumsum([0, *map(len, sliders)]),
        bent=np.array([bool(np.any(element.bends(element.laws))) for element in elements], dtype=np.bool_),
    )


def _end_slope(element: NonlinearElement, table: Float) -> float:
    return float(np.mean(table[1, [0, -1]]) * (NODES - 1) / (2.0 * element.reach))


def laws_in_order(elements: Sequence[NonlinearElement]) -> list[tuple[int, int]]:
    """Elements and laws in the order of their numbers: springs, then dampers, then joints."""
    return [
        (e, number)
        for family in (Spring, Damper, Joint)
        for e, element in enumerate(elements)
        for number, law in enumerate(element.laws)
        if isinstance(law, family)
    ]


def derivative_tables_of(elements: Sequence[NonlinearElement], tables: Tables, step_s: float) -> DerivativeTables:
    """Return the derivatives of `tables_of` by the numbers of the laws."""
    owner, springs, limits, dampers, joints = [], [], [], [], []
    for e, number in laws_in_order(elements):
        element, law = elements[e], elements[e].laws[number]
        begin = int(tables.first[e]) + sum(len(element.sliders([other])) for other in element.laws[:number])
        for k in range(law.vector.size):
            step = _NUDGE * np.eye(law.vector.size)[k]
            less, more = law.moved(law.vector - step), law.moved(law.vector + step)
            owner.append(e)
            if isinstance(law, Spring):
                change = (element.spring([more]) - element.spring([less])) / (2.0 * _NUDGE)
                inside = np.isclose(_end_slope(element, tables.springs[e]), tables.limits[e, 1], rtol=1e-12, atol=0.0)
                springs.append(change)
                limits.append([element.reach, *np.repeat(_end_slope(element, change) * inside, 2)])
            elif isinstance(law, Damper):
                dampers.append(
                    (element.damper([more]) - element.damper([law])) / _NUDGE
                )  # linear; less may be below zero
            else:
                way = float(more.vector[k] - less.vector[k])  # less may be at its bound
                rows = [np.hstack([element.sliders([one]), element.bends([one], step_s)]) for one in (more, less)]
                change = np.zeros((len(tables.sliders), 5))
                change[begin : begin + len(rows[0])] = (rows[0] - rows[1]) / way
                joints.append(change)
    by_slider = np.array(joints).reshape(len(joints), len(tables.sliders), 5)
    changed = np.any(by_slider != 0.0, axis=2)
    return DerivativeTables(
        element=np.array(owner, dtype=np.int64),
        springs=np.array(springs).reshape(-1, 3, NODES),
        limits=np.array(limits).reshape(-1, 3),
        dampers=np.array(dampers).reshape(-1, NODES),
        sliders=np.ascontiguousarray(by_slider[..., :2]),
        bends=np.ascontiguousarray(by_slider[..., 2:]),
        first=np.argmax(changed, axis=1) if joints else np.zeros(0, dtype=np.int64),
        last=changed.shape[1] - np.argmax(changed[:, ::-1], axis=1) if joints else np.zeros(0, dtype=np.int64),
    )


def at_rest(omega: Float, zeta: Float, elements: Sequence[NonlinearElement]) -> tuple[Float, Float]:
    """Return the matrices of stiffness and damping of small vibrations in modal coordinates, float[n, n] each.

    ``omega`` (rad/s) and ``zeta``, float[n], are those of the linear part. The support is left out.
    """
    phi = np.array([element.phi for element in elements]).reshape(len(elements), len(omega))
    slope, loss = np.array([element.at_rest for element in elements]).reshape(len(elements), 2).T
    return np.diag(omega**2) + (phi.T * slope) @ phi, np.diag(2.0 * zeta * omega) + (phi.T * loss) @ phi


def small_vibrations(omega: Float, zeta: Float, elements: Sequence[NonlinearElement]) -> tuple[Complex, Float]:
    """Return poles (rad/s, upper half, lowest first) and shapes without damping in modal coordinates, float[n, n] by columns.

    Arguments are those of `at_rest`. Raises `IdentificationError` if a mode does not oscillate and fade.
    """
    n = len(omega)
    stiffness, damping = at_rest(omega, zeta, elements)
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]]))
    poles = poles[poles.imag > 0.0]
    if len(poles) < n or np.any(poles.real >= 0.0):
        raise IdentificationError(
            "at rest a mode does not oscillate and fade; there are no small vibrations", field="elements"
        )
    return poles[np.argsort(np.abs(poles))], np.asarray(np.linalg.eigh(stiffness)[1])
