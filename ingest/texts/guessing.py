"""What a signal probably is, from its unit and the words of its name: for drafts that a person then checks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ingest.texts.units import normal_unit, spellings, tidy, without_mark

_OF_UNIT: Mapping[str, str] = {  # quantity -> units that speak for it
    "temperature": "degC K degF",
    "speed": "rpm krpm rps rad/s",
    "torque": "Nm kNm mNm",
    "current": "A mA kA",
    "voltage": "V mV kV",
    "power": "W kW MW hp PS",
    "flow": "lpm l/h l/s ml/min m3/h gpm",
    "resistance": "ohm mohm kohm Mohm Gohm",
    "flux": "Wb mWb",
    "acceleration": "m/s2",
    "capacitance": "F uF nF pF",
    "thermal_resistance": "K/W",
}
_BY_UNIT = {unit: quantity for quantity, units in _OF_UNIT.items() for unit in units.split()} | {
    "lbf ft": "torque",
    "lbf in": "torque",
}
# quantity -> what its names hold, in five languages; names are taken as `_lower_case_words_`
_BY_NAME: Mapping[str, str] = {
    "temperature": "temp|therm|termo|celsius|_t_?c_",
    "speed": "speed|spd|drehzahl|_rpm_|veloci[td]|_giri|vitesse|^_n_|_nmot_|_omega_",
    "torque": "torque|_trq_|_tq_|drehmoment|_moment_|coppia|couple|_par_|_md_",
    "flow": "flow|durchfluss|volumenstrom|portata|caudal|debit|débit|_vdot_",
    "power": "power|leistung|potenza|potencia|puissance|_pwr_|_p_?el",
    "flux": "flux|verkettung|_psi_",
    "voltage_dc": "_[uv]_?dc_|(batt|hv|link|dc).*volt|volt.*_dc_",
    "current_dc": "_i_?dc_|(batt|hv|link|dc).*curr|curr.*_dc_",
    "voltage_d": "_[uv]_?d_",
    "voltage_q": "_[uv]_?q_",
    "current_d": "^_id_|_id_(?!$)|_i_d_",  # a last word `id` is a number in a list
    "current_q": "_i_?q_",
    "inception_voltage": "pdiv|inception|einsetzspannung",
    "voltage": "volt|spannung|tensi[oó]n|_[uv]_?rms_",
    "current": "current|_curr_|strom|corrente|courant|corriente|_i_?rms_|_iph_",
    "resistance": "r[eé]sistance|widerstand|resisten[zc]",
    "polarisation_index": "polari[sz]ation|^_pi_$",
    "tan_delta": "_tan_(delta|δ)_|verlustfaktor|dissipation_factor",
    "dose": "_dos(e|is)_",
    "counter": "counter|_cnt_|alive|_crc_",
    "state": "state|status|_mode_|fault|error|zustand|_stato_",
}
_BY_NAME_ALONE = ("tan_delta", "dose")  # in per cent, and in hours, which speak for nothing
_PLACES = (  # of thermocouples whose column says no more than where they sit; "06:58:23 PM" is a time
    "wind|wdg|slot|yoke|tooth|teeth|stator|rotor|magnet|(?<!_[0-9]{2})_pm_|bearing|housing|ambient|coolant|inlet|outlet|oven|endcap|water"
    "|terminal|wickl|wickelk|lager|geh(ae|ä)use|k(ue|ü)hl|ofen|umgebung|wasser|avvolg|magnete|cuscinett|acqua|ambiente|forno"
    "|_mag_|_amb_|_brg_|cool|_oil_|joch|zahn|r(ue|ü)cken|_nut_|blechpaket|vorlauf|r(ue|ü)cklauf|_(oe|ö)l_|_avv_|giogo"
    "|_dente_|_cava_|statore|rotore|carcassa|raffredd|_olio_|[ée]tuve|bobinage|enroulement|aimant|palier|roulement|culasse"
    "|_carter_|_dents?_|encoche|refroid|_eau_|_huile_|_horno_|bobinado|devanado|_im[aá]n|rodamiento|cojinete|carcasa|_agua_"
)
PER_UNIT = r"^[^/]+/\s?[^/\s]+$"  # `T_EW/°C` and `n / min^-1`, as DIN 1313 writes quantities in tables
_UNIT_BEHIND = re.compile(
    r"(?: in|,) ([^\s(),]{2,})(?: *\([^()]*\))?$"
)  # T in °C; T, °C (SEN S/N: 7), as HOBO writes it
_LOOSELY_SPELT = ("nm", "degc", "degf")  # units at the end of names, in lower case
# of two temperatures: 5 K of it are no -268 degC
_DIFFERENCE = (
    "_d_?t_|_delta_?(t|temp|theta)|_diff(erence|erenz)?_|_rise_|[uü]bertemp|uebertemp|erw(ae|ä)rmung|gradient|δ"
)
_NO_TEMPERATURE = "pos_|position|angle|winkel|press|druck|level|humid"
_NUMBER = r"\bn\s?[°º]|serial|série|serien-?(nr|nummer)"  # of a part: what its digits look like means nothing
_NUMBERED = "_(id|no|nr|num|number|name|nummer)_"
_LABELS: Mapping[str, str] = {  # what tells parts or batches apart -> how its columns are called
    "specimen": "specimen|_serial(_|number)|_seri(al|en)_?(no|nr|num)|_s_n_|_sn_|_dut_|_uut_|pr(ue|ü)f(ling|teil)"
    f"|_(motor|stator|rotor|coil|spule|probe|muster){_NUMBERED}|_sample_(id|name)_|matricola|provino"
    "|(num[ée]ro|_n)_(de_)?s[ée]rie|[ée]prouvette|[ée]chantillon|probeta",
    "batch": "_batch_|_lot_|_lotto_|_lote_|_los_|_charge_?(id|no|nr|nummer)?_",
}
_OF_SENSOR = re.compile(r"\([^()]*\d[^()]*\)")  # (SEN S/N: 20451), not (S/N)
_DAYS = "_(date|datum|day|tag|data|fecha|jour)_"
_COMMAND = "_(ref|cmd|command|set|setpoint|req|request|demand|target|desired)_|soll"


def guess(signal: str, unit: str | None = None) -> str | None:
    """The quantity that a signal probably has: by its unit where that is known, and by the words of its name.

    `unit` as the file writes it. None where nothing speaks for one, and for commands that no quantity stands for.
    """
    if re.search(_NUMBER, signal.lower()):
        return None
    name = words(signal)
    by_name = next((quantity for quantity, holds in _BY_NAME.items() if re.search(holds, name)), None)
    known = normal_unit(without_mark(tidy(unit))[0]) if unit else None
    quantity = "temperature" if known == "F" and by_name == "temperature" else _BY_UNIT.get(known or "")
    if re.search(_DIFFERENCE, name) and (quantity or by_name or _place(name)) == "temperature":
        return None
    if known in (None, "1"):
        return _commanded(by_name or _place(name), name)
    if quantity and by_name and quantity in by_name.split("_"):  # current -> current_d, voltage -> inception_voltage
        return _commanded(by_name, name)
    if by_name in _BY_NAME_ALONE:
        return by_name
    return _commanded(_refined(quantity, name, known or ""), name)


def labels(columns: Sequence[str]) -> dict[str, str]:
    """ "specimen", "batch" -> the first of the columns of a table whose name says that it tells those apart."""
    bare = {one: words(_OF_SENSOR.sub("", one)) for one in columns}
    called = {what: [one for one in columns if re.search(looks, bare[one])] for what, looks in _LABELS.items()}
    return {what: some[0] for what, some in called.items() if some}


def says_days(column: str) -> bool:
    """Whether a column is called as one of dates is."""
    return bool(re.search(_DAYS, words(column)))


def unit_in_name(signal: str) -> str | None:
    """The unit that a name ends in, where it speaks for a quantity: "degC" of `EW_3_degC`, `T (°C)`, `T in °C` and
    `T, °C (SEN S/N: 7)`, "A" of `current_A`; of `1 [°C] Winding` that in brackets, of `M/Nm` that below the line. None
    for `winding_A`, where a letter is more likely one of several places or phases."""
    behind = _UNIT_BEHIND.search(signal)
    if behind and normal_unit(behind[1]) in _BY_UNIT:
        return behind[1]
    inner = re.search(r"\(([^()]+)\)\s*$", signal)
    if inner:
        return inner[1] if normal_unit(inner[1]) in _BY_UNIT else None
    within = (one[1] for one in re.finditer(r"[(\[]([^()\[\]]{2,})[)\]]", signal))
    if unit := next((one for one in within if normal_unit(one) in _BY_UNIT), None):
        return unit
    rest, _, last = (part.strip() for part in signal.rpartition("/" if re.search(PER_UNIT, signal) else "_"))
    if not rest or not (tidy(last) in spellings() or last.lower() in _LOOSELY_SPELT):
        return None
    quantity = _BY_UNIT.get(normal_unit(last) or "")
    by_name = next((one for one, holds in _BY_NAME.items() if re.search(holds, words(rest))), "")
    alone = len(last) > 1 or (quantity is not None and by_name.split("_")[0] == quantity)
    return last if quantity and alone else None


def words(signal: str) -> str:
    """ "IqFbk" -> "_iq_fbk_": words in lower case between single underscores."""
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", signal)
    return re.sub(r"[\W_]+", "_", f"_{split}_").lower()


def _place(name: str) -> str | None:
    return "temperature" if re.search(_PLACES, name) and not re.search(_NO_TEMPERATURE, name) else None


def _refined(quantity: str | None, name: str, unit: str) -> str | None:
    if quantity == "power":
        if re.search("heat|w(ae|ä)rme|calore|chaleur", name):
            return "heat"
        return None if re.search("mech|mecc|loss|verlust|perdit", name) else "power"
    if quantity == "resistance" and (unit in ("Mohm", "Gohm") or re.search("insul|iso", name)):
        return "insulation_resistance"
    return quantity


def _commanded(quantity: str | None, name: str) -> str | None:
    if not re.search(_COMMAND, name):
        return quantity
    return {"speed": "speed_command", "torque": "torque_command"}.get(quantity or "")
