import numpy as np

from vibrolock.compiled import kernel
from vibrolock.lanes import greatest, least, load, spread, store
from vibrolock.width import WIDTH


@kernel
def mixture(a: np.ndarray, b: np.ndarray, factor: float, out: np.ndarray) -> None:
    for k in range(0, a.size, WIDTH):
        x, y = load(a, k), load(b, k)
        store(out, k, greatest(least(x * spread(factor) - y, y + x), x))


def test_lanes_do_what_numpy_does_to_the_last_bit() -> None:
    random = np.random.default_rng(3)
    a, b = random.normal(size=(2, 5 * WIDTH))
    out = np.zeros_like(a)
    mixture(a, b, 1.7, out)
    assert np.array_equal(out, np.maximum(np.minimum(a * 1.7 - b, b + a), a))


def test_arrays_of_more_dimensions_are_counted_flat_and_need_no_alignment() -> None:
    random = np.random.default_rng(4)
    whole = random.normal(size=3 * WIDTH + 1)
    a = whole[1:].reshape(3, WIDTH)
    out = np.zeros(3 * WIDTH + 1)[1:].reshape(3, WIDTH)
    mixture(a, a, 0.3, out)
    assert np.array_equal(out, np.maximum(np.minimum(a * 0.3 - a, a + a), a))


@kernel
def clipped(a: np.ndarray, limit: float, out: np.ndarray) -> None:
    store(out, 0, greatest(least(load(a, 0), spread(limit)), spread(-limit)))


def test_what_is_not_a_number_is_replaced_by_the_second_argument() -> None:
    a, out = np.arange(float(WIDTH)), np.zeros(WIDTH)
    a[3] = np.nan
    clipped(a, 4.0, out)
    assert out.tolist() == [0.0, 1.0, 2.0, 4.0, *[4.0] * (WIDTH - 4)]
