"""Names in the letters of a country, as loggers there write them, read as they were written."""

from pathlib import Path

import pytest

from ingest.formats import recognise
from ingest.formats._text import place_of
from ingest.texts.encodings import encoding_of
from made.tables import read

HEADS = {
    "cp932": ("時間[s],コイル温度[℃],回転数[rpm],冷却水温度[℃]", "Time,巻線,Speed,水温", "日時,CH1 巻線U相,CH2 外気温"),
    "gb18030": ("时间,绕组温度,转速,冷却水温", "日期时间,U相绕组,轴承温度,环境温度"),
    "big5": ("時間,繞組溫度,轉速,冷卻水溫", "時間,馬達溫度,電流,環境溫度"),
    "cp949": ("시간,권선 온도,회전수,냉각수 온도", "시간,온도,속도,수온"),
    "cp1251": ("Время,Температура обмотки,Скорость,Поток", "Время;Т обмотки"),
}
WESTERN = (
    "Zeit;T_Rücken [°C];Drehzahl [U/min];T_Kühler [°C]",
    "Messgröße,Wälzlager,Kühlwasser,Öl",
    "Temps,Température moyenne d'été créée,débit",
    "t,T °C,µ",
)
ROWS = "".join(f"\r\n{k / 10:.1f},{20 + 0.1 * k:.2f},{1500 + k},{24.1 + 0.01 * k:.2f}" for k in range(400))


@pytest.mark.parametrize(("encoding", "head"), [(name, head) for name, heads in HEADS.items() for head in heads])
def test_the_letters_of_a_header_tell_its_encoding(encoding: str, head: str) -> None:
    assert encoding_of(head.encode(encoding)) == encoding
    assert encoding_of((head + ROWS).encode(encoding)) == encoding
    cut = (head + ROWS + "\r\n" + head).encode(encoding)
    assert {encoding_of(cut[: len(cut) - k]) for k in range(1, 8)} == {encoding}, "the last letter may be cut in half"


@pytest.mark.parametrize("head", WESTERN)
def test_western_letters_and_utf_8_need_none(head: str) -> None:
    assert encoding_of((head + ROWS).encode("cp1252")) is None
    assert encoding_of((head + ROWS).encode()) is None
    assert encoding_of("→ 温度,回転数\n".encode() + "Tür zu\n".encode("cp1252")) is None, (
        "UTF-8 with a line that is not"
    )


def test_umlauts_within_words_tell_the_encoding_of_dos(tmp_path: Path) -> None:
    for head in ("Zeit;T_Rücken [°C];Drehzahl", "t,Wälzlager,Öl", "t,Température", "t;Gehör"):
        assert encoding_of((head + ROWS).encode("cp850")) == "cp850"
    for head in ("t;„Länge”;T", "t,T [°C]"):
        assert encoding_of((head + ROWS).encode("cp1252")) is None
    damaged = "t;Rücken\n".encode() + b"0;ein\x84s\n"
    assert encoding_of(damaged) is None
    path = tmp_path / "log.csv"
    path.write_bytes((head := "Zeit;T_Kühl [°C]\n").encode("cp850") + b"0;20,5\n1;21,5\n")
    _, _, columns = read(path)
    assert columns == {head.strip().split(";")[1]: [20.5, 21.5]}


def test_a_line_is_found_at_its_byte_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("時間,コイル温度\n0,20\n1,備考\n2,21\n".encode("cp932"))
    assert place_of(path, 4) == f"line 4, byte {path.read_bytes().index(b'2,21')}"


def test_a_binary_file_is_no_text_in_a_foreign_encoding(tmp_path: Path) -> None:
    head = bytes(range(256)) * 16
    assert encoding_of(head) is None
    path = tmp_path / "table"
    path.write_bytes("時間,温度\n0,20\n1,21\n".encode("cp932"))
    assert recognise(path).name == "csv"
