"""The columns of the Parquet files that views read: name -> type in DuckDB."""

from __future__ import annotations


def _columns(text: str = "", whole: str = "", number: str = "", truth: str = "") -> dict[str, str]:
    kinds = ((text, "VARCHAR"), (whole, "BIGINT"), (number, "DOUBLE"), (truth, "BOOLEAN"))
    return {name: kind for names, kind in kinds for name in names.split()}


VALUES = _columns(text="channel quantity unit node region", whole="t_ns record", number="value", truth="doubled")
TEMPERATURES = _columns(text="node", whole="t_ns", number="temperature_degC")
RESIDUALS = _columns(
    text="channel node file_id",
    whole="t_ns first_record last_record",
    number="t_s measured_degC modelled_degC residual_K sd_K speed_rpm torque_Nm current_A",
    truth="used",
)
AGEING = {  # artefact of an assessment -> its columns, in the order of the file
    "ageing_hours": _columns(text="specimen batch session session_name channel", number="degC hours"),
    "ageing_cycles": _columns(
        text="session session_name specimen batch channel",
        whole="number start_ns",
        number="heating_from_s soak_from_s soak_to_s cooling_to_s highest_degC soak_degC hours_above unknown_h swing_K "
        "heating_K_per_min cooling_K_per_min",
    ),
    "ageing_checks": _columns(
        text="session session_name specimen batch source state why hottest_channel left",
        whole="start_ns number cycles",
        number="dose_h discharge_h equivalent_low_h equivalent_high_h resistance_K_per_W sd_K_per_W sd_percent "
        "conductivity_percent hottest_degC",
    ),
    "ageing_specimens": _columns(
        text="specimen batch form why",
        whole="checks",
        number="dose_h equivalent_low_h equivalent_high_h life_used_low life_used_high form_probability "
        "change_at_dose_h slope_percent_per_100h slope_low slope_high repeatability_percent "
        "fleet_slope_percent_per_100h fleet_slope_sd remaining_low_h remaining_high_h score",
        truth="significant outlying",
    ),
    "ageing_batches": _columns(
        text="batch", whole="specimens", number="slope_percent_per_100h score", truth="outlying"
    ),
}
