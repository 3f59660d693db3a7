"""Motors, benches, runs and diagnoses made by hand: what several tests begin with."""
