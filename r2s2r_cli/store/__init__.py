"""The project on disk: the only code that touches it, and the only importer of h5py.

Light (no h5py): `project`, `header`, `toml`, `staleness`, `lock`, `atomic`, `provenance`.
Heavy (numpy, h5py): everything else.
"""
