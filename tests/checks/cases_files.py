"""Files, form and links."""

from __future__ import annotations

import dataclasses

import numpy as np

from r2s2r_cli.artifact import Blobs
from r2s2r_cli.checks.subjects import Content, Difference, InputState, Journals, Links, Reading
from r2s2r_cli.errors import ArtifactError, InputError
from schemas.header import InputRef
from tests.checks.case import Case, Edge
from tests.support.check_subjects import SHA, content, edited_content, header, links, put

OTHER = "b" * 64
SOURCE = InputRef(path="crawl.csv", kind="file", sha256=SHA)
ARTIFACT = InputRef(path="iterations/001/10-record.h5", kind="recording", schema_version=1, sha256=SHA)
PLAN = InputRef(path="iterations/001/40-plan.h5", kind="plan", schema_version=1, sha256=SHA)
MISSING = ArtifactError("there is no such file", where="a.h5", expected="an artifact", received="", hint="ls -la '.'")
NEWER = ArtifactError("this version cannot be read", where="a.h5", expected="version 1", received="7", hint="pip")
LIBRARY = ArtifactError("the file's structure is damaged", where="a.h5", expected="an intact artifact",
                        received="Can't open object (addr overflow, addr = 8)", hint="r2s2r validate")  # fmt: skip
WRONG = InputError("the value is not allowed", where="a.h5, key rods.0.length_m", expected="at most 20 m",
                   received="325", hint="correct it")  # fmt: skip
FILTER = Difference("/runs/a/caps/t", "a checksum does not match", "1234",
                    "Can't synchronously read data (filter returned failure during read)")  # fmt: skip
DAMAGE = Difference("/runs/a/caps/t", "the data changed after sealing", "1234", "5678")


def _made(**changes: object) -> Links:
    head = header()
    made = head.provenance.model_copy(update=changes)
    body = {f"provenance/{key}": value for key, value in made.model_dump(mode="json").items()}
    return links(header=head.model_copy(update={"provenance": made}), body={**links().body, **body})


FAILS: tuple[Case, ...] = (
    Case(
        "file_opens",
        lambda: Reading(refused=(MISSING,)),
        (("", "there is no such file", "an artifact", ""),),
    ),
    Case(
        "file_opens",
        lambda: Reading(refused=(LIBRARY,)),
        (("", "the file's structure is damaged", "an intact artifact", "bytes from which no HDF5 object can be made"),),
    ),
    Case(
        "content_intact",
        lambda: Reading(damage=(FILTER,)),
        (("runs/a/caps/t", "a checksum does not match", "1234", "bytes that do not match their checksum"),),
    ),
    Case(
        "values_allowed",
        lambda: Reading(wrong=(WRONG,)),
        (("key rods.0.length_m", "the value is not allowed", "at most 20 m", "325"),),
    ),
    Case(
        "version_known",
        lambda: Reading(refused=(NEWER,), newer=True),
        (("", "this version cannot be read", "version 1", "7"),),
    ),
    Case(
        "content_intact",
        lambda: Reading(damage=(DAMAGE,)),
        (("runs/a/caps/t", "the data changed after sealing", "1234", "5678"),),
    ),
    Case(
        "bytes_intact",
        lambda: Reading(unread_bytes=True),
        (("", "bytes changed that nothing reads; the content hash still holds", "the sealed bytes", "others"),),
    ),
    Case(
        "layout_matches",
        lambda: dataclasses.replace(content(), layout=(DAMAGE,)),
        (("runs/a/caps/t", "the data changed after sealing", "1234", "5678"),),
    ),
    Case(
        "values_finite",
        lambda: edited_content(content(), "runs/a/caps/t", put(3, np.nan)),
        (("runs/a/caps/t", "a value is not finite", "finite numbers", "nan at t_caps 3"),),
    ),
    Case(
        "values_finite",
        lambda: edited_content(content(), "runs/a/caps/p_WE", put((3, 2, 1), np.inf)),
        (
            (
                "runs/a/caps/p_WE",
                "a value is not finite",
                "finite, or NaN for 'not observed'",
                "inf at t_caps 3, cap 2, xyz 1",
            ),
        ),
    ),
    Case(
        "codes_known",
        lambda: edited_content(content(), "runs/a/caps/drop_reason", put(slice(3, 5), 9)),
        (
            (
                "runs/a/caps/drop_reason",
                "a code has no meaning",
                "0 kept, 1 duplicate, 2 time runs backwards, 3 not observed",
                "9 at t_caps 3 (and 1 more)",
            ),
        ),
    ),
    Case(
        "text_readable",
        lambda: edited_content(_calibration(), "lines/name", np.array([b"old", b"\xff\xfe"])),
        (("lines/name", "a text is not UTF-8", "UTF-8", "b'\\xff\\xfe' in row 1: invalid start byte"),),
    ),
    Case(
        "images_begin_right",
        lambda: edited_content(content(), "runs/a/camera/color", Blobs([b"\xff\xd8\xff\xe0", b"", b"GIF89a"], 3)),
        (
            (
                "runs/a/camera/color",
                "an image is neither PNG nor JPEG",
                "PNG or JPEG",
                "an empty one at frame 1 (and 1 more)",
            ),
        ),
    ),
    Case(
        "head_matches_body",
        lambda: links(body={**links().body, "kind": "estimate", "provenance/seed": 7}),
        (
            ("kind", "the head of the file and its body differ", "recording", "estimate"),
            ("provenance/seed", "the head of the file and its body differ", "nothing", "7"),
        ),
    ),
    Case(
        "inputs_match",
        lambda: links(inputs=(InputState(ARTIFACT, OTHER),)),
        (
            (
                "provenance/inputs",
                "input iterations/001/10-record.h5 changed: its content hash is another",
                "sha256 aaaaaaaaaaaaaaaa, as it was",
                "sha256 bbbbbbbbbbbbbbbb",
            ),
        ),
    ),
    Case(
        "inputs_match",
        lambda: links(inputs=(InputState(ARTIFACT, None, "there is no such file"),)),
        (
            (
                "provenance/inputs",
                "an artifact that it was made from cannot be read",
                "iterations/001/10-record.h5",
                "there is no such file",
            ),
        ),
    ),
    Case(
        "plan_is_the_executed",
        lambda: dataclasses.replace(_made(stage="execute"), inputs=(InputState(PLAN, OTHER),)),
        (
            (
                "provenance/inputs",
                "recorded under an older iterations/001/40-plan.h5: what the robot did stays what it did",
                "sha256 aaaaaaaaaaaaaaaa, as it was",
                "sha256 bbbbbbbbbbbbbbbb",
            ),
        ),
    ),
    Case(
        "source_unchanged",
        lambda: links(inputs=(InputState(SOURCE, OTHER),)),
        (
            (
                "provenance/inputs",
                "the source crawl.csv has changed since it was read",
                "aaaaaaaaaaaaaaaa",
                "bbbbbbbbbbbbbbbb",
            ),
        ),
    ),
    Case(
        "robot_is_the_projects",
        lambda: links(robots={"runs/a": "sixbar", "runs/b": "threebar"}),
        (("runs/a@robot", "the data are of another robot", "threebar", "sixbar"),),
    ),
    Case(
        "stage_not_newer",
        lambda: _made(stage_version=3),
        (("provenance/stage_version", "stage import of a newer r2s2r made it", "at most 1", "3"),),
    ),
    Case(
        "name_fits_kind",
        lambda: links(filename="20-estimate.h5"),
        (("kind", "the file has the name of another kind", "estimate in 20-estimate.h5", "recording"),),
    ),
    Case(
        "recordings_sealed",
        lambda: Journals(("iterations/001/10-record.journal",)),
        (
            (
                "iterations/001/10-record.journal",
                "a recording was cut off before it was sealed",
                "an artifact",
                "its journal",
            ),
        ),
    ),
)

EDGES: tuple[Edge, ...] = (
    Edge("bytes_intact", "damage says it all", lambda: Reading(damage=(DAMAGE,), unread_bytes=True)),
    Edge(
        "values_finite", "NaN has a meaning here", lambda: edited_content(content(), "runs/a/caps/p_WE", put(0, np.nan))
    ),
    Edge("inputs_match", "a source is no artifact", lambda: links(inputs=(InputState(SOURCE, OTHER),))),
    Edge(
        "inputs_match",
        "what was measured is right under any plan",
        lambda: dataclasses.replace(_made(stage="execute"), inputs=(InputState(PLAN, OTHER),)),
    ),
    Edge(
        "plan_is_the_executed",
        "it is the plan that was executed",
        lambda: dataclasses.replace(_made(stage="execute"), inputs=(InputState(PLAN, SHA),)),
    ),
    Edge("plan_is_the_executed", "what was computed is of no plan", lambda: links(inputs=(InputState(PLAN, OTHER),))),
    Edge("source_unchanged", "a source may be gone", lambda: links(inputs=(InputState(SOURCE, None, "it is gone"),))),
    Edge("source_unchanged", "an artifact is no source", lambda: links(inputs=(InputState(ARTIFACT, OTHER),))),
    Edge("robot_is_the_projects", "there is no project", lambda: links(robots={"runs/a": "x"}, project_robot=None)),
    Edge("stage_not_newer", "an older stage is for status to tell", lambda: _made(stage_version=0)),
    Edge("stage_not_newer", "a stage that is not known", lambda: _made(stage="plan", stage_version=9)),
    Edge("name_fits_kind", "a name that no kind has", lambda: links(filename="backup.h5")),
    Edge(
        "images_begin_right",
        "PNG and JPEG",
        lambda: edited_content(
            content(), "runs/a/camera/color", Blobs([b"\xff\xd8\xff\xe0", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xdb"], 3)
        ),
    ),
)


def _calibration() -> Content:
    from tests.support.check_subjects import calibration

    return calibration()
