"""Ports and cameras: the only package that touches them. Values in SI on our side, pF and counts at the border."""
