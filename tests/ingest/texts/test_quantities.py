"""Units at the door: any usual spelling in, the stored unit out."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from ingest.errors import UnitError
from ingest.texts.guessing import guess, unit_in_name
from ingest.texts.quantities import PEAK, STORED_UNIT, Conversion, column_suffix, converter, other_unit
from ingest.texts.units import normal_unit, spellings


def test_importing_the_module_does_not_import_pint() -> None:
    code = "import ingest.texts.quantities as q, sys; q.converter('U/min', 'speed'); sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("unit", "quantity", "scale", "offset"),
    [
        ("Nm", "torque", 1, 0),  # a unit library reads it as textile mass per length
        ("NM", "torque", 1, 0),
        ("N·m", "torque", 1, 0),
        ("lbf·ft", "torque", 1.3558179483314004, 0),
        ("kgf·m", "torque", 9.80665, 0),
        ("min⁻¹", "speed", 1, 0),
        ("kNm", "torque", 1000, 0),
        ("lbf ft", "torque", 1.3558179483314004, 0),
        ("in-lb", "torque", 1.3558179483314004 / 12, 0),
        ("tr/mn", "speed", 1.0, 0),
        ("TΩ", "insulation_resistance", 1e12, 0),
        ("TOhm", "insulation_resistance", 1e12, 0),
        ("MOhms", "insulation_resistance", 1e6, 0),
        ("ozf*in", "torque", 0.00706155181422604, 0),
        ("U/min", "speed", 1, 0),  # ... as enzyme activity
        ("1/min", "speed", 1, 0),  # ... as a sixtieth of a hertz
        ("min^-1", "speed_command", 1, 0),
        ("giri/min", "speed", 1, 0),
        ("RPM", "speed", 1, 0),
        ("rad/s", "speed", 30 / math.pi, 0),
        ("1/s", "speed", 60, 0),
        ("l/min", "flow", 1, 0),
        ("LPM", "flow", 1, 0),
        ("m³/h", "flow", 1000 / 60, 0),
        ("°C", "temperature", 1, 0),
        ("Grad C", "temperature", 1, 0),
        ("C", "temperature", 1, 0),
        ("℃", "temperature", 1, 0),
        ("K", "temperature", 1, -273.15),
        ("degF", "temperature", 5 / 9, -160 / 9),
        ("F", "temperature", 5 / 9, -160 / 9),
        ("µF", "capacitance", 1e-6, 0),
        ("Vrms", "voltage", 1, 0),
        ("A_rms", "current", 1, 0),
        ("mA", "current_dc", 1e-3, 0),
        ("KW", "power", 1000, 0),
        ("MΩ", "insulation_resistance", 1e6, 0),
        ("mOhm", "resistance", 1e-3, 0),
        ("g", "acceleration", 9.80665, 0),
        ("m/s^2", "acceleration", 1, 0),
        ("-", "counter", 1, 0),
        ("", "state", 1, 0),
        ("%", "tan_delta", 0.01, 0),
        ("°C/W", "thermal_resistance", 1, 0),
        ("Vs", "flux", 1, 0),
        ("min", "dose", 1 / 60, 0),
        (" [Nm] ", "torque", 1, 0),
    ],
)
def test_units_as_logs_write_them_become_the_stored_unit(unit: str, quantity: str, scale: float, offset: float) -> None:
    found = converter(unit, quantity)
    assert [found.scale, found.offset] == pytest.approx([scale, offset], rel=1e-14)


@pytest.mark.parametrize("quantity", STORED_UNIT)
def test_the_stored_unit_converts_exactly_to_itself(quantity: str) -> None:
    assert converter(STORED_UNIT[quantity], quantity) == Conversion(1.0, 0.0)


@pytest.mark.parametrize(
    ("unit", "quantity", "says"),
    [
        ("Xm", "torque", 'unit "Xm" is not known for torque; use one of Nm, kNm, mNm, lbf ft.'),
        ("rpm", "temperature", 'unit "rpm" is not known for temperature; use one of degC, K, degF.'),
        ("Hz", "speed", 'unit "Hz" is not known for speed; use one of rpm, 1/min, U/min, rad/s.'),
        ("9**9**9**9", "torque", 'unit "9**9**9**9" is not known for torque; use one of Nm, kNm, mNm, lbf ft.'),
        ("m" * 100_000, "torque", "is not known for torque; use one of Nm, kNm, mNm, lbf ft."),
        ("__import__('os')", "torque", "is not known for torque; use one of Nm, kNm, mNm, lbf ft."),
        ("Nm", "torqe", 'quantity "torqe" is not known. Nearest: torque.'),
        ("Apk", "current", 'unit "Apk" says peak, convention says rms. Write convention = "peak".'),
    ],
)
def test_a_unit_that_does_not_fit_is_refused_with_those_that_do(unit: str, quantity: str, says: str) -> None:
    with pytest.raises(UnitError) as caught:
        converter(unit, quantity)
    assert str(caught.value).endswith(says) and len(str(caught.value)) < 300


@pytest.mark.parametrize("quantity", PEAK)
def test_amplitudes_become_rms_values(quantity: str) -> None:
    unit = STORED_UNIT[quantity]
    assert converter(unit, quantity, "peak")(np.array([math.sqrt(2)]))[0] == pytest.approx(1.0, rel=1e-15)
    assert converter(f"{unit}pk", quantity, "peak") == converter(unit, quantity, "peak")


def test_peak_is_refused_where_it_means_nothing_or_contradicts_the_unit() -> None:
    with pytest.raises(UnitError, match='convention = "peak" means nothing for torque: only for current, '):
        converter("Nm", "torque", "peak")
    with pytest.raises(UnitError, match='unit "Arms" says rms, convention says peak'):
        converter("Arms", "current", "peak")


def test_conversion_gives_new_float64_values_and_keeps_gaps() -> None:
    counts = np.array([0, 100], dtype=np.int16)
    assert converter("K", "temperature")(counts) == pytest.approx([-273.15, -173.15])
    gaps = np.array([np.nan, 1.0])
    converted = converter("degC", "temperature")(gaps)
    assert converted is not gaps and np.isnan(converted[0])


def test_every_spelling_leads_to_a_unit_that_is_its_own_spelling() -> None:
    wrong = {text for text, unit in spellings().items() if not normal_unit(text) == normal_unit(unit) == unit}
    assert len(spellings()) > 200 and wrong == set()


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("°C", "degC"),
        ("ºC", "degC"),
        ("\ufffdC", "degC"),
        ("ßC", "degC"),
        ("øC", "degC"),
        ("¡C", "degC"),
        ("?C", "degC"),
        ("deg. C", "degC"),
        ("KW", "kW"),
        ("mW", "mW"),
        ("MW", "MW"),
        ("kph", "km/h"),
        ("Vrms", "V"),
        ("VDC", "V"),
        ("V AC", "V"),
        ("min⁻¹", "rpm"),
        ("l·min⁻¹", "lpm"),
        ("N⋅m", "Nm"),
        ("kN∙m", "kNm"),
        ("V·s", "Wb"),
        ("lbf·ft", "lbf ft"),
        ("ft·lb", "lbf ft"),
        ("in·lbf", "lbf in"),
        ("W·h", "Wh"),
    ],
)
def test_a_unit_text_has_one_spelling(text: str, unit: str) -> None:
    assert normal_unit(text) == unit


@pytest.mark.parametrize("text", ["MODEMASK", "dC*2", "kW*0.25", "", None, "Apk", "mw", "ADC"])  # counts of a converter
def test_what_is_no_unit_for_sure_stays_unknown(text: str | None) -> None:
    assert normal_unit(text) is None and column_suffix(text) == ""


def test_columns_end_with_the_stored_unit() -> None:
    suffixes = {quantity: column_suffix(quantity) for quantity in STORED_UNIT}
    assert suffixes["temperature"] == "_degC" and suffixes["speed"] == "_rpm" and suffixes["current"] == "_A"
    assert suffixes["thermal_resistance"] == "_K_per_W" and suffixes["acceleration"] == "_m_per_s2"
    assert suffixes["counter"] == "" and column_suffix("km/h") == "_km_per_h" and column_suffix("%") == "_percent"


@pytest.mark.parametrize(
    ("found", "unit", "quantity", "contradicts"),
    [
        ("°C", "degC", "temperature", False),
        ("K", "degC", "temperature", True),
        ("rpm", "degC", "temperature", True),
        ("-", "degC", "temperature", False),
        ("Grad X", "degC", "temperature", False),
        ("Apk", "A", "current", True),
        ("Arms", "A", "current", False),
        ("N m", "Nm", "torque", False),
        ("1/s", "rpm", "speed", True),  # a factor of 60
        ("s^-1", "rpm", "speed_command", True),
        ("1/s", "1/s", "speed", False),
        ("G", "m/s2", "acceleration", True),
    ],
)
def test_a_unit_row_contradicts_only_what_it_says_otherwise(
    found: str, unit: str, quantity: str, contradicts: bool
) -> None:
    assert other_unit(found, unit, quantity) is contradicts


@pytest.mark.parametrize(
    ("signal", "unit", "quantity"),
    [
        ("MAG_1", "degC", "temperature"),
        ("n", "U/min", "speed"),
        ("TrqCmd", "Nm", "torque_command"),
        ("IqFbk", "A", "current_q"),
        ("IqRef", "A", None),
        ("Speed", "Apk", "current"),
        ("HV_Current", "A", "current_dc"),
        ("U_d", "V", "voltage_d"),
        ("P_mech", "kW", None),
        ("Q_heat", "W", "heat"),
        ("P_el", "kW", "power"),
        ("Riso", "MΩ", "insulation_resistance"),
        ("p_coolant", "bar", None),
        ("Motordrehzahl", None, "speed"),
        ("Drehmoment_Soll", None, "torque_command"),
        ("Strom_U", None, "current"),
        ("Temperatur_Wicklung", None, "temperature"),
        ("velocità", None, "speed"),
        ("coppia", None, "torque"),
        ("Moment", None, "torque"),
        ("corrente_fase", None, "current"),
        ("Termocoppia1", None, "temperature"),
        ("stator_winding", None, "temperature"),
        ("rotor_position", None, None),
        ("profile_id", None, None),
        ("i_d", None, "current_d"),
        ("AliveCounter", None, "counter"),
        ("T_pm_degC", None, "temperature"),
        ("07/09/2012 06:58:23 PM - Digital Input", None, None),
        ("Remark", None, None),
        ("Winding Temp (F)", "F", "temperature"),
        ("C_ph", "F", "capacitance"),
        ("Torque (lb-ft)", "lb-ft", "torque"),
        ("Velocidad", None, "speed"),
        ("Par", None, "torque"),
        ("current_dc", "A", "current_dc"),
        ("n° de série", None, None),
        ("Seriennummer", None, None),
        ("series_resistance", "mOhm", "resistance"),
        ("TE-Einsetzspannung", "kV", "inception_voltage"),
        ("PI", None, "polarisation_index"),
        ("PI_out", None, None),
        ("tan δ", "%", "tan_delta"),
        ("Dosis", "h", "dose"),
        ("dT", "K", None),
        ("ΔT_winding", "K", None),
        ("temperature rise", "°C", None),
        ("Übertemperatur", "K", None),
        ("diffuser", "°C", "temperature"),
    ],
)
def test_a_quantity_is_guessed_from_unit_and_name(signal: str, unit: str | None, quantity: str | None) -> None:
    assert guess(signal, unit) == quantity


@pytest.mark.parametrize(
    ("signal", "unit"),
    [
        ("EW_3_degC", "degC"),
        ("speed_rpm", "rpm"),
        ("torque_nm", "nm"),
        ("current_A", "A"),
        ("P_el_W", "W"),
        ("Torque (Nm)", "Nm"),
        ("T (°C)", "°C"),
        ("winding_A", None),
        ("torque_A", None),
        ("T_min", None),
        ("speed_ma", None),
        ("rpm", None),
        ("T (left)", None),
        ("1 [°C] Winding", "°C"),
        ("M/Nm", "Nm"),
        ("n / min^-1", "min^-1"),
        ("U/V", None),
        ("/motor/state.rpm", None),
        ("Torque (lb-ft)", "lb-ft"),
        ("Torque (lbf·ft)", "lbf·ft"),
        ("n / min⁻¹", "min⁻¹"),
        ("Lager (A) links", None),
        ("Temperatur Wicklung in °C", "°C"),
        ("Drehzahl in 1/min", "1/min"),
        ("Temp, °F (LGR S/N: 10, SEN S/N: 7)", "°F"),
        ("T winding, A", None),
        ("T stator in slot", None),
    ],
)
def test_a_unit_is_read_off_a_name_where_it_speaks_for_a_quantity(signal: str, unit: str | None) -> None:
    assert unit_in_name(signal) == unit
