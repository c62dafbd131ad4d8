"""Unmodelled laws in MuJoCo's terms: written for the rig, from the physics, without a look at `r2s2r_cli.effects`.

A law is switched on by `[effects.<id>]` in the world file. Several have another functional form than the catalogue's on
purpose: on a real robot nobody's formula holds either. What each does: docs/concepts/rig-effects.md.
"""
