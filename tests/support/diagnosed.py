"""What a diagnosis reports, without one."""

from __future__ import annotations

from schemas.results_diagnose import DiagnoseReport, ElementFound, RankedName, ShrinkageFound, WhereFound


def report() -> DiagnoseReport:
    """A payload on rod 1, found on three intervals."""
    element = ElementFound(kind="rod", index=1)
    return DiagnoseReport(
        verdict="effect", sentence="The gap is caused by payload at rod 1 (p = 0.90).", effects=("payload",),
        probability=0.9, set90=("payload", "com_offset"),
        ranking=(
            RankedName(effect="payload", elpd_gain=31.0, probability=0.9, size={"payload.mass_kg.1": 0.04},
                       ci90={"payload.mass_kg.1": (0.03, 0.05)},
                       units={"payload.mass_kg.1": "kg", "payload.place_m.1": "m"}, channel="mass",
                       element=element, rmse_m=0.006, on_bound=("payload.place_m.1",)),
            RankedName(effect="none", elpd_gain=0.0, probability=0.1),
        ),
        where=WhereFound(segments=("a:2",), onset_segment=None, channel="mass", element=element),
        shrinkage=ShrinkageFound(
            effects=("payload",), nominal=0.02, refit=0.012, refit_plus_effect=0.006, ceiling=0.01, floor=0.005,
            own_share=0.7, ci90=(0.4, 0.9), predicted=0.65, judged_on=("b:1", "b:2"), within_run=False,
        ),
        not_testable=("motor_dead_zone",), confusable=(("payload", "com_offset", 2.1),), next_gait=None,
        robot="threebar", floor_m=0.005, floor_from="repeats", floor_given=True, refit_rmse_m=0.012,
        refit_upper_m=0.014, chance_nats=4.0, calibrated="uncalibrated: a temperature by hand", left_out="3 gaits",
        segments=(), hidden=(), parity=("rod lengths are as built",), missing=("no sensors",),
        refit={"friction": (0.1, 0.02)}, rollouts=100, within_run=False, warnings=("look here",),
    )  # fmt: skip
