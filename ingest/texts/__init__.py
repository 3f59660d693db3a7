"""What people write, read strictly: TOML, units, quantities, formulas; and the names that they probably meant."""
