"""What one replay gives: open loop, residuals, heat, hot spots, filter and smoother; and the files that it leaves."""
