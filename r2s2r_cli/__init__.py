"""r2s2r: close the gap between a cable-driven robot and its simulator, and say what causes the rest."""

__version__ = "0.1.0"
