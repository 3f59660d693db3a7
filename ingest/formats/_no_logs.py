"""Files that are no logs here, and may have come out of one: what each is, and what its own program writes instead."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

# what a file begins with -> what it is; and what to do, as the program that wrote it calls that
NO_LOGS: Mapping[bytes, str] = {
    rb"(?:[\t\r\n -~]\0){4}|(?:\0[\t\r\n -~]){4}": "text in UTF-16 without its mark. Save it in UTF-8",
    rb"%PDF": "a PDF document. Export the table that is in it as CSV",
    rb"\xd0\xcf\x11\xe0": (
        "an old Office file, or one with a password. Save it as XLSX without a password (Excel: File, Info, Protect "
        "Workbook takes it off; of an XLS also soffice --convert-to xlsx)"
    ),
    rb"PK\x03\x04.{26}mimetypeapplication/vnd\.oasis\.opendocument": (
        "an OpenDocument file. Save it as XLSX (soffice --convert-to xlsx), or as CSV"
    ),
    rb"MATLAB 5\.0 MAT": "a MATLAB file. Export the table with writetable(T, 'log.csv'), or with parquetwrite",
    rb"\x89HDF": (
        "an HDF5 file (also of MATLAB 7.3: there writetable(T, 'log.csv')). Export the table as Parquet or CSV "
        "(pandas: read_hdf(...).to_parquet)"
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
    rb"RIFF.{4}WAVE": "a sound file (WAV). Export its channels as TDMS or CSV in what recorded it",
    **dict.fromkeys(
        (rb"7z\xbc\xaf", rb"Rar!", rb"BZh", rb"\xfd7zXZ"), "packed in a way that is not read. Unpack it first (7z x)"
    ),
}
# end of a name -> what to do with such a file, where nothing that it holds is known
BY_NAME: Mapping[str, str] = {
    **dict.fromkeys((".dxd", ".dxz", ".d7d"), "In DewesoftX open it and export it (Analyse, Export) as MDF4 or CSV"),
    ".psdata": "In PicoScope save it as CSV (File, Save as)",
}
# end of a name -> what a file is that another program packed or locked, and what to do: its bytes may look like text
LOCKED: Mapping[str, str] = {
    **dict.fromkeys(
        (".mfe", ".mfm", ".mfc"),
        "a log that a CANedge encrypted or packed. Export it as MF4 with its MF4 converters (mdf2finalized, with "
        "passwords.json beside it)",
    ),
}


def no_log(head: bytes) -> str | None:
    """What a file is, and what to do, where its first bytes say that it is no log; None where it may be one."""
    return next((says for looks, says in NO_LOGS.items() if re.match(looks, head, re.DOTALL)), None)


def locked(path: Path) -> str | None:
    """The same of a file that begins like no format of ours, by its name."""
    return LOCKED.get(path.suffix.lower())


def by_name(path: Path) -> str | None:
    """What to do with a file that nothing is known of but its name."""
    return BY_NAME.get(path.suffix.lower())
