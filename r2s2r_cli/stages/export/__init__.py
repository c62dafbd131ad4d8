"""Artifacts as files that other programs read. Values in, (file name, bytes) out."""
