"""Motor and bench files, read and written: a changed number is replaced where it stands.

`motor_file` reads a motor file (tables of maps by `motor_maps`), `models` publishes it in a store. `motor_text` and
`bench_text` write changed numbers over `toml_edit`, `network_text` a motor that a program made. `configurations` says
which network a session is about, `bench_versions` which bench file goes with a model.
"""
