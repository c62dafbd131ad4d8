"""Blind trials of `diagnose`: worlds that the diagnoser cannot look into, its verdicts on them, and the score.

`make` (a process of its own, the only part that knows the rig) writes sets of logs and, apart from them, encrypted
labels; `run` turns the logs into verdicts; `score` alone opens the labels. docs/concepts/blind-trials.md.
"""
