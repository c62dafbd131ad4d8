"""Malformed inputs of `import`, in a fixed order: 200 and more CSV, TOML and JSON texts, each with a name.

`accepted` marks the few that are unusual and yet say exactly what they mean; everything else must be refused.
Base of all: `small_csv()`, `SIDECAR` and `frame_json()` of `tests.support.import_samples`.
"""

from __future__ import annotations

import codecs
import json
import random
from dataclasses import dataclass
from typing import Any

from tests.support.import_samples import SIDECAR, frame_json

JUNK = (
    "abc", "1.2.3", "0x1F", "1e999", "-1e999", "--1", "1 2", "\u0663", "1_000", "#REF!", "NULL", "None", "TRUE", "-",
    ".", "1e", "inf", "-Infinity", "1;5", "0.1m", "\u22121", "1\u00a00", "'1'", "=1+1", "9" * 400 + "e999", "\x1b[31m1",
)  # fmt: skip
"""Cells that are no plain finite decimal number."""


@dataclass(frozen=True)
class Malformed:
    """One input."""

    name: str
    data: bytes
    accepted: bool = False


_INSERTS = (b"nan", b"-", b"1e300", b'"', b",", b"\n", b"\r", b"{", b"[", b"null", b"0", b"\0", b"\xff")


def mutated(data: bytes, seed: int) -> bytes:
    """One to five random changes: a flipped bit, a cut, a piece lost or doubled, a foreign token. Repeatable."""
    rng = random.Random(seed)
    text = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(max(1, len(text)))
        end = min(len(text), at + rng.randrange(1, 200))
        change = rng.randrange(5)
        if change == 0 and text:
            text[at] ^= 1 << rng.randrange(8)
        elif change == 1:
            del text[at:]
        elif change == 2:
            del text[at:end]
        elif change == 3:
            text[at:at] = text[at:end]
        else:
            text[at : at + 1] = rng.choice(_INSERTS)
    return bytes(text)


def _toml(**changes: str) -> bytes:
    """The good sidecar with lines replaced by key."""
    lines = [changes.pop(line.split(" = ")[0], line) for line in SIDECAR.splitlines()]
    return "\n".join([*lines, *changes.values()]).encode() + b"\n"


def sidecar_cases() -> list[Malformed]:
    """Malformed TOML sidecars."""
    raw = SIDECAR.encode()
    cases = [
        Malformed("empty", b""),
        Malformed("only_comment", b"# nothing\n"),
        Malformed("nul_byte", raw + b"\0"),
        Malformed("utf16", SIDECAR.encode("utf-16")),
        Malformed("latin1", raw + "# \u00e9".encode("latin-1")),
        Malformed("binary", bytes(range(128, 256))),
        Malformed("json", b'{"robot": "sample"}'),
        Malformed("yaml", b"robot: sample\nsource: x\n"),
        Malformed("ini_without_quotes", b"robot = sample\nsource = somewhere\n"),
        Malformed("open_string", raw.replace(b'"sample"', b'"sample')),
        Malformed("open_multiline_string", b'robot = """sample\n'),
        Malformed("open_table", raw.replace(b"[pid]", b"[pid")),
        Malformed("open_array", raw + b"x = [1, 2\n"),
        Malformed("duplicate_key", b'robot = "sample"\n' + raw),
        Malformed("duplicate_table", raw + b"[pid]\n"),
        Malformed("bad_escape", raw.replace(b"sample", b"sam\\ple")),
        Malformed("bad_number", _toml(tolerance="tolerance = 0,1")),
        Malformed("leading_zeros", _toml(tolerance="tolerance = 00.1")),
        Malformed("missing_value", _toml(tolerance="tolerance =")),
        Malformed("missing_equals", _toml(tolerance="tolerance 0.1")),
        Malformed("control_character", raw.replace(b"sample", b"sam\x01ple")),
        Malformed("deep_array", b"x = " + b"[" * 5000 + b"]" * 5000 + b"\n" + raw),
        Malformed("deep_keys", b"a" + b".a" * 2000 + b" = 1\n" + raw),
        Malformed("huge_integer", _toml(tolerance="tolerance = " + "9" * 6000)),
        Malformed("huge_exponent", _toml(tolerance="tolerance = 1e999")),
        Malformed("no_robot", _toml(robot="")),
        Malformed("no_source", _toml(source="")),
        Malformed("empty_robot", _toml(robot='robot = ""')),
        Malformed("empty_source", _toml(source='source = ""')),
        Malformed("long_robot", _toml(robot='robot = "' + "x" * 5000 + '"')),
        Malformed("other_robot", _toml(robot='robot = "sixbar"')),
        Malformed("unknown_nature", _toml(nature='nature = "real"')),
        Malformed("misspelt_key", _toml(source='sourc = "x"')),
        Malformed("unknown_key", b'colour = "red"\n' + raw),
        Malformed("misspelt_pid_key", _toml(tolerance="tolerence = 0.1")),
        Malformed("unknown_table", raw + b"[camera]\nfx = 1.0\n"),
        Malformed("robot_is_table", _toml(robot='robot.name = "sample"')),
        Malformed("array_of_pid", raw.replace(b"[pid]", b"[[pid]]")),
        Malformed("zero_start", b"start_unix_s = 0\n" + raw),
        Malformed("start_as_date", b"start_unix_s = 2023-02-21T00:00:00Z\n" + raw),
        Malformed("negative_noise", b"noise_sd_m = -0.001\n" + raw),
        Malformed("noise_as_list", b"noise_sd_m = [0.001, 0.001, 0.001]\n" + raw),
        Malformed("noise_nan", b"noise_sd_m = nan\n" + raw),
        Malformed("speed_in_percent", _toml(motor_speed="motor_speed = 80")),
        Malformed("speed_zero", _toml(motor_speed="motor_speed = 0")),
        Malformed("bom", codecs.BOM_UTF8 + raw, accepted=True),
        Malformed("crlf", SIDECAR.replace("\n", "\r\n").encode(), accepted=True),
        Malformed("without_pid", b'robot = "sample"\nsource = "x"\nnature = "measured"\n', accepted=True),
        Malformed("without_nature", b'robot = "sample"\nsource = "x"\n', accepted=True),
        Malformed("integer_for_number", _toml(tolerance="tolerance = 1"), accepted=True),
    ]  # fmt: skip
    wrong = {"string": '"0.1"', "bool": "true", "nan": "nan", "inf": "inf", "negative": "-0.1", "list": "[0.1]"}
    for key in ("min_length_m", "range_m", "tolerance"):
        cases += [Malformed(f"{key}_is_{what}", _toml(**{key: f"{key} = {value}"})) for what, value in wrong.items()]
    for key in ("robot", "source", "nature"):
        cases += [Malformed(f"{key}_is_{what}", _toml(**{key: f"{key} = {value}"})) for what, value in
                  {"number": "1", "list": '["a"]', "bool": "false"}.items()]  # fmt: skip
    return cases


def _frame(path: str, value: Any) -> bytes:
    """The good frame with the value at a dotted path replaced."""
    tree = frame_json()
    *parents, last = path.split(".")
    node = tree
    for key in parents:
        node = node[key]
    node[last] = value
    return json.dumps(tree).encode()


def json_cases() -> list[Malformed]:
    """Malformed frames of the authors' recorder."""
    good = json.dumps(frame_json())
    raw = good.encode()
    cases = [
        Malformed("empty", b""),
        Malformed("blank", b"  \n"),
        Malformed("null", b"null"),
        Malformed("number", b"3"),
        Malformed("list", b"[" + raw + b"]"),
        Malformed("string", b'"frame"'),
        Malformed("two_objects", raw + raw),
        Malformed("trailing_text", raw + b" x"),
        Malformed("trailing_comma", raw[:-1] + b",}"),
        Malformed("single_quotes", good.replace('"', "'").encode()),
        Malformed("comment", b"// frame\n" + raw),
        Malformed("nul_byte", raw[:50] + b"\0" + raw[50:]),
        Malformed("zeros_after_crash", b"\0" * 512),
        Malformed("utf16", good.encode("utf-16")),
        Malformed("bad_utf8", raw.replace(b"secs", b"s\xffcs")),
        Malformed("binary", bytes(range(256))),
        Malformed("deep", b"[" * 100_000),
        Malformed("deep_object", b'{"a":' * 50_000 + b"1" + b"}" * 50_000),
        Malformed("duplicate_key", b'{"header": {"secs": 1.0},' + raw[1:]),
        Malformed("infinity", raw.replace(b"15.5", b"Infinity")),
        Malformed("overflow", raw.replace(b"15.5", b"1e999")),
        Malformed("long_integer", raw.replace(b"15.5", b"9" * 6000)),
        Malformed("integer_beyond_floats", raw.replace(b"15.5", b"9" * 400)),
        Malformed("no_header", json.dumps({k: v for k, v in frame_json().items() if k != "header"}).encode()),
        Malformed("header_list", _frame("header", [1.0])),
        Malformed("no_secs", _frame("header", {"seq": 1})),
        Malformed("secs_null", _frame("header.secs", None)),
        Malformed("secs_nan", _frame("header.secs", float("nan"))),
        Malformed("secs_object", _frame("header.secs", {"secs": 1, "nsecs": 2})),
        Malformed("secs_in_nanoseconds", _frame("header.secs", 1676990000_000000000)),
        Malformed("motors_list", _frame("motors", [])),
        Malformed("motors_string", _frame("motors", "none")),
        Malformed("motor_key", _frame("motors.a", {})),
        Malformed("motor_key_negative", _frame("motors.-1", {})),
        Malformed("motor_key_float", json.dumps(frame_json(motors={"0.0": {}})).encode()),
        Malformed("motor_is_number", _frame("motors.0", 1.0)),
        Malformed("motor_null", _frame("motors.0", None)),
        Malformed("sensors_list", _frame("sensors", [1, 2])),
        Malformed("sensor_key", _frame("sensors.left", {})),
        Malformed("sensor_is_number", _frame("sensors.0", 15.5)),
        Malformed("imu_list", _frame("imu", [0, 0, 1])),
        Malformed("imu_is_number", _frame("imu.0", 1)),
        Malformed("accelerometer_list", _frame("imu.0.acceleromter", [0, 0, 1])),
        Malformed("gyroscope_number", _frame("imu.0.gyroscope", 5)),
        Malformed("mocap_list", _frame("mocap", [[0, 0, 0]])),
        Malformed("mocap_string", _frame("mocap", "off")),
        Malformed("mocap_point_list", _frame("mocap.0", [1, 2, 3])),
        Malformed("mocap_key", _frame("mocap.left", {"x": 0})),
        Malformed("info_list", _frame("info", [1])),
        Malformed("null_capacitance", _frame("sensors.0.capacitance", None), accepted=True),
        Malformed("nan_length", _frame("sensors.0.length", float("nan")), accepted=True),
        Malformed("unseen_marker", _frame("mocap.0", {"cond": False, "x": None, "y": None, "z": None}), accepted=True),
        Malformed("no_mocap", _frame("mocap", None), accepted=True),
        Malformed("done_as_number", _frame("motors.0.done", 1), accepted=True),
        Malformed("more_keys", _frame("trajectory", {"0": {"x": 0, "y": 0}}), accepted=True),
        Malformed("bom", codecs.BOM_UTF8 + raw, accepted=True),
    ]  # fmt: skip
    for path in ("header.secs", "motors.0.target", "motors.0.speed", "sensors.0.length", "mocap.0.x", "motors.0.done"):
        for what, value in {"string": "1.0", "list": [1.0], "object": {}, "infinite": float("inf")}.items():
            cases.append(Malformed(f"{path}_is_{what}", _frame(path, value)))
    return cases
