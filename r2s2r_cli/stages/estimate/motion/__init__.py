"""The motion back end of the camera tracker: from sightings of caps and lengths of cables to states.

`Forward` (forward.py) predicts where the caps are while the images are read; `label` (labels.py) tells which blob is
which cap; `smooth_run` (smooth_run.py) makes the states of the whole run from the stored sightings.
"""
