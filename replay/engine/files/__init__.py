"""Motor and bench files, read and written: a changed number is replaced where it stands, the rest stays as it was."""
