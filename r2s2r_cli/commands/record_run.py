"""A recording from the open port to the sealed artifact; what ends it early is raised once all is safe."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.record_journal import Recording
from r2s2r_cli.commands.record_live import Live, shown, stop_key
from r2s2r_cli.commands.record_wish import Wish, guarded, remarks
from r2s2r_cli.console import Console, PipeClosed
from r2s2r_cli.errors import HardwareError, InputError, Interrupted, R2S2RError, quoted

if TYPE_CHECKING:
    from r2s2r_cli.devices.camera import CameraFeed
    from r2s2r_cli.devices.link import LinkFacts
    from r2s2r_cli.stages.record import CameraFacts, Session
    from schemas.results import StageResult
    from schemas.results_record import RecordReport

_RIG = "rig"


def carry_out(wish: Wish, console: Console) -> None:
    """Record, seal, draw, report. Raises HardwareError or Interrupted after what there is was sealed."""
    from r2s2r_cli.hardware.signals import interrupting_signals
    from r2s2r_cli.stages.record import Session, as_run
    from r2s2r_cli.store.lock import writing

    recording = wish.recording()
    recording.require_room(force=wish.force)
    with writing(wish.project.root, wish.stage), interrupting_signals() as signals:
        ended: BaseException | None = None
        session: Session | None = None
        try:
            with ExitStack() as stack:
                feed, facts = _camera(wish.camera, stack)
                link = stack.enter_context(guarded(wish, dry_run=False))
                live = Live([len(as_run(plan, wish.robot).target) for plan in wish.runs])
                session = Session(
                    wish.runs, wish.robot, link, wish.settings, feed=feed, wall_clock=time.time, watch=live.watch,
                    begin=lambda: link.restart(time_limit=wish.settings.time_limit_s),
                )  # fmt: skip
                remarks(link.facts, console)
                kept = recording.put_aside()
                if kept is not None:
                    console.say(f"the recording that was there is kept as {kept.name}")
                stack.enter_context(stop_key(link.emergency_stop))
                stack.enter_context(shown(live, console))
                with recording.open(_streams(wish, link.facts, facts), _groups(wish, link.facts)) as journal:
                    session.record(journal.append)
        except (R2S2RError, KeyboardInterrupt) as error:
            if session is None:
                raise
            ended = error
        assert session is not None  # noqa: S101 - an error without a session was raised above
        signals.standing()
        result, trouble = _seal(wish, recording, session)
    _finish(session.report(), result, trouble, ended, console)


def _camera(spec: str | None, stack: ExitStack) -> tuple[CameraFeed | None, CameraFacts | None]:
    """The camera, open and read by a thread of its own until the stack ends. Raises CameraError, UsageError."""
    if spec is None:
        return None, None
    from r2s2r_cli.commands.cameras import camera_of
    from r2s2r_cli.hardware.camera.feed import Feed
    from r2s2r_cli.stages.record import CameraFacts

    camera = stack.enter_context(camera_of(spec))
    names = ("width", "height", "fx", "fy", "cx", "cy")
    intrinsics = {name: getattr(camera.intrinsics, name) for name in names}
    return stack.enter_context(Feed(camera)), CameraFacts(intrinsics, camera.depth_scale)


def _streams(wish: Wish, link: LinkFacts, camera: CameraFacts | None) -> list[Any]:
    from r2s2r_cli.stages.record import run_layout

    return [stream for plan in wish.runs for stream in run_layout(plan, wish.robot, link, camera)]


def _groups(wish: Wish, link: LinkFacts) -> dict[str, Mapping[str, Any]]:
    from r2s2r_cli.rig.wire.checked import FIRMWARE
    from r2s2r_cli.stages.record import place_of, run_attributes

    # By the whole name: any firmware may have "rig" in it, as `original-2.1` does.
    ours = link.device.startswith(FIRMWARE)
    rig = wish.simulated or link.lock_step or ours or (wish.camera or "").startswith("rig:")
    source = f"{wish.robot.name} at {place_of(link)}, protocol {link.protocol}"
    return {
        f"runs/{plan.name}": run_attributes(
            plan, wish.robot, origin=_RIG if rig else "robot", source=source, lock_step=link.lock_step
        )
        for plan in wish.runs
    }


def _seal(wish: Wish, recording: Recording, session: Session) -> tuple[StageResult | None, R2S2RError | None]:
    """The artifact of what was recorded, and what went wrong with it: without an artifact it is not sealed, and its
    journal stays; with one, its pictures are not drawn. Neither where nothing was recorded."""
    from r2s2r_cli.commands.record_run_pictures import draw_recorded, drawing_names
    from schemas.results import StageResult

    report = session.report()
    names = drawing_names(recording.target, report) if wish.draw else []
    again = f"r2s2r recover {quoted(f'{recording.target}.journal')}"
    try:
        sealed = recording.seal(report, session.started, names)
    except KeyboardInterrupt:  # an impatient second one
        return None, Interrupted("the recording is not sealed yet, all of it is in its journal", hint=again)
    except R2S2RError as error:
        error.what = f"what was recorded is not sealed yet: {error.what}"
        error.hint = f"{again}   # once: {error.hint}"
        return None, error
    if sealed.header is None:
        return None, None
    drawings: list[str] = []
    trouble: R2S2RError | None = None
    try:
        drawings = draw_recorded(wish.project, recording.target, report) if wish.draw else []
    except KeyboardInterrupt:
        trouble = Interrupted("the recording is sealed, its pictures are not drawn", hint="r2s2r status")
    except R2S2RError as error:
        error.what = f"the recording is sealed, its pictures are not drawn: {error.what}"
        trouble = error
    return StageResult(
        stage=wish.stage, state="done", artifact=wish.project.relative(recording.target), reasons=(), inputs=(),
        content_sha256=sealed.header.content_sha256, drawings=tuple(drawings), report=report.model_dump(mode="json"),
    ), trouble  # fmt: skip


def _finish(
    report: RecordReport, result: StageResult | None, trouble: R2S2RError | None, ended: BaseException | None,
    console: Console,
) -> None:  # fmt: skip
    """Say what there is; then raise what ended the recording early, else what went wrong with its artifact."""
    whole = ended is None and trouble is None
    try:
        _show(report, result, console, whole=whole)
    except (InputError, PipeClosed):  # stdout takes no more, which is the lesser one of two things that went wrong
        if whole:
            raise
    for run in report.runs:
        for text in run.warnings:
            console.warn(f"{run.run}: {text}")
    if ended is None and trouble is not None:
        raise trouble
    if ended is None:
        return
    if trouble is not None:
        console.warn(f"{trouble.what} ({trouble.where})" if trouble.where else trouble.what)
        console.hint(trouble.hint)
    if isinstance(ended, KeyboardInterrupt):
        kept, hint = "nothing was recorded", "r2s2r status"
        if result is not None:
            kept = "what was recorded is sealed"
        elif trouble is not None:
            kept, hint = "what was recorded is in its journal", trouble.hint
        raise Interrupted(f"the motors were told to stop; {kept}", hint=hint) from ended
    if isinstance(ended, HardwareError) and result is not None:
        ended.hint = f"{ended.hint}   # what came before is in {result.artifact}"
    raise ended


def _show(report: RecordReport, result: StageResult | None, console: Console, *, whole: bool) -> None:
    """What was recorded. whole: nothing went wrong."""
    from r2s2r_cli.commands.outcome import show_outcome
    from r2s2r_cli.views.record_page import report_tables

    if whole and result is not None:
        show_outcome(result, console)
    elif result is not None:
        console.say(f"sealed what there is: {result.artifact}")
    if report.runs:
        for table in report_tables(report):
            console.table(table.title, table.columns, table.rows)
