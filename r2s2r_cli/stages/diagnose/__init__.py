"""`diagnose`: where the gap lies, which unmodelled effect causes it, how far it shrinks once that is simulated."""
