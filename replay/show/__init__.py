"""What people see of a run: text for the terminal, an HTML report, layers for the rerun viewer."""
