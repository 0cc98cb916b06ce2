"""Recordings: a crash-safe journal while a run goes on, one HDF5 file when it ends, and the reader of both.

``journal`` writes while the run goes on, ``conversion`` turns a journal into HDF5, ``reader`` opens either, ``arrays`` keeps
models and imported measurements in the same kind of file. h5py is imported when an HDF5 file is first opened.
"""
