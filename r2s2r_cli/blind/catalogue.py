"""The diagnoser that is on trial: `diagnose` with the whole catalogue, as `r2s2r diagnose` runs it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from r2s2r_cli.stages.diagnose.evidence import Evidence


def diagnosed(evidence: Evidence, settings: dict[str, Any]) -> dict[str, Any]:
    """The document of `diagnose --json`.

    settings: fields of `stages.diagnose.diagnose.Settings`, and `cache` (folder of compiled steps), `threads`. What to
    run next is chosen from the library that `r2s2r diagnose` has. Raises as `diagnose` does.
    """
    from r2s2r_cli.stages.diagnose.diagnose import Settings, diagnose
    from r2s2r_cli.stages.diagnose.report import diagnose_report
    from r2s2r_cli.stages.diagnose.stage import library_of

    own = dict(settings)
    cache, threads = own.pop("cache", None), int(own.pop("threads", 1))
    how = Settings(library=library_of(evidence.robot), **own)
    found = diagnose(evidence, how, cache_dir=None if cache is None else Path(cache), threads=threads)
    document: dict[str, Any] = diagnose_report(found).model_dump(mode="json")
    return document
