"""One motor, given inputs: its temperatures and losses, the derivatives of a run, the load that it bears."""
