"""Pictures and pages, drawn from values: arrays in, PNG or HTML bytes out. matplotlib and jinja2 inside functions."""
