"""Recordings: a crash-safe journal while a run goes on, one HDF5 file when it ends, and the reader of both.

``journal`` writes, ``store`` turns a journal into HDF5, ``reader`` opens either, ``arrays`` keeps models and imported
measurements in the same kind of file. Only ``store``, ``reader`` and ``arrays`` need h5py, and import it on use.
"""
