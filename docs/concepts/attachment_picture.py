"""Draws docs/concepts/attachment.png: `.venv/bin/python docs/concepts/attachment_picture.py`."""

from pathlib import Path

from r2s2r_cli.stages.init.attachment import MODES, attach, paper_labels, site_points
from r2s2r_cli.stages.init.robots import robot_facts
from r2s2r_cli.views.attachment import attachment_png

TITLES = {"surface": "surface (the paper)", "rod_end": "rod_end (NTRT)"}

facts = robot_facts("threebar")
p_WE, radius = facts.rest_caps(), facts.cap_radius.value
found = {mode: attach(p_WE, facts.cables, radius, mode, guides=facts.guides) for mode in MODES}
panels = {TITLES[mode]: site_points(p_WE, facts.cables, a.sites, a.R_WR) for mode, a in found.items()}
labels = paper_labels(found["surface"], facts.cables)
png = attachment_png(p_WE, facts.cables, len(facts.actuated), radius, panels, labels)
Path(__file__).with_name("attachment.png").write_bytes(png)
