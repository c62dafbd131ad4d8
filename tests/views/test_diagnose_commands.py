"""Commands that a diagnosis ends with: what was found put to use, the gait to run next, healthy runs."""

from __future__ import annotations

from itertools import pairwise

import pytest

from r2s2r_cli.commands.diagnose_outcome import show
from r2s2r_cli.console import Console
from r2s2r_cli.effects import FURTHER
from r2s2r_cli.reached import ROBOT
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.effects_asked import effects_asked
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.task import specs_asked
from r2s2r_cli.stages.record.plan import plans
from r2s2r_cli.stages.record.policies import random_targets
from r2s2r_cli.views.diagnose_commands import AFTER_REPAIR, REPEATS, diagnose_commands, use
from r2s2r_cli.views.diagnose_page import diagnose_page, diagnose_tables
from schemas.config import IdentifySettings, LinkSettings
from schemas.results_diagnose import DiagnoseReport, NextGaitFound
from tests.support.diagnosed import report
from tests.support.rig_robots import known


def test_what_was_named_comes_with_the_command_that_uses_it() -> None:
    """At the element and sizes that were found; what has no number, and what is not committed to, has none."""
    plain = "--with-effect payload:1 --free +payload.mass_kg.1=0.04"
    assert use(report()) == f"r2s2r identify {plain}"
    placed = report().model_copy(update={"iteration": 1, "free_iteration": 3})
    assert use(placed) == f"r2s2r identify --iteration 3 --also 1 {plain}"
    place = {"friction_field.patch_factor": 0.262, "friction_field.patch_x_m": 0.2034}
    row = report().ranking[0].model_copy(update={"effect": "friction_field", "size": place})
    floor = report().model_copy(update={"effects": ("friction_field",), "ranking": (row,)})
    assert use(floor).endswith("--with-effect friction_field --free +friction_field.patch_factor=0.262 "
                               "--free +friction_field.patch_x_m=0.2034")  # fmt: skip
    assert not use(report().model_copy(update={"verdict": "ambiguous", "effects": ()}))
    lost = report().ranking[0].model_copy(update={"effect": "dropout", "size": {}})
    assert not use(report().model_copy(update={"effects": ("dropout",), "ranking": (lost,)}))


def test_what_ended_on_a_bound_can_be_used_as_well() -> None:
    """A sensor that shows nothing beyond its top has a share of 1, and a ground that only gives way creeps by 0: no fit
    begins on a bound, so the command leaves that start to `identify`, which takes it."""
    sizes = {"sensor_saturation.top_share.2": 1.0, "sensor_saturation.top_m": 0.1683}
    clipped = {"effect": "sensor_saturation", "size": sizes, "on_bound": ("sensor_saturation.top_share.2",)}
    row = report().ranking[0].model_copy(update=clipped)
    made = report().model_copy(update={"effects": ("sensor_saturation",), "ranking": (row,)})
    assert use(made) == ("r2s2r identify --with-effect sensor_saturation:2 --free +sensor_saturation.top_share.2 "
                         "--free +sensor_saturation.top_m=0.1683")  # fmt: skip


def test_identify_takes_every_effect_with_numbers_on_a_bound() -> None:
    """Of all elements together, and of the last one alone: every number is free, none begins on a bound."""
    robot = known("threebar", "surface")
    made = candidates(Model(nominal(robot), asked=[effect.name for effect in FURTHER]))
    some = {(one.effect, one.names[0].count(".")): one for one in made}
    assert {name for name, _ in some} > {effect.name for effect in FURTHER}
    for one in some.values():
        size = dict(zip(one.names, one.upper.tolist(), strict=True))
        row = report().ranking[0].model_copy(update={"effect": one.effect, "size": size, "on_bound": one.names})
        words = use(report().model_copy(update={"effects": (one.effect,), "ranking": (row,)})).split()
        typed = {flag: [b for a, b in pairwise(words) if a == flag] for flag in ("--with-effect", "--free")}
        asked = effects_asked(typed["--with-effect"], robot)
        request = Request(
            (Selection("a", (1,)),), free=tuple(typed["--free"]), effects=asked.ids, of_effects=asked.specs
        )
        frees = select(specs_asked(request, IdentifySettings(), ("friction",)), robot, asked.ids)
        assert {*one.names} <= {free.name for free in frees}, one.label
        assert all(free.lower < free.start < free.upper for free in frees), one.label


@pytest.mark.parametrize(
    ("nats", "now", "words"),
    [
        (
            30.0,
            2.0,
            "ramps: likeliest to decide between the likeliest candidates, worth 30.0 nats, these runs again 2.0",
        ),
        (2.0, 3.0, "nothing separates the candidates better than these runs; the best of the library is ramps"),
        (4.12, 4.08, "nothing separates the candidates better than these runs; the best of the library is ramps"),
        (2.0, None, "ramps: likeliest to decide between the likeliest candidates, worth 2.0 nats (little)"),
    ],
)
def test_what_to_run_next_is_said_beside_what_was_run(nats: float, now: float | None, words: str) -> None:
    """Its command is below; a gait that is worth less than the runs so far is not praised."""
    file = "iterations/001/70-diagnose-next.toml"
    one = NextGaitFound(name="ramps", file=file, targets=((1.0,),), nats=nats, now=now)
    made = report().model_copy(update={"next_gait": one, "free_iteration": 2})
    rows = [row for table in diagnose_tables(made) for row in table.rows if row[0] == "run next"]
    assert rows == [["run next", f"{words} (command: below)"]]
    payload, *others = diagnose_commands(made)
    assert payload[0] == "use it" and others == [("next", f"r2s2r record {file} --iteration 2 --repeats 2 {ROBOT}")]
    unwritten = made.model_copy(update={"next_gait": one.model_copy(update={"file": None})})
    assert [what for what, _ in diagnose_commands(unwritten)] == ["use it"]


def test_where_no_gait_helps_healthy_runs_would() -> None:
    """With the commands, of runs as they will be called; not where there are some, nor where a cause is named."""
    lacking = {"missing": ("healthy runs: findings are against robot.toml",), "iteration": 1, "free_iteration": 2}
    undecided = report().model_copy(update={"verdict": "ambiguous", "effects": (), **lacking})

    def advice(made: DiagnoseReport) -> str:
        return next(row[1] for table in diagnose_tables(made) for row in table.rows if row[0] == "run next")

    assert advice(undecided).endswith("of the robot as it was when nothing was wrong (command: below)")
    assert diagnose_commands(undecided) == [
        ("next", f"r2s2r record --random 15 --repeats 2 --iteration 2 {ROBOT}{AFTER_REPAIR}"),
        ("next", "r2s2r estimate --iteration 2"),
        (
            "next",
            "r2s2r diagnose --iteration 1 --also 2 --healthy 002-random-0-1 --healthy 002-random-0-2" + AFTER_REPAIR,
        ),
    ]
    plain = "no gait of the library is likely to decide more"
    assert advice(undecided.model_copy(update={"missing": ()})) == plain == advice(report().model_copy(update=lacking))
    assert diagnose_commands(undecided.model_copy(update={"missing": ()})) == []


def test_lines_that_take_runs_as_healthy_say_when(capsys: pytest.CaptureFixture[str]) -> None:
    """In the terminal and on the page, as a comment of the shell that stays when the line is pasted."""
    lacking = {"missing": ("healthy runs: none",), "iteration": 1, "free_iteration": 2}
    undecided = report().model_copy(update={"verdict": "ambiguous", "effects": (), **lacking})
    show(undecided, Console())
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("next: ")]
    page = diagnose_page(undecided, []).decode()
    said = [line.removeprefix("next: ") for line in lines if " record " in line or "--healthy" in line]
    assert len(said) == 2
    for line in said:
        assert "   # after you have put the robot right" in line and f"<code>{line}</code>" in page


def test_a_robot_that_the_project_names_is_not_named_again(capsys: pytest.CaptureFixture[str]) -> None:
    """Port and protocol of project.toml hold; without a port there both are shown."""
    one = NextGaitFound(name="ramps", file="70-diagnose-next.toml", targets=((1.0,),), nats=9.0, now=None)
    made = report().model_copy(update={"next_gait": one, "free_iteration": 2})
    record = "next: r2s2r record 70-diagnose-next.toml --iteration 2 --repeats 2"
    for link, reached in ((LinkSettings(), ROBOT), (LinkSettings(port="udp://0.0.0.0:2390"), "--camera realsense")):
        show(made, Console(), link=link)
        assert f"{record} {reached}" in capsys.readouterr().out.splitlines()


def test_a_command_is_a_line_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    """Whole, in the terminal however narrow it is and on the page: no table breaks it."""
    one = NextGaitFound(name="ramps", file="70-diagnose-next.toml", targets=((1.0,),), nats=9.0, now=None)
    made = report().model_copy(update={"next_gait": one, "free_iteration": 2})
    show(made, Console())
    lines = capsys.readouterr().out.splitlines()
    page = diagnose_page(made, []).decode()
    assert len(diagnose_commands(made)) == 2
    for what, command in diagnose_commands(made):
        assert f"{what}: {command}" in lines and f"<p>{what}: <code>{command}</code></p>" in page
    assert "r2s2r" not in "".join(cell for table in diagnose_tables(made) for row in table.rows for cell in row)


def test_healthy_runs_have_the_names_that_record_gives_them() -> None:
    """Of the command that is shown, in an iteration beside the diagnosed one."""
    made = plans([random_targets(known(), 15, 0)], repeats=REPEATS, rest=1.0)
    asked = {"missing": ("healthy runs: none",), "iteration": 1, "free_iteration": 12}
    undecided = report().model_copy(update={"verdict": "ambiguous", "effects": (), **asked})
    *_, (_, command) = diagnose_commands(undecided)
    names = " ".join(f"--healthy 012-{one.name}" for one in made)
    assert command.removesuffix(AFTER_REPAIR).endswith(names)


def test_what_was_asked_for_is_told_on_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """Though nothing is known of it."""
    none = report().ranking[-1]
    others = tuple(none.model_copy(update={"effect": name, "fitted": False}) for name in ("backlash", "motor_lag"))
    made = report().model_copy(update={"ranking": (*report().ranking, *others)})
    show(made, Console())
    assert "\n backlash " not in capsys.readouterr().out
    show(made, Console(), ("backlash",))
    assert "\n backlash " in capsys.readouterr().out
