"""One file a step: `<kind>_<n>_to_<n+1>.py` with one pure function from the old groups to the new.

A step that was released is never edited. It is named in `MIGRATIONS` of schemas/versions.py.
"""
