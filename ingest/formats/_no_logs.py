"""Files that are no logs here, and may have come out of one: what each is, and what its own program writes instead."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

# what a file begins with -> what it is; and what to do, as the program that wrote it calls that
NO_LOGS: Mapping[bytes, str] = {
    rb"%PDF": "a PDF document. Export the table that is in it as CSV",
    rb"\xd0\xcf\x11\xe0": (
        "an old Office file, or one with a password. Save it as XLSX without a password (Excel: File, Info, Protect "
        "Workbook takes it off; of an XLS also soffice --convert-to xlsx)"
    ),
    rb"PK\x03\x04.{26}mimetypeapplication/vnd\.oasis\.opendocument": (
        "an OpenDocument file. Save it as XLSX (soffice --convert-to xlsx), or as CSV"
    ),
    rb"PK\x03\x04.{0,3000}?(?:word|ppt|visio)/": (
        "an Office document without sheets. Save the table that is in it as XLSX or CSV (paste it into Excel)"
    ),
    rb"PK\x03\x04.{26}[^/]{1,99}\.npy": (
        "arrays of NumPy (NPZ). Export one with numpy.savetxt('log.csv', numpy.load(FILE)['name'], delimiter=',', "
        "header='t_s,...')"
    ),
    rb"MATLAB 7\.\d MAT": "a MATLAB file of version 7.3. Save it, once loaded, with save(FILE, '-v7')",
    rb"\x89HDF": (
        "an HDF5 file (of MATLAB 7.3: save(FILE, '-v7') there). Export the table as Parquet or CSV (pandas: "
        "read_hdf(...).to_parquet, or DataFrame({'t_s': h5py.File(...)['t_s'][:], ...}).to_parquet)"
    ),
    rb"CDF[\x01\x02\x05]": "a netCDF file. Export it as Parquet (xarray: open_dataset(...).to_dataframe().to_parquet)",
    rb"\x93NUMPY": "an array of NumPy. Export it with numpy.savetxt('log.csv', a, delimiter=',', header='t_s,...')",
    rb"\x80[\x03-\x05][\x95c}\](]": "a Python pickle. Export it as Parquet (pandas: read_pickle(...).to_parquet)",
    rb"\|CF,": "a file of imc FAMOS. Export the channels there as MDF4, or as CSV",
    rb"DIAEXTENDED": "a DAT header of DIAdem. Save the data as TDMS there (File, Save as)",
    rb"<\?xml.*<usi:tdm": "the header of a TDM file of DIAdem. Save the data as TDMS there (File, Save as)",
    rb" {4}-1\r?\n {4,5}\d": "a universal file (UFF). Export the channels as CSV or MDF4 in what wrote it",
    rb"PARE": "an encrypted Parquet file. Export it without encryption",
    rb"FEA1": "a Feather file of version 1. Export it as version 2, or as Parquet (pandas: to_parquet)",
    rb"\xd4\xc3\xb2\xa1|\xa1\xb2\xc3\xd4|\x4d\x3c\xb2\xa1|\xa1\xb2\x3c\x4d|\x0a\x0d\x0d\x0a": (
        "a capture of a network (PCAP). Record a CAN bus with candump -l"
    ),
    rb"#ROSBAG V": "a bag of ROS 1. Export it with mcap convert log.bag log.mcap",
    rb"RRF\d": "a recording of the rerun viewer. Export the session as MCAP or Parquet where it came from",
    rb"(?:#9\d{9})?WAVEDESC": (
        "a waveform of a LeCroy oscilloscope. Save it there as text (File, Save Waveform, Data Format: ASCII or Excel)"
    ),
    rb":(?:WFMP|WFMO|CURV)|(?:\x0f\x0f|\xf0\xf0):WFM#": (
        "a waveform of a Tektronix oscilloscope. Save it there as CSV (File, Save As, Waveform, *.csv)"
    ),
    rb"AG(?:01|03|10|30).{0,10}\0": "a waveform of a Keysight oscilloscope. Save it there as CSV (Save, CSV data)",
    rb"File created on \d\d.\d\d.\d{4}.*\[header\]": (
        "a VBO file of a VBOX, whose times are hours, minutes and seconds in one number. Export it as CSV in VBOX Test "
        "Suite"
    ),
    rb".{0,3000}?Channel, *ID, *Flags, *DLC, *D0": (
        "a log of CAN frames in CSV as Kvaser's tools write it. Export it as ASC, BLF or MF4 (Memorator Config Tool)"
    ),
    rb"\s*(?:Kvaser Memorator Log|Chn +Identifier +Flg)": (
        "a log of CAN frames in text as Kvaser's tools write it. Export it as ASC, BLF or MF4 (Memorator Config Tool)"
    ),
    rb".{0,3000}?Abs Time ?\(Sec\),[^\n]{0,300}?Arb ID,": (
        "a buffer of CAN frames in CSV as Vehicle Spy writes it. Save it as ASC there"
    ),
    rb"(?i).{0,3000}?(?:\A|[,;\t\n])\W{0,2}(?:(?:can|frame|message)[ _]?)?id(?:entifier)?[^\w,;\t\n]{0,3}[,;\t]"
    rb"[^\n]{0,99}\bDLC\b[^\n]{0,99}[,;\t]\W{0,2}(?:data|d0|b0|db0|byte ?0)\b": (
        "a table of CAN frames in a form that is not known. Export it as ASC, BLF, TRC or MF4 in what wrote it"
    ),
    rb"ASCII Trace IXXAT": "a trace of CAN frames in text as IXXAT's tools write it. Export it as ASC there",
    rb"Timestamp: +\d+\.\d+ +ID: +[0-9a-f]{3,8} ": (
        "a list of CAN frames as python-can prints it. Record them with can_logger -f log.blf"
    ),
    rb"\d+\.\d+ \d?[RT](?:11|29) [0-9A-Fa-f]{1,8} ": (
        "a log of CAN frames of OVMS (CRTD). Record them with candump -l, or export them as ASC or GVRET CSV"
    ),
    rb"\x1b\[\d*m ?\(\d": "a list of CAN frames in the colours of a terminal. Record them with candump -l",
    rb"\s*\w+  [0-9A-F]{3,8}   ?\[\d{1,2}\] ": "a list of CAN frames without times. Record them with candump -l",
    rb"[^\s,=]{1,99}(?:,[^\s=]+=\S+)? \w+=\S+ \d{16,19}\r?\n": (
        "line protocol of InfluxDB. Export it as CSV (influx query --raw)"
    ),
    rb"ULog\x01\x12\x35": (
        'a ULog of PX4. Export it as CSV with ulog2csv, and say unit = "us" under [time] of the bench file'
    ),
    rb"ORC[^ -~\t\r\n]": "an ORC file. Export it as Parquet (pandas: read_orc(...).to_parquet)",
    rb"Obj\x01": "an Avro file. Export it as Parquet (duckdb: COPY (FROM read_avro('log.avro')) TO 'log.parquet')",
    rb".{8}DUCK": "a database of DuckDB. Export a table of it (COPY t TO 'log.parquet')",
    rb'\s*(?:\[\s*["\[{]|\{\s*["\[{](?![^\n]*\}\s*\n\s*\{))': (
        "a text in JSON. Export it as JSON lines (jq -c '.[]'), or as Parquet (pandas: read_json(...).to_parquet)"
    ),
    rb"(?i)\s*(?:<!doctype html|<html[\s>])": "a web page (HTML). Export the table that is in it as CSV",
    rb"\s*<\?xml.{1,500}urn:schemas-microsoft-com:office:spreadsheet": (
        "a workbook of Excel 2003 (XML). Save it as XLSX (soffice --convert-to xlsx), or as CSV"
    ),
    rb"\{\\rtf": "a text document (RTF). Export the table that is in it as CSV",
    rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\0|MM\0\*|(?:<\?xml[^>]*>\s*)?<svg|.{4}ftyp|RIFF.{4}AVI |FFF\0": (
        "a picture or a film. Keep it beside the logs with whyhot attach FILE --specimen S --finding TEXT"
    ),
    rb".{257}ustar": "an archive of tar. Unpack it first (tar xf), or pack its logs with zip",
    rb"RIFF.{4}WAVE": "a sound file (WAV). Export its channels as TDMS or CSV in what recorded it",
    **dict.fromkeys(
        (rb"7z\xbc\xaf", rb"Rar!", rb"BZh", rb"\xfd7zXZ"), "packed in a way that is not read. Unpack it first (7z x)"
    ),
}
# end of a name -> what to do with such a file, where nothing that it holds is known
BY_NAME: Mapping[str, str] = {
    **dict.fromkeys((".dxd", ".dxz", ".d7d"), "In DewesoftX open it and export it (Analyse, Export) as MDF4 or CSV"),
    ".psdata": "In PicoScope save it as CSV (File, Save as)",
    ".tdx": "In DIAdem open the TDM file beside it and save it as TDMS (File, Save as)",
    ".mat": "In MATLAB save it with save(FILE, '-v7')",
    **dict.fromkeys((".tst", ".bin"), "In the program that wrote it export it as MDF4 or CSV (catman: ASCII)"),
    ".sie": "In InField or nCode export it as ASCII or CSV",
    ".gbd": "In GL-Connection convert it to CSV",
    **dict.fromkeys((".mem", ".hok"), "In the logger utility of Hioki save it as CSV"),
    **dict.fromkeys((".wdf", ".wvf"), "In Xviewer of Yokogawa convert it to CSV"),
    **dict.fromkeys((".gev", ".gds", ".gse"), "In Universal Viewer of Yokogawa convert it to ASCII"),
    ".vsb": "In Vehicle Spy save the buffer as ASC",
    ".wfm": "On the oscilloscope save it as CSV",
    ".lz4": "Unpack it first (lz4 -d)",
}
# end of a name -> what a file is that another program packed or locked, and what to do: its bytes may look like text
LOCKED: Mapping[str, str] = {
    **dict.fromkeys(
        (".mfe", ".mfm", ".mfc"),
        "a log that a CANedge encrypted or packed. Export it as MF4 with its MF4 converters (mdf2finalized, with "
        "passwords.json beside it)",
    )
}


def no_log(head: bytes) -> str | None:
    """What a file is, and what to do, where its first bytes say that it is no log; None where it may be one."""
    return next((says for looks, says in NO_LOGS.items() if re.match(looks, head, re.DOTALL)), None)


def locked(path: Path) -> str | None:
    """What a file that begins like no format of ours is by its name, and what to do."""
    return LOCKED.get(path.suffix.lower())


def by_name(path: Path) -> str | None:
    """What to do with a file that nothing is known of but its name."""
    return BY_NAME.get(path.suffix.lower())
