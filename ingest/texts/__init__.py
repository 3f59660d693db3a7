"""What people write, read strictly: TOML, units, quantities, formulas; and the names that they probably meant.

`toml_file` refuses with file and line (`toml_lines`, from where things stand: `toml_spans`), `quantities` over `units`
knows units, `expressions` over `powers` derived channels, `nearest` what was probably meant, `guessing` what a signal
probably is; `plain` writes names so that they steer no terminal, `cells` sets them in its columns, `names` makes names
differ and shortens ids, `times` writes seconds as h:mm:ss; `encodings` tells in which encoding a text is written.
"""
