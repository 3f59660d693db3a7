"""What heat has done to the insulation of every specimen: its history, its checks, and the answer."""
