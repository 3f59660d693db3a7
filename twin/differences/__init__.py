"""What may differ, as data: what healthy motors do, and every candidate cause, with priors."""
