"""Compression of datasets: by LZF, which is quick, and only where it pays."""

import numpy as np

COMPRESSED: dict[str, str | bool] = {"compression": "lzf", "shuffle": True}
"""Options of a dataset that is compressed."""
_WORTH_IT = 0.6  # of its size: what stays larger when compressed is stored as it is


def shrinks(values: np.ndarray, **options: str | bool) -> bool:
    """Return whether values are worth compressing, by a trial in memory.

    Measured values are noise in their lower digits: to compress them would take longer than all else and save a third.
    """
    import h5py

    with h5py.File("in memory", "w", driver="core", backing_store=False) as trial:
        dataset = trial.create_dataset("trial", data=values, chunks=values.shape, **COMPRESSED, **options)
        trial.flush()
        return bool(dataset.id.get_storage_size() <= _WORTH_IT * values.nbytes)
